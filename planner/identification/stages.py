"""The stages of a fit: nothing, the frames, the geometry, then one effect after the other while held-out poses gain."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.identification.fit import Fit, fit
from planner.identification.heldout import held_out
from planner.identification.problem import Problem
from planner.identification.seeing import only
from planner.identification.splits import Split
from planner.identification.types import Metrics, Stage
from planner.model import Model
from planner.repeatable import evenly
from planner.run import Run
from planner.units import Array

PART = 24_000  # readings of a long run that are fitted before the last stage
GAIN = 2.0  # standard errors that the held-out error must fall by before an effect is kept
Judge = Callable[[Fit], Metrics | None]


@dataclass(frozen=True)
class Fitted:
    """A stage and the fit behind it; ``refitted`` names parameters that only the held-out samples themselves know."""

    stage: Stage
    fit: Fit
    refitted: tuple[str, ...]


def fitted(
    name: str,
    model: Model,
    run: Run,
    split: Split,
    judge: Judge,
    robust: bool = False,
    before: Fit | None = None,
    whole: bool = False,
) -> Fitted:
    """Fit a model to a run and judge it on held-out poses and on the validation run.

    Of a long run only a spread part is fitted unless ``whole``; all of it is judged.
    """
    start = None if before is None else _start(model, before)
    factors = None if before is None else _known_factors(model, before)
    noise = None if before is None else before.problem.whitener.noise
    rough = not any(p.group != "gauge" for p in model.parameters)  # the robot's errors are no noise of its joints
    few = None if whole else fitted_part(run, model)
    part = run if few is None else run.take(few)
    found = fit(Problem.of(model, part, noise, even=rough), robust, start, factors=factors)
    held = held_out(found, split if few is None else split.take(few))
    residual, held_residual = found.problem.residual(found.errors), held.residual
    if few is not None:
        residual, held_residual = _over_all(found, run, held.shift, split)
    effects = tuple(g for g in dict.fromkeys(p.group for p in model.parameters) if g not in ("gauge", "geometry"))
    stage = Stage(
        name,
        effects,
        len(model.parameters),
        Metrics.of(residual),
        Metrics.of(held_residual, split.fold),
        judge(found),
        residual,
        held_residual,
    )
    return Fitted(stage, found, held.refitted)


def fitted_part(run: Run, model: Model) -> np.ndarray | None:
    """Positions of the samples of a long run that stages are fitted to, ``None`` for all of them."""
    return None if len(run) * model.width <= 2 * PART else evenly(len(run), PART // model.width)


def _over_all(found: Fit, run: Run, shift: Array, split: Split) -> tuple[Array, Array]:
    """Residuals of every sample of a run by the fit to a part of it, and by the fit without the sample's fold."""
    model, samples = found.model, run.samples
    targets = model.rig.targets(samples, run.readings)
    residual = model.residual(samples, targets, found.errors)
    held = np.empty_like(residual)
    for fold in range(split.folds):
        mine = np.flatnonzero(split.fold == fold)
        held[mine] = model.residual(samples.take(mine), targets.take(mine), found.errors + shift[fold])
    return residual, held


def nominal(model: Model, run: Run, split: Split, judge: Judge) -> Fitted:
    """Judge the robot as its data sheet has it, the gauge standing where the cell says or where it was placed."""
    return fitted("nominal", model.subset([]), run, split, judge)


def _start(model: Model, before: Fit) -> Array:
    known = dict(zip(before.model.names, before.errors, strict=True))
    return np.array([known.get(name, 0.0) for name in model.names])


def _known_factors(model: Model, before: Fit) -> Array:
    """Factors on the prior sizes as the fit before found them, 1 for what is new."""
    known = dict(zip(before.model.names, before.problem.prior, strict=True))
    return np.array([known.get(p.name, p.prior) / p.prior for p in model.parameters])


def gains(before: Stage, after: Stage, split: Split) -> bool:
    """Tell whether the held-out squared error falls by more than chance: by groups, paired, in standard errors."""
    if len(np.unique(split.fine)) < 2:
        return False
    gain, error = gain_in_errors(before, after, split)
    return gain > GAIN * error


def gain_in_errors(before: Stage, after: Stage, split: Split) -> tuple[float, float]:
    """Fall of the held-out squared error from one stage to another, and its standard error, over groups."""
    return fall_in_errors(before.held_residual, after.held_residual, split)


def fall_in_errors(before: Array, after: Array, split: Split) -> tuple[float, float]:
    """Fall of the squared error between residuals (n, r) of the same samples, and its standard error, over groups.

    As a share of the error before, positions and angles each by their own where a probe measures both: 1 is all of it.
    """
    fall = np.zeros(len(before))
    width = before.shape[1]
    blocks = [slice(k, min(k + 3, width)) for k in range(0, width, 3)]
    for block in blocks:
        was, now = before[:, block], after[:, block]
        fall += ((was**2).sum(axis=1) - (now**2).sum(axis=1)) / max(float((was**2).sum(axis=1).mean()), 1e-300)
    each = np.bincount(split.fine, fall) / np.bincount(split.fine) / len(blocks)
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))


def frames_only(model: Model) -> Model:
    """Return the model with only what places the gauge."""
    return only(model, ("gauge",))
