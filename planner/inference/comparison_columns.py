"""All columns that take part in comparisons for what findings explain, beside what the draws of the posterior hold."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.common.units import Array
from planner.effects.catalogue import Background, Excitation, effect_kinds, registration_of
from planner.effects.free_laws import beam_laws, free_laws
from planner.effects.nonparametric import NONPARAMETRIC
from planner.fit.problem import FitProblem
from planner.inference.candidates import Candidate, CauseComparison
from planner.inference.posterior_background import cause_of_family
from planner.inference.posterior_draws import SizeDraw, expected_share
from planner.inference.posterior_fit import (
    COMMON,
    OWN,
    OWN_WEIGHT,
    RARE,
    SLAB,
    SLAB_WEIGHT,
    UNNAMED,
    DrawRecord,
    IndependentReadings,
    PosteriorFit,
)

NO_POOL_ODDS = float(np.log(0.01))  # beforehand that a cause acts, where the posterior has no families to learn it by


@dataclass(frozen=True)
class Block:
    """Columns of one cause.

    Attributes:
        name: of the cause.
        columns: their positions, (k,).
        factors: that their sizes may have, (v,), and logs: of the odds beforehand that it acts with each, (v,).
    """

    name: str
    columns: np.ndarray
    factors: Array
    logs: Array

    def log_odds(self, factor: float) -> float:
        """Return the logarithm of the odds beforehand that it acts with a factor."""
        return float(self.logs[np.argmin(np.abs(self.factors - factor))])


@dataclass(frozen=True)
class ComparisonColumns:
    """All columns that take part, and the readings as the whole run would give them.

    Attributes:
        record: of the draws.
        kept: which of the record's columns take part, (k,) int: of what always acts, of what acts in a draw that is
            looked at, and of what has no name.
        columns: of these and of the candidates behind them, per prior sigma, (m, p).
        y: readings; what the posterior leaves of them is as small as the whole run makes it, (m,).
        worth: readings of the run that each is.
        families: blocks of the families that may be absent and act in a draw that is looked at, by number.
        own, others: block of each finding, and those of the causes of the catalogue that may stand for it.
        unnamed: blocks of what has no name.
        same_law: those of causes that are met in the name of another, with one factor and the odds over that one.
    """

    record: DrawRecord
    kept: np.ndarray
    columns: Array
    y: Array
    worth: float
    families: dict[int, Block]
    own: tuple[Block, ...]
    others: tuple[tuple[Block, ...], ...]
    unnamed: tuple[Block, ...]
    same_law: tuple[Block, ...] = ()

    @classmethod
    def of(
        cls, posterior: PosteriorFit, comparisons: Sequence[CauseComparison], worth: float, looked: Sequence[SizeDraw]
    ) -> "ComparisonColumns":
        """Lay out the columns.

        Args:
            posterior: with its record of the draws.
            comparisons: of the findings.
            worth: readings of the run that each of the record's is, 1 or more.
            looked: draws that are looked at.
        """
        record, odds = posterior.record, LearntOdds.of(posterior.record)
        run = Excitation.of(record.model.setup, record.run.samples)
        laws = [(f"{NONPARAMETRIC}, {name}", own) for name, own in free_laws(run)]
        beams = [Candidate(name, own) for name, own in beam_laws(run)]
        same_law = {who.name: who for c in comparisons for who in c.same_law}
        every = [*(who for c in comparisons for who in (c.own, *c.others)), *beams, *same_law.values()]
        named, often = len(every), Counter(name for name, _ in laws)
        every += [Candidate(name, own, float(np.log(often[name]))) for name, own in laws]
        taking = _Taking.of(record, looked)
        first = len(taking.kept)
        ends = first + np.cumsum([0, *(len(who.parameters) for who in every)])
        chances = [odds.of_cause(who.name) if k < named else odds.of_pool(UNNAMED) for k, who in enumerate(every)]
        blocks = [
            _block(who.name, np.arange(a, b), chance - who.handicap, SLAB, SLAB_WEIGHT)
            for who, chance, a, b in zip(every, chances, ends[:-1], ends[1:], strict=True)
        ]
        own, others = [], []
        for comparison in comparisons:
            mine, *rest = blocks[: 1 + len(comparison.others)]
            chance = odds.of_cause(mine.name) - comparison.own.handicap
            own.append(_block(mine.name, mine.columns, chance, OWN, OWN_WEIGHT))
            others.append(tuple(rest))
            blocks = blocks[1 + len(comparison.others) :]
        others, blocks = [(*rest, *blocks[: len(beams)]) for rest in others], blocks[len(beams) :]
        alike = tuple(
            replace(b, factors=np.ones(1), logs=np.array([-who.handicap]))
            for b, who in zip(blocks, same_law.values(), strict=False)
        )
        blocks = blocks[len(alike) :]
        nameless = [
            _block(cause, taking.places[f], odds.of_pool(UNNAMED), SLAB, SLAB_WEIGHT)
            for f, cause in taking.nameless.items()
        ]
        priors = record.effects.priors
        names = [record.finding_of(name) for name in record.names]
        families = {
            f: _block(names[f], taking.places[f], odds.of_pool(p.pool), p.factors[1:], p.probability[1:])
            for f, p in ((f, priors[f]) for f in taking.acting)
        }
        columns = np.hstack([record.effects.columns[:, taking.kept], _new_columns(record, every)])
        y = _readings_of_the_whole(posterior, worth)
        unnamed = (*nameless, *blocks)
        return cls(record, taking.kept, columns, y, worth, families, tuple(own), tuple(others), unnamed, alike)

    def products(self, draw: SizeDraw) -> Array:
        """Return products of all columns and of the readings, the last, beside what acts always, (p + 1, p + 1).

        They are in units of what is not known then: noise, geometry and place of the gauge as in the draw.
        """
        effects = self.record.effects
        always = np.array([p.factors[0] > 0.0 for p in effects.priors])
        factors = np.where(always, draw.factors, 0.0)
        known = effects.at(SizeDraw(factors, draw.noise_logs - 0.5 * np.log(self.worth)))
        white = np.column_stack([self.columns, self.y]) / known.noise[:, None]
        return np.asarray(white.T @ (known.inverse @ white))


def _block(name: str, columns: np.ndarray, odds: float, factors: Array, weight: Array) -> Block:
    return Block(name, columns, factors, np.asarray(odds + np.log(weight / weight.sum())))


@dataclass(frozen=True)
class _Taking:
    """Which of a record's columns take part in comparisons.

    Attributes:
        kept: their positions, (k,) int.
        acting: families that may be absent and act in a draw that is looked at, by number.
        nameless: causes without a name that families stand for, by number of the family.
        places: of the columns of these families among those kept, by number.
    """

    kept: np.ndarray
    acting: tuple[int, ...]
    nameless: dict[int, str]
    places: dict[int, np.ndarray]

    @classmethod
    def of(cls, record: DrawRecord, looked: Sequence[SizeDraw]) -> "_Taking":
        """Look at the families of a record and at some draws."""
        effects = record.effects
        optional = [f for f, p in enumerate(effects.priors) if p.factors[0] == 0.0]
        acting = tuple(f for f in optional if any(d.factors[f] > 0 for d in looked))
        nameless = {f: cause for f in optional if (cause := cause_of_family(record.names[f])) is not None}
        always = [f for f, p in enumerate(effects.priors) if p.factors[0] > 0.0]
        kept = np.flatnonzero(np.isin(effects.family, [*always, *acting, *nameless]))
        family = effects.family[kept]
        return cls(kept, acting, nameless, {f: np.flatnonzero(family == f) for f in (*acting, *nameless)})


def _new_columns(record: DrawRecord, every: Sequence[Candidate]) -> Array:
    """Return the columns of all parameters of candidates, per prior sigma, in the readings of a record, (m, p)."""
    new = tuple(replace(p, name=f"candidate {k}") for k, p in enumerate(p for who in every for p in who.parameters))
    problem = FitProblem.of(replace(record.model.fix_at(record.errors), parameters=new), record.run)
    return IndependentReadings.of(problem, np.zeros(len(new))).columns


def _readings_of_the_whole(posterior: PosteriorFit, worth: float) -> Array:
    """Return readings, (m,), of which the posterior leaves as little as the whole run makes it."""
    effects, model, values = posterior.record.effects, posterior.record.model, posterior.fit.values
    expected = effects.columns @ (np.array([values.get(n, 0.0) for n in model.names]) / model.prior)
    return np.asarray(expected + (effects.y - expected) / np.sqrt(worth))


@dataclass(frozen=True)
class LearntOdds:
    """Logarithms of the odds beforehand that one of a pool of families acts, as the draws have learnt them, by pool.

    Who takes part in a comparison is none of the families that the draws have counted: all of the pool are its others.
    """

    logs: dict[int, float]

    @classmethod
    def of(cls, record: DrawRecord) -> "LearntOdds":
        """Count how many of each pool act in each draw."""
        pool = np.array([p.pool for p in record.effects.priors])
        acts = np.array([d.factors > 0 for d in record.draws])
        sizes = {number: int((pool == number).sum()) for number in (RARE, COMMON, UNNAMED)}
        shares = {k: expected_share(float(acts[:, pool == k].sum(axis=1).mean()), n, n) for k, n in sizes.items() if n}
        return cls({number: float(np.log(share / (1 - share))) for number, share in shares.items()})

    def of_pool(self, pool: int) -> float:
        """Return those of a pool, of what stands in none as of causes that are seldom met."""
        return self.logs.get(pool, self.logs.get(RARE, NO_POOL_ODDS))

    def of_cause(self, name: str) -> float:
        """Return those of a cause of the catalogue."""
        return self.of_pool(COMMON if name.partition(", ")[0] in self._common_kinds else RARE)

    @cached_property
    def _common_kinds(self) -> frozenset[str]:
        """Kinds of causes that most arms have."""
        return frozenset(k for k in effect_kinds() if registration_of(k).background is Background.COMMON)
