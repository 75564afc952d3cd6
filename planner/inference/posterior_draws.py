"""Sizes of random effects, drawn from their posterior: which families act at all, how large they are, and the noise.

The model is y = X S z + e with z ~ N(0, 1), S the diagonal of sizes and independent noise e whose variance is a sum of
components of unknown size. Columns of a family share a factor on their prior sigmas. It is one of a few values; for the
families of the background the first is 0, and likely: a spike and a slab (Mitchell and Beauchamp 1988, JASA 83(404)).
How likely is learnt from how many of them act (Scott and Berger 2010, Annals of Statistics 38(5)). The factors are
drawn one after the other with z averaged over (Gibbs sampling, collapsed; George and McCulloch 1997, Statistica Sinica
7(2)), and families that explain the same are exchanged, since neither goes without the other; the noise is drawn by
Metropolis' rule, given a draw of e (van Dyk and Park 2008, J. Am. Stat. Assoc. 103(482)). A single best set of sizes
would hide how little a run says of them; the average over the draws does not.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from planner.common.determinism import with_fixed_signs
from planner.common.units import Array
from planner.fit.assumptions import EXPECTED_CAUSES, LOG_NOISE_RANGE, PREVALENCE
from planner.fit.wild_rows import row_weights
from planner.inference.even_sizes import spread_evenly
from planner.inference.family_gains import FamilyGains
from planner.model.linear_gaussian import LinearGaussian

SWEEPS = 160  # through all families
KEPT_EVERY = 3  # sweeps between draws that are kept: neighbours are alike
NOISE_EVERY = 6  # sweeps between draws of the noise: all products of columns are made anew with it


def expected_share(acting: float, counted: int, pool_size: int) -> float:
    """Return the mean of the share of a pool that acts, where ``acting`` of the families ``counted`` do: in (0, 1).

    Its prior is Beta(a, a · pool_size / EXPECTED_CAUSES) with a = PREVALENCE. It is the probability that one more acts.
    """
    if not 0 <= acting <= counted:
        raise ValueError(f"{acting} of {counted} families cannot act")
    return (acting + PREVALENCE) / (counted + PREVALENCE * (1 + pool_size / EXPECTED_CAUSES))


@dataclass(frozen=True)
class SizePrior:
    """Factors (k,) that a family's sizes may have, and their probabilities (k,).

    Of a family that is one of a ``pool`` the probability of 0 follows from how many others of the pool act; 0: of none.
    """

    factors: Array
    probability: Array
    pool: int = 0

    def logs(self, acting: int, others: int) -> Array:
        """Return log probabilities (k,) where ``acting`` of ``others`` of the pool act."""
        if not self.pool:
            return np.asarray(np.log(self.probability))
        here = self.factors > 0
        chance = expected_share(acting, others, others + 1)
        share = self.probability / np.where(here, self.probability[here].sum(), self.probability[~here].sum())
        return np.asarray(np.log(share * np.where(here, chance, 1 - chance)))


@dataclass(frozen=True)
class ChainLimits:
    """What the user says of the draws.

    Attributes:
        seed: of the draws.
        most_causes: how many causes with a name may act together at most; none: any number.
        declared: kinds of causes that the cell declares, which do not count.
    """

    seed: int = 0
    most_causes: int | None = None
    declared: tuple[str, ...] = ()

    def counts(self, cause: str) -> bool:
        """Tell whether a cause, ``KIND, PLACE`` or ``KIND (…)``, is one of those of which at most so many may act."""
        return self.most_causes is not None and cause.partition(", ")[0].partition(" (")[0] not in self.declared


@dataclass(frozen=True)
class SizeDraw:
    """Factor of every family, (f,), and logarithms of the noise's components over the declared ones, (c,)."""

    factors: Array
    noise_logs: Array


@dataclass(frozen=True)
class DrawnSizes(SizeDraw):
    """A draw, and how likely each family acts, (f,), where all others are as they were when its own factor was drawn.

    ``weight`` (n,): by how much each row of the run counted.

    The mean of that over the draws scatters less than the share of the draws in which the family acts (Rao and
    Blackwell; Gelfand and Smith 1990, J. Am. Stat. Assoc. 85(410)).
    """

    acting: Array
    weight: Array


