"""The model during the search: the geometry and the effects found so far, fitted and judged."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.effect import Effect
from planner.effects.parameters import Parameter
from planner.identification.least_squares import ROUGHLY_CONVERGED, Fit, solve, subset_size
from planner.identification.problem import FitProblem
from planner.identification.stages import FitContext, FittedStage, fit_stage
from planner.model.identification_document import Stage
from planner.model.model import Model
from planner.tracing.auxiliary_parameters import (
    COMPLIANCE,
    LARGEST_MASS_PRIOR,
    clip_to_grid,
    grid_spacing,
    link_mass_parameters,
    link_mass_uncertainty,
    sensitivity_parameter,
)

SETTLING_ROUNDS = 6  # in which inner numbers settle
SETTLING_SAMPLES = 3_000  # samples of a long run on which they do


@dataclass(frozen=True)
class FittedEffect:
    """An effect in the model: its entry and its inner number."""

    entry: Effect
    inner: float | None

    @property
    def slope_name(self) -> str:
        """Name of the parameter that moves the inner number, empty where there is none."""
        return f"{self.entry.name}, {self.entry.inner.name}" if self.entry.inner else ""


@dataclass(frozen=True)
class SearchState:
    """Fitted model with its effects.

    Attributes:
        base: model without any effect.
        effects: in the order in which they were found.
        fitted: stage and fit with all of them.
    """

    base: Model
    effects: tuple[FittedEffect, ...]
    fitted: FittedStage

    @property
    def fit(self) -> Fit:
        """The fit."""
        return self.fitted.fit

    @property
    def stage(self) -> Stage:
        """The stage with its errors."""
        return self.fitted.stage

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(h.entry.name for h in self.effects)

    @property
    def kind(self) -> frozenset[tuple[str, int]]:
        """What tells the model from others: its effects, and how many parameters each has."""
        return frozenset((h.entry.name, len(h.entry.make(h.inner))) for h in self.effects)

    def positions(self, held: FittedEffect) -> list[int]:
        """Positions of an effect's own parameters in the model, its inner number left aside."""
        names = {p.name for p in held.entry.make(held.inner)}
        return [j for j, name in enumerate(self.fit.model.names) if name in names]

    def sizes(self, held: FittedEffect) -> Array:
        """Values of an effect's parameters."""
        return self.fit.errors[self.positions(held)]

    def evidence(self, worth: float = 1.0) -> float:
        """Minus twice the logarithm of the run's likelihood under this model, its parameters averaged over (Laplace).

        Each parameter costs what the readings narrow its prior by, each inner number what they narrow its grid by
        (MacKay 1992): of two models that fit alike the simpler one has the lower value. ``worth`` samples are one.
        """
        problem, solution = self.fit.problem, self.fit.solution
        few = slice(0, None, max(1, len(problem) // 3000))
        noise = float(np.linalg.slogdet(problem.whitener.covariance(few))[1].mean() * len(problem))
        scanned = sum(2 * float(np.log(len(h.entry.inner.values))) for h in self.effects if h.entry.inner is not None)
        narrowed = 2 * float(np.log(np.maximum(np.abs(np.diag(solution.factor)) / np.sqrt(worth), 1.0)).sum())
        return (solution.cost + noise) / worth + narrowed + scanned


def refit(
    bench: FitContext, name: str, base: Model, effects: tuple[FittedEffect, ...], before: SearchState
) -> SearchState:
    """Fit the base model with effects: inner numbers settle first, noise and priors as they were, then all together."""
    quick = before.fit.problem
    if len(quick) > subset_size(base, SETTLING_SAMPLES):
        quick = quick.take(even_positions(len(quick), subset_size(base, SETTLING_SAMPLES)))
    errors = dict(zip(before.fit.model.names, before.fit.errors, strict=True))
    inside = any(h.inner is not None or h.entry.kind == COMPLIANCE for h in effects)
    for _ in range(SETTLING_ROUNDS if inside else 0):
        effects, errors, settled = _settle_nonlinear(quick, base, effects, errors)
        if settled:
            break
    sizes = [_known_sizes(h, errors) for h in effects]
    slopes = [
        sensitivity_parameter(h.entry, h.inner, s)
        for h, s in zip(effects, sizes, strict=True)
        if h.inner is not None and s.any()
    ]
    own = base.plus([*(p for h in effects for p in h.entry.make(h.inner)), *slopes])
    weights = _link_masses(base, effects, errors)

    def with_all(model: Model) -> FittedStage:
        return fit_stage(name, model, bench.run, bench.split, bench.judge, bench.robust, before.fit)

    found = with_all(own.plus(weights))
    if weights and link_mass_uncertainty(found.fit.model) > LARGEST_MASS_PRIOR:
        found = with_all(own)  # they stand in for what is missing yet, and for the compliances themselves
    return SearchState(base, effects, found)


def _known_sizes(held: FittedEffect, errors: dict[str, float]) -> Array:
    return np.array([errors.get(p.name, 0.0) for p in held.entry.make(held.inner)])


def _link_masses(base: Model, effects: tuple[FittedEffect, ...], errors: dict[str, float]) -> list[Parameter]:
    """Wrong weights, as the compliances that are known so far show them."""
    transforms = base.setup.chain.transforms
    soft = []
    for h in effects:
        if h.entry.kind == COMPLIANCE:
            first = h.entry.make(None)[0]
            joint, size = transforms[first.main.index].joint, errors.get(first.name, 0.0)
            if joint is not None and size:
                soft.append((joint, round(size, 12)))
    return link_mass_parameters(base, soft)


def _settle_nonlinear(
    quick: FitProblem, base: Model, effects: tuple[FittedEffect, ...], errors: dict[str, float]
) -> tuple[tuple[FittedEffect, ...], dict[str, float], bool]:
    """One step of the inner numbers with everything else free, and whether none moved by more than σ/10."""
    own = [h.entry.make(h.inner) for h in effects]
    slopes = {
        h.entry.name: sensitivity_parameter(h.entry, h.inner, size)
        for h in effects
        if h.inner is not None and (size := _known_sizes(h, errors)).any()
    }
    soft = _link_masses(base, effects, errors)
    priors = dict(zip(quick.model.names, quick.model.prior, strict=True))
    everything = [*base.parameters, *(p for parameters in own for p in parameters), *slopes.values(), *soft]
    model = replace(base, parameters=tuple(replace(p, prior=priors.get(p.name, p.prior)) for p in everything))
    here = quick.with_model(model)
    starts = np.array([0.0 if p in slopes.values() else errors.get(p.name, 0.0) for p in everything])
    found = solve(here, starts, ROUGHLY_CONVERGED)
    root = found.root(here.prior)
    sigma = dict(zip(model.names, np.linalg.norm(root, axis=1), strict=True))
    value = dict(zip(model.names, found.errors, strict=True))
    step = {name: (value[p.name], sigma[p.name]) for name, p in slopes.items()}
    moved = tuple(
        replace(h, inner=_limit_step(h, h.inner + step[h.entry.name][0]))
        if h.inner is not None and h.entry.name in step
        else h
        for h in effects
    )
    for before, after in zip(effects, moved, strict=True):  # parameters bear their inner number in their names
        sizes = [value[p.name] for p in before.entry.make(before.inner)]
        value |= {p.name: v for p, v in zip(after.entry.make(after.inner), sizes, strict=True)}
    settled = len(slopes) == sum(h.inner is not None for h in effects)
    settled = settled and all(abs(shift) <= 0.1 * std for shift, std in step.values())
    yielding = [h.entry.make(None)[0].name for h in effects if h.entry.kind == COMPLIANCE]
    settled = settled and all(abs(value[n] - errors.get(n, 0.0)) <= 0.02 * abs(value[n]) for n in yielding)
    return (effects if settled else moved), value, settled


def _limit_step(held: FittedEffect, value: float) -> float:
    """Keep an inner number within one grid spacing of where it was: beyond it the linear step means nothing."""
    assert held.inner is not None
    width = grid_spacing(held.entry, held.inner)
    return clip_to_grid(held.entry, float(np.clip(value, held.inner - width, held.inner + width)))


REPEATABLE_KINDS = ("gear ripple", "warm-up")
MOST_REPEATS = 4  # of one kind at one place
LEAST_SEPARATION = 3  # spacings of the grid between the frequencies of two of them
REPEAT_MARK = " ("


def number_repeat(entry: Effect, effects: tuple[FittedEffect, ...]) -> Effect:
    """Return the entry under a name that no effect has yet."""
    others = {h.entry.name for h in effects}
    count, again = 1, entry
    while again.name in others:
        count += 1
        again = replace(entry, kind=f"{entry.kind}{REPEAT_MARK}{count})", make=partial(_make_repeat, entry, count))
    return again


def _make_repeat(entry: Effect, count: int, inner: float | None) -> tuple[Parameter, ...]:
    return tuple(replace(p, name=f"{p.name}_{count}") for p in entry.make(inner))


def base_kind(kind: str) -> str:
    """The kind without the number of its turn."""
    return kind.split(REPEAT_MARK)[0]


def known_nonlinear_values(entry: Effect, effects: tuple[FittedEffect, ...]) -> list[float]:
    """Inner numbers that effects of this entry have already."""
    return [h.inner for h in effects if base_kind(h.entry.kind) == entry.kind and h.entry.on == entry.on and h.inner]


def may_join(entry: Effect, effects: tuple[FittedEffect, ...]) -> bool:
    """Whether the entry may be added to these effects."""
    if entry.name not in {h.entry.name for h in effects}:
        return True
    return entry.kind in REPEATABLE_KINDS and len(known_nonlinear_values(entry, effects)) < MOST_REPEATS
