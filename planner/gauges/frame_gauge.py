"""What gauges with a frame of their own share: they read positions in it, and it has to be found."""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import attached_kinds
from planner.cell.gauge_types import PlannedVisit, RecordedPose
from planner.cell.parts import Fixture
from planner.cell.placement import P, Placement, Targets
from planner.cell.places import placed_frame, read_joint_angles
from planner.cell.site import Site
from planner.common.errors import InputError
from planner.common.units import MM, Array, from_deg, read_only, to_mm
from planner.effects.basis import ONE, AtPlace
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Parameter, ParameterMove, tool_parameters, transform_move
from planner.effects.gauge_errors import POSITION_ERRORS, PointLag
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.gauges.lines import LineGauge
from planner.gauges.placement.flange_poses import LOCATED_SIGMA, LOCATED_TURN_SIGMA
from planner.kinematics.chain import ForwardPass
from planner.kinematics.robot import Robot
from planner.runs.run import Readings, Run, Samples


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