@dataclass(frozen=True)
class RandomEffects:
    """A linear model of random effects in families.

    Attributes:
        columns: of the effects per prior sigma, (m, p).
        y: readings less what is expected, (m,).
        family: number of each column's family, −1 for those whose size is known, (p,) int.
        noise: variance of each reading by component of the noise as declared, (m, c).
        priors: of the factors of the families, (f,).
        noise_precision: of the normal prior about 0 on the logarithms of the noise's components, (c, c).
        row: number of the row of the run that each reading is of, (m,) int; none: rows are not looked at.
        weight: by how much each row counts, (n,).
        limited: numbers of the families of which at most ``most`` may act together.
    """

    columns: Array
    y: Array
    family: np.ndarray
    noise: Array
    priors: tuple[SizePrior, ...]
    noise_precision: Array
    row: np.ndarray | None = None
    weight: Array | None = None
    limited: tuple[int, ...] = ()
    most: int = 0

    @cached_property
    def places(self) -> tuple[slice, ...]:
        """Where the columns of each family stand in ``sorted_columns``, (f,)."""
        ends = np.cumsum([0, *((self.family == f).sum() for f in range(len(self.priors)))])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @cached_property
    def order(self) -> np.ndarray:
        """Positions of the columns, those of one family after the other and what has a known size last, (p,) int."""
        return np.argsort(np.where(self.family < 0, len(self.priors), self.family), kind="stable")

    @cached_property
    def sorted_columns(self) -> Array:
        """Columns in that order, and the readings behind them, (m, p + 1)."""
        return np.column_stack([self.columns[:, self.order], self.y])

    @cached_property
    def family_positions(self) -> tuple[np.ndarray, ...]:
        """Positions of the columns of each family, (f,)."""
        return tuple(np.flatnonzero(self.family == f) for f in range(len(self.priors)))

    def compact(self) -> "RandomEffects":
        """Return the model with as few columns as tell the same: of each family those that the noise does not hide.

        They are its principal axes.
        """
        noise = np.sqrt(self.noise.sum(axis=1))[:, None]
        columns, family = [self.columns[:, self.family < 0]], [np.full((self.family < 0).sum(), -1)]
        for f, own in enumerate(self.family_positions):
            square, axes = np.linalg.eigh((self.columns[:, own] / noise).T @ (self.columns[:, own] / noise))
            # 0.03: of the declared noise, below which a direction tells nothing however large the family is
            count = max(1, int((square * self.priors[f].factors.max() ** 2 > 0.03**2).sum()))
            columns.append(self.columns[:, own] @ with_fixed_signs(axes[:, -count:]))
            family.append(np.full(count, f))
        return replace(self, columns=np.hstack(columns), family=np.concatenate(family))

    def sizes(self, factors: Array) -> Array:
        """Return the factor of each column, (p,), at factors of the families (f,)."""
        return np.asarray(np.append(factors, 1.0)[self.family])

    def variance(self, noise_logs: Array) -> Array:
        """Return the variance of each reading, (m,)."""
        variance = np.asarray(self.noise @ np.exp(2 * noise_logs))
        return variance if self.weight is None else variance / self.weight[self.row]

    def at(self, draw: SizeDraw) -> LinearGaussian:
        """Return the linear model of the sorted columns with all sizes and the noise as drawn."""
        sizes = np.append(self.sizes(draw.factors)[self.order], 0.0)
        return LinearGaussian(self.sorted_columns, sizes, np.sqrt(self.variance(draw.noise_logs)))

    def weigh_rows(self, known: LinearGaussian) -> Array:
        """Return by how much each row counts, (n,), held against what all others say of it at a draw of the sizes."""
        assert self.row is not None
        assert self.weight is not None
        left = known.inverse @ (self.y / known.noise) / np.sqrt(self.weight)[self.row]
        by_row = np.argsort(self.row, kind="stable").reshape(len(self.weight), -1)
        leverage = np.maximum(1.0 - np.diag(known.inverse), 0.0)
        return row_weights(left[by_row], leverage[by_row], self.weight)

    def draw_residual(self, known: LinearGaussian, rng: np.random.Generator) -> Array:
        """Return what the noise may be in each reading, (m,), drawn given the readings and a draw of the sizes.

        What all columns and the noise would give is drawn from their priors, and moved as far as the readings differ
        from it (Matheron's rule; Hoffman and Ribak 1991, Astrophysical Journal 380).
        """
        which = known.acting
        noise = rng.standard_normal(len(self.y))
        parameters = known.prior[which] * rng.standard_normal(len(which))
        apart = (self.y - known.columns[:, which] @ parameters) / known.noise - noise
        return np.asarray(known.noise * (noise + known.inverse @ apart))


def draw_sizes(
    model: RandomEffects, start: SizeDraw, seed: int = 0, sweeps: int | None = None
) -> tuple[DrawnSizes, ...]:
    """Return draws of the sizes from their posterior, one in KEPT_EVERY sweeps, of which SWEEPS if not given."""
    rng = np.random.default_rng(seed)
    chain = _Chain(model, start)
    out = []
    count = SWEEPS if sweeps is None else sweeps
    burn_in = count // 6  # sweeps that are forgotten
    for sweep in range(count):
        if (sweep + 1) % NOISE_EVERY == 0:
            chain.draw_noise(rng)
        chain.draw_factors(rng)
        chain.swap(rng)
        if sweep == burn_in:
            chain.put_acting_first()
        if sweep < burn_in:
            chain.acting[:] = 0.0
            chain.likely[:] = 0.0
        elif (sweep - burn_in + 1) % KEPT_EVERY == 0:
            acting = chain.acting / KEPT_EVERY
            weight = np.ones(0) if chain.model.weight is None else chain.model.weight
            out.append(DrawnSizes(chain.factors.copy(), chain.noise_logs, acting, weight))
            chain.acting[:] = 0.0
    return chain.spread(out, rng)


