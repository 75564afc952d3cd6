"""All columns that take part in contests for what findings explain, beside what the draws of the posterior hold."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.common.units import Array
from planner.effects.catalogue import Background, Excitation, effect_kinds, registration_of
from planner.effects.effect import Parameter
from planner.effects.free_laws import beam_laws, free_laws
from planner.effects.nonparametric import NONPARAMETRIC
from planner.identification.contenders import Contender, Contest
from planner.identification.posterior_background import cause_of_family
from planner.identification.posterior_draws import ReadingWhitener, SizeDraw
from planner.identification.posterior_fit import (
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
from planner.identification.problem import FitProblem

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
class Arena:
    """All columns that take part, and the readings as the whole run would give them.

    Attributes:
        record: of the draws.
        columns: of the record's families and of the contenders behind them, per prior sigma, (m, p).
        y: readings; what the posterior leaves of them is as small as the whole run makes it, (m,).
        worth: readings of the run that each is.
        families: blocks of the families that may be absent, by number.
        own, others: block of each finding, and those of the causes of the catalogue that may stand for it.
        unnamed: blocks of what has no name.
        same_law: those of causes that are met in the name of another, with one factor and the odds over that one.
    """

    record: DrawRecord
    columns: Array
    y: Array
    worth: float
    families: dict[int, Block]
    own: tuple[Block, ...]
    others: tuple[tuple[Block, ...], ...]
    unnamed: tuple[Block, ...]
    same_law: tuple[Block, ...] = ()

    @classmethod
    def of(cls, posterior: PosteriorFit, contests: Sequence[Contest], worth: float) -> "Arena":
        """Lay out the columns; ``worth``: readings of the run that each of the record's is, 1 or more."""
        record, odds = posterior.record, LearntOdds.of(posterior.record)
        run = Excitation.of(record.model.setup, record.run.samples)
        laws = [(f"{NONPARAMETRIC}, {name}", own) for name, own in free_laws(run)]
        beams = [Contender(name, own) for name, own in beam_laws(run)]
        same_law = {who.name: who for c in contests for who in c.same_law}
        every = [*(who for c in contests for who in (c.own, *c.others)), *beams, *same_law.values()]
        named, often = len(every), Counter(name for name, _ in laws)
        every += [Contender(name, own, float(np.log(often[name]))) for name, own in laws]
        readings = _with_columns(record, [p for who in every for p in who.parameters])
        first = len(record.model.parameters)
        ends = first + np.cumsum([0, *(len(who.parameters) for who in every)])
        chances = [odds.of_cause(who.name) if k < named else odds.of_pool(UNNAMED) for k, who in enumerate(every)]
        blocks = [
            _block(who.name, np.arange(a, b), chance - who.handicap, SLAB, SLAB_WEIGHT)
            for who, chance, a, b in zip(every, chances, ends[:-1], ends[1:], strict=True)
        ]
        own, others = [], []
        for contest in contests:
            mine, *rest = blocks[: 1 + len(contest.others)]
            chance = odds.of_cause(mine.name) - contest.own.handicap
            own.append(_block(mine.name, mine.columns, chance, OWN, OWN_WEIGHT))
            others.append(tuple(rest))
            blocks = blocks[1 + len(contest.others) :]
        others, blocks = [(*rest, *blocks[: len(beams)]) for rest in others], blocks[len(beams) :]
        alike = tuple(
            replace(b, factors=np.ones(1), logs=np.array([-who.handicap]))
            for b, who in zip(blocks, same_law.values(), strict=False)
        )
        blocks = blocks[len(alike) :]
        places = record.effects.family_positions
        nameless = [
            _block(cause, places[f], odds.of_pool(UNNAMED), SLAB, SLAB_WEIGHT)
            for f, name in enumerate(record.names)
            if record.effects.priors[f].factors[0] == 0.0 and (cause := cause_of_family(name)) is not None
        ]
        families = {
            f: _block(record.names[f], places[f], odds.of_pool(p.pool), p.factors[1:], p.probability[1:])
            for f, p in enumerate(record.effects.priors)
            if p.factors[0] == 0.0
        }
        values = posterior.fit.values
        mean = np.array([values.get(n, 0.0) for n in record.model.names]) / record.model.prior
        expected = readings.columns[:, :first] @ mean
        y = expected + (readings.y - expected) / np.sqrt(worth)
        return cls(record, readings.columns, y, worth, families, tuple(own), tuple(others), (*nameless, *blocks), alike)

    def products(self, draw: SizeDraw) -> Array:
        """Return products of all columns and of the readings, the last, beside what acts always, (p + 1, p + 1).

        They are in units of what is not known then: noise, geometry and place of the gauge as in the draw.
        """
        factors = draw.factors.copy()
        factors[list(self.families)] = 0.0
        effects = self.record.effects
        whitener = ReadingWhitener.of(effects, draw.noise_logs - 0.5 * np.log(self.worth))
        size = np.where(effects.family < 0, 0.0, effects.sizes(factors))
        lower = whitener.products(np.column_stack([self.columns, self.y]), size)
        return np.asarray(np.tril(lower) + np.tril(lower, -1).T)


def _block(name: str, columns: np.ndarray, odds: float, factors: Array, weight: Array) -> Block:
    return Block(name, columns, factors, np.asarray(odds + np.log(weight / weight.sum())))


def _with_columns(record: DrawRecord, new: Sequence[Parameter]) -> IndependentReadings:
    """Return the record's readings with columns of new parameters behind its own."""
    parameters = (*record.model.parameters, *(replace(p, name=f"contender {k}") for k, p in enumerate(new)))
    problem = FitProblem.of(replace(record.model, parameters=parameters), record.run)
    return IndependentReadings.of(problem, np.append(record.errors, np.zeros(len(new))))


@dataclass(frozen=True)
class LearntOdds:
    """Logarithms of the odds beforehand that one of a pool of families acts, as the draws have learnt them, by pool."""

    logs: dict[int, float]

    @classmethod
    def of(cls, record: DrawRecord) -> "LearntOdds":
        """Look how many of each pool act in the mean."""
        out = dict[int, float]()
        pool = np.array([p.pool for p in record.effects.priors])
        for number in (RARE, COMMON, UNNAMED):
            own = [p for p in record.effects.priors if p.pool == number]
            if own:
                acting = float(np.mean([(d.factors[pool == number] > 0).sum() for d in record.draws]))
                absent = float(own[0].logs(round(acting), len(own) - 1)[0])
                out[number] = float(np.log1p(-np.exp(absent)) - absent)
        return cls(out)

    def of_pool(self, pool: int) -> float:
        """Return those of a pool, of what stands in none as of causes that are seldom met."""
        return self.logs.get(pool, self.logs.get(RARE, NO_POOL_ODDS))

    def of_cause(self, name: str) -> float:
        """Return those of a cause of the catalogue."""
        kind = name.partition(", ")[0]
        is_common = kind in effect_kinds() and registration_of(kind).background is Background.COMMON
        return self.of_pool(COMMON if is_common else RARE)
