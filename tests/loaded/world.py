"""A loaded bar in a world of its own: the arm in plain numpy, the balance of bar and joints solved by iteration.

Nothing of the planner is used: forward pass and screws are those of ``tests.simulation.generator.arm``, the way round
the circle is found by Newton's method on its flange, and the joints turn by their compliance times the moment of the
bar's pull and of the weights about their axes, at the place where the arm really ends up.
"""

from dataclasses import dataclass, field

import numpy as np
import polars as pl

from tests.simulation.generator.arm import Arm, moment_of_weight, screw

CENTRE, RADIUS = np.array([1.35, -0.125, 1.25]), 0.125
FIXTURE, TOOL = np.array([1.35, -0.125, 1.2058]), np.array([0.12, 0.0, 0.25])
TOOL_KG, TOOL_COM = 20.0, np.array([0.04, 0.0, 0.1])
HOME = np.radians([0.0, 0.0, 0.0, 0.0, 90.0, 0.0])
EASY = 100.0  # [Nm]
LOADS = (125.0, 250.0, 375.0, 500.0, 625.0)
SOFT = np.array([0.9, 0.7, 0.8, 2.0, 2.5, 3.0]) * 1e-6  # [rad/Nm]


@dataclass(frozen=True)
class World:
    """The truth: ``soft`` (6,) [rad/Nm], geometric ``errors`` by slot, where the ball really is, and the noise.

    ``offset`` (3,) [m] of the ball from where the cell says; ``white`` [m] a reading; ``wander`` [m] a smooth curve
    of its own in every turn (the path's repeatability); ``reversal`` [rad] of each joint with its sense of turning;
    ``lost`` [rad] of lost motion, half of which is taken up by ``EASY`` [Nm] of the bar's pull; ``piston``: part of the
    load by which the cylinder's friction makes it differ from its pressure, a smooth curve for each load and sense.
    """

    soft: np.ndarray = field(default_factory=lambda: SOFT)
    errors: dict = field(default_factory=dict)
    offset: np.ndarray = field(default_factory=lambda: np.array([-0.00074, 0.00019, 0.0002]))
    zero: float = 1.7e-4
    white: float = 2e-6
    wander: float = 0.0
    reversal: float = 0.0
    lost: float = 0.0
    piston: float = 0.0


def arm():
    return Arm.from_toml("abb-irb6700")


def angles(the_arm, targets, tool=TOOL, start=HOME):
    """Controller angles (n, 6) that bring the nominal point to ``targets`` (n, 3), tool down as at home."""
    R0 = the_arm.walk(start[None], {}).R[:, :, 0]
    q = np.repeat(start[None], len(targets), axis=0)
    names = [f"theta{i + 1}" for i in range(6)]
    for _ in range(60):
        s = the_arm.walk(q, {}, names)
        x = s.p + np.einsum("ijn,j->in", s.R, tool)
        turn = 0.5 * sum(np.cross(s.R[:, k], R0[:, k][:, None], axis=0) for k in range(3))
        gap = np.concatenate([targets.T - x, turn]).T
        if np.abs(gap).max() < 1e-11:
            return q
        J = np.stack([np.concatenate([screw(the_arm, s, m, x), s.axes[m]]) for m in names], axis=2)  # (6, n, 6)
        step = np.linalg.solve(np.moveaxis(J, 1, 0), gap[:, :, None])[:, :, 0] @ np.linalg.inv(the_arm.sense).T
        q = q + np.clip(step, -0.3, 0.3)
    raise ValueError("the circle is out of reach")


def reach(the_arm, targets, rng, tool=TOOL, tries=12):
    """Angles (m, 6) for those of ``targets`` (n, 3) that some random start reaches within limits, any orientation."""
    names = [f"theta{i + 1}" for i in range(6)]
    q = rng.uniform(0.6 * the_arm.lower, 0.6 * the_arm.upper, (len(targets), tries, 6)).reshape(-1, 6)
    goal = np.repeat(targets, tries, axis=0)
    for _ in range(25):
        s = the_arm.walk(q, {}, names)
        x = s.p + np.einsum("ijn,j->in", s.R, tool)
        J = np.stack([screw(the_arm, s, m, x) for m in names], axis=2).transpose(1, 0, 2)
        step = np.einsum("nij,nj->ni", np.linalg.pinv(J), goal - x.T)
        q = q + np.clip(step @ np.linalg.inv(the_arm.sense).T, -0.3, 0.3)
    s = the_arm.walk(q, {})
    gap = np.linalg.norm(goal.T - s.p - np.einsum("ijn,j->in", s.R, tool), axis=0)
    good = (gap < 1e-6) & np.all((q > the_arm.lower) & (q < the_arm.upper), axis=1)
    good, q = good.reshape(-1, tries), q.reshape(-1, tries, 6)
    return q[np.arange(len(q)), np.argmax(good, axis=1)][good.any(axis=1)]


def circle_points(theta, centre=CENTRE, radius=RADIUS):
    return centre + radius * np.stack([np.cos(theta), np.sin(theta), 0 * theta], axis=1)


