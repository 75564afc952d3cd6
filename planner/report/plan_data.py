"""The numbers of the report, prepared once: page and prints show these and compute none of their own."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import Workspace
from planner.common.units import Array
from planner.design.observability.information import predict_covariance
from planner.effects.effect import Parameter
from planner.kinematics.robot import Robot
from planner.motion.timing.leg_times import axis_limits
from planner.motion.timing.trajectory import MotionSamples
from planner.runs.run import Mounting
from planner.session.plan_types import Drive, Plan
from planner.session.tour_cost import cost_name, leg_times


@dataclass(frozen=True)
class DrivenPath:
    """One fixture's measuring path, from the mount pose through all poses, as it is driven.

    Attributes:
        motion: state at n times.
        length: bar length, (n,) [m].
        tilt: of the bar at the fixture and at the tool, (n, 2) [rad]; None where the gauge has no cone at both ends.
        share: joint speed as a part of its limit, (n, N).
        passed: times of the visits [s], (k,), with the bar's length then, (k,) [m].
        ends: when the last visit is done [s]; a drive both ways then goes the same way back.
        returns: whether it does.
    """

    motion: MotionSamples
    length: Array
    tilt: Array | None
    share: Array
    passed: Array
    passed_length: Array
    ends: float
    returns: bool


def sample_drive(cell: Cell, drive: Drive, samples: int = 2000) -> DrivenPath:
    """Sample one fixture's way there evenly in time; a picture has no more columns than that."""
    trajectory, count = drive.trajectory, len(drive.path.q)
    returns = len(trajectory.waypoint_time) > count
    ends = float(trajectory.waypoint_time[count - 1]) if returns else trajectory.duration_s
    motion = trajectory.at(np.linspace(0.0, ends, samples))
    workspace = Workspace(cell, drive.mounting)
    cones = np.array([cell.gauge.cone_fixture, cell.gauge.cone_map])
    margins = workspace.stage("cones", motion.q)
    passed = trajectory.waypoint_time[:count][drive.path.node >= 0]
    return DrivenPath(
        motion=motion,
        length=cell.bar_length(motion.q, drive.mounting),
        tilt=cones - margins if margins.shape[1] == len(cones) else None,
        share=np.abs(motion.dq) / axis_limits(cell, bar=True).speed,
        passed=passed,
        passed_length=cell.bar_length(trajectory.angles(passed), drive.mounting),
        ends=ends,
        returns=returns,
    )


@dataclass(frozen=True)
class TourOrders:
    """The same poses in two orders: time of each [s] by the cost of the tour's legs, angles (m, N) [rad]."""

    unsorted_t: Array
    unsorted_q: Array
    sorted_t: Array
    sorted_q: Array
    cost_name: str
    angle_label: str


def angle_label(robot: Robot) -> str:
    """Return the label of a chart's axis for all joints, with the unit of travel if some joints slide."""
    return "joint angle (deg)" if not robot.slides.any() else "joints: angle (deg), travel (mm)"


def tour_orders(cell: Cell, drive: Drive) -> TourOrders:
    """Return the tour before and after sorting, both closed at the mount pose."""
    order = [int(k) for k in drive.tour.order]
    once = [v.q for k, v in enumerate(drive.visits) if v.repeats is None and (k == 0 or v.role != "mount")]
    q = np.array(once[: len(order)])
    sorted_q = np.vstack([q, q[:1]])
    unsorted_q = np.vstack([q[np.argsort(order)], q[:1]])
    unsorted_t, sorted_t = (_clock(cell, drive.mounting, way) for way in (unsorted_q, sorted_q))
    return TourOrders(unsorted_t, unsorted_q, sorted_t, sorted_q, cost_name(cell), angle_label(cell.robot))


def _clock(cell: Cell, mounting: Mounting, q: Array) -> Array:
    legs = leg_times(cell, mounting, q[:-1], q[1:])
    return np.concatenate([[0.0], np.cumsum(legs)])


@dataclass(frozen=True)
class ParameterForecast:
    """One identifiable parameter: its predicted standard deviation ``sigma`` [m or rad]."""

    parameter: Parameter
    sigma: float

    @property
    def share(self) -> float:
        """Standard deviation left, as a part of the prior sigma."""
        return self.sigma / self.parameter.prior


def forecast_parameters(plan: Plan) -> tuple[ParameterForecast, ...]:
    """Predict what one reading at each chosen pose leaves unknown of every parameter."""
    choice = plan.choice
    noise = choice.model.noise(choice.samples)
    std = predict_covariance(choice.model.rows(choice.samples), noise[:, None]).std
    return tuple(ParameterForecast(p, float(s)) for p, s in zip(choice.model.parameters, std, strict=True))
