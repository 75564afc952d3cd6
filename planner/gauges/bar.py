"""Double ball bars: a bar between a fixed ball and the tool reads the distance of both balls, free or under load."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, Field

from planner.cell.file import CellFile
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import GaugeBody, LeftStanding, PlannedVisit, RecordedPose, SessionGuide
from planner.cell.parts import Fixture
from planner.cell.placement import P, Placement, Targets
from planner.cell.places import read_fixtures
from planner.cell.site import Site
from planner.common.advice import Occasion, advice
from planner.common.choices import SetUp
from planner.common.errors import InputError
from planner.common.schema import NonNegativeFloat, PositiveFloat, StrictModel, validate
from planner.common.units import MM, UM, Array, from_deg, from_mm, read_only, to_mm
from planner.effects.basis import AtPlace
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Parameter, ParameterMove, reading_move, tool_parameters, transform_move
from planner.effects.gauge_errors import LENGTH_ERRORS, LengthLag
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.gauges.bar_checklist import LOADED, BarChecklist
from planner.gauges.frame_gauge import LineGauge
from planner.gauges.placement.lengths import place_lengths
from planner.gauges.placement.solver import LOCATED_SIGMA, LOCATED_TURN_SIGMA, flange_poses, index_in_cell
from planner.kinematics.bodies import capsule_between
from planner.kinematics.chain import ForwardPass
from planner.kinematics.geometry import bar_state
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting, Readings, Run, Samples

ZERO_SIGMA = 1.0 * MM  # [m] one sigma of a zero that is free


class BarKeys(StrictModel):
    """Keys of ``[gauge]`` that only a bar has: what it follows, and how far a plan stays off its ends."""

    rate_mm_s: Annotated[PositiveFloat, Field(ge=0.1)] = 100.0
    acceleration_mm_s2: Annotated[PositiveFloat, Field(ge=1)] = 1000.0
    stop_margin_mm: NonNegativeFloat | None = None
    mounting: str = Field(default="", pattern=r"^[A-Za-z0-9._-]{0,40}$")


UNITS = {  # times that lengths come out too large, by what the column may hold instead of what its name says
    "as the column says": 1.0,
    "metres in length_mm (then call it length_m), or millimetres in length_um (then call it length_mm)": 1e-3,
    "micrometres in length_mm (then call it length_um), or millimetres in length_m (then call it length_mm)": 1e3,
    "metres in length_um (then call it length_m)": 1e-6,
    "inches (then give 25.4 times the numbers: factor = 25.4 in a map of edbb import)": 1 / 25.4,
    "half inches (then give 12.7 times the numbers: factor = 12.7 in a map of edbb import)": 1 / 12.7,
    "centimetres (then give 10 times the numbers: factor = 10 in a map of edbb import)": 0.1,
}


def choose_stop_margin(robot: Robot, file: CellFile, keys: BarKeys) -> float:
    """Return the distance that a plan keeps from the ends of the bar's range [m].

    By default it is STOP_SIGMAS standard deviations of the length: by fixture, tool point and an uncalibrated arm.
    """
    if file.gauge.length_mm is None:
        return 0.0
    if keys.stop_margin_mm is not None:
        return keys.stop_margin_mm * MM
    tool, arm = 0.0, 0.0
    if file.tool is not None:
        sigma = file.tool.map_sigma_um
        tool = file.tool.prior_mm * MM if sigma is None else sigma * UM
        home = np.zeros(robot.n_joints)
        if file.home_deg is not None and len(file.home_deg) == (~robot.slides).sum():
            home[~robot.slides] = from_deg(file.home_deg)
        arm = robot.usual_error(home, from_mm(file.tool.map_mm))
    fixture = max((f.prior_mm for f in file.fixtures), default=0.0) * MM
    shortest, longest = file.gauge.length_mm
    # beyond 2 sigmas one reading in 40 is lost at the very end, and few poses are there; 0.2 of the range at most: what
    # is left of a short one must hold a plan
    return min(2.0 * float(np.hypot(np.hypot(fixture, tool), arm)), 0.2 * (longest - shortest) * MM)


@dataclass(frozen=True)
class LengthGauge(LineGauge, GaugeUnknowns):
    """Reads the distance from a fixture to the tool point, and is held between them.

    Attributes:
        housing: length of the part that goes with the fixture [m]; rod_radius [m] of the part that goes with the tool.
    """

    housing: float = 0.0
    rod_radius: float = 0.0

    OwnKeys: ClassVar[type[BaseModel] | None] = BarKeys
    columns: ClassVar[str] = "length_mm"
    plural: ClassVar[str] = "lengths"
    is_attached: ClassVar[bool] = True
    has_zero: ClassVar[bool] = True
    reads_moving: ClassVar[bool] = True
    usual_measure: ClassVar[Literal["continuous", "static"]] = "continuous"
    pose_columns: ClassVar[tuple[str, str]] = ("fixture", "bar (mm)")
    removal: ClassVar[str] = "take the bar off"
    checklist: ClassVar[BarChecklist] = BarChecklist()

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return zero, body, what it follows, and the margin at its ends.

        Raises:
            InputError: the body is longer than the shortest length, or the margin leaves nothing of the range.
        """
        g, body = file.gauge, file.gauge.body
        keys = validate(g.own, BarKeys, f"{path}: [gauge]")
        margin = choose_stop_margin(robot, file, keys)
        if g.length_mm is not None and 2.0 * margin >= (g.length_mm[1] - g.length_mm[0]) * MM:
            raise InputError(
                f"{path}: 'gauge.stop_margin_mm' = {margin / MM:g} at both ends leaves nothing of the range "
                f"{g.length_mm[0]:g} to {g.length_mm[1]:g} mm; allowed is less than half of it"
            )
        if planning and g.length_mm is not None and body.housing_mm + body.trim_mm > g.length_mm[0]:
            raise InputError(
                f"{path}: gauge.body.housing_mm = {body.housing_mm:g} and the trim of {body.trim_mm:g} mm at the far "
                f"ball do not fit into the shortest length {g.length_mm[0]:g} mm"
            )
        return {
            "zero_free": g.zero == "free",
            "radius": body.radius_mm * MM,
            "housing": body.housing_mm * MM,
            "rod_radius": body.rod_radius_mm * MM,
            "rate": keys.rate_mm_s * MM,
            "acceleration": keys.acceleration_mm_s2 * MM,
            "stop_margin": margin,
            "mounting": keys.mounting,
        }

    @classmethod
    def read_places(cls, path: Path, robot: Robot, file: CellFile) -> tuple[Fixture, ...]:
        """Return the fixtures."""
        if not file.fixtures:
            raise InputError(f"{path}: a length gauge needs at least one [[fixtures]] table")
        return read_fixtures(path, robot, file, cls.usual_set_up)

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """It is held between fixture and tool while it reads."""
        stands = bool(file.gauge.own.get("mounting"))
        return cls.checklist.guide(file, cls.noun, cls.removal, cls.usual_set_up, ZERO_SIGMA, stands)

    @property
    def measuring_command(self) -> str:
        """How the session is measured: by the extension that asks a person for each reading, if there is one."""
        usual = super().measuring_command
        return advice(Occasion.READ_BY_HAND, usual) if self.read_by == "hand" else usual

    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Length read less the distance of tool point and fixture, (n, 1) [m]."""
        assert targets.length is not None
        return (targets.length - bar_state(motion.x.T, setup.p_BX[samples.place]).length)[:, None]

    def project(self, setup: Placement, samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """Components of the screws along the bar, (k, 1, n)."""
        e = bar_state(motion.x.T, setup.p_BX[samples.place]).direction
        return np.asarray(np.einsum("kin,ni->kn", motion.point_screws(which), e)[:, None])

    def targets(self, setup: Placement, samples: Samples, readings: Readings) -> Targets:
        """Return the lengths that a fit compares with: as read, less the known part of the zero."""
        assert readings.length is not None
        return Targets(length=readings.length - setup.zero)

    def readings(self, values: Array) -> Readings:
        """Return lengths."""
        return Readings(length=read_only(values[:, 0]))

    def describe(self, cell: Site) -> str:
        """Say the range and the fixtures."""
        names = ", ".join(f.name for f in cell.fixtures)
        several = len(cell.tool.points) > 1
        points = f", tool points {', '.join(p.name for p in cell.tool.points)}" if several else ""
        return f"{self.noun} {self._range_text} on fixture{'s' if ',' in names else ''} {names}{points}"

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Return the instructions to attach the bar before the first pose."""
        fixture, point = cell.names_of(mounting)
        tool = f"tool point {point}" if point else "tool"
        zero = "leave fixture and zero as they stand" if self.mounting else "set its zero"
        return "", f"attach the {self.noun} (fixture {fixture} to {tool}), {zero}"

    def session_names(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """Name the fixture, and the tool point where there are more."""
        place = f"fixture {cell.place_name(mounting)}"
        return f"the mount pose of {place}", f"measuring on {place}"

    def tool_speed(self, cell: Site) -> float:
        """The bar limits it, moving or at rest at the poses."""
        return cell.motion.tool_speed

    def plan_errors(self, cell: Site, poses: Sequence[RecordedPose], plan: Path) -> Array:
        """Bar length by the cell less that of the plan, one a pose [mm]."""
        held = cell.mountings_of(poses, plan)
        length = [float(cell.bar_length(np.deg2rad([p.q_deg]), m)[0]) for p, m in zip(poses, held, strict=True)]
        return np.asarray(np.array(length) * 1e3 - [p.length_mm or 0.0 for p in poses])

    def plan_error_text(self, pose: int, error: float) -> str:
        """Say how much longer the bar would be."""
        return f"the {self.noun} at pose {pose} would be {error:+.3f} mm longer than planned"

    def visit_cells(self, cell: Site, visit: PlannedVisit) -> tuple[str, str]:
        """Return fixture and length."""
        return cell.place_name(visit.mounting), f"{float(to_mm(visit.length)):.2f}"

    def length_text(self, length: float) -> str:
        """Say the length of the bar."""
        return f"{to_mm(length):.1f} mm"

    def path_facts(self, shortest: float, longest: float) -> tuple[tuple[str, str], ...]:
        """Say the range of lengths, and the bar's own."""
        length = f"{float(to_mm(shortest)):.1f} – {float(to_mm(longest)):.1f} mm"
        return ((f"{self.noun} length", f"{length} of {self._range_text}"),)

    def reach_surfaces(self, cell: Site) -> tuple[tuple[Array, Array, float, float], ...]:
        """Return both shells about each fixture, as far as its cone is open."""
        ends = (self.length_min, self.length_max)
        return tuple((f.p_BX, f.axis_B, r, self.cone_fixture) for f in cell.fixtures for r in ends)

    @property
    def _range_text(self) -> str:
        return f"{float(to_mm(self.length_min)):g} – {float(to_mm(self.length_max)):g} mm"

    def visit_record(self, cell: Site, visit: PlannedVisit) -> dict[str, object]:
        """Return length, fixture and, where the tool has several points, the one that the bar hangs from."""
        return {"length_mm": visit.length * 1e3, **cell.place_record(visit.mounting)}

    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """Fixtures, tool points and zeros, as far as they are free."""
        if "fixture" in free:
            yield from fixture_parameters(setup)
        if "tool" in free:
            yield from tool_parameters(setup)
        if "zero" in free:
            yield from self.zero_parameters(setup)

    def zero_parameters(self, setup: Placement) -> Iterator[Parameter]:
        """Yield the zeros of the readings."""
        yield from _zero_parameters(setup, self.noun)

    def lag_moves(self) -> tuple[ParameterMove, ...]:
        """Return how a late clock shows in the length."""
        return reading_move(LengthLag())

    def errors(self, run: Excitation) -> Iterator[Effect]:
        """Yield scale, sag, growth and lag, balls off their centres, and the scale's own period."""
        for generator in LENGTH_ERRORS:
            yield from generator(run)

    def coordinates(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Iterator[tuple[str, Array]]:
        """Yield length and direction of the bar."""
        bar = bar_state(motion.x.T, setup.p_BX[samples.place])
        yield "length", bar.length
        yield "direction of the bar", bar.direction

    def pull_direction(self, setup: Placement, samples: Samples, motion: ForwardPass) -> Array | None:
        """Return the bar's direction."""
        return bar_state(motion.x.T, setup.p_BX[samples.place]).direction

    def number_places(self, setup: P, cell: Site, run: Run) -> P:
        """Return the setup with the fixtures as the run numbers them; without any in the cell, all are to be found."""
        if not cell.fixtures:
            return setup.with_unknown_places(run.places, LOCATED_SIGMA, LOCATED_TURN_SIGMA)
        which = [index_in_cell(run, name, setup.place_names, "fixture", cell) for name in run.places]
        return replace(
            setup,
            p_BX=setup.p_BX[which],
            place_prior=setup.place_prior[which],
            place_names=tuple(setup.place_names[k] for k in which),
        )

    def lasting_places(self, setup: Placement) -> dict[str, Array] | None:
        """Return the fixtures."""
        return dict(zip(setup.place_names, setup.p_BX, strict=True)) if len(setup.p_BX) else None

    def kept_mounting(self, setup: Placement) -> LeftStanding:
        """Return fixtures and zero."""
        names = [p.name for p in (*fixture_parameters(setup), *self.zero_parameters(setup))]
        return LeftStanding(dict(zip(names, names, strict=True)), self.lasting_places(setup) or {})

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find fixtures, tool points and zero, unless the cell has the fixtures and the tool points."""
        if len(setup.p_BX) and p_FM is not None:
            return setup
        known = setup.p_BX if len(setup.p_BX) else None
        assert run.readings.length is not None
        bar = place_lengths(flange_poses(setup, run, p_FM, known), run.readings.length, p_FM, known)
        prior = setup.place_prior if known is not None else np.full(len(bar.p_BX), LOCATED_SIGMA)
        return replace(setup, p_BX=bar.p_BX, p_FM=bar.p_FM, zero=float(np.mean(bar.zero)), place_prior=prior)

    def tell_readable(self, run: Run) -> np.ndarray:
        """Tell which lengths lie within the range, give or take its zero where that is free."""
        length = run.readings.length
        assert length is not None
        slack = ZERO_SIGMA if self.zero_free else 0.0
        return np.asarray((length >= self.length_min - slack) & (length <= self.length_max + slack))

    def range_warnings(self, readings: Readings) -> tuple[str, ...]:
        """Count the lengths at which the bar would be pulled off."""
        length = readings.length
        assert length is not None
        out = (length < self.length_min) | (length > self.length_max)
        if not out.any():
            return ()
        low, high = self.length_min * 1e3, self.length_max * 1e3
        return (
            f"{out.sum()} of {len(length)} lengths lie outside the {self.noun}'s {low:g} … {high:g} mm: with these "
            "errors it would be pulled off there",
        )

    def check_run(self, cell: Site, run: Run) -> None:
        """Refuse lengths in another unit than their column says."""
        roughly = 1.25  # times that lengths may lie beyond what is expected of the gauge
        super().check_run(cell, run)
        length = run.readings.length
        assert length is not None
        typical = float(np.median(np.abs(length)))
        low, high, reach = self._expected_lengths(cell, run)
        fits = {w: f for w, f in UNITS.items() if low / roughly <= typical / f <= high * roughly}
        if fits and 1.0 not in fits.values():
            words = min(fits, key=lambda w: abs(np.log(typical / fits[w] / np.sqrt(low * high))))
            raise InputError(
                f"{run.name}: the lengths are about {typical / MM:.4g} mm as their column says, but {reach}: these "
                f"look like {words}"
            )

    def _expected_lengths(self, cell: Site, run: Run) -> tuple[float, float, str]:
        """Shortest and longest that the gauge may read in a run [m], and in words why."""
        if np.isfinite(self.length_max):
            low, high = max(self.length_min, 1e-3), self.length_max
            return low, high, f"the {self.noun} reaches from {self.length_min / MM:g} to {high / MM:g} mm"
        if not cell.fixtures:
            return 1e-6, 1e6, ""
        away = cell.map_position(run.samples.q)[:, None] - np.array([f.p_BX for f in cell.fixtures])[None]
        far = np.linalg.norm(away, axis=2)
        low, high = max(float(far.min()), 1e-3), float(far.max())
        return low, high, f"by the cell the tool is {low / MM:.4g} to {high / MM:.4g} mm from where it begins"

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """Housing along z from the fixture's ball, rod along −z from the tool's ball, together always the whole bar."""
        rod_length = min(self.length_max - self.housing, self.length_min - self.trim)
        housing_length = max(self.housing, self.length_max - rod_length)
        z = np.array([0.0, 0.0, 1.0])
        start = self.trim + self.radius
        housing = capsule_between("bar housing", z * start, z * max(housing_length - self.radius, start), self.radius)
        start = self.trim + self.rod_radius
        rod = capsule_between("bar rod", -z * start, -z * max(rod_length - self.rod_radius, start), self.rod_radius)
        return [GaugeBody(housing, "housing"), GaugeBody(rod, "rod")]


@register_gauge
@dataclass(frozen=True)
class DoubleBallBar(LengthGauge):
    """The extended double ball bar (EDBB)."""

    kind: ClassVar[str] = "edbb"
    can_be_loaded: ClassVar[bool] = True
    usual_set_up: ClassVar[SetUp] = "robot"  # both its balls are alike: the tool's finds the fixture's cup
    default_noise_um: ClassVar[float] = 1.0


@register_gauge
@dataclass(frozen=True)
class LoadedBar(DoubleBallBar):
    """The loaded double ball bar (LDBB): it pulls while it reads."""

    kind: ClassVar[str] = "ldbb"
    is_loaded: ClassVar[bool] = True
    checklist: ClassVar[BarChecklist] = LOADED


def fixture_parameters(setup: Placement) -> Iterator[Parameter]:
    """A fixture that lies further out looks like a base that stands further back, hence the sign."""
    for s, name in enumerate(setup.place_names):
        label = f"fixture_{name}" if name else "fixture"
        prior = float(setup.place_prior[s])
        for a, axis in enumerate("xyz"):
            what = f"place of fixture {name} along {axis}"
            yield Parameter(f"{label}_{axis}", "m", prior, what, transform_move(a, AtPlace(s, -1.0)), "gauge")


def _zero_parameters(setup: Placement, noun: str) -> Iterator[Parameter]:
    """One zero, or where a loaded bar stands beside another one for each of the two."""
    under = [name in setup.loaded for name in setup.place_names]
    if all(under) or not any(under):
        yield Parameter("zero", "m", ZERO_SIGMA, f"zero of the {noun}", reading_move(), "gauge")
        return
    for name, what, which in (("zero", "the bar without load", False), ("zero_loaded", "the loaded bar", True)):
        moves = tuple(m for s, loaded in enumerate(under) if loaded == which for m in reading_move(AtPlace(s)))
        yield Parameter(name, "m", ZERO_SIGMA, f"zero of {what}", moves, "gauge")
