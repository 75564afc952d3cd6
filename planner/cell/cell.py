"""The cell: robot, tool, fixtures and surroundings, with the gauge that measures there.

The measurement set-up: where robot, gauge and targets stand, with the gauge that reads them.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from planner.cell.gauge import Gauge
from planner.cell.parts import STANDARD_GRAVITY
from planner.cell.placement import FREEABLE, N_BASE_TRANSFORMS, Placement, Targets
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import Array
from planner.kinematics.chain import Chain, xyz_transforms
from planner.kinematics.robot import BASE_TRANSFORMS
from planner.runs.run import Readings, Samples


@dataclass(frozen=True, repr=False)
class Cell(Site):
    """A site with its gauge.

    Attributes:
        gauge: what is read, and its noise.

    Example:
        >>> cell = load_cell("comau-nj130/edbb")  # doctest: +SKIP
        >>> cell.home + 0.1  # (N,) rad  # doctest: +SKIP
    """

    gauge: Gauge = field(kw_only=True)

    def __repr__(self) -> str:
        """Name the cell, its robot and its gauge."""
        return f"Cell('{self.path}', robot='{self.robot.name}', gauge='{self.gauge.kind}')"

    @property
    def rest_seconds(self) -> float:
        """Return the time for which the robot rests at a pose [s]."""
        motion, gauge = self.motion, self.gauge
        if motion.is_continuous:
            return gauge.reading_seconds
        return motion.settle + gauge.reading_seconds + (0.0 if gauge.drives_on_when_read else motion.dwell)

    @property
    def seconds_until_read(self) -> float:
        """Return the time from where the robot has come to rest at a pose to the middle of the reading [s]."""
        return (self.motion.settle + self.rest_seconds) / 2

    def with_reading_time(self) -> Self:
        """Return the cell whose file states the time for which the robot waits for a reading, if it waits.

        A plan states what it has reckoned with; files of plans from before have no such time.
        """
        gauge, file = self.gauge, self.file.gauge
        usual = gauge.usual_reading_times.get(gauge.read_by)
        if usual is None or file.reading_s is not None:
            return self
        stated = file.model_copy(update={"read_by": gauge.read_by, "reading_s": usual})
        return replace(
            self, file=self.file.model_copy(update={"gauge": stated}), gauge=replace(gauge, reading_time=usual)
        )

    @property
    def is_under_load(self) -> bool:
        """Whether a bar pulls at the tool, or something else than poses is driven."""
        return self.gauge.is_loaded or bool(self._driven_tables)

    @property
    def _driven_tables(self) -> tuple[str, ...]:
        """The sections of which a session is planned, and not one of poses."""
        return tuple(key for key, content in self.sections.items() if content.replaces_poses)

    def has_bar(self, free: bool = False) -> bool:
        """Tell whether a bar is attached between fixture and tool; ``free``: without load, at poses."""
        return self.gauge.is_attached and not (free and self.is_under_load)

    def require_bar(self, use: str, free: bool = False) -> None:
        """Refuse a gauge that is not attached between fixture and tool.

        Args:
            use: what needs one, the beginning of a sentence.
            free: whether a loaded bar, and a cell of which no poses are planned, are refused as well.

        Raises:
            InputError: naming the gauge's kind.
        """
        if not self.has_bar(free):
            tables = "".join(f" with [[{key}]]" for key in self._driven_tables)
            raise InputError(f"{self.path}: {use}, and gauge.kind is '{self.gauge.kind}'{tables}")


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
