"""Scores every effect in one pass: what it would explain that the present model cannot.

The columns of the candidate are projected off those of the model (with its priors); the fall of the sum of squares
is the squared length of the projection of the residual on what remains (the score test; Rao 1948)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import f as f_distribution

from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.effects.effect import Effect
from planner.identification.least_squares import Fit, subset_size
from planner.identification.problem import FitProblem
from planner.tracing.auxiliary_parameters import clip_to_grid, grid_spacing
from planner.tracing.dictionary import EffectAtValue, EffectDictionary, column_products

SCREENED_SAMPLES = 4_000  # samples of a long run that are screened
LEAST_SHARE = 1e-6  # share of a column that must be left off the model's for its parameter to count as shown


@dataclass(frozen=True)
class ScoreTest:
    """A fitted model seen as the space that it spans.

    Attributes:
        problem, errors: the model about its fit, on the samples that are screened.
        basis: orthonormal rows Q (m, P) of the whitened Jacobian with the prior's, readings only.
        residual: whitened, (m,).
        spare: degrees of freedom of the residual, noise correlation counted.
    """

    problem: FitProblem
    errors: Array
    basis: Array
    residual: Array
    spare: float

    @classmethod
    def of(cls, fit: Fit, worth: float = 1.0) -> "ScoreTest":
        """Look at a fit; ``worth`` samples are worth one."""
        problem = fit.problem
        n = len(problem)
        if n > subset_size(fit.model, SCREENED_SAMPLES):
            problem = problem.take(even_positions(n, subset_size(fit.model, SCREENED_SAMPLES)))
        piece = problem.piece(slice(None), fit.errors)
        tall = piece.rows.reshape(-1, piece.rows.shape[2])
        readings = len(tall)
        prior = np.eye(tall.shape[1]) * np.sqrt(readings / (n * piece.rows.shape[1]))
        Q = np.linalg.qr(np.vstack([tall, prior]))[0][:readings]
        residual = piece.residual.reshape(-1)
        residual = residual - Q @ (Q.T @ residual)
        spacing = n / len(problem)
        return cls(problem, fit.errors, Q, residual, max(1.0, readings / max(1.0, worth / spacing) - fit.effective))

    @cached_property
    def scatter(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)

    @property
    def variance(self) -> float:
        """Variance of one whitened reading."""
        return float(max(self.scatter / max(1, len(self.residual) - self.basis.shape[1]), 1e-300))

    @property
    def worth(self) -> float:
        """How many independent readings one of the screened ones stands for, at most 1."""
        return min(1.0, float(self.spare + self.basis.shape[1]) / len(self.residual))

    def lay_out(self, pairs: list[EffectAtValue]) -> EffectDictionary:
        """Lay out entries over the samples that are screened."""
        return EffectDictionary.of(self.problem.context, pairs)


@dataclass(frozen=True)
class EffectScore:
    """An entry at one inner value: its gain, and how many of its parameters the readings show.

    Per prior sizes, after projection: its ``information`` (k, k), and products ``along`` the residual, (k,).
    """

    entry: Effect
    inner: float | None
    gain: float
    size: int
    information: Array
    along: Array


def score_effects(shade: ScoreTest, dictionary: EffectDictionary) -> list[EffectScore]:
    """Score every item of a dictionary, laid out over the same samples as the shade."""
    done = column_products(dictionary, shade.problem, shade.errors, shade.basis, shade.residual)
    widths = np.array([s.shape[0] for s in done.squares])
    out: list[EffectScore | None] = [None] * len(widths)
    for width in np.unique(widths):
        which = np.flatnonzero(widths == width)
        starts = np.array([dictionary.items[k].columns.start for k in which])
        columns = starts[:, None] + np.arange(width)
        W = done.shadow[:, columns].transpose(1, 0, 2)
        square = np.stack([done.squares[k] for k in which])
        information, along = square - W.transpose(0, 2, 1) @ W, done.along[columns]
        gain, size = _score_gains(information, along, np.einsum("kii->ki", square))
        for j, k in enumerate(which):
            item = dictionary.items[k]
            out[k] = EffectScore(item.entry, item.inner, float(gain[j]), int(size[j]), information[j], along[j])
    return [s for s in out if s is not None]


def _score_gains(G: Array, a: Array, length: Array) -> tuple[Array, np.ndarray]:
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


def log_p(shade: ScoreTest, gain: float, size: int, tried: float) -> float:
    """Logarithm of the chance of so large a gain of ``size`` parameters in any of so many tries (F, Bonferroni)."""
    if size == 0:
        return 0.0
    spare = max(1.0, shade.spare - size)
    rest = max(shade.scatter - gain, 1e-300)
    ratio = shade.worth * gain / size / (shade.worth * rest / spare)
    return min(0.0, float(f_distribution.logsf(ratio, size, spare)) + float(np.log(tried)))


def grid_values(entry: Effect) -> list[EffectAtValue]:
    """An entry at every value of its inner number."""
    return [(entry, None)] if entry.inner is None else [(entry, float(v)) for v in entry.inner.values]


REFINEMENT_ROUNDS = 4  # rounds of the search between grid neighbours, each five times finer


def refine_value(shade: ScoreTest, entry: Effect, value: float) -> float:
    """Move the inner number off its grid to where it explains most."""
    width = grid_spacing(entry, value)
    for _ in range(REFINEMENT_ROUNDS):
        tries = value + width * np.linspace(-1, 1, 11)
        tries = np.unique([clip_to_grid(entry, float(v)) for v in tries])
        gains = [s.gain for s in score_effects(shade, shade.lay_out([(entry, float(v)) for v in tries]))]
        value = float(tries[int(np.argmax(gains))])
        width /= 5
    return value
