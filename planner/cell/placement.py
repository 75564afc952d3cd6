"""Where robot, gauge and targets stand to each other: all that a reading needs, but for the gauge that takes it.

Places are fixtures of a bar, socket plates or tracker stations; points are targets on the tool. Where the cell does
not say where they are, they are found from the run first (``planner.gauges.placement``) and stand here as found.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self, TypeVar

import numpy as np

from planner.common.units import Array, Rows
from planner.kinematics.chain import Chain
from planner.kinematics.robot import BASE_TRANSFORMS, Robot
from planner.runs.run import Samples

FREEABLE = frozenset({"fixture", "tool", "zero"})  # what of a set-up a cell may free
N_BASE_TRANSFORMS = len(BASE_TRANSFORMS)  # before the robot's: small corrections of how the base stands to the gauge


@dataclass(frozen=True)
class RobotSetup:
    """A robot with its loads: all that its own effects need, whether or not a gauge looks at it.

    Attributes:
        gravity_B: in the base frame, (3,) [m/s²].
        tool_mass: [kg]; com_F (3,) [m]: what the flange carries.
    """

    robot: Robot
    gravity_B: Array
    tool_mass: float
    com_F: Array

    @cached_property
    def chain(self) -> Chain:
        """Corrections of the base, then the robot up to its flange."""
        return Chain((*BASE_TRANSFORMS, *self.robot.transforms))

    def offsets(self, samples: Samples) -> list[float | Array]:
        """Return the additions to the nominal values of the K transforms, (K,) [m, rad]."""
        return [0.0] * len(self.chain)

    @property
    def weighs(self) -> bool:
        """Whether any weight on the joints is known, a link's or the tool's."""
        return bool(self.tool_mass) or any(m is not None for m in self.robot.masses)


@dataclass(frozen=True)
class Placement(RobotSetup):
    """Robot, places of a gauge and targets: what is known of where things stand.

    Attributes:
        p_BX: fixtures in the base frame, (S, 3) [m]; only a length gauge has them.
        R_BG, p_BG: frames of plates or trackers in the base frame, (S, 3, 3) and (S, 3) [m].
        p_FM, R_FM: targets on the flange, (T, 3) [m] and (T, 3, 3).
        p_GS: sockets in the plate's frame, (K, 3) [m]; ball_names: as they are called.
        place_names, point_names: as they are called.
        place_prior, tool_prior, turn_prior: one-sigma sizes of their errors, (S,) [m], [m], [rad].
        joint_sigma: repeatability of one joint [rad].
        zero: what a bar reads beyond its length, as far as known [m].
        loaded: the places at which the gauge pulls, with the key of the cell's file that says so; where another bar
            stands elsewhere each has a zero of its own.
        fixed: what of ``FREEABLE`` the cell holds for known, so that it is not in the model.
    """

    p_BX: Array
    R_BG: Array
    p_BG: Array
    p_FM: Array
    R_FM: Array
    p_GS: Array
    place_names: tuple[str, ...]
    point_names: tuple[str, ...]
    place_prior: Array
    tool_prior: float
    turn_prior: float
    joint_sigma: float
    zero: float = 0.0
    loaded: Mapping[str, str] = field(default_factory=dict)
    ball_names: tuple[str, ...] = ()
    fixed: frozenset[str] = frozenset()

    def with_unknown_places(self, names: tuple[str, ...], prior: float, turn: float) -> Self:
        """Return the setup with places still to be found, at the base, known to ``prior`` [m] and ``turn`` [rad]."""
        n = len(names)
        return replace(
            self,
            place_names=names,
            R_BG=np.broadcast_to(np.eye(3), (n, 3, 3)),
            p_BG=np.zeros((n, 3)),
            place_prior=np.full(n, prior),
            turn_prior=turn,
        )


P = TypeVar("P", bound=Placement)


@dataclass(frozen=True)
class Targets(Rows):
    """Readings in the base frame: length (n,) [m], position p_BM (n, 3) [m], rotation R_BF' (n, 3, 3).

    ``pixels`` (n, K, 2) [px] of an image need no frame; NaN where a corner is not seen. ``scalar`` (n,) is what
    a gauge of one number reads, in SI units.
    """

    length: Array | None = None
    position: Array | None = None
    rotation: Array | None = None
    pixels: Array | None = None
    scalar: Array | None = None

    @classmethod
    def at_base(cls, n: int) -> "Targets":
        """Return n readings at the base's own frame: their residuals are minus the prediction."""
        return cls(np.zeros(n), np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)), scalar=np.zeros(n))
