"""Scores every effect in one pass: what it would explain that the present model cannot.

The columns of the candidate are projected off those of the model (with its priors). The fall of the sum of squares is
the squared length of the projection of the residual on what remains (the score test; Rao 1948).
"""

from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.effect import Effect
from planner.fit.least_squares import Fit, subset_size
from planner.fit.problem import FitProblem
from planner.model.model import Model
from planner.tracing.column_space import ColumnSpace, products_of_items, squares_before
from planner.tracing.dictionary import EffectAtValue, EffectDictionary, WhitenedDictionary, whiten

LEAST_SHARE = 1e-6  # of a column that must be left off the model's for its parameter to count as shown


def order_of(merit: float) -> float:
    """Return what sorts the largest merit [noise variances] first, those equal but for rounding in their order."""
    return -round(merit, 6)


@dataclass(frozen=True)
class EffectScore:
    """An effect at one value of its nonlinear parameter, and what it would explain.

    Attributes:
        effect, value: which.
        gain: fall of the whitened sum of squares by its parameters, after the model has taken what it can.
        size: number of its parameters that the readings show.
        information, along: per prior sigmas, after projection: its information (k, k) and products with the residual.
        log_p: logarithm of the chance of so large a gain, corrected for everything that was tried.
        merit: gain in noise variances less what parameters and nonlinear values explain by being many.
    """

    effect: Effect
    value: float | None
    gain: float
    size: int
    information: Array
    along: Array
    log_p: float = 0.0
    merit: float = 0.0

    @property
    def place_in_order(self) -> float:
        """Return what sorts the best first, and leaves those equal but for rounding in the catalogue's order."""
        return order_of(self.merit)


@dataclass(frozen=True)
class DictionaryScores:
    """Scores of all items of a dictionary.

    Attributes:
        gain, size: as of :class:`EffectScore`, (items,).
        information, along: the same, (K, k, k) and (K, k) for each of the dictionary's ``equal_items``.
    """

    dictionary: EffectDictionary
    gain: Array
    size: np.ndarray
    information: tuple[Array, ...]
    along: tuple[Array, ...]

    def __getitem__(self, k: int) -> EffectScore:
        """Return the score of the item at position k."""
        item = self.dictionary.items[k]
        g, j = self._place[k].tolist()
        return EffectScore(
            item.effect, item.value, float(self.gain[k]), int(self.size[k]), self.information[g][j], self.along[g][j]
        )

    def __iter__(self) -> Iterator[EffectScore]:
        """Yield the scores in order."""
        return (self[k] for k in range(len(self.gain)))

    @cached_property
    def _place(self) -> np.ndarray:
        out = np.empty((len(self.gain), 2), dtype=int)
        for g, equal in enumerate(self.dictionary.equal_items):
            out[equal.items, 0], out[equal.items, 1] = g, np.arange(len(equal.items))
        return out


