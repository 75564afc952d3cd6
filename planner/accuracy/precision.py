"""Precision of a head of indicators: repeated centrings and checks against the master ball (TriCal paper)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner.accuracy.assumptions import FRAMES
from planner.cell.cell import Cell
from planner.cell.places import nests_frame
from planner.common.errors import InputError
from planner.common.summary import Summary
from planner.common.units import UM, Array, in_units, mean_by_group, read_only, to_mm
from planner.model.model import Model
from planner.runs.run import NO_REFERENCE_READINGS, ReferenceReadings, Run
from planner.session.document import read_plan


@dataclass(frozen=True)
class Mastering:
    """Readings at the master ball.

    Attributes:
        wanted: what each indicator should show [m].
        off: of each check, what the three showed beyond that, (k, 3) [m].
        drift: from the first check to the last, (3,) [m]; zero where there is but one.
    """

    wanted: float
    off: Array
    drift: Array

    @property
    def good(self) -> bool:
        """Whether all checks are within the tolerance."""
        return bool(np.abs(self.off).max() <= FRAMES.centring_tolerance)

    def text(self) -> str:
        """Say it in one sentence."""
        checks = f"{len(self.off)} check{'s' * (len(self.off) > 1)} of the master ball"
        worst, wanted = float(np.abs(self.off).max()) / UM, float(to_mm(self.wanted))
        drift = f", drift from first to last {float(np.abs(self.drift).max()) / UM:.1f} µm" if len(self.off) > 1 else ""
        said = "" if self.good else "; the tool point is off by as much: master the indicators again"
        return f"{checks}: at most {worst:.1f} µm from {wanted:.3f} mm{drift}{said}"


def check_mastering(cell: Cell, said: ReferenceReadings) -> Mastering | None:
    """Judge the checks that a run's file has above its columns; ``None`` where it has none."""
    wanted = cell.gauge.mastered_reading(cell)
    if not said.masters or wanted is None:
        return None
    off = np.array(said.masters) - wanted
    return Mastering(wanted, read_only(off), read_only(off[-1] - off[0]))


@dataclass(frozen=True)
class Precision:
    """How closely repeated centrings agree.

    Attributes:
        poses: how many were centred more than once.
        centrings: of all these together.
        largest: distance of a centring from its pose's mean, or from the reference where there is one [m].
        rms: of these distances [m].
        apart: largest distance of two centrings of one pose [m].
        axis_std: standard deviation of one centring along each axis, within poses, (3,) [m].
    """

    poses: int
    centrings: int
    largest: float
    rms: float
    apart: float
    axis_std: Array


def repeat_groups(plan: Path) -> dict[int, int]:
    """Return for each pose of the plan at ``plan`` the one that it repeats, or itself.

    Raises:
        InputError: no plan.
    """
    return {p.id: p.id if p.repeats is None else p.repeats for p in read_plan(plan, "poses").poses}


def repeat_precision(position: Array, group: np.ndarray, reference: Array | None = None) -> Precision:
    """Judge positions (n, 3) [m] of balls centred repeatedly; ``group`` (n,) int says which pose each belongs to.

    ``reference`` (3,) [m] is the master ball's centre where a CMM measured it, as in the paper's Table 3.

    Raises:
        InputError: no pose was centred more than once.
    """
    often, member, _, off = _deviations(position, group)
    size = np.linalg.norm(off if reference is None else position[often] - reference, axis=1)
    parts = [position[often][member == k] for k in np.unique(member)]
    std = np.sqrt((off**2).sum(axis=0) / (len(off) - len(parts)))
    rms = float(np.sqrt((size**2).mean()))
    return Precision(len(parts), len(off), float(size.max()), rms, max(map(_diameter, parts)), std)


def _deviations(position: Array, group: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, Array]:
    """Rows of poses centred more than once (m,), the pose of each and its centrings, and how far it is from their mean.

    Raises:
        InputError: there is none.
    """
    _, member, count = np.unique(group, return_inverse=True, return_counts=True)
    often = np.flatnonzero(count[member] > 1)
    if not often.size:
        raise InputError("no pose was centred more than once: plan.repeat says how many poses are")
    mean = mean_by_group(position, member)
    return often, member[often], count[member[often]], (position - mean[member])[often]


def _diameter(x: Array) -> float:
    return float(np.linalg.norm(x[:, None] - x[None], axis=2).max())


SCHEMA = "edbb-accuracy/1"
DECIMALS = 6  # of mm and µm as they are written


