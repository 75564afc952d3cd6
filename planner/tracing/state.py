"""The model as the search has it: the geometry and the effects found so far, fitted and judged."""

from dataclasses import dataclass, replace

import numpy as np

from planner.catalogue import Entry
from planner.identification import Bench, Fit, Split, Stage, error_size
from planner.identification.stages import Fitted, fitted
from planner.model import Model
from planner.tracing.inner import slope, spacing
from planner.units import Array

ROUNDS = 6  # in which inner numbers settle


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
    """Fit the base model with effects; inner numbers settle over a few rounds."""
    state = _once(bench, name, base, effects, before.fit)
    for _ in range(ROUNDS):
        settled, moved = _settled(bench, name, state)
        if not moved:
            return settled
        state = settled
    return state


def _once(bench: Bench, name: str, base: Model, effects: tuple[Held, ...], before: Fit) -> State:
    parameters = [p for held in effects for p in held.entry.make(held.inner)]
    found = fitted(name, base.plus(parameters), bench.run, bench.split, bench.judge, bench.robust, before)
    return State(base, effects, found)


def _settled(bench: Bench, name: str, state: State) -> tuple[State, bool]:
    """Free the inner numbers about where they are; move them, and tell whether any moved by more than its σ/10."""
    inner = [h for h in state.effects if h.inner is not None]
    if not inner:
        return state, False
    parameters = [p for h in state.effects for p in h.entry.make(h.inner)]
    slopes = [slope(h.entry, float(h.inner or 0.0), state.sizes(h)) for h in inner]
    model = state.base.plus([*parameters, *slopes])
    found = fitted(name, model, bench.run, bench.split, bench.judge, bench.robust, state.fit)
    root = found.fit.solution.root(found.fit.problem.prior)
    sigma = np.sqrt((root**2).sum(axis=1))
    shift = dict(zip(found.fit.model.names, found.fit.errors, strict=True))
    known = dict(zip(found.fit.model.names, sigma, strict=True))
    names = {h.entry.name: p.name for h, p in zip(inner, slopes, strict=True)}
    moved = any(abs(shift[n]) > 0.1 * known[n] for n in names.values())
    if not moved:
        return State(state.base, state.effects, found), False
    effects = tuple(
        h if h.inner is None else replace(h, inner=_within(h, h.inner + shift[names[h.entry.name]]))
        for h in state.effects
    )
    return _once(bench, name, state.base, effects, found.fit), True


def _within(held: Held, value: float) -> float:
    """Keep an inner number within one grid spacing of where it was: beyond it the linear step means nothing."""
    assert held.inner is not None
    width = spacing(held.entry, held.inner)
    value = float(np.clip(value, held.inner - width, held.inner + width))
    return value if held.inner <= 0 else max(value, 0.1 * held.inner)


def gain_in_errors(before: Stage, after: Stage, split: Split) -> tuple[float, float]:
    """Fall of the held-out squared error [m²] when an effect was added, and its standard error, over groups."""
    fall = error_size(before.held_residual) ** 2 - error_size(after.held_residual) ** 2
    each = np.bincount(split.group, fall) / np.bincount(split.group)
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each)))