@dataclass(frozen=True)
class ScoreTest:
    """A fitted model seen as the space that it spans.

    Attributes:
        space: that has all of its columns, on the samples that are screened.
        model, errors: the model about its fit.
        residual: whitened, (m,).
        dof: degrees of freedom of the residual, autocorrelation of the noise counted.
        gone: what of the space, (P, k) in its vectors, the model does not span.
        beside: vectors (m, l) across the space that the model spans as well.
        added: number of columns that are out of the residual but not in the model.
    """

    space: ColumnSpace
    model: Model
    errors: Array
    residual: Array
    dof: float
    gone: Array
    beside: Array
    added: int = 0
    _scores: dict[int, DictionaryScores] = field(default_factory=dict, init=False, repr=False, compare=False)
    _steps: dict[str, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, fit: Fit, correlation_time: float = 1.0, near: ColumnSpace | None = None) -> "ScoreTest":
        """Look at a fit; so many samples of it count as one.

        ``near`` is the space of another fit to the same samples, which is taken where it is near enough.
        """
        problem, n = fit.problem, len(fit.problem)
        # 4_000: samples of a long run; half of them along a drive, where neighbours err alike
        screened = subset_size(fit.model, 4_000 if problem.samples.speed is None else 2_000)
        if near is not None and _is_near(near, fit):
            space = near.with_parameters(fit.model.parameters)
        else:
            if n > screened:
                problem = problem.take(even_positions(n, screened))
            space = ColumnSpace.of(problem, fit.errors, len(problem) / n)
        readings, spacing = len(space.block), n / len(space.problem)
        dof = max(1.0, readings / max(1.0, correlation_time / spacing) - fit.effective)
        return cls._from_space(space, fit.model, fit.errors, dof)

    @classmethod
    def _from_space(cls, space: ColumnSpace, model: Model, errors: Array, dof: float) -> "ScoreTest":
        """Look at a model whose columns a space has."""
        problem, gone = space.problem, space.find_missing_part(model.parameters)
        raw = model.residual_in(problem.context, problem.targets, errors)
        white = whiten(problem, raw[..., None]).reshape(-1)
        bare = cls(space, model, errors, white, dof, gone, np.zeros((len(white), 0)))
        return replace(bare, residual=bare.remainder(white))

    def with_model(self, model: Model, errors: Array) -> "ScoreTest":
        """Return the test of a model that has fewer parameters, or others in their places, about ``errors`` of these.

        Columns are taken as they are: those of fewer parameters span a part of the same space.
        """
        return self._from_space(self.space.with_parameters(model.parameters), model, errors, self.dof)

    @property
    def problem(self) -> FitProblem:
        """The samples that are screened, with the noise that they are whitened by."""
        return self.space.problem

    def products(self, columns: Array) -> Array:
        """Return the products (P + l, k) of columns (m, k) with the model's orthonormal vectors."""
        inside = self.space.products(columns)
        if self.gone.size:
            inside -= self.gone @ (self.gone.T @ inside)
        return np.concatenate([inside, self.beside.T @ columns])

    def remainder(self, columns: Array, shared: Array | None = None) -> Array:
        """Return what of columns (m,) or (m, k) the model does not span; ``shared`` are their products with it."""
        shared, P = self.products(columns) if shared is None else shared, len(self.space)
        return np.asarray(columns - self.space.combine(shared[:P]) - self.beside @ shared[P:])

    def information_before(self, columns: Array, name: str) -> Array:
        """Return the information (n − 1, k, k) of columns (n, r, k) beyond the model up to each sample but the last.

        It is kept under the name of the thing that they are of.
        """
        if name not in self._steps:
            known = self.space.sums_before(columns, name)
            known = known + squares_before(self._lost_directions, columns) if self.gone.size else known
            self._steps[name] = known - squares_before(self.beside, columns) if self.beside.size else known
        return self._steps[name]

    @cached_property
    def _lost_directions(self) -> Array:
        """Orthonormal vectors (m, k), the prior's rows below them, that are in the space and not here."""
        return self.space.combine(self.gone)

    @property
    def rank(self) -> int:
        """Number of parameters of the model."""
        return int(len(self.space) - self.gone.shape[1] + self.beside.shape[1] + self.added)

    @cached_property
    def scatter(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)

    @property
    def variance(self) -> float:
        """Variance of one whitened reading."""
        return float(max(self.scatter / max(1, len(self.residual) - self.rank), 1e-300))

    @property
    def effective_samples(self) -> float:
        """How many independent readings one of the screened ones stands for, at most 1."""
        return min(1.0, float(self.dof + self.rank) / len(self.residual))

    @property
    def noise(self) -> float:
        """Variance of the noise in a sum of squares over the screened readings."""
        return self.variance / self.effective_samples

    def lay_out(self, pairs: Sequence[EffectAtValue]) -> EffectDictionary:
        """Lay out effects over the samples that are screened."""
        return EffectDictionary.of(self.problem.context, pairs)

    def score(self, dictionary: EffectDictionary) -> DictionaryScores:
        """Score every item of a dictionary that was laid out over the screened samples."""
        if len(dictionary.items) < 1_000:  # of a dictionary, from which on its columns are kept for the next look
            columns = WhitenedDictionary.of(dictionary, self.problem, self.space.motion)
            shared = products_of_items(dictionary, self._project(columns))
            information = [square - W for square, W in zip(columns.squares, shared, strict=True)]
            return _scores(columns, information, columns.along(self.residual))
        if id(dictionary) not in self._scores:
            columns = self.space.whiten(dictionary)
            along = columns.along(self.residual)
            self._scores[id(dictionary)] = _scores(columns, self.information_blocks(dictionary), along)
        return self._scores[id(dictionary)]

    def _project(self, columns: WhitenedDictionary) -> Array:
        """Products of a dictionary's columns with the model's orthonormal vectors, (width, P + l)."""
        inside = self.space.project(columns)
        if self.gone.size:
            inside -= (inside @ self.gone) @ self.gone.T
        return np.concatenate([inside, columns.project(self.beside)], axis=1) if self.beside.size else inside

    def information_blocks(self, dictionary: EffectDictionary) -> list[Array]:
        """Information beyond the model of a kept dictionary's items, (K, k, k) for each of its equal items."""
        known = self.space.information_blocks(dictionary)
        if self.gone.size:
            free = products_of_items(dictionary, self.space.project_on(dictionary, self.gone))
            known = [before + W for before, W in zip(known, free, strict=True)]
        if self.beside.size:
            taken = products_of_items(dictionary, self.space.whiten(dictionary).project(self.beside))
            known = [before - W for before, W in zip(known, taken, strict=True)]
        return known

    def score_one(self, effect: Effect, value: float | None = None) -> EffectScore:
        """Score one effect."""
        return self.score(self.lay_out([(effect, value)]))[0]

    def refine_value(self, effect: Effect, value: float) -> float:
        """Move a nonlinear value off its grid to where the effect explains most."""
        assert effect.nonlinear is not None
        grid, width = effect.nonlinear, effect.nonlinear.spacing(value)
        for _ in range(4):  # rounds of the search between grid neighbours, each five times finer
            tries = np.unique([grid.clip(float(v)) for v in value + width * np.linspace(-1, 1, 11)])
            gains = self.score(self.lay_out([(effect, float(v)) for v in tries])).gain
            value = float(tries[int(np.argmax(gains))])
            width /= 5
        return value

    def log_p(self, gain: float, size: int, tried: float) -> float:
        """Logarithm of the chance of so large a gain of ``size`` parameters in any of so many tries (F, Bonferroni)."""
        return float(self.log_ps(np.array([gain]), np.array([size]), tried)[0])

    def log_ps(self, gain: Array, size: np.ndarray, tried: float) -> Array:
        """Return log p of several gains (k,)."""
        number = np.maximum(size, 1)
        dof = np.maximum(1.0, self.dof - size)
        rest = np.maximum(self.scatter - gain, 1e-200)
        each = self.effective_samples
        ratio = each * gain / number / (each * rest / dof)
        chance = np.minimum(0.0, log_exceedance(ratio, number, dof) + np.log(tried))
        return np.where(size == 0, 0.0, chance)