class _Chain:
    """Where the draws stand; ``acting`` sums up how likely each family was to act when it was drawn."""

    def __init__(self, model: RandomEffects, start: SizeDraw):
        self.model = model = model.compact()
        self.factors = start.factors.copy()
        self.noise_logs = start.noise_logs
        self.known = FamilyGains(model.at(start), model.places)
        self.pool = np.array([p.pool for p in model.priors])
        self.pool_sizes = np.bincount(self.pool)
        kinds = {id(p): p for p in model.priors}
        self.kinds = tuple(kinds.values())
        self.kind = np.array([list(kinds).index(id(p)) for p in model.priors])
        grids = {p.factors.tobytes(): p.factors for p in self.kinds}
        self.grids = tuple(grids.values())  # of factors, which several kinds share
        grid = np.array([list(grids).index(p.factors.tobytes()) for p in self.kinds])
        self.alike = np.array(self.known.widths) * len(grids) + grid[self.kind]
        self.most_factors = max(len(p.factors) for p in self.kinds)
        self.known_logs = dict[tuple[int, int], Array]()
        self.optional = np.array([p.factors[0] == 0.0 for p in model.priors])
        self.acting = np.zeros(len(model.priors))
        # how likely each factor of a family that always acts was when it was drawn, summed up
        self.likely = np.zeros((len(model.priors), self.most_factors))
        self.put_acting_first()

    def spread(self, draws: list[DrawnSizes], rng: np.random.Generator) -> tuple[DrawnSizes, ...]:
        """Return the draws with the factors of families that always act as evenly spread as they are likely."""
        factors = np.array([d.factors for d in draws]).reshape(len(draws), -1)
        for f in np.flatnonzero(~self.optional & (self.likely.sum(axis=1) > 0)).tolist() if draws else ():
            own = self.model.priors[f].factors
            factors[:, f] = spread_evenly(factors[:, f], own, self.likely[f, : len(own)], rng)
        return tuple(replace(d, factors=own) for d, own in zip(draws, factors, strict=True))

    def draw_noise(self, rng: np.random.Generator) -> None:
        """Draw the noise with the sizes as they are, given what it may be in each reading."""
        known = self.known.model
        if self.model.weight is not None:  # rows count as they stand to the others now
            weight = self.model.weigh_rows(known)
            if not np.array_equal(weight, self.model.weight):
                self.model = replace(self.model, weight=weight)
                known = self.model.at(SizeDraw(self.factors, self.noise_logs))
        for _ in range(2):  # where many families act one step follows the other only slowly
            self._draw_noise_beside(self.model.draw_residual(known, rng) ** 2, rng)
            known = self.model.at(SizeDraw(self.factors, self.noise_logs))
        self.known = FamilyGains(known, self.model.places)

    def _draw_noise_beside(self, square: Array, rng: np.random.Generator) -> None:
        """Draw the noise given the squares of what it is in each reading, (m,)."""
        model, here = self.model, self.noise_logs

        def log_density(logs: Array) -> float:
            """Return the log density of the noise's size, without a constant."""
            variance = model.variance(logs)
            prior = logs @ model.noise_precision @ logs
            return -0.5 * float((square / variance + np.log(variance)).sum() + prior)

        likely = log_density(here)
        step = max(1.5 / np.sqrt(len(model.y)), 0.05)  # of a proposal's logarithm, times 1/√readings
        for move in rng.standard_normal((16, len(here))) * step:  # 16: proposals of one draw, a sum over readings each
            there = np.clip(here + move, *LOG_NOISE_RANGE)
            other = log_density(there)
            if np.log(rng.uniform()) < other - likely:
                here, likely = there, other
        self.noise_logs = here

    def draw_factors(self, rng: np.random.Generator) -> None:
        """Draw the factor of one family after the other."""
        left = self.sequence
        while len(left):
            acting = np.flatnonzero((self.factors[left] > 0) | ~self.optional[left])
            if len(acting) and acting[0] == 0:
                self._draw_factor(int(left[0]), rng)
                left = left[1:]
            else:  # what is absent mostly stays so: up to the next that acts all are looked at together
                left = left[self._draw_idle(left[: acting[0]] if len(acting) else left, rng) :]

    def put_acting_first(self) -> None:
        """Go on in an order in which few families that act stand between those that do not."""
        self.sequence = np.argsort((self.factors == 0) & self.optional, kind="stable")

    def _draw_factor(self, family: int, rng: np.random.Generator) -> None:
        prior, own = self.model.priors[family], self.factors[family]
        acting = self._acting()[self.pool[family]] - int(own > 0)
        logs = self.known.change_gains(family, prior.factors**2 - own**2)
        logs = logs + self._prior_logs(int(self.kind[family]), int(acting))
        chance = _chances(logs)
        self.acting[family] += 1 - float(chance[0] / chance[-1]) if self.optional[family] else 1.0
        self.likely[family, : len(chance)] += np.diff(chance, prepend=0.0) / chance[-1]
        chosen = float(prior.factors[_choose(chance, rng)])
        if chosen != own:
            self.known.set_size(family, chosen)
            self.factors[family] = chosen

    def _draw_idle(self, families: np.ndarray, rng: np.random.Generator) -> int:
        """Draw the factors of families (f,), all absent, until one appears; return how many were drawn."""
        logs = self._gains(families) + self._idle_prior_logs(families)
        chance = np.exp(logs - logs.max(axis=1, keepdims=True)).cumsum(axis=1)
        absent = chance[:, 0] / chance[:, -1]
        for k, (family, none, own) in enumerate(zip(families.tolist(), absent.tolist(), chance, strict=True)):
            self.acting[family] += 1 - none
            chosen = _choose(own, rng)
            if chosen > 0:
                self._let_act(family, chosen)
                return k + 1
        return len(families)

    def _gains(self, families: np.ndarray) -> Array:
        """Return the gain (f, v) by each of the factors of absent families, 0 by absence; −∞ behind the last factor."""
        out, alike = np.full((len(families), self.most_factors), -np.inf), self.alike[families]
        out[:, 0] = 0.0
        for label in np.unique(alike).tolist():
            mine, factors = np.flatnonzero(alike == label), self.grids[label % len(self.grids)]
            out[mine, 1 : len(factors)] = self.known.gains(families[mine], factors[1:] ** 2)
        return out

    def _let_act(self, family: int, chosen: int) -> None:
        self.factors[family] = self.model.priors[family].factors[chosen]
        self.known.set_size(family, float(self.factors[family]))

    def swap(self, rng: np.random.Generator) -> None:
        """Let one family that acts give way to any other that does not, or to another size of itself."""
        acting = np.flatnonzero(self.optional & (self.factors > 0))
        if not len(acting):
            return
        leaving = int(rng.choice(acting))
        self.known.set_size(leaving, 0.0)
        self.factors[leaving] = 0.0
        idle = np.flatnonzero(self.optional & (self.factors == 0))
        logs = self._idle_prior_logs(idle)
        odds = self._gains(idle)[:, 1:] + logs[:, 1:] - logs[:, :1]
        k = _choose(_chances(np.logaddexp.reduce(odds, axis=1)), rng)
        self._let_act(int(idle[k]), 1 + _choose(_chances(odds[k]), rng))

    def _acting(self) -> np.ndarray:
        """Return how many families of each pool act, (pools,) int."""
        return np.asarray(np.bincount(self.pool[self.factors > 0], minlength=len(self.pool_sizes)))

    def _idle_prior_logs(self, families: np.ndarray) -> Array:
        """Return the log prior probabilities (f, v) of factors of absent families, 0 behind the last factor."""
        acting, out = self._acting(), np.zeros((len(self.kinds), self.most_factors))
        for k in np.unique(self.kind[families]).tolist():
            prior = self.kinds[k]
            out[k, : len(prior.factors)] = self._prior_logs(k, int(acting[prior.pool]))
        out = out[self.kind[families]]
        limited = list(self.model.limited)
        if limited and np.count_nonzero(self.factors[limited]) >= self.model.most:  # none of them may join
            out[np.isin(families, limited), 1:] = -np.inf
        return np.asarray(out)

    def _prior_logs(self, kind: int, acting: int) -> Array:
        """Return the log prior probabilities of factors of a kind where so many others of its pool act; cached."""
        if (kind, acting) not in self.known_logs:
            prior = self.kinds[kind]
            self.known_logs[kind, acting] = prior.logs(acting, int(self.pool_sizes[prior.pool]) - 1)
        return self.known_logs[kind, acting]


def _chances(logs: Array) -> Array:
    """Return chances (k,) added up, by their logarithms."""
    return np.asarray(np.exp(logs - logs.max()).cumsum())


def _choose(chance: Array, rng: np.random.Generator) -> int:
    """Return a position in chances (k,) that are added up."""
    return int(chance.searchsorted(rng.random() * chance[-1], side="right"))
