"""The whitened residual with the model taken out of it, and what the other columns reach beyond the model."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.identification import Problem
from planner.identification.fit import MEDIAN
from planner.identification.splits import poses
from planner.identification.spread import correlation_time
from planner.units import Array

SHOWN = 1e-3  # part of a column that must be left beyond the model for it to count
FAR = 2.5  # standard deviations
MOST_GONE = 0.8  # part of the slow noise that may be taken out before its memory is no longer known


@dataclass(frozen=True)
class Rest:
    """Whitened residual with the model's columns projected out; readings of one group count as one.

    Attributes:
        white: (m,), of the groups in the order of measuring, r numbers each.
        basis: orthonormal, of the model's columns, (m, P).
        group: of every sample, (n,) int.
        width: numbers of a reading, r.
    """

    white: Array
    basis: Array
    group: np.ndarray
    width: int

    @classmethod
    def of(cls, problem: Problem, errors: Array, moving: bool) -> "Rest":
        """Look at what a fit leaves; along a continuous run every sample is its own group."""
        group = np.arange(len(problem)) if moving else grouped(problem)
        piece = problem.piece(slice(None), errors)
        basis = np.linalg.qr(summed(piece.rows, group))[0]
        white = summed(problem.white_residual(errors)[..., None], group)[:, 0]
        return cls(white - basis @ (basis.T @ white), basis, group, problem.model.width)

    @property
    def dof(self) -> float:
        """Degrees of freedom that the model leaves."""
        return float(len(self.white) - self.basis.shape[1])

    @cached_property
    def square(self) -> float:
        """Sum of squares."""
        return float(self.white @ self.white)

    @property
    def tame(self) -> "Rest":
        """The same with numbers beyond ``FAR`` robust standard deviations brought there, the model taken out anew."""
        far = FAR * float(np.median(np.abs(self.white))) / MEDIAN[1]
        white = np.clip(self.white, -far, far)
        return replace(self, white=white - self.basis @ (self.basis.T @ white))

    def beyond(self, problem: Problem, columns: Array) -> Array:
        """Orthonormal basis (m, rank) of what columns (n, r, k) of the reading reach beyond the model."""
        tall = summed(problem.whitener.white(slice(None), columns), self.group)
        tall = tall / np.maximum(np.linalg.norm(tall, axis=0), 1e-300)
        tall = tall - self.basis @ (self.basis.T @ tall)
        return spanned(tall - self.basis @ (self.basis.T @ tall))


def spanned(tall: Array) -> Array:
    """Orthonormal basis (m, rank) of columns (m, k) of about unit length, those shorter than ``SHOWN`` left out."""
    size, axes = np.linalg.eigh(tall.T @ tall)
    shown = size > SHOWN**2
    return np.asarray(tall @ (axes[:, shown] / np.sqrt(size[shown])))


def grouped(problem: Problem) -> np.ndarray:
    """Number the poses, each at its place and target, in the order in which they were first measured, (m,)."""
    s = problem.samples
    point = np.zeros(len(s), dtype=int) if s.point is None else s.point
    label = np.stack([poses(s.q), s.place, point], axis=1)
    first, group = np.unique(label, axis=0, return_index=True, return_inverse=True)[1:]
    return np.argsort(np.argsort(first))[group.reshape(-1)]


def summed(rows: Array, group: np.ndarray) -> Array:
    """Sum the rows (m, r, k) of each group over the root of its size, so that noise keeps its size; (groups·r, k)."""
    count = np.bincount(group)
    if len(count) == len(group):
        return rows[np.argsort(group)].reshape(-1, rows.shape[2])
    out = np.zeros((len(count), *rows.shape[1:]))
    np.add.at(out, group, rows)
    return np.asarray(out / np.sqrt(count)[:, None, None]).reshape(-1, rows.shape[2])


@dataclass(frozen=True)
class Memory:
    """How long noise stays what it is: so many samples are worth one, known with so many degrees of freedom."""

    time: float = 1.0
    dof: float = np.inf


def memory(rest: Rest, taken: Array) -> Memory:
    """Find the memory of what the columns ``taken`` (m, k), orthonormal and beyond the model, do not explain.

    Model and alternatives change slowly along the drive: with them a part of the slow noise is taken out, from which
    the time is read. Over the window of that reading (Sokal's, 5 times either way) it is trace(BᵀTB)/n, B the basis of
    all that was taken out, T one within the window. The time scatters as a sum of 10·time correlations does.
    """
    left = (rest.white - taken @ (taken.T @ rest.white)).reshape(-1, rest.width)
    seen = max(correlation_time(of_one) for of_one in left.T)
    out = np.concatenate([rest.basis, taken], axis=1).reshape(len(left), -1)
    window = int(np.ceil(5 * seen))
    total = np.cumsum(np.pad(out, ((window + 1, window), (0, 0))), axis=0)
    gone = float((out * (total[2 * window + 1 :] - total[: -2 * window - 1])).sum()) / (len(left) * rest.width)
    if gone > MOST_GONE:
        return Memory(np.inf, 0.0)
    time = seen / (1 - gone)
    return Memory(time, len(left) / (10 * time + 1))
