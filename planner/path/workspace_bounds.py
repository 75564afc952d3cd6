"""Margins of limits, bar length, cones and cable at a state, and how much of each a neighbourhood can use up.

The columns are those of :class:`planner.workspace.Workspace`, which the tests hold this against.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.gauge import tilt
from planner.path.bounds import Travel, travel
from planner.path.kinematics import Kinematics, Pose
from planner.units import Array
from planner.workspace import Workspace


@dataclass(frozen=True)
class WorkspaceBounds:
    """Margins and their bounds for one workspace."""

    workspace: Workspace

    @cached_property
    def kinematics(self) -> Kinematics:
        """The forward pass."""
        return Kinematics(self.workspace.cell, self.workspace.fixture)

    def travel(self, q: Array, spokes: Array) -> tuple[Pose, Travel]:
        """Return tool, bar and their travel over neighbourhoods q (n, N), spokes (n, M, N) [rad, controller's]."""
        pose = self.kinematics.at(q)
        return pose, travel(pose, spokes @ self.workspace.cell.robot.sense_matrix.T, self.kinematics.map_reach)

    def margins(self, q: Array, pose: Pose) -> Array:
        """Return the margins at q (n, N) [rad], (n, columns) [rad or m], as ``Workspace.margins`` does."""
        cell, gauge = self.workspace.cell, self.workspace.cell.gauge
        limits = np.minimum(q - cell.robot.q_lower, cell.robot.q_upper - q)
        sums = [limit - np.abs(q[:, axes] - cell.home[list(axes)]).sum(axis=1) for axes, limit in cell.cable.sums]
        if not self.workspace.bar:
            return np.column_stack([limits, *sums])
        fixture = cell.fixtures[self.workspace.fixture]
        reach = [pose.length - gauge.length_min, gauge.length_max - pose.length]
        cones = [
            gauge.cone_fixture - tilt(pose.direction, fixture.axis_B),
            gauge.cone_map - tilt(-pose.direction, pose.axis),
        ]
        limit = cell.cable.tool_about_bar
        spin = [] if limit is None else [limit - np.abs(pose.spin)]
        return np.column_stack([limits, *reach, *cones, *sums, *spin])

    def changes(self, spokes: Array, far: Travel) -> Array:
        """Return what each margin can lose in the neighbourhoods, (n, columns) [rad or m]."""
        cell, step = self.workspace.cell, np.abs(spokes)
        limits = step.max(axis=1)
        sums = [step[:, :, axes].sum(axis=2).max(axis=1) for axes, _ in cell.cable.sums]
        if not self.workspace.bar:
            return np.column_stack([limits, *sums])
        cones = [far.swing, far.swing + far.turn]
        spin = []
        if cell.cable.tool_about_bar is not None:
            # carried along the sphere at a tilt of c, a line turns at tan(c/2) times the rate of the direction
            at_fixture, at_map = np.tan(cell.gauge.cone_fixture / 2), np.tan(cell.gauge.cone_map / 2)
            spin = [far.turn + far.swing * at_fixture + (far.swing + far.turn) * at_map]
        return np.column_stack([limits, far.stretch, far.stretch, *cones, *sums, *spin])
