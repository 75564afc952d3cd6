"""Causes that no catalogue of effects lists, each with the shape of its own mechanics."""

import numpy as np

from tests.independent_arms.causes import between
from tests.independent_arms.chain import points
from tests.independent_arms.state import Cause


def softening_stop(rng):
    """A worn bearing seat of axis 2 or 3: the first load moves it much, more load little, then it touches a stop."""
    joint = int(rng.choice([2, 3]))
    knee, soft = between(rng, 100, 400), between(rng, 0.3e-6, 0.9e-6)
    stop = soft * knee * rng.uniform(1.2, 2.0)

    def acts(s, e):
        torque = s.load.torque(joint)
        free = soft * torque * (1 + 0.5 * np.abs(torque) / knee)
        e.joint[:, joint - 1] += stop * np.clip(free / stop, -1, 1) + 0.1e-6 * torque

    return Cause("seat that softens, then a stop", f"joint {joint}", acts, size=f"{stop * 1e6:.0f} urad at the stop")


def cam_wobble(rng):
    """A dent in the ring of a main bearing: the axis tips over a part of the turn only, as over a cam."""
    joint = int(rng.choice([1, 2, 4]))
    size, width = between(rng, 80e-6, 300e-6), np.radians(rng.uniform(40, 90))
    middle, side = rng.uniform(-0.8, 0.8), rng.uniform(0, 2 * np.pi)

    def acts(s, e):
        off = (s.q[:, joint - 1] - middle) / width
        lift = size * np.where(np.abs(off) < 1, 0.5 * (1 + np.cos(np.pi * off)), 0.0)
        e.twist[joint - 1][:, 3] += lift * np.cos(side)
        e.twist[joint - 1][:, 4] += lift * np.sin(side)

    return Cause("bearing with a dent", f"joint {joint}", acts, size=f"{size * 1e6:.0f} urad")


def cable_pack(rng):
    """A hose pack from the shoulder to the wrist: slack up to a length, from there it pulls along itself."""
    start, end = rng.uniform([-0.3, -0.25, 0.1], [0.1, 0.0, 0.3]), rng.uniform([-0.1, -0.05, 0.05], [0.1, 0.1, 0.2])
    slack, pull = rng.uniform(0.75, 1.0), between(rng, 300, 1200)  # m; N/m
    soft = {2: 0.5e-6, 3: 0.8e-6, 4: 3e-6, 5: 5e-6}

    def acts(s, e):
        here, there = points(s.frame[1], start), points(s.frame[5], end)
        line = here - there
        far = np.linalg.norm(line, axis=1)
        force = (pull * np.maximum(0, far - slack) / far)[:, None] * line
        for joint, give in soft.items():
            axis, origin = s.frame[joint - 1][:, :3, 2], s.frame[joint - 1][:, :3, 3]
            e.joint[:, joint - 1] += give * np.sum(axis * np.cross(there - origin, force), 1)

    return Cause("hose pack that pulls", "links 1 to 5", acts, size=f"{pull:.0f} N/m beyond {slack:.2f} m")


def loose_flange(rng):
    """A loose bolt at the flange: the tool tips to the side to which it is heavier, friction keeps it until then."""
    size, side = between(rng, 60e-6, 300e-6), rng.uniform(0, 2 * np.pi)
    across = np.array([np.cos(side), np.sin(side), 0.0])
    hold = rng.uniform(0.3, 1.5)  # Nm

    def acts(s, e):
        moment = s.load.moment[6] @ across
        pushed = np.abs(moment) > hold
        last = np.maximum.accumulate(np.where(pushed, np.arange(len(moment)), 0))
        e.twist[6][:, 3:] += size * np.sign(moment[last])[:, None] * across

    return Cause("loose bolt at the flange", "flange", acts, size=f"{size * 1e6:.0f} urad")


def counterbalance(rng):
    """A balancing spring that is set wrongly, on a triangle of column and upper arm: its torque winds gear 2."""
    crank, post = rng.uniform(0.15, 0.25), rng.uniform(0.5, 0.8)
    rate, free = between(rng, 1.5e4, 6e4), rng.uniform(0.8, 0.95)
    angle, soft = rng.uniform(2.3, 3.0), 0.35e-6

    def acts(s, e):
        beta = angle - s.q[:, 1]
        long = np.sqrt(crank**2 + post**2 - 2 * crank * post * np.cos(beta))
        pull = rate * np.maximum(0, long - free * (post - crank))
        e.joint[:, 1] += soft * pull * crank * post * np.sin(beta) / long

    return Cause("balancing spring set wrongly", "joint 2", acts, size=f"{rate / 1e3:.0f} N/mm")


