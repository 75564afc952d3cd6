"""How large errors of a kind are, learnt from what was seen of some of them.

Of readings (``learn_errors``) by their marginal likelihood; of estimates of several robots (``learn_sizes``) by EM:

Each error x_i of a family is normal with the family's size s. Before anything is seen s² is scaled-inverse-chi-square
with ν degrees of freedom about the size that such errors usually have (Gelman et al., Bayesian Data Analysis, 3rd ed.,
2.6 and 5.1). Where x_i is known with mean m_i and variance c_i, the likeliest s² solves (EM; Dempster, Laird and Rubin
1977, JRSS B 39(1))

    s² = (ν s₀² + Σ (m_i² + c_i)) / (ν + n)

in which what was not seen has c_i = s², and pulls nowhere.

What some readings leave of the tool's error in a linear model, the sizes of its errors learnt from these readings.

Everything is asked of a set of readings, of which only those that were taken have taught the sizes: so further ones are
foreseen by the sizes as known now.

What further readings are likely to leave of the tool's error, where sizes are learnt from the readings themselves.

While few readings are taken the size of a family is an average over robots in which it acts and many in which it does
not. Further readings tell these apart, so the sizes shrink on most robots. Foreseen with the sizes as they stand now, a
session would seem to need many more readings than it does.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from planner.common.units import Array
from planner.design.expected_errors import limit_of_sum
from planner.model.linear_gaussian import LinearGaussian

TRUST = 4.0  # [errors seen] that a usual size counts for: it is good to a factor of about two (1/sqrt(2 ν) of ln s)


ALWAYS, MOSTLY, AT_TIMES, HARDLY_EVER = "always", "mostly", "at times", "hardly ever"
"""How often errors of a family act: the geometry's; gears and joints that yield; what else the catalogue names; what it
has no name for. A session stops by them, so they promise less than an identification, which has half absent.
"""


@dataclass(frozen=True)
class Families:
    """Which errors share a size.

    Attributes:
        number: family of each error, (P,) int from 0.
        known: families whose size is stated and not learnt, (F,) bool.
        acts: on how many robots each acts, (F,): ``ALWAYS``, ``MOSTLY``, ``AT_TIMES`` or ``HARDLY_EVER``.
        doubt: one sigma of the logarithm of what is left of the errors, once their sizes are learnt each as the others
            stand: by that they are known too well (of arms drawn with sizes between half and twice the usual).
    """

    number: np.ndarray
    known: np.ndarray
    acts: np.ndarray
    doubt: float = 0.0

    # families of a kind that count as seen to act, and in all, before any reading (a beta distribution)
    SEEN_TO_ACT: ClassVar[dict[str, tuple[float, float]]] = {
        MOSTLY: (3.0, 4.0),
        AT_TIMES: (1.0, 2.0),
        HARDLY_EVER: (1.0, 10.0),
    }

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.known)

    def factors(self, family: int) -> tuple[Array, Array]:
        """Return factors on the usual size that a family may have, and their probabilities, (k,) each.

        They are normal in the log about the usual size with a sigma of 1, or 0 of those that may be absent, with a
        probability that is learnt.
        """
        if self.acts[family] == ALWAYS:
            own = np.exp(np.linspace(-2.0, 2.0, 9))
            weight = np.exp(-0.5 * np.log(own) ** 2)
            return own, weight / weight.sum()
        slab = 0.1 * 2.0 ** np.arange(7, dtype=float)
        weight = np.exp(-0.5 * np.log(slab) ** 2)
        return np.append(0.0, slab), np.append(0.25, 0.75 * weight / weight.sum())


@dataclass(frozen=True)
class LearntErrors:
    """Errors after some readings, in their usual sizes.

    Attributes:
        mean, std: estimates and standard deviations, (P,).
        factors: sizes of the families, (F,): roots of their mean squares, over all that each may be.
        typical: sizes that are as likely exceeded as not, (F,): 0 of a family that rather does not act.
        noise: of a reading, over the one that is declared: an arm mostly comes to rest better than its maker promises;
            what follows no column of the model is in it as well.
    """

    mean: Array
    std: Array
    factors: Array
    typical: Array
    noise: float = 1.0

    @classmethod
    def usual(cls, errors: int, families: int) -> "LearntErrors":
        """Return what is known of so many errors and families before any reading."""
        return cls(np.zeros(errors), np.ones(errors), np.ones(families), np.ones(families))


def learn_errors(white: Array, seen: Array, families: Families, begin: LearntErrors | None = None) -> LearntErrors:
    """Estimate P errors from n readings, and the size of the errors of each of F families.

    The readings y are normal with the covariance S = ν² 1 + Σ_f v_f W_f W_fᵀ. In turn each v_f is the mean of its
    square under the readings' marginal likelihood, all others as they stand (mean field; Bishop, Pattern Recognition
    and Machine Learning, 10.1). Solved among the readings: while a session is measured they are fewer than the errors.

    Args:
        white: the readings' rows W in standard deviations per usual size, (n, P).
        seen: the readings less what was expected of them, in standard deviations, (n,).
        families: which errors share a size.
        begin: what fewer readings said, from which the sizes are sought; none: from the usual ones.
    """
    begin = begin or LearntErrors.usual(white.shape[1], len(families))
    own = [np.flatnonzero(families.number == f) for f in range(len(families))]
    offers = [families.factors(f) for f in range(len(families))]
    square, typical, noise = begin.factors**2, begin.typical.copy(), begin.noise**2
    model = LinearGaussian(white, begin.factors[families.number], np.full(len(white), begin.noise))
    kinds = [(families.acts == kind, a, of) for kind, (a, of) in families.SEEN_TO_ACT.items()]
    acts = sum((np.where(mine, a / of, 0.0) for mine, a, of in kinds), np.zeros(len(square)))
    share = acts.copy()
    for turn in range(12):  # rounds: sizes move by less than a few per cent after that
        before = np.append(square, noise)
        for mine, a, of in kinds:  # how many act says how likely each does
            share[mine] = (a + acts[mine].sum()) / (of + mine.sum())
        for f in np.flatnonzero(~families.known):
            values, axes = np.linalg.eigh(model.products(own[f]))
            values = np.maximum(values, 0.0)
            ease = np.maximum(1.0 - square[f] * values, 1e-9)  # without this family
            shown, pull = values / ease, (axes.T @ model.toward(seen, own[f])) / ease
            factors, probability = offers[f]
            weight = _weigh_factors(factors, probability, shown, pull, float(share[f]))
            square[f], acts[f] = float(weight @ factors**2), float(weight[factors > 0].sum())
            typical[f] = factors[np.searchsorted(np.cumsum(weight), 0.5)]
            model = model.update(own[f], float(np.sqrt(square[f])))
        if turn % 3 == 0:  # the noise, which costs most, in every third
            new = _learn_noise(model, noise, seen)
            model, noise = model.scale_noise(float(np.sqrt(new / noise))), new
            if np.abs(np.append(square, noise) - before).max() < 1e-2 * (1e-2 + square.max()):
                break
    return LearntErrors(model.mean(seen), np.sqrt(model.variance()), np.sqrt(square), typical, float(np.sqrt(noise)))


def _learn_noise(model: LinearGaussian, noise: float, seen: Array) -> float:
    """Return the readings' noise variance over the declared one, all else as it stands.

    Args:
        model: with the noise so far.
        noise: its variance.
        seen: see :func:`learn_errors`.
    """
    # from a fifth of the declared standard deviation to ten times as much, normal in the log about it, sigma 1
    offers = 0.05 * 2.0 ** np.arange(12, dtype=float)
    kept, axes = np.linalg.eigh(model.inverse)
    others, pull = noise * np.maximum(1.0 / np.maximum(kept, 1e-300) - 1.0, 0.0), (axes.T @ seen) ** 2
    spread = offers[:, None] + others
    log = -0.5 * (0.5 * np.log(offers)) ** 2 - 0.5 * (np.log(spread) + pull / spread).sum(axis=1)
    weight = np.exp(log - log.max())
    return float(weight @ offers / weight.sum())


def _weigh_factors(factors: Array, probability: Array, shown: Array, pull: Array, share: float) -> Array:
    """Return the probability of each factor of a family, (k,).

    Args:
        factors, probability: that it may have, (k,); where the first is 0, the others together have ``share``.
        shown, pull: what the readings show of it in their principal axes, and how they pull, (m,).
    """
    size = factors[:, None] ** 2
    spread = 1.0 + size * shown
    if factors[0] == 0.0:
        probability = np.append(1.0 - share, share * probability[1:] / probability[1:].sum())
    log = np.log(probability) + 0.5 * (size * pull**2 / spread - np.log(spread)).sum(axis=1)
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


@dataclass(frozen=True)
class LearntSizes:
    """Sizes of families from estimates of their errors, over the usual ones.

    Attributes:
        factors: (F,).
        seen: how many errors the estimates show, (F,): one that is known well counts one, one that is not none.
    """

    factors: Array
    seen: Array

    @property
    def log_std(self) -> Array:
        """One standard deviation of the logarithm of each factor, (F,): 1/sqrt(2 (ν + seen))."""
        return np.asarray(1.0 / np.sqrt(2.0 * (TRUST + self.seen)))


def learn_sizes(value: Array, std: Array, family: np.ndarray, count: int) -> LearntSizes:
    """Return the sizes of families of which some errors were estimated, each by itself.

    Args:
        value: estimates over the usual size, (n,), as the readings alone say: no prior drew them in.
        std: their standard deviations over the usual size, (n,).
        family: of each, (n,) int from 0 to ``count`` − 1.
        count: of families F.
    """
    square = np.ones(count)
    number = np.bincount(family, minlength=count)
    for _ in range(500):  # rounds
        own = square[family]
        left = own * std**2 / (own + std**2)
        mean = value * own / (own + std**2)
        new = (TRUST + np.bincount(family, mean**2 + left, minlength=count)) / (TRUST + number)
        change = np.abs(np.log(new / square)).max(initial=0.0)
        square = new
        if change < 1e-6:
            break
    own = square[family]
    seen = np.bincount(family, (own / (own + std**2)) ** 2, minlength=count)
    return LearntSizes(np.asarray(np.sqrt(square)), np.asarray(seen, dtype=float))


@dataclass
class LearntPosterior:
    """A linear model whose errors belong to families of sizes that are learnt.

    Attributes:
        white: Jacobian of all readings that may be taken, (n, P). A row is divided by the reading's standard deviation,
            a column multiplied by the usual size of its error.
        root: R, (P, r), with which R Rᵀ maps squared errors to the mean square error of the tool [m²].
        families: which errors share a size.
        learnt: what the readings taken say.
    """

    white: Array
    root: Array
    families: Families
    learnt: LearntErrors

    def __post_init__(self) -> None:
        self._weigh()

    def _weigh(self) -> None:
        """Take the sizes as they are learnt into what is known before any reading."""
        root = self.root * self.size[:, None]
        self._before: Array = root.T @ root  # before any reading, with the sizes as learnt; asked for many sets

    @classmethod
    def of(cls, white: Array, weight: Array, families: Families) -> "LearntPosterior":
        """Return the posterior before any reading; errors e (P,) make the tool's square error eᵀ ``weight`` e [m²]."""
        return cls(white, root_of(weight), families, LearntErrors.usual(white.shape[1], len(families)))

    @property
    def size(self) -> Array:
        """Sizes of the errors over the usual ones, (P,)."""
        return np.asarray(self.learnt.factors[self.families.number])

    def learn(self, taken: Sequence[int], off: Array) -> None:
        """Learn from readings ``taken``, less what was expected of them, in standard deviations, (k,)."""
        self.learnt = learn_errors(self.white[list(taken)], off, self.families)
        self._weigh()

    def spread_of(self, reading: int, taken: Sequence[int]) -> float:
        """Return the variance of a reading that is expected after those ``taken``, its noise included, in its own."""
        own = self.white[[reading]]
        left = (own * self.size) @ (own * self.size).T - self.model(taken).reduction(own)
        return self.learnt.noise**2 + float(max(left[0, 0], 0.0))

    def model(self, which: Sequence[int]) -> LinearGaussian:
        """Return the linear model of some readings, with the sizes and the noise as learnt."""
        white = self.white[list(which)]
        return LinearGaussian(white, self.size, np.full(len(white), self.learnt.noise))

    def remaining_error(self, which: Sequence[int]) -> Array:
        """Return the matrix whose trace is the mean square error of the tool after some readings, (r, r) [m²].

        It is Rᵀ C R, with R the root of the weight and C the covariance that the readings leave.
        """
        return np.asarray(self._before - self.model(which).reduction(self.root.T))

    def square(self, which: Sequence[int]) -> float:
        """Return the mean square error of the tool after some readings [m²]."""
        return float(np.trace(self.remaining_error(which))) * float(np.exp(2.0 * self.families.doubt**2))

    def square_error_limit(self, which: Sequence[int]) -> float:
        """Return the square that 95 of 100 such robots stay below after some readings [m²]."""
        values = np.maximum(np.linalg.eigvalsh(self.remaining_error(which))[::-1], 0.0)
        most = 60  # values that vary; the small ones that are left count as certain
        return limit_of_sum(values[:most], float(values[most:].sum()), self.families.doubt)


