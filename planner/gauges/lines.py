"""Joint samples and margins of a gauge that reads along the line from a place to the tool point."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from planner.cell.cell import Cell, Fixture
from planner.cell.gauge import Gauge
from planner.cell.gauge_types import FilterStage, JointSamples, PointTravel
from planner.common.units import Array
from planner.gauges.shell import sample_shell, shell_points
from planner.kinematics.bar_geometry import bar_state, tilt_angle
from planner.runs.run import Mounting


@dataclass(frozen=True)
class LineGauge(Gauge):
    """A gauge whose workspace is a spherical shell about a place, narrowed by a cone at either end."""

    noun: ClassVar[str] = "bar"

    def joint_sampler(self, cell: Cell, mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Draw states whose first joint brings the tool point into the shell."""
        draw = shell_points(cell, seed)
        return lambda count: sample_shell(cell, mounting, draw(count))

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        """Both ends of the range, then both cones."""
        return (
            ("workspace", f"shortest {self.noun} length"),
            ("workspace", f"longest {self.noun} length"),
            ("cones", "tilt at the fixture"),
            ("cones", "tilt at the tool"),
        )

    def margins(self, stage: FilterStage, place: Fixture, p_BM: Array, axis_B: Array) -> Array:
        """Length within the range that a plan uses, tilts within the cones."""
        line = bar_state(p_BM, place.p_BX)
        if stage == "workspace":
            shortest, longest = self.planned_range
            return np.column_stack([line.length - shortest, longest - line.length])
        if stage == "cones":
            at_place = self.cone_fixture - tilt_angle(line.direction, place.axis_B)
            return np.column_stack([at_place, self.cone_map - tilt_angle(-line.direction, axis_B)])
        return np.empty((len(p_BM), 0))

    def margin_changes(self, travel: PointTravel) -> list[Array]:
        """The length changes by the stretch, the tilts by the swing, at the tool by its turn as well."""
        return [travel.stretch, travel.stretch, travel.swing, travel.swing + travel.turn]