def cracked_plate(rng):
    """A cracked base plate: it opens to one side under the overturning moment, and not to the other."""
    size, side = between(rng, 0.06e-6, 0.3e-6), rng.uniform(0, 2 * np.pi)
    hinge = np.array([np.cos(side), np.sin(side), 0.0])

    def acts(s, e):
        e.twist[0][:, 3:] += size * np.maximum(0, s.load.moment[0] @ hinge)[:, None] * hinge

    return Cause("cracked base plate", "base", acts, size=f"{size * 1e6:.2f} urad/Nm")


def hot_motor(rng):
    """The motor of one axis warms the casting beside it, faster while the axis works; nothing of it is logged."""
    joint = int(rng.choice([2, 3]))
    size, lag = between(rng, 60e-6, 250e-6), rng.uniform(500, 2500)

    def acts(s, e):
        warm = 1 - np.exp(-s.time / lag) * (1 + 0.4 * s.time / lag)
        e.twist[joint][:, 1] += 0.6 * size * warm
        e.joint[:, joint - 1] += 0.7 * size * warm

    return Cause("motor that warms its casting", f"joint {joint}", acts, size=f"{size * 1e6:.0f} um")


def rolling_tube(rng):
    """A forearm tube stiffer across its ribs: it bends by the moment times a function of the angle of axis 4."""
    size, ribs = between(rng, 0.4e-6, 2e-6), int(rng.choice([2, 3]))
    phase = rng.uniform(0, 2 * np.pi)

    def acts(s, e):
        weak = size * (0.5 + 0.5 * np.cos(ribs * s.q[:, 3] + phase)) ** 2
        e.twist[3][:, 3:5] += weak[:, None] * s.load.moment[3][:, :2]

    return Cause("forearm with ribs", "link 3", acts, size=f"{size * 1e6:.2f} urad/Nm")


def bar_sag(rng):
    """The bar bends under its own weight: the chord is shorter, the more so the longer and the flatter it lies."""
    size = between(rng, 6e-6, 30e-6)  # at 0.5 m, level

    def reads(r):
        level = 1 - r.along[:, 2] ** 2
        return -size * (r.length / 0.5) ** 7 * level * (1 + 0.3 * r.along[:, 2])

    return Cause("long bar that sags", "bar", None, reads, ("gauge sag",), (), f"{size * 1e6:.1f} um")


def tie_rod(rng):
    """For judgement only: an oval bush of a tie rod moves the elbow by where upper arm and forearm stand together."""
    size, oval = between(rng, 80e-6, 300e-6), rng.uniform(0.3, 0.7)

    def acts(s, e):
        leaning = s.q[:, 1] + s.q[:, 2]
        e.joint[:, 2] += size * np.abs(np.sin(leaning)) ** (1 + oval) * np.cos(s.q[:, 2] - oval)

    return Cause("tie rod with an oval bush", "joint 3", acts, size=f"{size * 1e6:.0f} urad")


def warm_side(rng):
    """For judgement only: a furnace on one side of the cell bows the upper arm as it looks that way."""
    size, side = between(rng, 80e-6, 350e-6), rng.uniform(-np.pi, np.pi)

    def acts(s, e):
        lit = np.maximum(0, np.cos(s.q[:, 0] - side)) ** 1.5
        upright = np.abs(s.frame[2][:, 2, 0])
        e.twist[2][:, 4] += size * lit * (0.4 + 0.6 * upright)
        e.twist[2][:, 2] -= 0.4 * size * lit * (0.4 + 0.6 * upright)

    return Cause("furnace on one side", "link 2", acts, size=f"{size * 1e6:.0f} urad")


KNOWN = (
    softening_stop, cam_wobble, cable_pack, loose_flange, counterbalance, cracked_plate, hot_motor, rolling_tube,
)  # fmt: skip
OF_A_BAR = (bar_sag,)
FOR_JUDGEMENT = (tie_rod, warm_side)
JUDGEMENT_FROM = 1000  # seeds below are for development


def draw(rng, gauge, seed):
    """One foreign cause; those kept for judgement come only for seeds that are."""
    makers = KNOWN + (() if gauge == "tracker" else OF_A_BAR)
    if seed >= JUDGEMENT_FROM:
        makers = makers + 2 * FOR_JUDGEMENT  # a third of the draws
    return makers[int(rng.integers(len(makers)))](rng)
