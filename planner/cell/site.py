"""A cell without its gauge, in SI units, checked and read-only: robot, tool, fixtures, balls, and how it is driven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from planner.cell.file import CellFile, ControllerFile
from planner.cell.parts import (
    STANDARD_GRAVITY,
    Ball,
    BaseMounting,
    Cable,
    Fixture,
    MotionSettings,
    NamedPlace,
    Nest,
    PlanSettings,
    Tool,
)
from planner.cell.section_content import SectionContent
from planner.common.errors import InputError
from planner.common.units import CACHED_ROWS, Array
from planner.kinematics.bodies import Body
from planner.kinematics.chain import Chain, xyz_transforms
from planner.kinematics.geometry import bar_state
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting, Run


@dataclass(frozen=True)
class Site:
    """Robot, tool, fixtures and surroundings, all that a gauge may ask for; ``file`` is what was read, whole.

    ``carrier`` are the artifact's bodies, in its own frame; ``nests`` tie a tracker's frame to the artifact's;
    ``sections`` are what extensions have read of sections of their own, by the keys of these.
    """

    name: str
    robot: Robot
    home: Array
    tool: Tool
    fixtures: tuple[Fixture, ...]
    balls: tuple[Ball, ...]
    obstacles: tuple[Body, ...]
    motion: MotionSettings
    cable: Cable
    base: BaseMounting
    controller: ControllerFile
    plan: PlanSettings
    file: CellFile
    path: Path
    carrier: tuple[Body, ...] = ()
    nests: tuple[Nest, ...] = ()
    sections: Mapping[str, SectionContent] = field(default_factory=dict)

    def check_robot(self, run: Run) -> None:
        """Refuse a run of another robot.

        Raises:
            InputError: with both names.
        """
        if run.robot is not None and run.robot != self.robot.name:
            raise InputError(
                f"{run.name}: was measured on '{run.robot}', but {self.path} has the robot '{self.robot.name}'"
            )
        for joint, slides in enumerate(self.robot.slides.tolist(), start=1):
            if slides != (joint in run.slides):
                does, unit = ("slides", "mm") if slides else ("turns", "deg")
                raise InputError(
                    f"{run.name}: joint {joint} of {self.robot.name} {does}: its columns are q{joint}_{unit} and "
                    f"cmd{joint}_{unit}"
                )

    def check_load(self, load: float, what: str, cure: str) -> None:
        """Refuse a load [N] beyond what the robot may carry beside its tool; ``what`` says where it comes from.

        Raises:
            InputError: with the load, what is allowed, and the ``cure``.
        """
        robot, tool = self.robot, self.tool
        if robot.payload is None:  # nobody says what it may carry
            return
        allowed = (robot.payload - tool.mass) * STANDARD_GRAVITY
        if load > allowed:
            raise InputError(
                f"{what}, but {robot.name} may carry {robot.payload:g} kg, {allowed:.0f} N beyond its tool of "
                f"{tool.mass:g} kg: {cure}"
            )

    @property
    def p_BS(self) -> Array:
        """Balls in the base frame, where the cell says that the artifact stands, (K, 3) [m]."""
        place = self.fixtures[0]
        return np.array([b.p_GS for b in self.balls]).reshape(-1, 3) @ place.R_BX.T + place.p_BX

    @property
    def joint_range(self) -> tuple[Array, Array]:
        """Return the ends of each joint's range, (N,) each [rad]: its limits, or one turn about home if they are wider.

        A further turn gives the same posture again. A joint that slides has its whole stroke.
        """
        turn, robot = 2 * np.pi, self.robot
        lower = np.clip(self.home - np.pi, robot.q_lower, np.maximum(robot.q_upper - turn, robot.q_lower))
        upper = np.minimum(lower + turn, robot.q_upper)
        return np.where(robot.slides, robot.q_lower, lower), np.where(robot.slides, robot.q_upper, upper)

    @property
    def sampling_range(self) -> tuple[Array, Array]:
        """Range that each joint is sampled in, both ends (N,) [rad]: narrowed to what the cable lets each axis do."""
        lower, upper = self.joint_range
        for axes, limit in self.cable.sums:
            for a in axes:
                lower[a] = max(lower[a], self.home[a] - limit)
                upper[a] = min(upper[a], self.home[a] + limit)
        return lower, upper

    @property
    def without_twist(self) -> Self:
        """The cell without the cable's twist along the bar, which counts from a mount pose that is not yet chosen."""
        return replace(self, cable=replace(self.cable, tool_about_bar=None))

    @property
    def mountings(self) -> tuple[Mounting, ...]:
        """Every way to hold the gauge: at all fixtures with the first tool point, then with the next."""
        return tuple(Mounting(k, p) for p in range(len(self.tool.points)) for k in range(len(self.fixtures)))

    def at(self, mounting: Mounting) -> Self:
        """Return the cell with the tool point that the gauge is held at."""
        return replace(self, tool=replace(self.tool, point=mounting.point))

    def restrict_to(self, mounting: Mounting) -> Self:
        """Return the cell with that fixture and that tool point, and no other."""
        fixture, point = self.fixtures[mounting.fixture], self.tool.points[mounting.point]
        tool = replace(self.tool, points=(point,), point=0)
        return replace(self, tool=tool, fixtures=(replace(fixture, mounts=(fixture.mounts[mounting.point],)),))

    def mount(self, mounting: Mounting) -> Array | None:
        """Return the pose (N,) [rad] where the gauge is attached; ``None`` until one is chosen."""
        return self.fixtures[mounting.fixture].mounts[mounting.point]

    def with_mount(self, mounting: Mounting, q: Array | None) -> Self:
        """Return the cell with the pose q (N,) [rad] where the gauge is attached."""
        fixtures = list(self.fixtures)
        mounts = list(fixtures[mounting.fixture].mounts)
        mounts[mounting.point] = q
        fixtures[mounting.fixture] = replace(fixtures[mounting.fixture], mounts=tuple(mounts))
        return replace(self, fixtures=tuple(fixtures))

    def names_of(self, mounting: Mounting) -> tuple[str, str]:
        """Return the names of fixture and tool point; the point's is empty where there is but one."""
        points = self.tool.points
        point = points[mounting.point].name if len(points) > 1 else ""
        return self.fixtures[mounting.fixture].name, point

    def mountings_of(self, records: Sequence[NamedPlace], plan: Path) -> list[Mounting]:
        """Return how the gauge is held in drives or poses of the plan at ``plan``.

        Raises:
            InputError: at a fixture or tool point that the cell does not have.
        """
        there = {self.names_of(m): m for m in self.mountings}
        for r in records:
            if (r.fixture, r.point) not in there:
                where = f"'{r.fixture}'" + (f", tool point '{r.point}'" if r.point else "")
                raise InputError(f"{plan}: measures at fixture {where}, which {self.path} does not have")
        return [there[r.fixture, r.point] for r in records]

    def place_name(self, mounting: Mounting) -> str:
        """Return the name of a place of the gauge: the fixture, and the tool point if there are several."""
        fixture, point = self.names_of(mounting)
        return fixture + (f", tool point {point}" if point else "")

    def place_record(self, mounting: Mounting) -> dict[str, object]:
        """Return the fixture and, where the tool has several points, the one that the gauge is held at."""
        fixture, point = self.names_of(mounting)
        place: dict[str, object] = {"fixture": fixture}
        return place | {"point": point} if point else place

    @cached_property
    def chain(self) -> Chain:
        """The chain from the base to the measurement application point."""
        return Chain((*self.robot.transforms, *xyz_transforms("map_", "translation", self.tool.p_FM)))

    def map_position(self, q: Array) -> Array:
        """Position of the MAP in the base frame, (n, 3) [m], for controller angles q (n, N) [rad]."""
        return self.chain.carry(self.robot.theta(q), np.zeros(3))

    def bar_length(self, q: Array, mounting: Mounting) -> Array:
        """Length of the bar as it is held, (n,) [m], for controller angles q (n, N) [rad]."""
        return bar_state(self.at(mounting).map_position(q), self.fixtures[mounting.fixture].p_BX).length

    def map_jacobian(self, q: Array) -> Array:
        """Derivative of the MAP position by the controller angles, (n, 3, N) [m/rad]."""
        chain, out = self.chain, np.empty((len(q), 3, q.shape[1]))
        for k in range(0, len(q), CACHED_ROWS):
            part = slice(k, k + CACHED_ROWS)
            screws = chain.forward(self.robot.theta(q[part])).point_screws(chain.joint_places)  # (N, 3, n) by theta
            np.einsum("jkn,ji->nki", screws, self.robot.coupling_matrix, out=out[part])
        return out

    def map_axis(self, q: Array) -> Array:
        """Axis of the MAP's ball joint in the base frame, (n, 3)."""
        return self.chain.carry(self.robot.theta(q), self.tool.axis_F, point=False)
