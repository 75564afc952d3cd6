"""Causes proposed by the posterior's sampler alone, in the place of the search by steps: see ``one_engine``.

It starts from geometry with every effect of the catalogue open at every value of its inner number (each frequency, each
sample at which a thing may have stepped), beside what has no name. Whatever acts in more than half of its draws is
fitted; no effect is selected by a forward step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from planner.identification.reading_precision import FamilyBlock

from planner.common.determinism import even_positions
from planner.common.progress import StageReport
from planner.common.units import Array
from planner.effects.catalogue import Background, Excitation, registration_of
from planner.effects.effect import Effect, Parameter, Role
from planner.effects.gauge_shapes import GAUGE_HANGING, GAUGE_SHAPE
from planner.effects.nonparametric import gear_curve
from planner.effects.steps import steppables
from planner.identification import posterior_draws
from planner.identification.assumptions import (
    EXPECTED_CAUSES,
    LOG_NOISE_RANGE,
    LOG_NOISE_SIGMA,
    PREVALENCE,
    UNKNOWN_PRIOR,
)
from planner.identification.noise import RATIO
from planner.identification.posterior_background import background_families
from planner.identification.posterior_draws import (
    RandomEffects,
    ReadingWhitener,
    SizeDraw,
    SizePrior,
)
from planner.identification.posterior_fit import (
    COMMON,
    OWN,
    OWN_WEIGHT,
    RARE,
    SLAB,
    SLAB_WEIGHT,
    UNNAMED,
    IndependentReadings,
)
from planner.identification.problem import FitProblem
from planner.identification.stages import FitContext
from planner.tracing.assumptions import QUICKNESSES
from planner.tracing.effect_scores import ScoreTest
from planner.tracing.search import SearchResult
from planner.tracing.search_context import SearchContext
from planner.tracing.state import FittedEffect, SearchState, number_repeat

READINGS = 360  # that are looked at
SWEEPS, FORGOTTEN, NOISE_EVERY = 60, 15, 6
STRIDE = 2  # values of a fine grid: neighbours look alike, and the value is refined by the fit
NEAR = 3  # values, or samples, on either side of the likeliest that are the same cause


@dataclass(frozen=True)
class Item:
    """An effect at one value, one of ``among`` values and samples at which it may act; none: what has no name."""

    effect: Effect | None
    value: float | None
    parameters: tuple[Parameter, ...]
    pool: int
    among: int = 1
    always: bool = False


@dataclass(frozen=True)
class ItemPrior(SizePrior):
    """Of an item that is one of ``among`` of an effect, in a pool of so many ``effects``."""

    among: int = 1
    effects: int = 1

    def logs(self, acting: int, others: int) -> Array:
        """Return log probabilities of the factors."""
        if not self.pool:
            return np.asarray(np.log(self.probability))
        chance = (acting + PREVALENCE) / (self.effects + PREVALENCE * (1 + (self.effects + 1) / EXPECTED_CAUSES))
        chance = min(chance, 0.5) / self.among
        share = self.probability / self.probability[1:].sum()
        return np.asarray(np.log(np.append(1 - chance, share[1:] * chance)))


def catalogue_items(effects: Sequence[Effect], run: Excitation) -> Iterator[Item]:
    """Yield every effect at every value, the curves of gears, and every thing that may step at every sample."""
    for e in effects:
        pool = COMMON if registration_of(e.kind).background is Background.COMMON else RARE
        grid = e.grid[::STRIDE] if len(e.grid) > 40 else e.grid
        yield from (Item(e, v, e.make(v), pool, len(grid)) for v in grid)
    setup, q = run.setup, run.samples.q
    for joint in sorted({e.place.joint for e in effects if e.has(Role.GEAR_WAVE) and e.place.joint is not None}):
        curves = [gear_curve(setup, q, joint, f) for f in QUICKNESSES]
        yield from (Item(e, None, e.make(), RARE, len(curves)) for e in curves)
    number = run.samples.number
    if number is None:
        return
    at = number[3:-3]
    at = at[even_positions(len(at), min(len(at), 100))]
    for thing in steppables(run):
        yield from (Item(e := thing.step(int(k), 1), None, e.make(), RARE, len(at)) for k in at)


def nameless_items(run: Excitation) -> Iterator[Item]:
    """Yield what has no name."""
    for f in background_families(run.setup, run.samples):
        if f.unnamed or f.name in (GAUGE_SHAPE, GAUGE_HANGING) or f.name.startswith("joint "):
            yield Item(None, None, f.parameters, UNNAMED, always=f.certain)


class Precision:
    """What the readings tell of each item beside all that act, by products in the space of the readings."""

    def __init__(self, white: Array, widths: Sequence[int]):
        self.columns, self.widths = white[:, :-1], tuple(widths)
        ends = np.cumsum([0, *widths])
        self.places = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.y = white[:, -1]
        self.bare_toward = self.columns.T @ self.y
        self.bare, self.position = {}, np.zeros(len(widths), dtype=int)
        for k in set(widths):
            mine = np.flatnonzero(np.array(widths) == k)
            at = ends[mine][:, None] + np.arange(k)
            own = self.columns.T[at]
            self.bare[k] = (at, own @ own.transpose(0, 2, 1))
            self.position[mine] = np.arange(len(mine))
        self.restart((), np.zeros(0))

    def _gram(self, family: int) -> Array:
        return self.of_width[self.widths[family]][1][self.position[family]]

    def block(self, family: int) -> FamilyBlock:
        values, axes = np.linalg.eigh(self._gram(family))
        return FamilyBlock(family, axes, np.maximum(values, 0.0), axes.T @ self.toward[self.places[family]])

    def gains(self, families: np.ndarray, more: Array) -> Array:
        k = self.widths[int(families[0])]
        at, grams = (x[self.position[families]] for x in self.of_width[k])
        t, v = self.toward[at][:, None], more[None, :]
        if k == 1:
            d = np.maximum(1 + v * grams[:, :, 0], 1.0)
            return 0.5 * (v * t[:, :, 0] ** 2 / d - np.log(d))
        if k == 2:
            a, b, c = (grams[:, i, j][:, None] for i, j in ((0, 0), (1, 1), (0, 1)))
            d = np.maximum((1 + v * a) * (1 + v * b) - (v * c) ** 2, 1.0)
            t0, t1 = t[:, :, 0], t[:, :, 1]
            return 0.5 * (v * (t0**2 * (1 + v * b) - 2 * v * t0 * t1 * c + t1**2 * (1 + v * a)) / d - np.log(d))
        values, axes = np.linalg.eigh(grams)
        along = (axes.transpose(0, 2, 1) @ t.transpose(0, 2, 1))[:, :, 0]
        grown = 1 + more[None, :, None] * np.maximum(values, 0.0)[:, None]
        return 0.5 * (more[None, :, None] * along[:, None] ** 2 / grown - np.log(grown)).sum(axis=2)

    def add(self, block: FamilyBlock, variance: float) -> None:
        """Let a family act that does not, or more than it does; less is for ``restart``."""
        columns = self.columns[:, self.places[block.family]]
        self._take_out(columns - self.inside.T @ (self.inside @ columns), self._gram(block.family), variance)

    def restart(self, acting: Sequence[int], factors: Array) -> None:
        """Begin anew with families (a,) that act by factors (a,): taking one out again would cancel all digits."""
        self.of_width = {k: (at, grams.copy()) for k, (at, grams) in self.bare.items()}
        self.toward, self.inside = self.bare_toward.copy(), np.zeros((0, len(self.columns)))
        if len(acting):
            A = np.hstack([self.columns[:, self.places[f]] * s for f, s in zip(acting, factors, strict=True)])
            self._take_out(A, A.T @ A, 1.0)

    def _take_out(self, left: Array, gram: Array, variance: float) -> None:
        """Take out columns, of which ``left`` (m, k) is what is not taken out yet, and ``gram`` its products."""
        values, axes = np.linalg.eigh(gram)
        axes = axes * np.sqrt(variance / (1 + variance * np.maximum(values, 0.0)))
        q = left @ axes
        across = self.columns.T @ q
        for at, grams in self.of_width.values():
            own = across[at]
            grams -= own @ own.transpose(0, 2, 1)
        self.toward = self.toward - across @ (q.T @ self.y)
        self.inside = np.vstack([self.inside, q.T])


class Chain(posterior_draws._Chain):
    """The posterior's chain over all items."""

    known: Any  # a Precision

    def __init__(self, model: RandomEffects, start: SizeDraw):
        self.model, self.factors, self.noise_logs = model, start.factors.copy(), start.noise_logs
        self.widths = [len(p) for p in model.family_positions]
        self.known = self.look()
        self.pool = np.array([p.pool for p in model.priors])
        self.pool_sizes = np.bincount(self.pool)
        kinds = {id(p): p for p in model.priors}
        self.kinds = tuple(kinds.values())
        order = {key: k for k, key in enumerate(kinds)}
        self.kind = np.array([order[id(p)] for p in model.priors])
        self.alike = np.array(self.widths) * len(kinds) + self.kind
        self.known_logs = {}
        self.optional = np.array([p.factors[0] == 0.0 for p in model.priors])
        self.acting = np.zeros(len(model.priors))

    @cached_property
    def raw(self) -> Array:
        return np.column_stack([self.model.columns[:, self.model.family >= 0], self.model.y])

    def look(self) -> Precision:
        white = ReadingWhitener.of(self.model, self.noise_logs).white(self.raw)
        known = Precision(white, self.widths)
        acting = np.flatnonzero(self.factors)
        known.restart(acting.tolist(), self.factors[acting])
        return known

    def _restart(self) -> None:
        acting = np.flatnonzero(self.factors)
        self.known.restart(acting.tolist(), self.factors[acting])

    def _draw_factor(self, family: int, rng: np.random.Generator) -> None:
        self.factors[family] = 0.0
        self._restart()
        prior, block = self.model.priors[family], self.known.block(family)
        logs = block.gains(prior.factors**2) + prior.logs(int(self._acting()[self.pool[family]]), 0)
        chance = np.exp(logs - logs.max())
        self.acting[family] += 1 - float(chance[0] / chance.sum()) if self.optional[family] else 1.0
        self.factors[family] = chosen = prior.factors[rng.choice(len(logs), p=chance / chance.sum())]
        if chosen > 0:
            self.known.add(block, chosen**2)

    def swap(self, rng: np.random.Generator) -> None:
        """Let one that acts give way to any other that does not."""
        acting = np.flatnonzero(self.optional & (self.factors > 0))
        if len(acting):
            self.factors[rng.choice(acting)] = 0.0
            self._restart()
            idle = np.flatnonzero(self.optional & (self.factors == 0))
            logs = self._idle_prior_logs(idle)
            odds = self._gains(idle)[:, 1:] + logs[:, 1:] - logs[:, :1]
            each = np.logaddexp.reduce(odds, axis=1)
            share = np.exp(each - each.max())
            k = int(rng.choice(len(idle), p=share / share.sum()))
            sizes = np.exp(odds[k] - each[k])
            self._let_act(int(idle[k]), 1 + int(rng.choice(len(sizes), p=sizes / sizes.sum())))

    def draw_noise(self, rng: np.random.Generator) -> None:
        model, here = self.model, self.noise_logs
        square = model.draw_residual(SizeDraw(self.factors, here), rng) ** 2

        def deviance(logs: Array) -> float:
            variance = model.variance(logs)
            return float((square / variance + np.log(variance)).sum() + logs @ model.noise_precision @ logs)

        for move in rng.standard_normal((16, len(here))) * max(1.5 / np.sqrt(len(model.y)), 0.05):
            there = np.clip(here + move, *LOG_NOISE_RANGE)
            here = there if np.log(rng.uniform()) < 0.5 * (deviance(here) - deviance(there)) else here
        self.noise_logs = here
        self.known = self.look()


