"""From the last stage to the calibration: uncertainties, checks and warnings."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.summary import Aside, Doubt
from planner.common.system import give_back_memory
from planner.common.units import MM, Array, mean_by_group
from planner.design.observability.information import r_factor
from planner.documents.calibration import (
    Calibration,
    ResidualDiagnosis,
    find_joint_zeros,
    find_other_zeros,
)
from planner.effects.steps import SLIP
from planner.fit.artifact_pose import gauge_frames
from planner.fit.assumptions import (
    COUNTED,
    FEW_READINGS_EACH,
    LARGEST_HELD_OUT,
)
from planner.fit.better_explanations import explain_better
from planner.fit.covariance import (
    consider_covariance,
    parameter_covariance,
    workspace_error,
    workspace_warning,
)
from planner.fit.cross_validation import (
    Split,
    finer_split,
    number_targets,
    predict_held_out,
)
from planner.fit.gross_errors import DeclaredGeometry, gross_error
from planner.fit.identifiable_parameters import FittedParameters, estimate_parameters
from planner.fit.least_squares import Fit
from planner.fit.noise import least_noise
from planner.identification.residual_tests import diagnose_residual
from planner.identification.run_warnings import collect_warnings, warn_of_validation
from planner.inference.candidates import TracingResult
from planner.inference.stages import FitContext, FittedStage
from planner.model.gauge_frames import GaugeFrames
from planner.model.identification_document import (
    Estimate,
    HoldOut,
    Metrics,
    Release,
    ReleaseBasis,
    Stage,
    Unexplained,
    WithinGroups,
    error_size,
)
from planner.release.causes import Causes, name_causes
from planner.release.nominal_comparison import worse_than_nominal
from planner.release.released_parameters import released_estimates, std_beside_robot
from planner.release.released_robot import ReleasedRobot
from planner.release.releasing import describe_release, draws_note, release_robot, tool_point_advice
from planner.runs.run import Run

NO_POSTERIOR = (
    "the fit of all effects together did not come to rest: the calibrated robot is that of the last stage, and its "
    "error over the workspace is that of its covariance, which sees no misfit"
)
ROW_EFFECTS = ("backlash", "hysteresis")  # that show by how each joint came to a pose


def find_problems(
    stages: Sequence[FittedStage], free: FittedParameters, traced: TracingResult, run: Run, cell: Cell, time: float
) -> tuple[tuple[str, ...], DeclaredGeometry]:
    """Return the reasons not to use the result, after tracing, none when it passed; and what the run says of geometry.

    ``time``: how many samples are worth one.
    """
    out, unit, found = [], cell.gauge.unit, stages[-1].fit
    before, last = (min((s.stage.held_out for s in part), key=lambda m: m.rms) for part in (stages[:2], stages[-1:]))
    geometry = DeclaredGeometry.of(found, {p.name: p.prior for p in free.whole.parameters}, time)
    if last.rms > LARGEST_HELD_OUT:
        off = f"held-out poses are still {last.rms / MM:.1f} {unit} off"
        usual = "look for rows that were exchanged, another ball, fixture or tool point, and units"
        hint = explain_better(cell, run)
        out.append(f"{hint}; {off}" if hint else f"the readings do not belong to these poses: {off}; {usual}")
    elif gross := gross_error(geometry, cell, run):
        out.append(f"{gross}{_attempts_text(traced)}")
    elif last.rms > before.rms and last.rms > least_noise() * found.problem.whitener.declared_rms:
        out.append(
            "there are too few readings for so many parameters, or the error is nothing but noise: held-out poses got "
            f"worse, {before.rms / MM:.3g} {unit} to {last.rms / MM:.3g} {unit}"
        )
    factor = found.solution.factor
    if len(factor) and not np.all(np.isfinite(factor)):
        out.append("the information of the fit is not finite")
    return tuple(out), geometry


def _attempts_text(traced: TracingResult) -> str:
    """Say what was tried before a fit is refused."""
    if traced.tried is None:
        return ""
    return f" ({traced.tried} causes were tried, and none explains it)"


def too_few_text(spare: int) -> str:
    """Say that too few readings are left beyond the parameters to trace anything."""
    return f"only {spare} readings beyond the parameters: too few to trace what is left; nothing was sought"


def few_readings_note(fitted: int, width: int, rows: int, time: float) -> list[str]:
    """Say that a fit has nearly as many parameters as independent readings, and what helps.

    Args:
        fitted: parameters.
        width: readings of a row.
        rows: of the run.
        time: how many rows are worth one.
    """
    readings = rows * width / time
    if readings >= FEW_READINGS_EACH * fitted:
        return []
    alike = f" ({rows} rows along a drive, of which {time:.1f} are worth one)" if time > 1.05 else ""
    more = "drive through further poses: a slower drive adds next to nothing" if alike else "measure further poses"
    return [
        Doubt(
            f"{fitted} parameters were fitted to {readings:.0f} independent readings{alike}: what these leave open "
            f"rests on usual sizes of errors; {more}, or free fewer in [plan]"
        )
    ]


def approach_warnings(traced: TracingResult) -> list[str]:
    """Return a warning if a finding rests on directions of approach that the run did not log."""
    if by_rows := [f.name for f in traced.findings if f.effect in ROW_EFFECTS]:
        return [
            Aside(
                f"{', '.join(by_rows)}: no direction of approach was logged (direction1 ...), so the arm was taken to "
                "have moved straight from row to row"
            )
        ]
    return []


def _release(
    stages: Sequence[FittedStage],
    free: FittedParameters,
    context: FitContext,
    cell: Cell,
    time: float,
    basis: ReleaseBasis,
    traced: TracingResult,
    declared: DeclaredGeometry,
) -> ReleasedRobot | None:
    """Return the robot to be released, ``None`` where it is the fit's or the posterior does not come to rest."""
    if basis == "fit":
        return None
    give_back_memory()
    try:
        return release_robot(stages, free.whole, context, cell, time, basis == "geometry", declared, traced.variants)
    except (NoSolutionError, np.linalg.LinAlgError):
        return None