def log_exceedance(ratio: Array, number: Array | int, dof: Array | float) -> Array:
    """Logarithm of the chance that a ratio of mean squares, of so many and ``dof`` degrees of freedom, is as large.

    As ``scipy.stats.f.logsf`` has it, which takes a hundred times as long to look at its arguments.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(fdtrc(number, dof, ratio)))


def _is_near(space: ColumnSpace, fit: Fit) -> bool:
    """Tell whether a space stands for a fit: its noise is about the same, and it has few columns too many."""
    then, now = (np.array(astuple(p.whitener.noise)) for p in (space.problem, fit.problem))
    # 0.2: logarithm of what the noise may have changed by since columns were whitened that stand for it
    # 1.3: times those of the model that a space may have
    return bool(np.abs(np.log(now / then)).max() < 0.2 and len(space) < 1.3 * max(len(fit.errors), 1))


def _scores(columns: WhitenedDictionary, information_blocks: Sequence[Array], products: Array) -> DictionaryScores:
    """Score a dictionary's items by their information and the products (width,) of their columns with the residual."""
    dictionary = columns.dictionary
    gains, sizes = np.empty(len(dictionary.items)), np.empty(len(dictionary.items), dtype=int)
    alongs = [products[equal.columns] for equal in dictionary.equal_items]
    for equal, square, information, along in zip(
        dictionary.equal_items, columns.squares, information_blocks, alongs, strict=True
    ):
        gains[equal.items], sizes[equal.items] = score_gains(information, along, np.einsum("kii->ki", square))
    return DictionaryScores(dictionary, gains, sizes, tuple(information_blocks), tuple(alongs))


def score_gains(G: Array, a: Array, length: Array) -> tuple[Array, np.ndarray]:
    """Gain and number of shown parameters, (K,) each, of K items of k parameters.

    Args:
        G: their information after projection, (K, k, k).
        a: products of their columns with the residual, (K, k).
        length: squared lengths of their columns before projection, (K, k).
    """
    scale = np.sqrt(np.maximum(length, 1e-300))
    mu, axes = np.linalg.eigh(G / (scale[:, :, None] * scale[:, None, :]))
    shown = mu > LEAST_SHARE
    along = np.einsum("kij,ki->kj", axes, a / scale)
    gain = np.where(shown, along**2 / np.where(shown, mu, 1.0), 0.0).sum(axis=1)
    return gain, shown.sum(axis=1)
