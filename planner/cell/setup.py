"""The setup: the robot, where the gauge stands, and where the targets sit on the tool — all that a reading needs.

Places are fixtures of a bar, socket plates or tracker stations; points are targets on the tool. Where the cell does
not say where they are, they are found from the run first (``planner.gauges.placement``) and stand here as found.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import STANDARD_GRAVITY, Cell
from planner.cell.gauge import Gauge
from planner.common.arrays import Rows
from planner.common.units import Array
from planner.kinematics.chain import Chain, xyz_transforms
from planner.kinematics.robot import BASE_TRANSFORMS, Robot
from planner.runs.run import Readings, Samples

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
        """Return what every transform gets beside its nominal value, K values [m, rad]."""
        return [0.0] * len(self.chain)

    @property
    def weighs(self) -> bool:
        """Whether any weight on the joints is known, a link's or the tool's."""
        return bool(self.tool_mass) or any(m is not None for m in self.robot.masses)


@dataclass(frozen=True)
class MeasurementSetup(RobotSetup):
    """Robot, gauge and targets.

    Attributes:
        gauge: what is read, and how well.
        p_BX: fixtures in the base frame, (S, 3) [m]; only a length gauge has them.
        R_BG, p_BG: frames of plates or trackers in the base frame, (S, 3, 3) and (S, 3) [m].
        p_FM, R_FM: targets on the flange, (T, 3) [m] and (T, 3, 3).
        p_GS: sockets in the plate's frame, (K, 3) [m]; ball_names: as they are called.
        place_names, point_names: as they are called.
        place_prior, tool_prior, turn_prior: one-sigma sizes of their errors, (S,) [m], [m], [rad].
        joint_sigma: repeatability of one joint [rad].
        zero: what a bar reads beyond its length, as far as known [m].
        loaded: names of the places of a loaded bar, where another bar stands elsewhere: each has a zero of its own.
        fixed: what of ``FREEABLE`` the cell holds for known, so that it is not in the model.
    """

    gauge: Gauge
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
    loaded: tuple[str, ...] = ()
    ball_names: tuple[str, ...] = ()
    fixed: frozenset[str] = frozenset()

    @cached_property
    def chain(self) -> Chain:
        """Corrections of the base, the robot, the tool point, and for a probe with orientation its turn.

        The base stands first so that a shift of the gauge, a soft foundation and a tracker's frame are transforms like
        all others; the tool point is at the flange here, see :meth:`offsets`.
        """
        tool = xyz_transforms("map_", "translation")
        probe = xyz_transforms("probe_r", "rotation") if self.gauge.angles else []
        return Chain((*BASE_TRANSFORMS, *self.robot.transforms, *tool, *probe))

    def offsets(self, samples: Samples) -> list[float | Array]:
        """Return what every transform gets beside its nominal value: the tool point that was measured, K values [m]."""
        out = super().offsets(samples)
        first = N_BASE_TRANSFORMS + len(self.robot.transforms)
        for k in range(3):
            several = len(self.p_FM) > 1 and samples.point is not None
            out[first + k] = self.p_FM[samples.point, k] if several else float(self.p_FM[0, k])
        return out

    def targets(self, samples: Samples, readings: Readings) -> "Targets":
        """Bring the readings to the base frame, as far as it is known where the gauge stands."""
        return self.gauge.targets(self, samples, readings)

    def with_unknown_places(self, names: tuple[str, ...], prior: float, turn: float) -> "MeasurementSetup":
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


@dataclass(frozen=True)
class Targets(Rows):
    """Readings in the base frame: length (n,) [m], position p_BM (n, 3) [m], rotation R_BF' (n, 3, 3)."""

    length: Array | None = None
    position: Array | None = None
    rotation: Array | None = None

    @classmethod
    def at_base(cls, n: int) -> "Targets":
        """Return n readings at the base's own frame: their residuals are minus the prediction."""
        return cls(np.zeros(n), np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)))


def setup_of(cell: Cell) -> MeasurementSetup:
    """Return the setup as the cell describes it; frames that it does not give are the base's and the flange's own."""
    fixtures, tool, points = cell.fixtures, cell.tool, cell.tool.points
    n = max(1, len(fixtures))
    return MeasurementSetup(
        robot=cell.robot,
        gauge=cell.gauge,
        p_BX=np.array([f.p_BX for f in fixtures]).reshape(-1, 3),
        R_BG=np.broadcast_to(np.eye(3), (n, 3, 3)),
        p_BG=np.zeros((n, 3)),
        p_FM=np.array([p.p_FM for p in points]),
        R_FM=np.broadcast_to(np.eye(3), (len(points), 3, 3)),
        p_GS=np.array([b.p_GS for b in cell.balls]).reshape(-1, 3),
        place_names=tuple(f.name for f in fixtures) or ("",),
        point_names=tuple(p.name for p in points) if len(points) > 1 else ("",),
        place_prior=_place_priors(cell),
        tool_prior=tool.prior,
        turn_prior=min([f.turn for f in fixtures] or [np.inf]),
        joint_sigma=_repeatability_of_joint(cell),
        gravity_B=cell.base.R_WB.T @ np.array([0.0, 0.0, -STANDARD_GRAVITY]),
        tool_mass=tool.mass,
        com_F=tool.com_F,
        loaded=tuple(dict.fromkeys(fixtures[c.fixture].name for c in cell.circles if c.loads)),
        ball_names=tuple(b.name for b in cell.balls),
        fixed=_known_parts(cell),
    )


def _known_parts(cell: Cell) -> frozenset[str]:
    """Return what a cell holds for known without having measured it: what a CMM measured is not sought elsewhere."""
    measured = {"tool"} if cell.tool.measured or not cell.tool.known else set()
    return FREEABLE - cell.plan.free - measured


def _place_priors(cell: Cell) -> Array:
    """Return one-sigma sizes of the errors of the places, (S,) [m], by what the cell states.

    A fixture that the robot sets up stands where the robot came, whatever is stated: one that is not freed, so that the
    statement counts, is known no better than the tool point of a robot before calibration, looked at at home.
    """
    stated = np.array([f.prior for f in cell.fixtures] or [np.inf])
    by_robot = [f.set_up == "robot" for f in cell.fixtures]
    if "fixture" in cell.plan.free or not any(by_robot):
        return stated
    least = cell.robot.usual_error(cell.home, cell.tool.points[0].p_FM)
    return np.where(by_robot, np.maximum(stated, least), stated)


def _repeatability_of_joint(cell: Cell) -> float:
    """Standard deviation of one joint's angle [rad] that explains the published repeatability.

    The same angle for each joint, such that the tool point's, at the home pose, is the published value (three sigma).
    """
    lever = np.linalg.norm(cell.map_jacobian(cell.home[None]), axis=1)  # (1, N)
    return float(cell.robot.repeatability / 3.0 / np.sqrt((lever**2).sum()))