def _whole_covariance(found: Fit, free: FittedParameters, continuous: bool) -> tuple[Array, float]:
    """Return the covariance (P, P), what is held and may be off counted in, and the correlation time in samples."""
    fitted, time = parameter_covariance(found, continuous)
    return fitted + consider_covariance(found, free.held), time


def _fit_notes(fitted: FittedStage, parts: Split, run: Run, time: float) -> Iterator[str]:
    """Yield what is to be said of a long run that was fitted once more, and of few readings for many parameters."""
    model = fitted.fit.model
    yield from _refit_notes(parts, fitted)
    yield from few_readings_note(len(model.names), model.width, len(run), time)


def _notes_by_kind(said: Sequence[str]) -> dict[str, Any]:
    """Return those that ask nothing of anybody, and those that make the verdict doubtful."""
    asides = frozenset(text for text in said if isinstance(text, Aside))
    return {"asides": asides, "doubts": tuple(text for text in said if isinstance(text, Doubt))}


def assess_fit(
    stages: list[FittedStage], free: FittedParameters, context: FitContext, cell: Cell, validation: Run | None,
    traced: TracingResult, notes: Sequence[str] = (), basis: ReleaseBasis = "posterior",
) -> Calibration:  # fmt: skip
    """Assess the last stage and assemble the calibration."""
    run, parts, stages = context.run, context.split, _count_alike(stages, stages[-1].stage.weight, context.split)
    found = stages[-1].fit
    covariance, time = _whole_covariance(found, free, run.continuous)
    table = _estimate_all(free, found, covariance, traced)
    problems, declared = find_problems(stages, free, traced, run, cell, time)
    released = None if problems else _release(stages, free, context, cell, time, basis, traced, declared)
    expected = workspace_error(cell, run, found, covariance) if released is None else released.anywhere
    last = (stages := _count_alike(stages, _row_weight(released, stages[-1].stage), parts))[-1].stage
    said = [
        *(*run.warnings, *collect_warnings(run, cell, found, last.weight, _held_out_errors(released, last))),
        *(*warn_of_validation(found, cell, validation), *notes),
        *(*_fit_notes(stages[-1], parts, run, time), *_release_notes(released, not problems and basis != "fit")),
        *(*workspace_warning(expected, last.held_out, found.model.width), *(() if problems else declared.factor_notes)),
    ]
    estimates, release = _released_sections(released, table)
    diagnosis, kept = diagnose_residual(found, run.continuous, last.train.rms), tuple(s.stage for s in stages)
    worse = None if problems else worse_than_nominal(kept, release, expected, cell.gauge.unit)
    causes, traced = _find_causes(bool(problems or worse), traced, released, table, context, time)
    return Calibration(
        schema_="edbb-identification/1",
        worse_than_nominal=worse,
        robot=found.setup.robot.name,
        n_samples=len(run),
        n_groups=parts.groups,
        n_validation=None if validation is None else len(validation),
        split=HoldOut(by=parts.by, hold_out=1.0 / parts.folds, within=_errors_within_groups(run, parts, found)),
        stages=kept,
        estimates=estimates,
        joint_zeros=find_joint_zeros(found.setup.robot, estimates),
        other_zeros=find_other_zeros(found.setup.robot, estimates, cell.controller.dialects),
        fitted=() if released is None else tuple(e for e in table if e.identifiable),
        degrees_of_freedom=max(1.0, len(found.problem) * found.model.width / time - found.effective),
        findings=causes.findings,
        limits=traced.limits,
        rejected=causes.rejected,
        tried=traced.tried,
        unexplained=_describe_rest(diagnosis, last),
        noise_floor=_noise_floor(run, last.residual, last.weight),
        workspace_error=expected,
        release=release,
        condition_number=_condition(found),
        correlation_time=time,
        frames=_frames(found, released, estimates),
        problems=problems if worse is None else (worse,),
        warnings=tuple(said),
        **_notes_by_kind(said),
        angle_unit="mrad" if cell.gauge.unit == "mrad" else None,
        simulated=True if run.simulated or (validation is not None and validation.simulated) else None,
        run=run,
        fit=found,
        dropped=free.dropped,
        covariance=covariance,
        diagnosis=diagnosis,
        released=released,
        row_weight=last.weight,
    )


