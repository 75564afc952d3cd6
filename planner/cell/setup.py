"""The measurement set-up: where robot, gauge and targets stand, with the gauge that reads them."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.cell.gauge import Gauge
from planner.cell.parts import STANDARD_GRAVITY
from planner.cell.placement import FREEABLE, N_BASE_TRANSFORMS, Placement, Targets
from planner.common.units import Array
from planner.kinematics.chain import Chain, xyz_transforms
from planner.kinematics.robot import BASE_TRANSFORMS
from planner.runs.run import Readings, Samples


@dataclass(frozen=True)
class MeasurementSetup(Placement):
    """A placement with its ``gauge``: what is read, and how well."""

    gauge: Gauge = field(kw_only=True)

    def __repr__(self) -> str:
        """Name robot and gauge."""
        return f"MeasurementSetup('{self.robot.name}', gauge='{self.gauge.kind}')"

    @cached_property
    def chain(self) -> Chain:
        """Corrections of the base, the robot, the tool point, and for a probe with orientation its turn.

        The base stands first so that a shift of the gauge, a soft foundation and a tracker's frame are transforms like
        all others. The tool point is at the flange here, see :meth:`offsets`.
        """
        tool = xyz_transforms("map_", "translation")
        probe = xyz_transforms("probe_r", "rotation") if self.gauge.angles else []
        return Chain((*BASE_TRANSFORMS, *self.robot.transforms, *tool, *probe))

    @property
    def has_own_frames(self) -> bool:
        """Whether the gauge reads in frames of its own, as a tracker does, whose place is found with the robot."""
        return self.gauge.frees_base

    def offsets(self, samples: Samples) -> list[float | Array]:
        """Return the additions to the nominal values of the K transforms for the measured tool point [m]."""
        out = super().offsets(samples)
        first = N_BASE_TRANSFORMS + len(self.robot.transforms)
        for k in range(3):
            several = len(self.p_FM) > 1 and samples.point is not None
            out[first + k] = self.p_FM[samples.point, k] if several else float(self.p_FM[0, k])
        return out

    def targets(self, samples: Samples, readings: Readings) -> Targets:
        """Bring the readings to the base frame, as far as it is known where the gauge stands."""
        return self.gauge.targets(self, samples, readings)


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
        loaded={fixtures[k].name: key for content in cell.sections.values() for k, key in content.pulls.items()},
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