def draw_items(start: SearchState, items: Sequence[Item], context: FitContext, seed: int = 0) -> Array:
    """Return how likely each item acts, (items,)."""
    fit, run = start.fit, context.run
    few = run.take(even_positions(len(run), min(len(run), READINGS // fit.model.width)))
    own = [replace(p, prior=p.prior if np.isfinite(p.prior) else UNKNOWN_PRIOR) for p in fit.model.parameters]
    parts = [[p for p in own if p.group == "gauge"], [p for p in own if p.group != "gauge" and p.unit == "m"]]
    parts += [[p for p in own if p.group != "gauge" and p.unit != "m"]]
    parts += [list(i.parameters) for i in items]
    family = np.repeat(np.arange(len(parts)) - 1, [len(p) for p in parts])
    everything = [p for part in parts for p in part]
    first = sum(len(p) for p in parts[:3])
    errors = np.append(fit.at([p.name for p in everything[:first]]), np.zeros(len(everything) - first))
    named = tuple(replace(p, name=f"{p.name} {k}") for k, p in enumerate(everything))
    readings = IndependentReadings.of(FitProblem.of(replace(fit.model, parameters=named), few), errors)
    count = readings.noise.shape[1]
    apart = np.eye(count)[0] - np.eye(count)[1]
    precision = np.eye(count) / LOG_NOISE_SIGMA**2 + np.outer(apart, apart) / RATIO**2
    priors = tuple(_priors(items))
    model = RandomEffects(*_narrow(readings, family), readings.noise, priors, precision)
    noise = fit.problem.whitener.noise
    logs = np.log([noise.gauge, noise.joints, noise.angle][:count])
    chain = Chain(model, SizeDraw(np.array([0.0 if p.factors[0] == 0 else 1.0 for p in priors]), logs))
    rng, acting = np.random.default_rng(seed), np.zeros(len(priors))
    for sweep in range(SWEEPS):
        if sweep % NOISE_EVERY == 0:
            chain.draw_noise(rng)
        chain.acting[:] = 0.0
        chain.draw_factors(rng)
        chain.swap(rng)
        acting += chain.acting if sweep >= FORGOTTEN else 0.0
    return acting[2:] / (SWEEPS - FORGOTTEN)


def _priors(items: Sequence[Item]) -> Iterator[SizePrior]:
    yield from (SizePrior(OWN, OWN_WEIGHT / OWN_WEIGHT.sum()) for _ in range(2))
    pools = {pool: {i.effect.name if i.effect else id(i) for i in items if i.pool == pool} for pool in (1, 2, 3)}
    slab, known = SLAB_WEIGHT / SLAB_WEIGHT.sum(), {}
    for i in items:
        key = (i.pool, i.among, i.always)
        if key not in known:
            known[key] = (
                SizePrior(SLAB, slab)
                if i.always
                else ItemPrior(np.append(0.0, SLAB), np.append(0.5, slab / 2), i.pool, i.among, len(pools[i.pool]))
            )
        yield known[key]


def _narrow(readings: IndependentReadings, family: np.ndarray) -> tuple[Array, Array, np.ndarray]:
    """Return columns, readings and families, wide families by as few columns as tell the same."""
    noise = np.sqrt(readings.noise.sum(axis=1))[:, None]
    columns, numbers = [readings.columns[:, family < 0]], [np.full((family < 0).sum(), -1)]
    for f in range(family.max() + 1):
        own = readings.columns[:, np.searchsorted(family, f) : np.searchsorted(family, f, side="right")]
        if own.shape[1] > 6:
            axes, size, _ = np.linalg.svd(own / noise, full_matrices=False)
            keep = max(1, int((size > 0.03).sum()))
            own = noise * axes[:, :keep] * size[:keep]
        columns.append(own)
        numbers.append(np.full(own.shape[1], f))
    return np.hstack(columns), readings.y, np.concatenate(numbers)


def likely_effects(items: Sequence[Item], acting: Array, least: float = 0.5) -> list[tuple[float, FittedEffect]]:
    """Return the effects that act more likely than ``least``, the likeliest first, at their likeliest values."""
    out, left = [], acting.copy()
    names: dict[str, list[int]] = {}
    for k, i in enumerate(items):
        if i.effect is not None:
            names.setdefault(i.effect.name, []).append(k)
    for own in names.values():
        while True:
            best = int(np.argmax(left[own]))
            near = own[max(0, best - NEAR) : best + NEAR + 1]
            chance = float(left[near].sum())
            if chance < least:
                break
            item = items[own[best]]
            out.append((chance, FittedEffect(item.effect, item.value)))
            left[near] = 0.0
    return sorted(out, key=lambda pair: -pair[0])


def search_by_draws(
    start: SearchState, effects: Sequence[Effect], fit_context: FitContext, report: StageReport
) -> SearchResult:
    """Stand in for the search by steps."""
    test = ScoreTest.of(start.fit)
    run = Excitation(start.base.setup, test.problem.samples)
    dictionary = test.lay_out([(e, value) for e in effects for value in e.grid])
    context = SearchContext(tuple(effects), dictionary, fit_context, report, tuple(steppables(run)))
    items = [*catalogue_items(effects, run), *nameless_items(run)]
    state, path = start, [start]
    for chance, found in likely_effects(items, draw_items(start, items, fit_context)):
        value = None if found.value is None else context.score_test(state).refine_value(found.effect, found.value)
        joined = (*state.effects, FittedEffect(number_repeat(found.effect, state.effects), value))
        trial = context.try_refit(state, joined)
        if trial is not None and np.linalg.norm(trial.sizes(trial.effects[-1])) < found.effect.largest:
            state = context.settle(state, trial)
            path.append(state)
        report(f"{found.name}: {chance:.2f}")
    return SearchResult(context, tuple(path), ())