def _find_causes(
    refused: bool,
    traced: TracingResult,
    released: ReleasedRobot | None,
    table: Sequence[Estimate],
    context: FitContext,
    time: float,
) -> tuple[Causes, TracingResult]:
    """Return the causes that are named and what tracing says: nothing of a fit that is not to be used."""
    traced, released = TracingResult() if refused else traced, None if refused else released
    readings = 0.0 if released is None else len(context.run) * released.fit.model.width / time
    return name_causes(traced, released, table, readings, context.limits.most_causes), traced


def _released_sections(
    released: ReleasedRobot | None, table: tuple[Estimate, ...]
) -> tuple[tuple[Estimate, ...], Release | None]:
    """Return every parameter of the robot that is written, and the section about it; the table if that is the fit's."""
    if released is None:
        return table, None
    return released_estimates(table, released), describe_release(released)


def _release_notes(released: ReleasedRobot | None, wanted: bool) -> list[str]:
    """Return what to know of the robot that is written; that there is none though it was ``wanted``."""
    if released is None:
        return [NO_POSTERIOR] if wanted else []
    return [*tool_point_advice(released), *draws_note(released)]


def _count_alike(stages: Sequence[FittedStage], weight: Array, parts: Split) -> list[FittedStage]:
    """Return stages whose errors count the samples by the same weights (n,): else a row spoils some of them alone."""
    return [replace(s, stage=s.stage.weigh(weight, parts.fold)) for s in stages]