def root_of(weight: Array) -> Array:
    """Return a root (P, r) of a symmetric matrix, without what adds nothing to its trace."""
    values, axes = np.linalg.eigh(weight)
    kept = values > 1e-9 * values.sum()
    return np.asarray(axes[:, kept] * np.sqrt(values[kept]))


@dataclass(frozen=True)
class LearntForesight:
    """The posterior as it is likely to be after some of the readings that may follow.

    The readings that may follow are drawn once, of a robot whose families have their typical sizes, and the sizes are
    learnt from them all. In between, the logarithm of a size goes evenly with the logarithm of the number of readings.

    Attributes:
        now: what the readings taken say.
        taken: these, then those that may follow, in their order.
        count: how many are taken.
        factors: sizes of the families once all are taken, (F,).
        noise: of a reading then, over the one that is declared.
    """

    now: LearntPosterior
    taken: tuple[int, ...]
    count: int
    factors: Array
    noise: float

    @classmethod
    def of(cls, now: LearntPosterior, taken: Sequence[int], off: Array, more: Sequence[int]) -> "LearntForesight":
        """Return the foresight after readings ``taken`` with the deviations ``off`` (k,) when ``more`` may follow."""
        every = (*taken, *more)
        if not more:
            return cls(now, every, len(taken), now.learnt.factors, now.learnt.noise)
        drawn = np.append(off, draw_readings(now, taken, off, more))
        then = learn_errors(now.white[list(every)], drawn, now.families, now.learnt)
        return cls(now, every, len(taken), then.factors, then.noise)

    def after(self, more: int) -> LearntPosterior:
        """Return the posterior that is expected after so many of the readings that may follow."""
        if more == 0:
            return self.now
        learnt, first = self.now.learnt, self.count + 1  # 1: the usual sizes are known before any reading
        share = np.log((first + more) / first) / np.log((1 + len(self.taken)) / first)
        now, then = (np.log(np.maximum(f, 1e-6)) for f in (learnt.factors, self.factors))  # 1e-6: of none
        noise = learnt.noise * (self.noise / learnt.noise) ** share
        sizes = replace(learnt, factors=np.exp(now + share * (then - now)), noise=float(noise))
        return replace(self.now, learnt=sizes)

    def square(self, more: int) -> float:
        """Return the mean square error of the tool [m²] that is expected after so many more."""
        return self.after(more).square(self.taken[: self.count + more])

    def square_error_limit(self, more: int) -> float:
        """Return the square [m²] that 95 of 100 such robots are expected to stay below after so many more."""
        return self.after(more).square_error_limit(self.taken[: self.count + more])


def draw_readings(now: LearntPosterior, taken: Sequence[int], off: Array, more: Sequence[int]) -> Array:
    """Draw readings ``more`` [standard deviations] of a robot of typical sizes that agrees with those taken, (m,).

    Errors are drawn before any reading and then moved by what the readings differ from those drawn (Matheron's rule;
    Journel and Huijbregts 1978, Mining Geostatistics).
    """
    seed = 5  # fixed: the same readings foresee the same
    rng = np.random.default_rng(seed)
    size, noise = now.learnt.typical[now.families.number], now.learnt.noise
    errors = size * rng.standard_normal(len(size))
    seen, ahead = now.white[list(taken)], now.white[list(more)]
    gap = off - seen @ errors - noise * rng.standard_normal(len(off))
    errors = errors + LinearGaussian(seen, size, np.full(len(seen), noise)).mean(gap)
    return np.asarray(ahead @ errors + noise * rng.standard_normal(len(ahead)))