@dataclass(frozen=True)
class RepeatedCentrings:
    """The repeated centrings of a run, one entry each, in the order in which they were measured.

    Attributes:
        run: as measured.
        pose: which pose it belongs to, (m,) int.
        ball: name of the ball.
        off: from the mean of that pose's centrings, in the base frame, (m, 3) [m].
        expected: rms of these distances, were repeatability and noise as declared [m].
        summary: the figures.
        master: the checks of the master ball, where the run has any.
        notes: what a person should know.
    """

    run: Run
    pose: np.ndarray
    ball: tuple[str, ...]
    off: Array
    expected: float
    summary: Precision
    master: Mastering | None
    notes: tuple[str, ...]

    def overview(self) -> Summary:
        """Return how closely the centrings agree."""
        s = self.summary
        std = ", ".join(f"{v / UM:.1f}" for v in s.axis_std)
        facts = [
            ("precision", f"at most {s.largest / UM:.1f} µm from the mean of a pose, rms {s.rms / UM:.1f} µm"),
            ("", f"two of a pose at most {s.apart / UM:.1f} µm apart; std {std} µm along x, y, z"),
            ("expected", f"rms {self.expected / UM:.1f} µm of the robot's repeatability and the gauge's noise"),
            *([] if self.master is None else [("mastering", self.master.text())]),
        ]
        return Summary(f"{self.run.name}: {s.centrings} centrings of {s.poses} poses", facts, notes=self.notes)

    def content(self, robot: str) -> dict[str, object]:
        """Return ``accuracy.json``."""
        s, m, size = self.summary, self.master, np.linalg.norm(self.off, axis=1)
        figures = None if m is None else in_units(DECIMALS, wanted_mm=m.wanted, off_um=m.off, drift_um=m.drift)
        return {
            "schema": SCHEMA,
            "kind": "precision",
            "robot": robot,
            "run": self.run.name,
            "poses": s.poses,
            "centrings": s.centrings,
            **in_units(DECIMALS, max_um=s.largest, rms_um=s.rms, expected_rms_um=self.expected),
            **in_units(DECIMALS, apart_um=s.apart, std_um=s.axis_std),
            "published": {"centrings": 3, "max_um": FRAMES.published_centring_um, "by": "a CMM, the arm left out"},
            "each": [
                {"pose": int(p), "ball": b, **in_units(DECIMALS, off_um=o, size_um=d)}
                for p, b, o, d in zip(self.pose, self.ball, self.off, size, strict=True)
            ],
            "mastering": None if m is None or figures is None else {**figures, "good": m.good},
            "notes": list(self.notes),
        }

    def tables(self) -> dict[str, str]:
        """Return the tables that are written beside the document: none."""
        return {}


def judge_repeated_centrings(
    cell: Cell,
    run: Run,
    groups: dict[int, int],
    said: ReferenceReadings = NO_REFERENCE_READINGS,
    notes: tuple[str, ...] = (),
) -> RepeatedCentrings:
    """Judge the repeated centrings of a run: where the robot's axes and the last readings put the ball each time.

    The nominal geometry is near enough: centrings of one pose differ by micrometres. What the arm's axes do not show,
    its repeatability, is part of the figures. A CMM beside the head, as in the paper, would leave it out.

    Raises:
        InputError: no run of balls, or it names no poses, or none was centred more than once.
    """
    if run.readings.ball is None:
        raise InputError(f"{run.name}: a precision test needs the column ball of a head that is centred on balls")
    if run.samples.pose is None:
        raise InputError(f"{run.name}: the column 'pose' is missing, so nothing tells which centrings belong together")
    x = cell.map_position(run.samples.q)
    if run.readings.offset is not None:
        x = x - run.readings.offset @ nests_frame(cell.file)[0].T
    group = np.array([groups.get(int(k), int(k)) for k in run.samples.pose])
    try:
        summary = repeat_precision(x, group)
    except InputError as err:
        raise InputError(f"{run.name}: {err}") from err
    often, _, count, off = _deviations(x, group)
    ball = tuple(run.balls[k] for k in run.readings.ball[often])
    noise = Model.from_cell(cell).reading_noise(run.samples.take(often)).square
    expected = float(np.sqrt((noise * (1.0 - 1.0 / count)).mean()))  # its own mean takes a part of a pose's scatter
    master = check_mastering(cell, said)
    return RepeatedCentrings(run, group[often], ball, read_only(off), expected, summary, master, notes)
