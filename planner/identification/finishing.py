"""From the last stage to the calibration that is handed over: uncertainties, checks, and what a person should know."""

from collections.abc import Sequence

import numpy as np

from planner.cell import Cell
from planner.identification.anywhere import known_anywhere, known_worse
from planner.identification.bench import Bench
from planner.identification.checks import problems_of, warnings_of
from planner.identification.considered import considered
from planner.identification.estimates import estimates
from planner.identification.fit import Fit
from planner.identification.freeing import Freed
from planner.identification.heldout import held_out
from planner.identification.splits import Split, poses, within
from planner.identification.spread import parameter_covariance
from planner.identification.stages import Fitted
from planner.identification.types import Calibration, Metrics, Traced, error_size
from planner.observability import r_factor
from planner.repeatable import evenly
from planner.run import Run
from planner.units import Array

JUDGED = 8_000  # samples of a long run that the condition number is of


def finished(
    stages: list[Fitted],
    free: Freed,
    bench: Bench,
    cell: Cell,
    validation: Run | None,
    traced: Traced | None,
    notes: Sequence[str] = (),
) -> Calibration:
    """Judge the last stage and put everything together; of a long run it is fitted once more, to all of it."""
    run, parts = bench.run, bench.split
    if len(run) > len(stages[-1].fit.problem):
        last = stages[-1]
        stages = [*stages[:-1], bench.fitted(last.stage.name, last.fit.model, last.fit, whole=True)]
    found = stages[-1].fit
    known = set(free.whole.names)
    whole = free.whole.plus([p for p in found.model.parameters if p.name not in known])
    covariance, time = parameter_covariance(found, run.continuous)
    covariance = covariance + considered(found, free.held)
    expected = known_anywhere(cell, run, found, covariance)
    table = estimates(whole, found, free.dropped, covariance)
    return Calibration(
        run=run,
        split_by=parts.by,
        hold_out=1.0 / parts.folds,
        n_groups=parts.groups,
        within=_within(run, parts, found),
        stages=tuple(s.stage for s in stages),
        fit=found,
        dropped=free.dropped,
        estimates=table,
        covariance=covariance,
        correlation_time=time,
        condition_number=_condition(found),
        noise_floor=_noise_floor(run, stages[-1].stage.residual),
        known_anywhere=expected,
        traced=traced,
        problems=problems_of(table, stages, found),
        warnings=(
            *(*run.warnings, *warnings_of(run, cell, found, validation)),
            *(*notes, *_fitted_there(parts, stages[-1])),
            *known_worse(expected, stages[-1].stage.held_out, found.model.width),
        ),
    )


def _within(run: Run, parts: Split, found: Fit) -> Metrics | None:
    """Errors of the last stage where single poses are held out, for a run that is split by something coarser."""
    finer = within(run, parts)
    return None if finer is None else Metrics.of(held_out(found, finer).residual, finer.fold)


def _fitted_there(parts: Split, last: Fitted) -> list[str]:
    """What a reader of the held-out errors must know: numbers that were found on the held-out samples themselves."""
    if not last.refitted:
        return []
    what = next(p.what for p in last.fit.model.parameters if p.name in last.refitted)
    return [
        f"each {parts.by} has numbers of its own, such as the {what}: they were fitted on the {parts.by} itself where "
        "it was held out"
    ]


def _condition(found: Fit) -> float:
    """Condition number of the whitened rows of geometry and gauge per prior size, the prior left out."""
    problem = found.problem
    own = [k for k, p in enumerate(found.model.parameters) if p.group in ("gauge", "geometry")]
    if not own:
        return 1.0
    few = problem.take(evenly(len(problem), JUDGED))
    mu = np.linalg.svd(r_factor(few.piece(slice(None), found.errors).rows[:, :, own]), compute_uv=False)
    return float(mu[0] / max(mu[-1], np.finfo(float).eps * mu[0]))


def _noise_floor(run: Run, residual: Array) -> float | None:
    """Standard deviation of readings repeated at the same pose [m], from residuals (n, r); ``None`` without repeats."""
    if run.continuous:
        return None
    group = poses(run.samples.q) * len(run.places) + run.samples.place
    _, group = np.unique(group, return_inverse=True)
    count = np.bincount(group)
    spare = int((count - 1).sum())
    if spare < 3:
        return None
    mean = np.stack([np.bincount(group, residual[:, k]) / count for k in range(residual.shape[1])], axis=1)
    return float(np.sqrt((error_size(residual - mean[group]) ** 2).sum() / spare))
