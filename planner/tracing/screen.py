"""Scores every entry of the catalogue in one pass: what it would explain that the present model cannot.

The candidate's columns are projected off the model's (with its priors); the fall of the sum of squares is the squared
length of the residual's shadow on what is left of them (the score test; Rao 1948).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import f as f_distribution

from planner.catalogue import Entry
from planner.identification import Fit, Problem
from planner.identification.fit import fewer
from planner.repeatable import evenly
from planner.tracing.dictionary import Dictionary, Pair, products
from planner.units import Array

LOOK = 4_000  # samples of a long run that are screened
SHOWN = 1e-6  # share of a column that must be left off the model's for its parameter to count as shown


@dataclass(frozen=True)
class Shade:
    """A fitted model seen as the space that it spans.

    Attributes:
        problem, errors: the model about its fit, on the samples that are screened.
        basis: orthonormal rows Q (m, P) of the whitened Jacobian with the prior's, readings only.
        residual: whitened, (m,).
        spare: degrees of freedom of the residual, noise correlation counted.
    """

    problem: Problem
    errors: Array
    basis: Array
    residual: Array
    spare: float

    @classmethod
    def of(cls, fit: Fit, worth: float = 1.0) -> "Shade":
        """Look at a fit; ``worth`` samples are worth one."""
        problem = fit.problem
        n = len(problem)
        if n > fewer(fit.model, LOOK):
            problem = problem.take(evenly(n, fewer(fit.model, LOOK)))
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

    def lay_out(self, pairs: list[Pair]) -> Dictionary:
        """Lay out entries over the samples that are screened."""
        return Dictionary.of(self.problem.context, pairs)


@dataclass(frozen=True)
class Scored:
    """An entry at one inner value: its gain, and how many of its parameters the readings show.

    Per prior sizes, after projection: its ``information`` (k, k), and products ``along`` the residual, (k,).
    """

    entry: Entry
    inner: float | None
    gain: float
    size: int
    information: Array
    along: Array


def scored(shade: Shade, dictionary: Dictionary) -> list[Scored]:
    """Score every item of a dictionary, laid out over the same samples as the shade."""
    done = products(dictionary, shade.problem, shade.errors, shade.basis, shade.residual)
    widths = np.array([s.shape[0] for s in done.squares])
    out: list[Scored | None] = [None] * len(widths)
    for width in np.unique(widths):
        which = np.flatnonzero(widths == width)
        starts = np.array([dictionary.items[k].columns.start for k in which])
        columns = starts[:, None] + np.arange(width)
        W = done.shadow[:, columns].transpose(1, 0, 2)
        square = np.stack([done.squares[k] for k in which])
        information, along = square - W.transpose(0, 2, 1) @ W, done.along[columns]
        gain, size = _gains(information, along, np.einsum("kii->ki", square))
        for j, k in enumerate(which):
            item = dictionary.items[k]
            out[k] = Scored(item.entry, item.inner, float(gain[j]), int(size[j]), information[j], along[j])
    return [s for s in out if s is not None]


def _gains(G: Array, a: Array, length: Array) -> tuple[Array, np.ndarray]:
    """Gain and number of shown parameters, (K,) each, of K items of k parameters.

    Args:
        G: their information after projection, (K, k, k).
        a: products of their columns with the residual, (K, k).
        length: squared lengths of their columns before projection, (K, k).
    """
    scale = np.sqrt(np.maximum(length, 1e-300))
    mu, axes = np.linalg.eigh(G / (scale[:, :, None] * scale[:, None, :]))
    shown = mu > SHOWN
    along = np.einsum("kij,ki->kj", axes, a / scale)
    gain = np.where(shown, along**2 / np.where(shown, mu, 1.0), 0.0).sum(axis=1)
    return gain, shown.sum(axis=1)


def log_p(shade: Shade, gain: float, size: int, tried: float) -> float:
    """Logarithm of the chance of so large a gain of ``size`` parameters in any of so many tries (F, Bonferroni)."""
    if size == 0:
        return 0.0
    spare = max(1.0, shade.spare - size)
    rest = max(shade.scatter - gain, 1e-300)
    ratio = shade.worth * gain / size / (shade.worth * rest / spare)
    return min(0.0, float(f_distribution.logsf(ratio, size, spare)) + float(np.log(tried)))


def grid(entry: Entry) -> list[Pair]:
    """An entry at every value of its inner number."""
    return [(entry, None)] if entry.inner is None else [(entry, float(v)) for v in entry.inner.values]
