"""A laser tracker: it reads the position of a reflector on the tool, or position and orientation of a probe."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from planner.cell.file import CellFile, PlacedFile
from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import CellStep, GaugeBody, SessionGuide, place_text
from planner.cell.placement import P, Placement, Targets
from planner.cell.places import nests_frame
from planner.cell.site import Site
from planner.cell.workspace import axis_reach
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import MM, Array, from_mm, read_only, to_mm
from planner.effects.effect import Parameter, transform_move
from planner.gauges.frame_gauge import FrameGauge
from planner.gauges.placement.frames import FramePlacement, are_collinear, place_frames
from planner.gauges.placement.solver import flange_poses
from planner.kinematics.bodies import capsule_between
from planner.kinematics.chain import ForwardPass
from planner.kinematics.geometry import small_log3
from planner.kinematics.robot import Robot
from planner.runs.run import Mounting, Readings, ReferenceReadings, Run, Samples

NOMINAL_OFF = 10 * MM  # [m] more than a robot as it is bought misses by (rms)


@register_gauge
@dataclass(frozen=True)
class Tracker(FrameGauge):
    """Reads the position of a reflector.

    Attributes:
        beam_radius: of the beam between tracker and reflector [m].
    """

    beam_radius: float = 0.0

    kind: ClassVar[str] = "tracker"
    noun: ClassVar[str] = "beam"
    usual_scale: ClassVar[float] = 2e-6  # air 2 K off; its distance meter errs by 0.3 ppm (Leica AT500 manual)
    wrong_scales: ClassVar[float] = 5e-3  # nobody types in a length of it: its wavelength is its standard
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {"cone_deg": {"fixture": 180.0}}  # it turns anywhere
    validates_with: ClassVar[int] = 500  # (TriCal paper, section 6)
    default_noise_um: ClassVar[float] = 15.0

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the beam."""
        return {"beam_radius": 0.0 if file.tracker is None else file.tracker.beam_radius_mm * MM}

    @classmethod
    def placed_section(cls, path: Path, file: CellFile) -> PlacedFile:
        """Return where the tracker stands."""
        fewest = 3  # nests that a frame takes
        if file.tracker is None:
            raise InputError(f"{path}: the section [tracker] with position_mm is missing: where the tracker stands")
        nests = file.tracker.nests
        if 0 < len(nests) < fewest:
            raise InputError(f"{path}: tracker.nests has {len(nests)} nests; a frame takes {fewest} of them")
        if nests and are_collinear(from_mm([n.position_mm for n in nests])):
            raise InputError(
                f"{path}: tracker.nests lie nearly on one line, about which the tracker's frame stays open"
            )
        return file.tracker

    @property
    def ends(self) -> tuple[str, str]:
        """The tracker and its reflector."""
        return "tracker", "reflector"

    def preparation(self, cell: Site, mounting: Mounting) -> tuple[str, str]:
        """The tracker has to see the reflector."""
        return "", "put the reflector into its nest and let the tracker find it"

    @classmethod
    def session_guide(cls, file: CellFile) -> SessionGuide:
        """The tracker and its reflector are set up; the tracker sees the reflector at every pose."""
        where = f" near {place_text(file.tracker.position_mm)} of the base frame" if file.tracker else ""
        on_tool = f" at {place_text(file.tool.map_mm)} of the flange" if file.tool else ""
        steps = [
            CellStep(
                "Set up the tracker",
                f"It stands{where}, warmed up and checked as its maker says; nothing moves it until the log is saved.",
            ),
            CellStep("Nest on the tool", f"The reflector's nest sits{on_tool}, tight and clean; the reflector fits."),
        ]
        if file.tracker and file.tracker.nests:
            names = ", ".join(n.name for n in file.tracker.nests)
            steps.append(
                CellStep(
                    "Read the nests that tie the frames",
                    f"Put the reflector into the nests {names}, one after the other. Each becomes a line above the "
                    "columns of the log: # nest_mm: NAME, x, y, z",
                )
            )
        seen = CellStep(
            "Put the reflector into the nest on the tool",
            "Where the program pauses: lock the beam on it; it stays locked until the last pose.",
        )
        stay = "Stay beside it: where the beam breaks, stop the program, lock it on again and go on from there."
        return SessionGuide(f"the reflector's position ({cls.columns})", tuple(steps), (seen,), stay)

    def describe(self, cell: Site) -> str:
        """Say where the tracker stands."""
        if not cell.fixtures:
            return "tracker, its place not declared"
        return f"tracker at [{', '.join(f'{v:.0f}' for v in to_mm(cell.fixtures[0].p_BX))}] mm"

    def declared_frame(self, file: CellFile) -> PlacedFile | None:
        """Return the station."""
        return file.tracker

    def with_turns(self, turns: bool) -> Gauge:
        """Return the tracker with a probe where its orientation is read."""
        if not turns:
            return self
        return PoseTracker(**{f.name: getattr(self, f.name) for f in fields(self)})

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find the stations, and the targets where the cell has none."""
        seen = _place_frames(setup, run, p_FM)
        return replace(setup, R_BG=seen.R_BG, p_BG=seen.p_BG, p_FM=seen.p_FM)

    def simulate(
        self, cell: Site, samples: Samples, predict: Callable[[Samples], Array],
        slopes: Callable[[Samples], Array], noise: Array,
    ) -> tuple[Samples, Readings]:  # fmt: skip
        """Return the positions as the tracker sees them in its own frame."""
        place = cell.fixtures[0]
        return samples, self.readings((predict(samples) - place.p_BX) @ place.R_BX + noise)

    def reference_readings(self, cell: Site, rng: np.random.Generator) -> ReferenceReadings:
        """Return the nests as the tracker reads them."""
        R_BW, p_BW = nests_frame(cell.file)
        place = cell.fixtures[0]
        seen = [(n.name, (R_BW @ n.p_WN + p_BW - place.p_BX) @ place.R_BX) for n in cell.nests]
        return ReferenceReadings(tuple((name, read_only(p + self.noise * rng.standard_normal(3))) for name, p in seen))

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """The beam from the reflector on, past all that the robot can put in its way."""
        reach = float(axis_reach(cell.chain.transforms, cell.robot.n_joints)[0])
        far = float(np.linalg.norm(cell.fixtures[0].p_BX)) - reach
        z, start = np.array([0.0, 0.0, 1.0]), self.trim + self.beam_radius
        end = max(far, self.length_min, 2 * start)
        return [GaugeBody(capsule_between("tracker's beam", -z * start, -z * end, self.beam_radius), "rod")]


@dataclass(frozen=True)
class PoseTracker(Tracker):
    """Reads position and orientation of a probe."""

    plural: ClassVar[str] = "positions and orientations"
    width: ClassVar[int] = 6
    angles: ClassVar[int] = 3

    def residual(self, setup: Placement, samples: Samples, motion: ForwardPass, targets: Targets) -> Array:
        """Position and orientation read less those of the probe, (n, 6) [m, rad]."""
        apart = super().residual(setup, samples, motion, targets)
        assert targets.rotation is not None
        R = np.einsum("nij,kjn->nik", targets.rotation, motion.R)
        return np.concatenate([apart, small_log3(R)], axis=1)

    def project(self, setup: Placement, samples: Samples, motion: ForwardPass, which: np.ndarray) -> Array:
        """The screws and the axes of what turns, (k, 6, n)."""
        turns = motion.turns(which)
        return np.concatenate([motion.point_screws(which), turns], axis=1)

    def targets(self, setup: Placement, samples: Samples, readings: Readings) -> Targets:
        """Return positions and orientations in the base frame."""
        R_BG, R_FM = setup.R_BG[samples.place], setup.R_FM[samples.point_numbers]
        assert readings.rotation is not None
        R = np.einsum("nij,njk,nlk->nil", R_BG, readings.rotation, R_FM)
        return replace(super().targets(setup, samples, readings), rotation=R)

    def parameters(self, setup: Placement, free: frozenset[str]) -> Iterator[Parameter]:
        """Yield beside a tracker's how the probe is turned on the tool."""
        yield from super().parameters(setup, free)
        for axis in "xyz" if "tool" in free else "":
            k = setup.chain.index(f"probe_r{axis}")
            what = f"turn of the probe about {axis}"
            yield Parameter(f"probe_r{axis}", "rad", setup.turn_prior, what, transform_move(k), "gauge")

    def place(self, setup: P, run: Run, p_FM: Array | None) -> P:
        """Find the stations and how the probes sit on the flange."""
        probe = _place_frames(setup, run, p_FM)
        return replace(setup, R_BG=probe.R_BG, p_BG=probe.p_BG, p_FM=probe.p_FM, R_FM=probe.R_FM)