def true_point(the_arm, world, q, force, fixture, tool=TOOL, sense=None):
    """Measured point (n, 3) [m] in balance with the bar's pull (n,) [N] and all weights."""
    names = [f"theta{i + 1}" for i in range(6)]
    delta = {n: world.errors.get(n, 0.0) for n in the_arm.names if n in world.errors or n in names}
    back = {} if sense is None else {n: world.reversal * sense[:, i] for i, n in enumerate(names)}
    yielded = {n: np.zeros(len(q)) for n in names}
    for _ in range(4):
        here = {n: delta.get(n, 0.0) + yielded.get(n, 0.0) + back.get(n, 0.0) for n in {*delta, *yielded}}
        s = the_arm.walk(q, here, names)
        x = s.p + np.einsum("ijn,j->in", s.R, tool)
        bar = fixture[:, None] - x
        pull = force * bar / np.linalg.norm(bar, axis=0)
        com = s.p + np.einsum("ijn,j->in", s.R, TOOL_COM)
        for i, n in enumerate(names):
            moment = moment_of_weight(the_arm, s, n, the_arm.mass, [(TOOL_KG, com)])
            by_bar = np.sum(screw(the_arm, s, n, x) * pull, axis=0)
            yielded[n] = world.soft[i] * (moment + by_bar) + world.lost * by_bar / (EASY + np.abs(by_bar))
    return x.T


def turns(direction, rate, overshoot=np.pi, speed=0.05, radius=RADIUS):
    """Angles (n,) [rad] and times (n,) [s] of one pass: a whole turn with overshoot at either end."""
    total = 2 * np.pi + 2 * overshoot
    t = np.arange(0.0, total * radius / speed, 1.0 / rate)
    return direction * (t * speed / radius - overshoot), t


def passes(loads=LOADS, directions=(1, -1), repeats=5):
    return [(d, f, r) for r in range(repeats) for f in loads for d in directions]


@dataclass(frozen=True)
class Course:
    """One circle as driven: ``q`` (n, 6), ``t``, ``force``, ``part`` (n,) number of the pass, ``theta``, ``sense`` of
    every joint (n, 6) and ``sense_of_travel`` (n,)."""

    q: np.ndarray
    t: np.ndarray
    force: np.ndarray
    part: np.ndarray
    theta: np.ndarray
    sense: np.ndarray
    sense_of_travel: np.ndarray


def course(the_arm, loads=LOADS, directions=(1, -1), repeats=5, rate=25.0, centre=CENTRE, overshoot=np.pi, tool=TOOL):
    """Drive every load in every sense, ``repeats`` times."""
    fine = np.linspace(0.0, 2 * np.pi, 721)
    q_fine = angles(the_arm, circle_points(fine, centre), tool)
    parts = []
    start = 0.0
    for k, (d, f, _) in enumerate(passes(loads, directions, repeats)):
        theta, t = turns(d, rate, overshoot)
        q = np.stack([np.interp(theta, fine, column, period=2 * np.pi) for column in q_fine.T], axis=1)
        sense = np.sign(np.gradient(q, axis=0))
        parts.append((q, t + start, np.full(len(t), f), np.full(len(t), k), theta, sense, np.full(len(t), d)))
        start += t[-1] + 3.0
    return Course(*(np.concatenate([p[k] for p in parts]) for k in range(7)))


def shift(the_arm, world, way, tool=TOOL):
    """How far the unloaded true circle lies from the nominal one, (3,) [m]: the ball is set up by the arm itself."""
    few = way.q[way.part == way.part[0]]
    true = true_point(the_arm, world, few, np.zeros(len(few)), FIXTURE, tool)
    nominal = the_arm.walk(few, {})
    return (true.T - nominal.p - np.einsum("ijn,j->in", nominal.R, tool)).mean(axis=1)


def readings(the_arm, world, way, rng, fixture=FIXTURE, tool=TOOL):
    """What the bar reads, (n,) [m], and the same without noise."""
    ball = fixture + world.offset + shift(the_arm, world, way, tool)
    x = true_point(the_arm, world, way.q, way.force * (1.0 + friction(world, way)), ball, tool, way.sense)
    clean = np.linalg.norm(x - ball, axis=1) + world.zero
    return clean + noise(world, way, rng), clean


def friction(world, way):
    """Part of the load by which it differs from the pressure, (n,): the same in all repeats of a load and sense."""
    rng, out = np.random.default_rng(11), np.zeros(len(way.t))
    n = np.arange(1, 4)[:, None]
    for load in np.unique(way.force):
        for d in (-1, 1):
            a = rng.normal(0.0, world.piston / np.sqrt(3), (3, 2))
            mine = (way.force == load) & (way.sense_of_travel == d)
            wave = a[:, :1] * np.cos(n * way.theta[mine]) + a[:, 1:] * np.sin(n * way.theta[mine])
            out[mine] = wave.sum(axis=0)
    return out


def noise(world, way, rng):
    """White noise and, for each pass, a smooth curve of its own over the angle, (n,) [m]."""
    wave = np.zeros(len(way.t))
    for k in np.unique(way.part):
        mine = way.part == k
        a = rng.normal(0.0, world.wander / np.sqrt(8), (8, 2))
        n = np.arange(8)[:, None]
        wave[mine] = (a[:, :1] * np.cos(n * way.theta[mine]) + a[:, 1:] * np.sin(n * way.theta[mine])).sum(axis=0)
    return wave + world.white * rng.standard_normal(len(wave))


def run_text(way, length, fixture="A", sign=1.0, noise=None):
    """The run as CSV."""
    force = way.force if noise is None else way.force + noise
    data = {"t_s": np.round(way.t, 5)}
    data |= {f"q{i + 1}_deg": np.round(np.degrees(way.q[:, i]), 8) for i in range(6)}
    data |= {"length_mm": np.round(length * 1e3, 7), "force_N": np.round(sign * force, 3)}
    data["fixture"] = np.repeat(fixture, len(length))
    return "# robot: abb-irb6700\n" + pl.DataFrame(data).write_csv()
