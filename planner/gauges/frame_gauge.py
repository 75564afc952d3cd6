"""What gauges with a frame of their own share: they read positions in it, and it has to be found.

A gauge that reads along the line from a place to the tool point: joint samples and margins.
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import attached_kinds
from planner.cell.gauge_types import FilterStage, JointSamples, PlannedVisit, PointTravel, RecordedPose
from planner.cell.parts import Fixture
from planner.cell.placement import P, Placement, Targets
from planner.cell.places import placed_frame, read_joint_angles
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.second_process import available_threads
from planner.common.sequences import sobol_points
from planner.common.units import MM, Array, from_deg, read_only, to_mm
from planner.effects.basis import ONE, AtPlace
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Parameter, ParameterMove, tool_parameters, transform_move
from planner.effects.gauge_errors import POSITION_ERRORS, PointLag
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.gauges.placement.solver import LOCATED_SIGMA, LOCATED_TURN_SIGMA
from planner.kinematics.chain import ForwardPass
from planner.kinematics.geometry import bar_state, tilt_angle
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting, Readings, Run, Samples


@dataclass(frozen=True)
class LineGauge(Gauge):
    """A gauge whose workspace is a spherical shell about a place, narrowed by a cone at either end."""

    noun: ClassVar[str] = "bar"

    def joint_sampler(self, cell: Site, mounting: Mounting, seed: int) -> Callable[[int], JointSamples]:
        """Draw states whose first joint brings the tool point into the shell."""
        draw = shell_points(cell, seed)
        return lambda count: sample_shell(cell, mounting, draw(count), self.planned_range)

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


def shell_points(cell: Site, seed: int) -> Callable[[int], Array]:
    """Return a function that draws low-discrepancy points over all joints but the first that turns, chosen by the arcs.

    Raises:
        InputError: another joint's axis is coupled to that one's, so that its circle is none.
    """
    first = first_turn(cell)
    if np.any(np.delete(cell.robot.coupling_matrix[:, first], first)):
        raise InputError(
            f"{cell.robot.path}: a joint is coupled to joint {first + 1}; candidates need it to turn alone"
        )
    return sobol_points(cell.robot.n_joints - 1, seed)


def sample_shell(cell: Site, mounting: Mounting, points: Array, shell: tuple[float, float]) -> JointSamples:
    """Bring low-discrepancy points into the shell of one fixture.

    Args:
        cell: the cell.
        mounting: how the gauge is held.
        points: samples of all joints but the first that turns in the unit cube, (m, N − 1).
        shell: its inner and outer radius [m].
    """
    states = 8192  # that a thread brings into the shell at a time
    cell, p_BX = cell.at(mounting), cell.fixtures[mounting.fixture].p_BX
    lower, upper = cell.sampling_range
    q = np.empty((len(points), cell.robot.n_joints))
    first = first_turn(cell)
    q[:, first], others = 0.0, np.delete(np.arange(cell.robot.n_joints), first)
    q[:, others] = lower[others] + points * (upper - lower)[others]
    chunks = [q[k : k + states] for k in range(0, len(q), states)]
    with ThreadPoolExecutor(available_threads()) as threads:
        arcs = threads.map(lambda part: _arcs_in_shell(cell, p_BX, part, (lower[first], upper[first]), shell), chunks)
        inside, start, length = (np.concatenate(parts) for parts in zip(*arcs, strict=True))
    return _sample_arcs(q[inside], first, start, length, float(upper[first] - lower[first]), len(q))


def first_turn(cell: Site) -> int:
    """Return the first joint that turns, from 0: those before it slide, so that its axis keeps its direction."""
    return int(np.argmin(cell.robot.slides))


def _sample_arcs(q: Array, joint: int, start: Array, length: Array, full: float, count: int) -> JointSamples:
    """Place equidistant points on the concatenated arcs (m, A) of a joint of samples q (m, N).

    ``count``: of samples, with those that have no arc.
    """
    per_arc = 4.0  # mean number of points on an arc that is not empty
    ends = np.cumsum(length.ravel())
    used = np.count_nonzero(length)
    if used == 0:
        return JointSamples(q[:0], count)
    spacing = ends[-1] / (per_arc * used)
    s = (np.arange(int(per_arc * used)) + 0.5) * spacing
    arc = np.minimum(np.searchsorted(ends, s, side="right"), len(ends) - 1)
    out = q[arc // length.shape[1]].copy()
    out[:, joint] = start.ravel()[arc] + (s - (ends[arc] - length.ravel()[arc]))
    return JointSamples(out, max(len(out), round(count * full / spacing)))


def _parts_along(x: Array, e: Array) -> Array:
    """Return the parts of x (n, 3) along e, one direction (1, 3) for all or (n, 3), (n,)."""
    return np.asarray(x @ e[0] if len(e) == 1 else np.einsum("ni,ni->n", x, e))


def _arcs_in_shell(
    cell: Site, p_BX: Array, q: Array, joint_range: tuple[float, float], shell: tuple[float, float]
) -> tuple[np.ndarray, Array, Array]:
    """Arcs of the first joint that turns that lie in the shell, for q with 0 there: start and length, (m, A) [rad].

    Of those states alone, (n,) bool and returned first, whose circle meets the shell.

    L² = h² + r² + f² − 2 r f cos φ: h along its axis, r and f the distances of the MAP and the fixture from it,
    φ the angle between them.
    """
    chain, joint = cell.chain, first_turn(cell)
    sense = float(cell.robot.coupling_matrix[joint, joint])
    lower, upper = joint_range
    first = chain.joint_places[joint]
    motion = chain.forward(cell.robot.theta(q if joint else q[:1]))  # slides before it shift the axis
    u, c = motion.u[first, :, 0], motion.p[first].T
    x, f = cell.map_position(q) - c, p_BX - c
    e1 = f - (f @ u)[:, None] * u
    f_radial = np.linalg.norm(e1, axis=1)
    away = f_radial > 1e-9
    e1 = np.where(away[:, None], e1, np.linalg.svd(u[None])[2][1]) / np.where(away, f_radial, 1.0)[:, None]
    along, across = _parts_along(x, e1), _parts_along(x, np.cross(u, e1))
    r = np.hypot(along, across)
    square = (x @ u - f @ u) ** 2 + r**2 + f_radial**2
    scale = np.maximum(2 * r * f_radial, 1e-12)
    shortest, longest = shell
    near, far = (np.clip((square - end**2) / scale, -1, 1) for end in (shortest, longest))
    inside = near > far
    near, far, phi0 = np.arccos(near[inside]), np.arccos(far[inside]), np.arctan2(across[inside], along[inside])
    starts, ends = np.stack([near, -far], axis=1) - phi0[:, None], np.stack([far, -near], axis=1) - phi0[:, None]
    if sense < 0:
        starts, ends = -ends, -starts
    turns = 2 * np.pi * np.arange(np.floor((lower - np.pi) / (2 * np.pi)), np.ceil((upper + np.pi) / (2 * np.pi)) + 1)
    start = np.maximum(starts[:, :, None] + turns, lower).reshape(len(near), 2 * len(turns))
    end = np.minimum(ends[:, :, None] + turns, upper).reshape(start.shape)
    return inside, start, np.maximum(end - start, 0.0)


@dataclass(frozen=True)
class PositionGauge(Gauge, GaugeUnknowns):
    """Reads the position of the tool point in a frame."""

    width: ClassVar[int] = 3
    columns: ClassVar[str] = "x_mm, y_mm, z_mm"
    plural: ClassVar[str] = "positions"
    frees_base: ClassVar[bool] = True
    set_anew: ClassVar[str] = "base"

    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Position read less the tool point, (n, 3) [m]."""
        assert targets.position is not None
        return targets.position - motion.x.T

    def project(self, setup: Placement, samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """The screws themselves, (k, 3, n)."""
        return motion.point_screws(which)

    def targets(self, setup: Placement, samples: Samples, readings: Readings) -> Targets:
        """Return the positions in the base frame."""
        place = samples.place
        position = np.einsum("nij,nj->ni", setup.R_BG[place], self.positions(setup, readings)) + setup.p_BG[place]
        return Targets(position=position)

    def positions(self, setup: Placement, readings: Readings) -> Array:
        """Return the positions read, in the gauge's frame, (n, 3) [m]."""
        assert readings.position is not None
        return readings.position

    def readings(self, values: Array) -> Readings:
        """Return positions."""
        return Readings(position=read_only(values))

    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """How the base stands to each frame, and the tool points where they are free."""
        yield from _frame_parameters(setup)
        if "tool" in free:
            yield from tool_parameters(setup)

    def lag_moves(self) -> tuple[ParameterMove, ...]:
        """Return how a late clock shows in the position."""
        return tuple(ParameterMove("reading", a, PointLag(a)) for a in range(3))

    def errors(self, run: Excitation) -> Iterator[Effect]:
        """Yield scale, growth, lag and refraction."""
        for generator in POSITION_ERRORS:
            yield from generator(run)

    def coordinates(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Iterator[tuple[str, Array]]:
        """Yield the coordinates of the measured position."""
        yield "position", motion.x.T

    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with frames that are all to be found, as well as the nominal robot finds them."""
        turn = max(LOCATED_TURN_SIGMA, setup.robot.usual_turn)
        return setup.with_unknown_places(run.places, LOCATED_SIGMA, turn)

    def set_up_again(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with the frames of the run; the targets sit where they sat."""
        there = self.place(self.number_places(setup, cell, run), run, setup.p_FM)
        return replace(there, p_FM=setup.p_FM, R_FM=setup.R_FM)

    def needs_new_frames(self, setup: Placement, run: Run) -> bool:
        """Tell whether the run was measured from another station."""
        return not set(run.places) <= set(setup.place_names)


@dataclass(frozen=True)
class ToolPosition(PositionGauge):
    """The tool point itself, as if it were seen without a gauge: for the errors that a robot has where it works."""

    kind: ClassVar[str] = "tool-position"
    default_noise_um: ClassVar[float] = 0.0

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Return the setup as it is: the base's frame is the gauge's."""
        return setup


@dataclass(frozen=True)
class FrameGauge(PositionGauge, LineGauge):
    """Stands in one place of the cell and reads positions in a frame of its own, along lines from there."""

    pose_columns: ClassVar[tuple[str, str]] = ("ball", "first contact (mm)")

    @classmethod
    @abstractmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return the section of the cell file that says where it stands.

        Raises:
            InputError: it is missing, or what it needs beside it.
        """

    @classmethod
    def read_places(cls, path: Path, robot: Robot, file: CellFile) -> tuple[Fixture, ...]:
        """Return the one unnamed place at which it stands."""
        bars = ", ".join(attached_kinds())
        if file.tool is not None and file.tool.points:
            raise InputError(f"{path}: [[tool.points]] are for a bar ({bars})")
        if file.fixtures:
            raise InputError(f"{path}: [[fixtures]] are for a bar ({bars}); a {file.gauge.kind} has none")
        given = file.gauge.mount_deg
        mount = None if given is None else read_joint_angles(path, robot, "gauge.mount_deg", given, file.gauge.mount_mm)
        placed = cls.placed_section(path, file)
        R, p = placed_frame(placed)
        turn = float(from_deg(placed.prior_deg))
        return (Fixture("", p, read_only(R[:, 2]), placed.prior_mm * MM, (mount,), R, turn),)

    def visit_cells(self, cell: Site, visit: PlannedVisit) -> tuple[str, str]:
        """Return the ball and how far off centre it is met."""
        met = "" if visit.contact is None else f"{float(to_mm(visit.contact)):.2f}"
        return cell.balls[visit.ball].name if visit.ball >= 0 else "", met

    def plan_errors(self, cell: Site, poses: Sequence[RecordedPose], plan: Path) -> Array:
        """Distance of the tool point from the ball that is centred there, one a pose [mm]; nothing is off elsewhere."""
        names = [b.name for b in cell.balls]
        x = cell.map_position(np.deg2rad([p.q_deg for p in poses]))
        ball = [names.index(p.ball) if p.ball in names else -1 for p in poses]
        return np.array(
            [0.0 if k < 0 else float(np.linalg.norm(x[i] - cell.p_BS[k])) * 1e3 for i, k in enumerate(ball)]
        )

    def visit_record(self, cell: Site, visit: PlannedVisit) -> dict[str, object]:
        """Return the ball and how far off centre it is met."""
        if visit.ball < 0:
            return {}
        said: dict[str, object] = {"ball": cell.balls[visit.ball].name}
        return said if visit.contact is None else said | {"first_contact_mm": visit.contact * 1e3}


def _frame_parameters(setup: Placement) -> Iterator[Parameter]:
    for s, name in enumerate(setup.place_names):
        label = f"base_{name}" if name else "base"
        whose = f" for {name}" if name else ""
        phi = AtPlace(s) if len(setup.place_names) > 1 else ONE
        prior = float(setup.place_prior[s])
        for a, axis in enumerate("xyz"):
            what = f"place of the base along {axis}{whose}"
            yield Parameter(f"{label}_{axis}", "m", prior, what, transform_move(a, phi), "gauge")
        for a, axis in enumerate("xyz"):
            what = f"tilt of the base about {axis}{whose}"
            yield Parameter(f"{label}_r{axis}", "rad", setup.turn_prior, what, transform_move(3 + a, phi), "gauge")
