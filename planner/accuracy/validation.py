"""Validation by a tracker: position errors of the nominal and of the calibrated robot, in the manner of ISO 9283."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from planner.accuracy.assumptions import VALIDATION
from planner.accuracy.precision import DECIMALS, SCHEMA
from planner.accuracy.reference_frame import (
    ErrorFloor,
    RobotModel,
    TrackerRegistration,
    calibrated_model,
    error_floor,
    nominal_model,
    position_errors,
    register_tracker,
)
from planner.cell.cell import Cell
from planner.common.errors import InputError, did_you_mean
from planner.common.numbers import number_of
from planner.common.summary import Summary
from planner.common.units import MM, UM, Array, in_units, read_only, to_mm
from planner.runs.run import ReferenceReadings, Run


@dataclass(frozen=True)
class PosePerformance:
    """AP and RP of poses that were visited several times (ISO 9283:1998, 7.2.1 and 7.2.2, position alone).

    Attributes:
        visits: of each pose, (k,) int.
        accuracy: AP, distance from where the model has the tool to the barycentre of where it stood, (k,) [m].
        repeatability: RP = l̄ + 3 S_l, of the distances l from the barycentre, (k,) [m].
    """

    visits: np.ndarray
    accuracy: Array
    repeatability: Array

    def text(self) -> str:
        """Return the figures as a sentence, in mm."""
        ap, rp = (f"{to_mm(v.mean()):.3f} (largest {to_mm(v.max()):.3f})" for v in (self.accuracy, self.repeatability))
        few = self.visits.min() < VALIDATION.standard_visits or len(self.visits) < VALIDATION.standard_poses
        rest = (
            f"; the standard asks for {VALIDATION.standard_poses} poses of {VALIDATION.standard_visits} visits"
            if few
            else ""
        )
        seen = f"{len(self.visits)} poses of {self.visits.min()} to {self.visits.max()} visits"
        return f"AP {ap}, RP {rp} mm, in the manner of ISO 9283, {seen}{rest}"

    def section(self) -> dict[str, object]:
        """Return the figures as a section of ``accuracy.json``."""
        ap, rp = self.accuracy, self.repeatability
        figures = in_units(6, AP_mm=ap.mean(), AP_max_mm=ap.max(), RP_mm=rp.mean(), RP_max_mm=rp.max())
        return {"poses": len(ap), "visits": [int(self.visits.min()), int(self.visits.max())], **figures}


def pose_performance(run: Run, error: Array) -> PosePerformance | None:
    """Return AP and RP of the poses that a tracker saw several times; ``None`` where there is none.

    Args:
        run: with ``pose`` in its samples; scatter is that of the positions as seen, whatever the angles that were read.
        error: seen less model in the base frame, (n, 3) [m].
    """
    pose, seen = run.samples.pose, run.readings.position
    if pose is None or seen is None:
        return None
    visits, ap, rp = list[int](), list[float](), list[float]()
    for p in np.unique(pose[pose >= 0]):
        here = pose == p
        if here.sum() < VALIDATION.fewest_visits:
            continue
        off = np.linalg.norm(seen[here] - seen[here].mean(axis=0), axis=1)
        visits.append(int(here.sum()))
        ap.append(float(np.linalg.norm(error[here].mean(axis=0))))
        rp.append(float(off.mean() + VALIDATION.performance_sigmas * off.std(ddof=1)))
    return PosePerformance(np.array(visits), np.array(ap), np.array(rp)) if visits else None


@dataclass(frozen=True)
class ErrorFigures:
    """Figures of n position errors.

    Attributes:
        count: n.
        mean, largest, std: of the errors [m]; ``std`` with n − 1, as in ISO 9283.
        percentiles: (per cent, error) pairs [m].
    """

    count: int
    mean: float
    largest: float
    std: float
    percentiles: tuple[tuple[int, float], ...]

    def text(self) -> str:
        """Return the figures as a sentence, in mm."""
        parts = ", ".join(f"{share} % within {float(to_mm(v)):.3f}" for share, v in self.percentiles)
        mean, largest, std = (float(to_mm(v)) for v in (self.mean, self.largest, self.std))
        return f"{self.count} poses: mean {mean:.3f}, max {largest:.3f}, std {std:.3f} mm; {parts}"


def error_figures(error: Array) -> ErrorFigures:
    """Return the figures of position errors (n, 3), or of their lengths (n,), [m].

    Raises:
        InputError: fewer than two errors.
    """
    size = np.linalg.norm(error, axis=1) if np.ndim(error) == 2 else np.asarray(error, dtype=float)
    if len(size) < 2:
        raise InputError(f"figures of accuracy need two poses at least, found {len(size)}")
    percentiles = tuple((p, float(np.percentile(size, p))) for p in VALIDATION.percentiles)
    return ErrorFigures(len(size), float(size.mean()), float(size.max()), float(size.std(ddof=1)), percentiles)


@dataclass(frozen=True)
class ModelErrors:
    """One robot model against the tracker: errors seen − model in the base frame (n, 3) [m], and figures of them."""

    arm: RobotModel
    error: Array
    figures: ErrorFigures
    performance: PosePerformance | None = None


@dataclass(frozen=True)
class Validation:
    """What a tracker's run says.

    Attributes:
        run: the validation poses alone.
        nests: names of the nests that gave the frame.
        frame: of the tracker.
        before: the robot of the data sheet.
        after: the calibrated one, where there is one.
        floor: what even a perfect model would show.
        notes: what a person should know.
    """

    run: Run
    nests: tuple[str, ...]
    frame: TrackerRegistration
    before: ModelErrors
    after: ModelErrors | None
    floor: ErrorFloor
    notes: tuple[str, ...]

    def overview(self) -> Summary:
        """Return the errors before and after."""
        misses = ", ".join(f"{n} {m / UM:.0f} µm" for n, m in zip(self.nests, self.frame.misses, strict=True))
        facts = []
        for name, judged in (("before", self.before), ("after", self.after)):
            facts += [] if judged is None else [(name, judged.figures.text())]
            facts += [("", judged.performance.text())] if judged is not None and judged.performance else []
        facts += [("frame", f"from the nests, which miss by {misses}"), ("floor", self.floor.text())]
        return Summary(f"{self.run.name}: {number_of(len(self.run), 'pose')}", facts, notes=self.notes)

    def content(self, robot: str) -> dict[str, object]:
        """Return ``accuracy.json``."""
        f = self.floor
        misses = zip(self.nests, self.frame.misses, strict=True)
        return {
            "schema": SCHEMA,
            "kind": "validation",
            "robot": robot,
            "run": self.run.name,
            "n_poses": len(self.run),
            "frame": {"from": "nests", "nests": [{"name": n, **in_units(DECIMALS, miss_mm=m)} for n, m in misses]},
            "before": _model_section(self.before),
            "after": None if self.after is None else _model_section(self.after),
            "floor": in_units(
                DECIMALS, all_rms_mm=f.all, nests_rms_mm=f.nests, tracker_rms_mm=f.tracker, arm_rms_mm=f.arm
            ),
            "notes": list(self.notes),
        }

    def tables(self) -> dict[str, str]:
        """Return every validation pose with its errors, seen less predicted, in the base frame."""
        pose = self.run.samples.pose
        columns: dict[str, object] = {"pose": np.arange(1, len(self.run) + 1) if pose is None else pose}
        for name, judged in (("before", self.before), ("after", self.after)):
            columns |= {} if judged is None else _error_columns(name, judged)
        return {"errors.csv": pl.DataFrame(columns).write_csv()}


def validate_robot(
    cell: Cell, run: Run, said: ReferenceReadings, model: Path | None = None, others: Run | None = None
) -> Validation:
    """Judge the robot at the poses of a tracker's run; the frame comes from the nests alone.

    ``others`` are poses of the same run that nothing is judged by: they place a calibrated robot whose own gauge stood
    elsewhere.

    Raises:
        InputError: no or bad nests, too few poses, another gauge, another robot.
        NoSolutionError: the other poses cannot place the robot.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: a validation needs the tracker's x_mm, y_mm, z_mm")
    if len(run) < VALIDATION.fewest_poses:
        raise InputError(
            f"{run.name}: {len(run)} poses are too few to judge a robot by; at least {VALIDATION.fewest_poses} are"
            " needed"
        )
    if len(run.places) > 1:
        raise InputError(
            f"{run.name}: the tracker stood at {len(run.places)} places ({', '.join(run.places)}), each with nests of "
            "its own: judge them one by one"
        )
    cell, notes = with_nests(cell, said)
    frame = register_tracker(cell)
    after = None if model is None else _model_errors(calibrated_model(cell, model, frame, others), frame, run)
    if len(run) < VALIDATION.enough_poses:
        notes.append(f"{len(run)} poses: what 95 and 99 % of them stay within is known roughly")
    if after is not None:
        notes += after.arm.notes
    read = tuple(n.name for n in cell.nests if n.p_GN is not None)
    before = _model_errors(nominal_model(cell), frame, run)
    _check_far(run, before)
    floor = error_floor(cell, run, frame, (after or before).arm.by_nests)
    return Validation(run, read, frame, before, after, floor, tuple(notes))