def _place_frames(setup: Placement, run: Run, p_FM: Array | None) -> FramePlacement:
    """Find the stations, and how targets or probes sit on the flange.

    Raises:
        InputError: the positions are those of a left-handed frame.
        NoSolutionError: the poses leave a direction open.
    """
    stand = flange_poses(setup, run, p_FM)
    p_GM, R_GM = run.readings.position, run.readings.rotation
    assert p_GM is not None

    def place_mirror_image() -> FramePlacement:
        """Place the tracker as if its axes were left-handed."""
        return place_frames(stand, p_GM * np.array([1.0, 1.0, -1.0]), p_FM)

    try:
        seen = place_frames(stand, p_GM, p_FM, R_GM)
    except NoSolutionError:
        _check_handedness(run, np.inf, place_mirror_image)
        raise
    if seen.rms > NOMINAL_OFF:
        _check_handedness(run, seen.rms, place_mirror_image)
    return seen


def _check_handedness(run: Run, rms: float, mirrored: Callable[[], FramePlacement]) -> None:
    """Refuse positions that fit the arm far better, against ``rms`` [m], once they are seen in a mirror."""
    try:
        found = mirrored().rms
    except NoSolutionError:
        return
    mirrored_gain = 3.0  # times better in a mirror: the axes are left-handed
    if found < min(rms / mirrored_gain, NOMINAL_OFF):
        instead = "not at all" if np.isinf(rms) else f"to {float(to_mm(rms)):.3g} mm"
        raise InputError(
            f"{run.name}: the positions fit the arm {instead} as they are, and to {float(to_mm(found)):.3g} mm with "
            "one axis turned round: the tracker's axes are left-handed. Change the sign of one of x_mm, y_mm, z_mm "
            "(factor = -1 in the map of edbb import), or exchange two of them"
        )
