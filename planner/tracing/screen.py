"""Scores every entry of the catalogue in one pass: what it would explain that the present model cannot.

The candidate's columns are projected off the model's (with its priors); the fall of the sum of squares is the squared
length of the residual's shadow on what is left of them (the score test; Rao 1948).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.stats import f as f_distribution

from planner.catalogue import Entry
from planner.identification import Fit, Problem
from planner.model import Model
from planner.tracing.types import Candidate
from planner.units import Array

LOOK = 6_000  # samples of a long run that are screened
SHOWN = 1e-4  # share of a column that must be left off the model's for its parameter to count as shown
BATCH = 600  # columns at a time


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
        if n > LOOK:
            problem = problem.take(np.unique(np.linspace(0, n - 1, LOOK).astype(int)))
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

    def columns(self, model: Model) -> Array:
        """Whitened columns (m, M) per prior size of a model's parameters, on the same samples."""
        problem = self.problem
        rows = model.rows(problem.samples) * model.prior
        white = problem.whitener.white(slice(None), rows) * np.sqrt(problem.weight)[:, None, None]
        return white.reshape(-1, rows.shape[2])


@dataclass(frozen=True)
class Scored:
    """An entry at one inner value: gain, how many of its parameters are shown, and its information after projection."""

    entry: Entry
    inner: float | None
    gain: float
    size: int
    information: Array


def scored(shade: Shade, entries: Sequence[tuple[Entry, float | None]], residual: Array | None = None) -> list[Scored]:
    """Score entries at given inner values."""
    residual = shade.residual if residual is None else residual
    out: list[Scored] = []
    for batch in _batches(shade, entries):
        model = Model(shade.problem.model.rig, tuple(p for _, _, parameters in batch for p in parameters))
        C = shade.columns(model)
        length = np.einsum("mj,mj->j", C, C)
        W = shade.basis.T @ C
        a = C.T @ residual
        k = 0
        for entry, inner, parameters in batch:
            part = slice(k, k + len(parameters))
            k += len(parameters)
            G = C[:, part].T @ C[:, part] - W[:, part].T @ W[:, part]
            out.append(_score(entry, inner, G, a[part], length[part]))
    return out


def _batches(shade: Shade, entries: Sequence[tuple[Entry, float | None]]) -> Iterator[list]:  # type: ignore[type-arg]
    batch, width = [], 0
    for entry, inner in entries:
        parameters = entry.make(inner)
        batch.append((entry, inner, parameters))
        width += len(parameters)
        if width >= BATCH:
            yield batch
            batch, width = [], 0
    if batch:
        yield batch


def _score(entry: Entry, inner: float | None, G: Array, a: Array, length: Array) -> Scored:
    scale = np.sqrt(np.maximum(length, 1e-300))
    mu, axes = np.linalg.eigh(G / np.outer(scale, scale))
    shown = mu > SHOWN
    along = axes.T @ (a / scale)
    gain = float((along[shown] ** 2 / mu[shown]).sum())
    return Scored(entry, inner, gain, int(shown.sum()), G)


def log_p(shade: Shade, gain: float, size: int, tried: float) -> float:
    """Logarithm of the chance of so large a gain of ``size`` parameters in any of so many tries (F test, Bonferroni)."""
    if size == 0:
        return 0.0
    spare = max(1.0, shade.spare - size)
    # of a long run only every so many samples is worth one: the gain counts by their number
    worth = (shade.spare + shade.basis.shape[1]) / len(shade.residual)
    rest = max(shade.scatter - gain, 1e-300)
    ratio = (min(worth, 1.0) * gain / size) / (min(worth, 1.0) * rest / spare)
    return min(0.0, float(f_distribution.logsf(ratio, size, spare)) + float(np.log(tried)))


def grid(entry: Entry) -> list[tuple[Entry, float | None]]:
    """An entry at every value of its inner number."""
    return [(entry, None)] if entry.inner is None else [(entry, float(v)) for v in entry.inner.values]


def ranked(shade: Shade, entries: Sequence[Entry]) -> list[Candidate]:
    """Every entry at its best inner value, the most surprising first; ties in the catalogue's order."""
    every = [pair for entry in entries for pair in grid(entry)]
    scores = scored(shade, every)
    best: dict[str, Scored] = {}
    for s in scores:
        if s.entry.name not in best or s.gain > best[s.entry.name].gain:
            best[s.entry.name] = s
    out = [Candidate(s.entry, s.inner, s.gain, s.size, log_p(shade, s.gain, s.size, len(every))) for s in best.values()]
    return sorted(out, key=lambda c: (c.log_p, -c.gain))