def _check_far(run: Run, before: ModelErrors) -> None:
    if before.figures.mean > VALIDATION.no_robot_error:
        raise InputError(
            f"{run.name}: the robot of the data sheet would be {before.figures.mean / MM:.0f} mm off on average, and "
            "none is: look whether two nests were exchanged, whether they and the poses were read in one frame and "
            "in millimetres, and where [artifact] stands"
        )


def with_nests(cell: Cell, said: ReferenceReadings) -> tuple[Cell, list[str]]:
    """Return the cell with the nests as the run's file has them, and what to say of that.

    Raises:
        InputError: the file names a nest that the cell does not have, or one twice.
    """
    known = [n.name for n in cell.nests]
    read = dict(said.nests)
    for name in read:
        if name not in known:
            raise InputError(
                f"nest '{name}' of the run is not in {cell.path}{did_you_mean(name, known)} (there: {', '.join(known)})"
            )
    if len(read) < len(said.nests):
        raise InputError(f"a nest is read twice above the columns of the run ({', '.join(n for n, _ in said.nests)})")
    both = [n.name for n in cell.nests if n.p_GN is not None and n.name in read]
    notes = [f"nests {', '.join(both)}: as read in the run, not as in {cell.path.name}"] if both else []
    return replace(cell, nests=tuple(replace(n, p_GN=read.get(n.name, n.p_GN)) for n in cell.nests)), notes


def _model_errors(arm: RobotModel, frame: TrackerRegistration, run: Run) -> ModelErrors:
    error = position_errors(arm.robot, arm.p_FM, arm.stand, frame, run)
    return ModelErrors(arm, read_only(np.array(error)), error_figures(error), pose_performance(run, error))


def _error_columns(name: str, judged: ModelErrors) -> dict[str, object]:
    error = to_mm(judged.error)
    out: dict[str, object] = {
        f"{name}_{axis}_mm": np.round(e, DECIMALS) for axis, e in zip("xyz", error.T, strict=True)
    }
    return out | {f"{name}_mm": np.round(np.linalg.norm(error, axis=1), DECIMALS)}


def _model_section(judged: ModelErrors) -> dict[str, object]:
    iso = {} if judged.performance is None else {"iso9283": judged.performance.section()}
    return _figures_section(judged.figures) | iso


def _figures_section(f: ErrorFigures) -> dict[str, object]:
    shares = {f"p{share}_mm": v for share, v in f.percentiles}
    return in_units(DECIMALS, mean_mm=f.mean, max_mm=f.largest, std_mm=f.std, **shares)
