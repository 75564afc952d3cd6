"""``identify()``: from a run to a calibrated robot, stage by stage."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.identification.checks import TRACEABLE, problems_of, too_few, warnings_of
from planner.identification.estimates import estimates
from planner.identification.fit import Fit
from planner.identification.heldout import held_out
from planner.identification.placed import placed, rig_for, with_motion
from planner.identification.seeing import seen_by
from planner.identification.splits import Split, poses, split, within
from planner.identification.spread import parameter_covariance
from planner.identification.stages import Fitted, fitted, frames_only, gains, nominal
from planner.identification.types import Calibration, Metrics, Traced, error_size
from planner.identification.validation import judged
from planner.model import Model
from planner.model.parameters import clock_offset, compliance_parameters
from planner.observability import Dropped, r_factor
from planner.repeatable import evenly, single_threaded
from planner.run import Run
from planner.units import Array

Say = Callable[[str], None]
JUDGED = 8_000  # samples of a long run that the condition number is of
SPARE = 5  # readings beyond the parameters, below which nothing is fitted


@dataclass(frozen=True)
class Bench:
    """What every fit of a run needs: run, split, judge of the validation run, and whether outliers are turned down."""

    run: Run
    split: Split
    judge: Callable[[Fit], Metrics | None]
    robust: bool


Tracer = Callable[[Fitted, Bench, Say], tuple[list[Fitted], Traced]]
"""From the fitted geometry to one stage for each effect, and what was found."""


@dataclass(frozen=True)
class Settings:
    """What the user may choose: share of the groups held out, robust loss, seed of the folds."""

    hold_out: float = 0.2
    robust: bool = False
    seed: int = 0


@single_threaded
def identify(
    run: Run,
    cell: Cell,
    validation: Run | None = None,
    settings: Settings | None = None,
    say: Say = lambda _: None,
    tracer: Tracer | None = None,
) -> Calibration:
    """Identify the robot of a run; with a ``tracer`` what the geometry leaves is traced to its causes.

    Raises:
        InputError: run and cell do not belong together, or the run is too small.
        NoSolutionError: the fit does not come to rest.
    """
    settings = settings or Settings()
    run = with_motion(run)
    validation = None if validation is None else with_motion(validation)
    say("placing the gauge")
    rig = placed(rig_for(cell, run), run)
    bare = None if validation is None else rig_for(cell, validation)
    parts = split(run, settings.hold_out, settings.seed)

    def judge(found: Fit) -> Metrics | None:
        return None if validation is None or bare is None else judged(found, validation, bare)

    whole = Model.of(rig, cell.plan.free | ({"tool"} if not cell.tool.known else frozenset()))
    if run.clocks == 2 and run.samples.speed is not None:
        whole = whole.before([clock_offset(rig)])
    model, seen = seen_by(whole, run.samples)
    _check_size(run, model)
    say("nominal robot")
    stages = [nominal(model, run, parts, judge)]
    say("frames")
    stages.append(fitted("frames", frames_only(model), run, parts, judge, settings.robust))
    say("geometry")
    stages.append(fitted("geometry", model, run, parts, judge, settings.robust, stages[-1].fit))
    bench = Bench(run, parts, judge, settings.robust)
    if tracer is not None and _spare(run, model) >= TRACEABLE:
        more, traced = tracer(stages[-1], bench, say)
        return _finished([*stages, *more], whole, seen.dropped, bench, cell, validation, traced)
    scarce = [] if tracer is None else [too_few(_spare(run, model))]
    say("joint compliance")
    stages, whole, dropped = _with_compliance(stages, whole, seen.dropped, bench)
    return _finished(stages, whole, dropped, bench, cell, validation, None, scarce)


def _with_compliance(
    stages: list[Fitted],
    whole: Model,
    dropped: tuple[Dropped, ...],
    bench: Bench,
) -> tuple[list[Fitted], Model, tuple[Dropped, ...]]:
    """Add the joints' compliance where the loads are known, and keep it only if held-out samples gain."""
    rig, run = whole.rig, bench.run
    if all(m is None for m in rig.robot.masses) and not rig.tool_mass and run.samples.force is None:
        return stages, whole, dropped
    more = whole.plus(compliance_parameters(rig))
    model, seen = seen_by(more, run.samples)
    if len(model.parameters) == len(stages[-1].fit.errors) or _spare(run, model) < SPARE:
        return stages, whole, dropped
    trial = fitted("joint compliance", model, run, bench.split, bench.judge, bench.robust, stages[-1].fit)
    if not gains(stages[-1].stage, trial.stage, bench.split):
        return stages, whole, dropped
    return [*stages, trial], more, seen.dropped


def _finished(
    stages: list[Fitted],
    whole: Model,
    dropped: tuple[Dropped, ...],
    bench: Bench,
    cell: Cell,
    validation: Run | None,
    traced: Traced | None,
    notes: Sequence[str] = (),
) -> Calibration:
    run, parts = bench.run, bench.split
    if len(run) > len(stages[-1].fit.problem):
        last = stages[-1]
        again = fitted(last.stage.name, last.fit.model, run, parts, bench.judge, bench.robust, last.fit, whole=True)
        stages = [*stages[:-1], again]
    found = stages[-1].fit
    known = set(whole.names)
    whole = whole.plus([p for p in found.model.parameters if p.name not in known])
    covariance, time = parameter_covariance(found, run.continuous)
    table = estimates(whole, found, dropped, covariance)
    return Calibration(
        run=run,
        split_by=parts.by,
        hold_out=1.0 / parts.folds,
        n_groups=parts.groups,
        within=_within(run, parts, found),
        stages=tuple(s.stage for s in stages),
        fit=found,
        dropped=dropped,
        estimates=table,
        covariance=covariance,
        correlation_time=time,
        condition_number=_condition(found),
        noise_floor=_noise_floor(run, stages[-1].stage.residual),
        traced=traced,
        problems=problems_of(table, stages, found),
        warnings=(
            *(*run.warnings, *warnings_of(run, cell, found, validation)),
            *(*notes, *_fitted_there(parts, stages[-1])),
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


def _spare(run: Run, model: Model) -> int:
    return len(run) * model.width - len(model.parameters)


def _check_size(run: Run, model: Model) -> None:
    if _spare(run, model) < SPARE:
        raise InputError(
            f"{run.name}: {len(run)} samples give {len(run) * model.width} readings, too few for "
            f"{len(model.parameters)} parameters; measure at least {len(model.parameters) + SPARE}, better twice that, "
            "or free fewer in [plan]"
        )


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
