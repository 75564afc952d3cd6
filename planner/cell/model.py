"""The cell that everything else works with: SI units, checked, read-only."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.bodies import Body
from planner.cell.circles import Circle
from planner.cell.file import CellFile
from planner.cell.parts import Ball, Base, Cable, Controller, Fixture, Gauge, Motion, Nest, PlanOptions, Tool
from planner.chain import Chain, Transform
from planner.gauge import bar_state
from planner.robot import Robot
from planner.units import Array


@dataclass(frozen=True)
class Cell:
    """Robot, tool, fixtures, gauge and surroundings; ``file`` is what was read, whole.

    ``carrier`` are the artifact's bodies, in its own frame; ``nests`` tie a tracker's frame to the artifact's.
    """

    name: str
    robot: Robot
    home: Array
    tool: Tool
    gauge: Gauge
    fixtures: tuple[Fixture, ...]
    balls: tuple[Ball, ...]
    obstacles: tuple[Body, ...]
    motion: Motion
    cable: Cable
    base: Base
    controller: Controller
    plan: PlanOptions
    file: CellFile
    path: Path
    circles: tuple[Circle, ...] = ()
    carrier: tuple[Body, ...] = ()
    nests: tuple[Nest, ...] = ()

    @property
    def p_BS(self) -> Array:
        """Balls in the base frame, where the cell says that the artifact stands, (K, 3) [m]."""
        place = self.fixtures[0]
        return np.array([b.p_GS for b in self.balls]).reshape(-1, 3) @ place.R_BX.T + place.p_BX

    @property
    def joint_range(self) -> tuple[Array, Array]:
        """Range of each joint, both ends (N,) [rad]: its limits, or a turn about home where it can turn further.

        More turns only repeat the same arm.
        """
        turn, robot = 2 * np.pi, self.robot
        lower = np.clip(self.home - np.pi, robot.q_lower, np.maximum(robot.q_upper - turn, robot.q_lower))
        return lower, np.minimum(lower + turn, robot.q_upper)

    @property
    def unwound(self) -> "Cell":
        """The cell without the cable's twist along the bar, which counts from a mount pose that is not yet chosen."""
        return replace(self, cable=replace(self.cable, tool_about_bar=None))

    def at(self, fixture: int) -> "Cell":
        """Return the cell with the tool point that the bar hangs from at the entry ``fixture`` of its fixtures."""
        if not self.tool.points:
            return self
        point = self.tool.points[self.fixtures[fixture].point]
        return replace(self, tool=replace(self.tool, p_FM=point.p_FM, axis_F=point.axis_F))

    def point_name(self, fixture: int) -> str:
        """Return the name of that tool point; empty where there is but one."""
        return self.tool.points[self.fixtures[fixture].point].name if self.tool.points else ""

    def place_name(self, fixture: int) -> str:
        """Return what a person calls that place of the bar: the fixture, and the tool point where there are several."""
        point = self.point_name(fixture)
        return self.fixtures[fixture].name + (f", tool point {point}" if point else "")

    @property
    def chain(self) -> Chain:
        """The chain from the base to the measurement application point."""
        tool = [Transform(f"map_{'xyz'[k]}", "translation", k, float(self.tool.p_FM[k])) for k in range(3)]
        return Chain((*self.robot.transforms, *tool))

    def map_position(self, q: Array) -> Array:
        """Position of the MAP in the base frame, (n, 3) [m], for controller angles q (n, N) [rad]."""
        return self.chain.carry(self.robot.theta(q), np.zeros(3))

    def bar_length(self, q: Array, fixture: int) -> Array:
        """Length of the bar at an entry of the fixtures, (n,) [m], for controller angles q (n, N) [rad]."""
        return bar_state(self.at(fixture).map_position(q), self.fixtures[fixture].p_BX).length

    def map_jacobian(self, q: Array) -> Array:
        """Derivative of the MAP position by the controller angles, (n, 3, N) [m/rad]."""
        chain = self.chain
        moving = [k for k, t in enumerate(chain.transforms) if t.joint is not None]
        joints = [int(chain.transforms[k].joint or 0) for k in moving]
        screws = chain.forward(self.robot.theta(q)).point_screws()[moving]  # (N, 3, n) by theta
        return np.asarray(np.einsum("jkn,ji->nki", screws, self.robot.sense_matrix[joints]))

    def map_axis(self, q: Array) -> Array:
        """Axis of the MAP's ball joint in the base frame, (n, 3)."""
        return self.chain.carry(self.robot.theta(q), self.tool.axis_F, point=False)
