"""The stages of a fit: nominal robot, frames, geometry, then declared effects and compliance."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.cell.placement import Targets
from planner.common.determinism import even_positions
from planner.common.progress import StageReport
from planner.common.units import MM, Array, mean_by_group
from planner.effects.context import Context
from planner.effects.effect import Parameter
from planner.fit.assumptions import GAIN_STANDARD_ERRORS, TOO_FEW_READINGS
from planner.fit.cross_validation import HeldOutPrediction, Split, predict_held_out
from planner.fit.identifiable_parameters import FittedParameters
from planner.fit.least_squares import Fit, fit
from planner.fit.problem import PIECE_SAMPLES, FitProblem
from planner.fit.wild_rows import unseen_weights
from planner.inference.candidates import TracingResult
from planner.inference.posterior_draws import ChainLimits
from planner.model.identification_document import Metrics, Stage
from planner.model.model import Model, chunks
from planner.runs.run import Run


@dataclass(frozen=True)
class FittedStage:
    """A stage and its fit.

    Attributes:
        stage, fit: what is told of it, and what it was told by.
        refitted: names of parameters that were fitted on the held-out samples themselves.
        shift: what taking out each fold moves the parameters by, (folds, P).
    """

    stage: Stage
    fit: Fit
    refitted: tuple[str, ...]
    shift: Array


@dataclass(frozen=True)
class FitContext:
    """What every fit of a run needs.

    Attributes:
        run, split: with what is held out.
        judge: of the validation run.
        unseen: parameters that may be off as well, and that the run cannot tell from those that are fitted.
        validation: a run that no fit sees.
        of_part: whether the run is a part of a longer one.
        limits: seed of the draws, and how many causes may act.
    """

    run: Run
    split: Split
    judge: Callable[[Fit], Metrics | None]
    unseen: tuple[Parameter, ...] = ()
    validation: Run | None = None
    of_part: bool = False
    limits: ChainLimits = field(default_factory=ChainLimits)
    _problems: dict[bool, FitProblem] = field(default_factory=dict, repr=False, compare=False)

    def redundancy(self, model: Model) -> int:
        """Number of readings beyond the parameters of a model."""
        return len(self.run) * model.width - len(model.parameters)

    def part(self, model: Model) -> np.ndarray | None:
        """Positions of the samples of a long run that stages are fitted to, ``None`` for all of them.

        Along a drive neighbours err alike: so many samples tell nearly as much as all do.
        """
        most = _fitted_samples(model)
        return even_positions(len(self.run), most) if len(self.run) > 2 * most else None

    def for_trials(self, begin: FittedStage) -> tuple["FitContext", FittedStage]:
        """Return the context in which stages are tried, and the one that they begin with as it is fitted there.

        Most of what is tried is left: no validation run judges it, and of a run that is more than one piece only a part
        is looked at, whose basis functions are kept.
        """
        few = self._tried_part(begin.fit.model)
        if few is None:
            return replace(self, judge=_no_judge), begin
        known = self._problems.get(False)
        problems = {} if known is None else {True: known}
        run, split = self.run.take(few), self.split.take(few)
        tried = replace(self, run=run, split=split, judge=_no_judge, of_part=True, _problems=problems)
        return tried, tried.fit_stage(begin.stage.name, begin.fit.model, begin.fit)

    def judge_trials(self, tried: Sequence[FittedStage]) -> list[FittedStage]:
        """Return stages that were tried, judged on all of the run and on the validation run."""
        if tried and self._tried_part(tried[0].fit.model) is not None:
            over_all = self._over_all([(t.fit, t.shift) for t in tried])
            return [self._stage(t.stage.name, t.fit, *errors, t) for t, errors in zip(tried, over_all, strict=True)]
        return [replace(t, stage=t.stage.model_copy(update={"validation": self.judge(t.fit)})) for t in tried]

    def _tried_part(self, model: Model) -> np.ndarray | None:
        """Positions of the samples that stages are tried on, ``None`` for all; of a long run those of its part."""
        return even_positions(len(self.run), _fitted_samples(model)) if len(self.run) > PIECE_SAMPLES else None

    def fit_stage(self, name: str, model: Model, before: Fit | None = None, whole: bool = False) -> FittedStage:
        """Fit a model to the run and judge it on held-out poses and on the validation run.

        Of a long run only a spread part is fitted unless ``whole``; all of it is judged. The fit starts where
        ``before`` ended, with its noise, prior sigmas and weights of rows.
        """
        start = factors = noise = leverage = None
        if before is not None:
            prior = dict(zip(before.model.names, before.problem.prior, strict=True))
            start = before.at(model.names)
            factors = np.array([prior.get(p.name, p.prior) / p.prior for p in model.parameters])
            noise, leverage = before.problem.whitener.noise, before.leverage
        rough = not any(p.group != "gauge" for p in model.parameters)  # the robot's errors are no noise of its joints
        few = None if whole else self.part(model)
        problem = self._problem(model, few).restart_with(model, noise, even=rough)
        fold = self.split.fold if few is None else self.split.fold[few]
        if before is not None and len(before.problem) == len(problem):
            problem = replace(problem, weight=before.problem.weight)
        return self._judge(name, fit(problem, start, factors, leverage, fold), few)

    def _judge(self, name: str, found: Fit, few: np.ndarray | None) -> FittedStage:
        """Judge a fit to the run, or to the samples ``few`` of it, on all samples."""
        held = predict_held_out(found, self.split if few is None else self.split.take(few))
        residual, held_residual = found.problem.residual(found.errors), held.residual
        if few is not None:
            residual, held_residual = self._over_all([(found, held.shift)])[0]
        return self._stage(name, found, residual, held_residual, held)

    def _weight(self, found: Fit) -> Array:
        """Return by how much each sample of the run counts, (n,), those that a fit of a part has not seen as well."""
        if len(found.problem) == len(self.run):
            return found.problem.weight
        whole = self._problem(found.model, None).restart_with(found.model, found.problem.whitener.noise)
        return unseen_weights(whole.white_residual(found.errors))

    def _stage(
        self, name: str, found: Fit, residual: Array, held_residual: Array, held: HeldOutPrediction | FittedStage
    ) -> FittedStage:
        """Return the stage of a fit with its residuals (n, r) of all samples, fitted and held out."""
        parameters, weight = found.model.parameters, self._weight(found)
        stage = Stage(
            name=name,
            effects=tuple(dict.fromkeys(p.group for p in parameters if p.is_effect)),
            parameters=len(parameters),
            train=Metrics.of(residual, weight=weight),
            held_out=Metrics.of(held_residual, self.split.fold, weight),
            validation=self.judge(found),
            residual=residual,
            held_residual=held_residual,
            weight=weight,
        )
        return FittedStage(stage, found, held.refitted, held.shift)

    def forget_values(self, model: Model) -> None:
        """Let go of the basis functions of all models so far but one: most of them were tried and left."""
        kept = {m.phi for p in model.parameters for m in p.moves}
        for problem in self._problems.values():
            problem.memory.forget(kept)

    def _problem(self, model: Model, few: np.ndarray | None) -> FitProblem:
        """Fit of the run, or of a part of it, to a model of the same setup: kept from stage to stage."""
        known = self._problems.get(few is None)
        if known is None or known.model.setup is not model.setup:
            known = FitProblem.of(model, self.run if few is None else self.run.take(few))
            self._problems[few is None] = known
        return known

    def _over_all(self, fits: Sequence[tuple[Fit, Array]]) -> list[tuple[Array, Array]]:
        """Residuals of every sample by fits to a part of the run, and by each without the sample's fold.

        ``fits`` with the shifts (folds, P) by each fold; what their basis functions look at is computed once for all.
        """
        shape = (len(self.run), fits[0][0].model.width)
        out = [(np.empty(shape), np.empty(shape)) for _ in fits]
        for piece in self._pieces(fits[0][0].model):
            for (found, shift), (residual, held) in zip(fits, out, strict=True):
                for errors, into in ((found.errors, residual), (found.errors + shift[piece.fold], held)):
                    into[piece.samples] = found.model.residual_in(piece.context, piece.targets, errors)
        return out

    def _pieces(self, model: Model) -> Iterator["_Piece"]:
        """Yield the whole run in pieces of one fold."""
        samples, fold = self.run.samples, self.split.fold
        targets = model.setup.targets(samples, self.run.readings)
        for k in range(self.split.folds):
            mine = np.flatnonzero(fold == k)
            for part in chunks(len(mine)):  # what basis functions look at is computed once for both residuals
                few = mine[part]
                yield _Piece(few, k, Context(model.setup, samples.take(few)), targets.take(few))


def _fitted_samples(model: Model) -> int:
    """Number of samples of a long run that are fitted before the last stage: they are one piece."""
    return min(8_000, 24_000 // model.width)  # so many readings of more than one number


def _no_judge(_: Fit) -> Metrics | None:
    return None


@dataclass(frozen=True)
class _Piece:
    """Some samples of a run, (m,) int, all of one fold."""

    samples: np.ndarray
    fold: int
    context: Context
    targets: Targets


Tracer = Callable[[FittedStage, FitContext, StageReport], tuple[list[FittedStage], TracingResult]]
"""From the fitted geometry, with what the cell declares beside it, to one stage for each effect, and what was found."""


def is_gain(before: Stage, after: Stage, split: Split) -> bool:
    """Tell whether the held-out squared error falls by more than chance: by groups, paired, in standard errors."""
    if len(np.unique(split.fine)) < 2:
        return False
    gain, error = error_reduction(before.held_residual, after.held_residual, split, comparison_weight(before, after))
    return gain > GAIN_STANDARD_ERRORS * error


def comparison_weight(before: Stage, after: Stage) -> Array:
    """Return by how much each sample counts in a comparison, (n,): as in the stage in which it counts for more.

    What one stage explains and the other does not counts in full; what stands outside in both counts in neither.
    """
    return np.maximum(before.weight, after.weight)


def error_reduction(before: Array, after: Array, split: Split, weight: Array | float = 1.0) -> tuple[float, float]:
    """Fall of the squared error between residuals (n, r) of the same samples, and its standard error, over groups.

    As a share of the error before, positions and angles each by their own where a probe measures both: 1 is all of it.
    Samples count by their ``weight`` (n,), all alike if none is given.
    """
    fall = np.zeros(len(before))
    width = before.shape[1]
    blocks = [slice(k, min(k + 3, width)) for k in range(0, width, 3)]
    for block in blocks:
        was, now = (weight * (x[:, block] ** 2).sum(axis=1) for x in (before, after))
        fall += (was - now) / max(float(was.mean()), 1e-300)
    filled = np.unique(split.fine)  # a part may lack a group
    each = mean_by_group(fall, split.fine)[filled] / len(blocks)
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))


def add_declared_stages(
    stages: list[FittedStage], free: FittedParameters, effects: tuple[str, ...], context: FitContext, say: StageReport
) -> tuple[list[FittedStage], list[str]]:
    """Add a stage for each effect that the cell declares; return the stages and warnings.

    Declared effects stay in the model even if the held-out error grows, since the plan chose its poses for them.
    """
    stages, notes = list(stages), list[str]()
    kinds = list(dict.fromkeys(effects))
    for k, kind in enumerate(kinds):
        model = free.model_up_to(kinds[: k + 1])
        if len(model.parameters) == len(stages[-1].fit.errors):
            notes.append(f"{kind} is declared in plan.effects, but this run shows nothing of it: it was left out")
            continue
        say(kind)
        stages.append(context.fit_stage(kind, model, stages[-1].fit))
        before, after = (s.stage.held_out.rms for s in stages[-2:])
        if after > before:
            unit = model.setup.gauge.unit
            notes.append(
                f"{kind} is declared in plan.effects and was fitted, but held-out samples came out worse with it, "
                f"{after / MM:.4f} {unit} against {before / MM:.4f} {unit} without: this run says too little of it"
            )
    return stages, notes


def add_stage_if_gain(
    stages: list[FittedStage], free: FittedParameters, wider: FittedParameters, kind: str, context: FitContext
) -> tuple[list[FittedStage], FittedParameters]:
    """Add an effect that is not declared, and keep it only if the held-out error falls significantly."""
    if len(wider.model.parameters) == len(stages[-1].fit.errors) or context.redundancy(wider.model) < TOO_FEW_READINGS:
        return stages, free
    trial = context.fit_stage(kind, wider.model, stages[-1].fit)
    return ([*stages, trial], wider) if is_gain(stages[-1].stage, trial.stage, context.split) else (stages, free)