def _row_weight(released: ReleasedRobot | None, last: Stage) -> Array:
    """Return by how much each row counts, (n,): by the posterior, or by the last stage where there is none."""
    return last.weight if released is None else released.posterior.fit.problem.weight


def _held_out_errors(released: ReleasedRobot | None, last: Stage) -> Array:
    """Return how far rows held out are off (n,) [m] by the robot that is written, or likewise by the last stage."""
    return error_size(last.held_residual if released is None else released.held_residual)


def _frames(found: Fit, released: ReleasedRobot | None, estimates: Sequence[Estimate]) -> GaugeFrames:
    """Return where gauge and tool are by the robot that is written."""
    written, known = (found, found) if released is None else (released.fit, released.posterior.fit)
    return gauge_frames(written, estimates, std_beside_robot(known))


def _estimate_all(free: FittedParameters, found: Fit, covariance: Array, traced: TracingResult) -> tuple[Estimate, ...]:
    """Return every parameter: the model's own, those of the effects that were found, and their inner numbers."""
    known = set(free.whole.names)
    whole = free.whole.plus([p for p in found.model.parameters if p.name not in known])
    inner = {f"{f.name}, {f.inner.name}": f.inner.value for f in traced.findings if f.inner is not None}
    return estimate_parameters(whole, found, free.dropped, covariance, inner)


def _describe_rest(diagnosis: ResidualDiagnosis, last: Stage) -> Unexplained:
    """Return the residual of the last stage in numbers, with the structure that the tests found in it."""
    return Unexplained(
        structured=diagnosis.structured,
        along=tuple(t.along for t in diagnosis.found),
        rms=last.held_out.rms,
        structured_rms=diagnosis.rms,
        note=diagnosis.sentence,
    )


def _errors_within_groups(run: Run, parts: Split, found: Fit) -> WithinGroups | None:
    """Return the errors with single poses held out, for a run whose folds are whole sessions, placements or blocks."""
    finer = finer_split(run, parts)
    if finer is None:
        return None
    held = predict_held_out(found, finer).residual
    return WithinGroups(held_out=Metrics.of(held, finer.fold, found.problem.weight))


def _refit_notes(parts: Split, last: FittedStage) -> list[str]:
    """Return a warning if parameters were fitted on the held-out samples, because no others depend on them."""
    own = [p for p in last.fit.model.parameters if p.name in last.refitted and not p.group.startswith(SLIP)]
    if not own:
        return []
    what = own[0].what
    return [
        f"each {parts.by} has numbers of its own, such as the {what}: they were fitted on the {parts.by} itself where "
        "it was held out"
    ]


def _condition(found: Fit) -> float | None:
    """Condition number of the whitened rows of geometry and gauge per prior sigma, the prior left out, if finite."""
    problem = found.problem
    own = [k for k, p in enumerate(found.model.parameters) if not p.is_effect]
    if not own:
        return 1.0
    rows = problem.white_columns(found.errors).factored.select(np.array(own)).dense.transpose(2, 1, 0)
    mu = np.linalg.svd(r_factor(rows), compute_uv=False)
    condition = float(mu[0] / max(mu[-1], np.finfo(float).eps * mu[0]))
    return condition if np.isfinite(condition) else None


def _noise_floor(run: Run, residual: Array, weight: Array) -> float | None:
    """Standard deviation of readings repeated at the same pose [m], from residuals (n, r); ``None`` without repeats.

    Rows that stand outside, by their weights (n,), are left out: they are no noise.
    """
    if run.continuous:
        return None
    fine = weight >= COUNTED
    group, residual = np.unique(number_targets(run.samples)[fine], return_inverse=True)[1].reshape(-1), residual[fine]
    count = np.bincount(group)
    spare = int((count - 1).sum())
    if spare < 3:
        return None
    mean = mean_by_group(residual, group)
    return float(np.sqrt((error_size(residual - mean[group]) ** 2).sum() / spare))
