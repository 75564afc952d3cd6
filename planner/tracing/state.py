"""The model as the search has it: the geometry and the effects found so far, fitted and judged."""

from dataclasses import dataclass, replace

import numpy as np

from planner.catalogue import Entry
from planner.identification import Bench, Fit, Problem, Split, Stage, error_size
from planner.identification.solve import solve
from planner.identification.stages import Fitted, fitted
from planner.model import Model
from planner.tracing.inner import slope, spacing
from planner.units import Array

ROUNDS = 6  # in which inner numbers settle
QUICK = 4_000  # samples of a long run on which they do


@dataclass(frozen=True)
class Held:
    """An effect in the model: its entry and its inner number."""

    entry: Entry
    inner: float | None


@dataclass(frozen=True)
class State:
    """Fitted model with its effects.

    Attributes:
        base: model without any effect.
        effects: in the order in which they were found.
        fitted: stage and fit with all of them.
    """

    base: Model
    effects: tuple[Held, ...]
    fitted: Fitted

    @property
    def fit(self) -> Fit:
        """The fit."""
        return self.fitted.fit

    @property
    def stage(self) -> Stage:
        """The stage with its errors."""
        return self.fitted.stage

    def positions(self, held: Held) -> list[int]:
        """Positions of an effect's own parameters in the model, its inner number left aside."""
        names = {p.name for p in held.entry.make(held.inner)}
        return [j for j, name in enumerate(self.fit.model.names) if name in names]

    def sizes(self, held: Held) -> Array:
        """Values of an effect's parameters."""
        return self.fit.errors[self.positions(held)]


def refit(bench: Bench, name: str, base: Model, effects: tuple[Held, ...], before: State) -> State:
    """Fit the base model with effects: inner numbers settle first, noise and priors as they were, then all together."""
    quick = before.fit.problem
    if len(quick) > QUICK:
        quick = quick.take(np.unique(np.linspace(0, len(quick) - 1, QUICK).astype(int)))
    errors = dict(zip(before.fit.model.names, before.fit.errors, strict=True))
    for _ in range(ROUNDS if any(h.inner is not None for h in effects) else 0):
        effects, errors, settled = _settled(quick, base, effects, errors)
        if settled:
            break
    sizes = [np.array([errors.get(p.name, 0.0) for p in h.entry.make(h.inner)]) for h in effects]
    slopes = [
        slope(h.entry, h.inner, s) for h, s in zip(effects, sizes, strict=True) if h.inner is not None and s.any()
    ]
    model = base.plus([*(p for h in effects for p in h.entry.make(h.inner)), *slopes])
    return State(base, effects, fitted(name, model, bench.run, bench.split, bench.judge, bench.robust, before.fit))


def _settled(
    quick: Problem, base: Model, effects: tuple[Held, ...], errors: dict[str, float]
) -> tuple[tuple[Held, ...], dict[str, float], bool]:
    """One step of the inner numbers with everything else free, and whether none moved by more than σ/10."""
    own = [h.entry.make(h.inner) for h in effects]
    known = [np.array([errors.get(p.name, 0.0) for p in parameters]) for parameters in own]
    slopes = {
        h.entry.name: slope(h.entry, h.inner, size)
        for h, size in zip(effects, known, strict=True)
        if h.inner is not None and size.any()
    }
    priors = dict(zip(quick.model.names, quick.model.prior, strict=True))
    everything = [*base.parameters, *(p for parameters in own for p in parameters), *slopes.values()]
    model = replace(base, parameters=tuple(replace(p, prior=priors.get(p.name, p.prior)) for p in everything))
    here = quick.with_model(model)
    starts = np.array([0.0 if p in slopes.values() else errors.get(p.name, 0.0) for p in everything])
    found = solve(here, starts)
    root = found.root(here.prior)
    sigma = dict(zip(model.names, np.linalg.norm(root, axis=1), strict=True))
    value = dict(zip(model.names, found.errors, strict=True))
    step = {name: (value[p.name], sigma[p.name]) for name, p in slopes.items()}
    moved = tuple(
        replace(h, inner=_within(h, h.inner + step[h.entry.name][0]))
        if h.inner is not None and h.entry.name in step
        else h
        for h in effects
    )
    settled = len(slopes) == sum(h.inner is not None for h in effects)
    settled = settled and all(abs(shift) <= 0.1 * std for shift, std in step.values())
    return (effects if settled else moved), value, settled


def _within(held: Held, value: float) -> float:
    """Keep an inner number within one grid spacing of where it was: beyond it the linear step means nothing."""
    assert held.inner is not None
    width = spacing(held.entry, held.inner)
    value = float(np.clip(value, held.inner - width, held.inner + width))
    return value if held.inner <= 0 else max(value, 0.1 * held.inner)


def gain_in_errors(before: Stage, after: Stage, split: Split) -> tuple[float, float]:
    """Fall of the held-out squared error [m²] when an effect was added, and its standard error, over groups."""
    fall = error_size(before.held_residual) ** 2 - error_size(after.held_residual) ** 2
    each = np.bincount(split.fine, fall) / np.bincount(split.fine)
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))
