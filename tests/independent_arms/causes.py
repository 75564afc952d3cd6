"""Causes of the kinds that calibration reports name, with sizes and shapes of an engineer's own estimate."""

import numpy as np

from tests.independent_arms.state import Cause

AXES = (1, 2, 3, 4, 5, 6)
LINK_STIFFNESS = {1: 3e7, 2: 1.2e7, 4: 3.5e6}  # bending, EI in N m2: iron castings of some 300, 250, 180 mm


def between(rng, low, high):
    """A size, as often in one octave as in another."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def compliance(rng):
    joint = int(rng.choice([2, 3, 5], p=[0.45, 0.35, 0.2]))
    most = {2: 0.8e-6, 3: 1.2e-6, 5: 8e-6}[joint]  # gears of 1 to 4 MN m/rad, the wrist of 0.1 to 0.4
    size = between(rng, most / 4, most)

    def acts(s, e):
        e.joint[:, joint - 1] += size * s.load.torque(joint)

    names = ("joint compliance",)
    return Cause("compliance", f"joint {joint}", acts, None, names, (joint,), f"{size * 1e6:.2f} urad/Nm")


def cantilever(s, link, stiffness):
    """Twist at the end of a link that bends and twists as a beam, in the frame at its end."""
    turn = s.frame[link][:, :3, :3]
    beam = np.einsum("nji,nj->ni", turn, s.frame[link][:, :3, 3] - s.frame[link - 1][:, :3, 3])
    length = np.linalg.norm(beam[0])
    along = beam / length
    moment, force = s.load.moment[link], s.load.force[link]
    axial = np.sum(moment * along, 1)[:, None] * along
    cross = moment - axial
    shear = force - np.sum(force * along, 1)[:, None] * along
    turned = (length * cross + length**2 / 2 * np.cross(along, shear) + 1.3 * length * axial) / stiffness
    moved = (length**2 / 2 * np.cross(cross, along) + length**3 / 3 * shear) / stiffness
    return np.hstack([moved, turned])


def bending(rng):
    link = int(rng.choice([1, 2, 4]))
    stiffness = LINK_STIFFNESS[link] * between(rng, 0.25, 1.2)

    def acts(s, e):
        e.twist[link] += cantilever(s, link, stiffness)

    return Cause("bending", f"link {link}", acts, None, ("link bending",), (link,), f"EI {stiffness / 1e6:.1f} MN m2")


def _wave(rng, kind, periods, low, high, names):
    joint = int(rng.choice(AXES, p=[0.2, 0.2, 0.2, 0.2, 0.15, 0.05]))
    size, phase = between(rng, low, high), rng.uniform(0, 2 * np.pi)

    def acts(s, e):
        e.joint[:, joint - 1] += size * np.sin(periods * s.q[:, joint - 1] + phase)

    return Cause(kind, f"joint {joint}", acts, None, names, (joint,), f"{size * 1e6:.0f} urad, {periods} a turn")


def eccentricity(rng):
    return _wave(rng, "encoder eccentricity", 1, 60e-6, 350e-6, ("encoder once a turn",))


def gear_twice(rng):
    return _wave(rng, "gear twice a turn", 2, 50e-6, 250e-6, ("encoder twice a turn", "gear"))


def ripple(rng):
    periods = int(rng.choice([3, 4, 6, 9, 12, 59, 80, 101, 161]))  # planets and pins of a cycloid, or flexspline teeth
    return _wave(rng, "gear ripple", periods, 30e-6, 150e-6, ("gear",))


def backlash(rng):
    joint = int(rng.choice([2, 3, 4, 5]))
    play, soft = between(rng, 60e-6, 250e-6), between(rng, 3, 30)

    def acts(s, e):
        e.joint[:, joint - 1] += play / 2 * np.tanh(s.load.torque(joint) / soft)

    names = ("backlash by load",)
    return Cause("backlash by torque", f"joint {joint}", acts, None, names, (joint,), f"{play * 1e6:.0f} urad")


def coupling(rng):
    driver, driven = [(4, 5), (4, 6), (5, 6)][int(rng.integers(3))]
    size = between(rng, 80e-6, 400e-6) * rng.choice([-1, 1])

    def acts(s, e):
        e.joint[:, driven - 1] += size * s.q[:, driver - 1]

    where = f"joint {driver} on joint {driven}"
    return Cause("wrist coupling", where, acts, None, ("coupling",), (driver, driven), f"{size * 1e6:.0f} urad/rad")


def soft_base(rng):
    size, uneven = between(rng, 0.04e-6, 0.25e-6), rng.uniform(0.6, 1.4)

    def acts(s, e):
        e.twist[0][:, 3:5] += size * np.array([1.0, uneven]) * s.load.moment[0][:, :2]

    return Cause("soft base", "base", acts, None, ("soft base",), (), f"{size * 1e6:.2f} urad/Nm")


def thermal_growth(rng):
    link = int(rng.choice([1, 2, 4]))
    share = between(rng, 0.6, 2.0)  # of iron's 11 ppm/K: castings are warmer than the place that is logged, or cooler

    def acts(s, e):
        turn = s.frame[link][:, :3, :3]
        beam = np.einsum("nji,nj->ni", turn, s.frame[link][:, :3, 3] - s.frame[link - 1][:, :3, 3])
        e.twist[link][:, :3] += 11e-6 * share * s.warm[:, None] * beam

    names = ("warm-up", "drift", "thermal", "link growth")
    return Cause("thermal growth", f"link {link}", acts, None, names, (link,), f"{11 * share:.0f} ppm/K")


def tool_bends(rng):
    size = between(rng, 10e-6, 50e-6)

    def acts(s, e):
        e.twist[6][:, 3:5] += size * s.load.moment[6][:, :2]

    return Cause("tool compliance", "tool", acts, None, ("tool compliance",), (), f"{size * 1e6:.1f} urad/Nm")


def ball_ovality(rng):
    size, phase = between(rng, 3e-6, 15e-6), rng.uniform(0, np.pi)

    def reads(r):
        seen = np.einsum("nji,nj->ni", r.turn, -r.along)
        return size * np.sum(seen[:, :2] ** 2, 1) * np.cos(2 * np.arctan2(seen[:, 1], seen[:, 0]) + phase)

    return Cause("ball ovality", "bar", None, reads, ("ball ovality", "ball lobing"), (), f"{size * 1e6:.1f} um")


def bar_drift(rng):
    size = between(rng, 5e-6, 30e-6) / 3600 * rng.choice([-1, 1])
    return Cause("gauge drift", "gauge", None, lambda r: size * r.time, ("drift",), (), f"{size * 3.6e9:.1f} um/h")


def tracker_cyclic(rng):
    size, wave, phase = between(rng, 4e-6, 20e-6), rng.uniform(0.15, 0.6), rng.uniform(0, 2 * np.pi)

    def reads(r):
        return size * np.sin(2 * np.pi * r.length / wave + phase)

    names = ("scale interpolation", "gauge nonlinearity", "gauge cubic nonlinearity")
    return Cause("tracker's cyclic error", "tracker", None, reads, names, (), f"{size * 1e6:.1f} um")


ROBOT = (
    compliance, compliance, bending, eccentricity, gear_twice, ripple, backlash, coupling, soft_base, thermal_growth,
    tool_bends,
)  # fmt: skip
GAUGE = {"bar": (ball_ovality, bar_drift), "driven": (ball_ovality, bar_drift), "tracker": (bar_drift, tracker_cyclic)}


def draw(rng, gauge, count):
    """``count`` causes, no two of one kind at one place."""
    makers, found = ROBOT + GAUGE[gauge], {}
    while len(found) < count:
        cause = makers[int(rng.integers(len(makers)))](rng)
        found.setdefault((cause.kind, cause.where), cause)
    return list(found.values())
