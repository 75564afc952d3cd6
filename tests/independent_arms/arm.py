"""One arm as it truly is: drawn by its seed, read by a gauge that a person has set up."""

from dataclasses import dataclass

import numpy as np

from tests.independent_arms import causes, foreign
from tests.independent_arms.chain import Arm, Masses, frames, loads, points, read_arm
from tests.independent_arms.state import Cause, Errors, Reading, States

TOOL = np.array([0.050, 0.0, 0.150])  # nominal ball or reflector in the flange, as in the cells
ANGLE, LENGTH = 0.5e-3, 0.3e-3  # one sigma of what a link is off in each direction, rad and m
TOOL_OFF, HAND, ZERO_OFF = 0.3e-3, 0.4e-3, 0.05e-3  # tool, fixture beside where the robot shows it, bar's zero: m
LATE = 1e-3  # s, one sigma
SCALE = {"bar": 10e-6, "driven": 10e-6, "tracker": 2e-6}


def own_masses(rng):
    """Links of an arm of the class of 130 kg, by volume and motor sizes; each arm differs by some per cent."""
    kg = np.array([330.0, 95.0, 125.0, 85.0, 22.0, 4.0, 5.0]) * rng.normal(1, 0.05, 7)
    centre = np.array([
        [-0.16, 0.12, 0.0], [-0.42, 0.0, 0.06], [0.05, 0.02, 0.02], [0.0, 0.27, 0.0], [0.0, 0.0, 0.04],
        [0.0, 0.0, -0.02], [0.015, 0.0, 0.06],
    ])  # fmt: skip
    return Masses(kg, centre + rng.normal(0, 0.01, centre.shape))


@dataclass(frozen=True)
class TrueArm:
    """An arm, its gauge, and all that is wrong with them."""

    seed: int
    gauge: str  # bar, driven or tracker
    arm: Arm
    masses: Masses
    link: np.ndarray  # (7, 1, 6) twists of the links as built
    tool: np.ndarray  # true tool point in the flange
    causes: tuple
    joint_noise: float  # rad, one sigma of an axis coming to rest
    noise: float  # m, one sigma of a reading
    scale: float
    zero: float
    late: float  # s, by how much the reading lags behind the axes while the robot drives

    def states(self, q, time=0.0, warm=0.0):
        n = len(q)
        return States(
            self.arm, q, loads(self.arm, self.masses, q), frames(self.arm, q), TOOL, np.broadcast_to(time, n),
            np.broadcast_to(warm, n),
        )  # fmt: skip

    def flange(self, q, time=0.0, warm=0.0, rest=0.0):
        """True flange (n, 4, 4) with the controller at q; ``rest`` is where the axes come to rest beside it."""
        states, errors = self.states(q, time, warm), Errors.none(len(q))
        for cause in self.causes:
            if cause.acts is not None:
                cause.acts(states, errors)
        return frames(self.arm, q + rest + errors.joint, self.link + errors.twist)[6]

    def points(self, q, **conditions):
        return points(self.flange(q, **conditions), self.tool)

    def read_along(self, true, seen, turn, time):
        """What the gauge's own errors add to lengths ``seen`` of vectors ``true`` (n, 3)."""
        reading = Reading(true / seen[:, None], seen, turn, time)
        own = [c.reads(reading) for c in self.causes if c.reads is not None]
        return self.scale * seen + sum(own, np.zeros(len(seen)))


def make_arm(seed, gauge, count, with_foreign):
    """The arm of a seed: the same geometry whatever is hidden in it."""
    rng = np.random.default_rng([seed, 7741])
    size = np.array([LENGTH] * 3 + [ANGLE] * 3)
    link = rng.normal(size=(7, 1, 6)) * size
    tool = TOOL + rng.normal(0, TOOL_OFF, 3)
    masses = own_masses(rng)
    joint_noise = causes.between(rng, 3e-6, 9e-6)
    noise = causes.between(rng, 1.5e-6, 5e-6) if gauge != "tracker" else causes.between(rng, 8e-6, 16e-6)
    scale, zero = rng.normal(0, SCALE[gauge]), rng.normal(0, ZERO_OFF)
    hidden = causes.draw(np.random.default_rng([seed, count, 88]), gauge, count)
    if with_foreign:
        hidden.append(foreign.draw(np.random.default_rng([seed, 4099]), gauge, seed))
    late = abs(rng.normal(0, LATE)) if gauge == "driven" else 0.0
    if late:
        hidden.append(Cause("gauge lag", "bar", None, None, ("gauge lag", "servo lag"), (), f"{late * 1e3:.2f} ms"))
    return TrueArm(seed, gauge, read_arm(), masses, link, tool, tuple(hidden), joint_noise, noise, scale, zero, late)


def workspace(arm, count, rng):
    """Random joint angles within the strokes (axis 6: one turn) whose tool and wrist stay above the floor."""
    low, high = np.maximum(arm.low, -np.pi), np.minimum(arm.high, np.pi)
    kept = np.empty((0, 6))
    while len(kept) < count:
        q = rng.uniform(low, high, (2 * count, 6))
        frame = frames(arm, q)
        tool, wrist = points(frame[6], TOOL), frame[4][:, :3, 3]
        clear = (np.minimum(tool[:, 2], wrist[:, 2]) > 0) & (np.hypot(tool[:, 0], tool[:, 1]) > 0.3)
        kept = np.vstack([kept, q[clear]])
    return kept[:count]
