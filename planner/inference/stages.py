"""The stages of a fit: nominal robot, frames, geometry, then declared effects and compliance."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from planner.common.progress import StageReport
from planner.common.units import MM, Array, mean_by_group
from planner.effects.effect import Parameter
from planner.fit.assumptions import GAIN_STANDARD_ERRORS, TOO_FEW_READINGS
from planner.fit.cross_validation import Split, predict_held_out
from planner.fit.identifiable_parameters import FittedParameters
from planner.fit.least_squares import Fit, fit
from planner.fit.problem import FitProblem
from planner.inference.candidates import TracingResult
from planner.inference.posterior_draws import ChainLimits
from planner.model.identification_document import Metrics, Stage
from planner.model.model import Model
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
        limits: seed of the draws, and how many causes may act.
    """

    run: Run
    split: Split
    judge: Callable[[Fit], Metrics | None]
    unseen: tuple[Parameter, ...] = ()
    validation: Run | None = None
    limits: ChainLimits = field(default_factory=ChainLimits)
    _problems: list[FitProblem] = field(default_factory=list, repr=False, compare=False)

    def redundancy(self, model: Model) -> int:
        """Number of readings beyond the parameters of a model."""
        return len(self.run) * model.width - len(model.parameters)

    def for_trials(self) -> "FitContext":
        """Return the context in which stages are tried: most of them are left, and no validation run judges them."""
        return replace(self, judge=_no_judge)

    def validate(self, tried: FittedStage) -> FittedStage:
        """Return a stage that was tried, judged on the validation run."""
        return replace(tried, stage=tried.stage.model_copy(update={"validation": self.judge(tried.fit)}))

    def fit_stage(self, name: str, model: Model, before: Fit | None = None) -> FittedStage:
        """Fit a model to the run and judge it on held-out poses and on the validation run.

        The fit starts where ``before`` ended, with its noise, prior sigmas and weights of rows.
        """
        start = factors = noise = leverage = None
        if before is not None:
            prior = dict(zip(before.model.names, before.problem.prior, strict=True))
            start = before.at(model.names)
            factors = np.array([prior.get(p.name, p.prior) / p.prior for p in model.parameters])
            noise, leverage = before.problem.whitener.noise, before.leverage
        rough = not any(p.group != "gauge" for p in model.parameters)  # the robot's errors are no noise of its joints
        problem = self._problem(model).restart_with(model, noise, even=rough)
        if before is not None:
            problem = replace(problem, weight=before.problem.weight)
        return self._judge(name, fit(problem, start, factors, leverage, self.split.fold))

    def _judge(self, name: str, found: Fit) -> FittedStage:
        """Return the stage of a fit, with its residuals of all samples, fitted and held out."""
        held, weight = predict_held_out(found, self.split), found.problem.weight
        residual, parameters = found.problem.residual(found.errors), found.model.parameters
        stage = Stage(
            name=name,
            effects=tuple(dict.fromkeys(p.group for p in parameters if p.is_effect)),
            parameters=len(parameters),
            train=Metrics.of(residual, weight=weight),
            held_out=Metrics.of(held.residual, self.split.fold, weight),
            validation=self.judge(found),
            residual=residual,
            held_residual=held.residual,
            weight=weight,
        )
        return FittedStage(stage, found, held.refitted, held.shift)

    def forget_values(self, model: Model) -> None:
        """Let go of the basis functions of all models so far but one: most of them were tried and left."""
        kept = {m.phi for p in model.parameters for m in p.moves}
        for problem in self._problems:
            problem.memory.forget(kept)

    def _problem(self, model: Model) -> FitProblem:
        """Fit of the run to a model of the same setup: kept from stage to stage."""
        if not self._problems or self._problems[-1].model.setup is not model.setup:
            self._problems[:] = [FitProblem.of(model, self.run)]
        return self._problems[-1]


def _no_judge(_: Fit) -> Metrics | None:
    return None


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
