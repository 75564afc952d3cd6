"""Coordinates in which the information of the whole pool is one: every comparison is then well conditioned."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.observability.information import r_factor

UNSEEN = 1e-8  # share of the largest singular value below which the pool does not see a direction
ALONG = 1e-6  # the same for what some columns span


@dataclass(frozen=True)
class PoolCoordinates:
    """New coordinates of the columns.

    Attributes:
        to: (P, p): rows of the pool times it have the information one.
        columns: (p, P): where each column lies.
    """

    to: Array
    columns: Array

    @classmethod
    def of(cls, rows: Array) -> "PoolCoordinates":
        """Take the coordinates from the rows (n, r, P) of the whole pool."""
        size = np.maximum(np.linalg.norm(rows.reshape(-1, rows.shape[2]), axis=0), 1e-300)
        _, mu, axes = np.linalg.svd(r_factor(rows / size))
        seen = mu > UNSEEN * mu[0]
        return cls((axes[seen].T / mu[seen]) / size[:, None], mu[seen, None] * axes[seen] * size)

    def rows(self, rows: Array) -> Array:
        """Rows (n, r, P) in the new coordinates, (n, r, p)."""
        return np.asarray(rows @ self.to)

    def span(self, which: np.ndarray) -> Array:
        """Orthonormal basis (p, k) of what some columns span."""
        columns = self.columns[:, which]
        size = np.linalg.norm(columns, axis=0)
        out, mu, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
        return np.asarray(out[:, mu > ALONG * mu[0]])


OWN_SHARE = 0.25  # k: what is measured must still identify the robot


RIDGE = 1e-8  # of the information of the whole pool


@dataclass(frozen=True)
class DiscriminationQuestion:
    """Would readings of a truth be taken for another effect?

    Attributes:
        pair: which pair it belongs to.
        truth: its name.
        signal: values of the parameters by which the truth shows, (P,) in the columns' units.
        base: columns that are in the model anyway, (p,) ints; ``rival`` those of the other effect.
    """

    pair: int
    truth: str
    signal: Array
    base: np.ndarray
    rival: np.ndarray

    @property
    def taken(self) -> np.ndarray:
        """Columns that may explain the truth otherwise."""
        return np.union1d(self.base, self.rival)


@dataclass(frozen=True)
class LogDetTerm:
    """``weight`` times log det T'MT; ``basis`` T (p, k), orthonormal."""

    weight: float
    basis: Array

    def of(self, mass: Array) -> Array:
        """T'MT, (k, k)."""
        return np.asarray(self.basis.T @ mass @ self.basis + RIDGE * np.eye(self.basis.shape[1]))


@dataclass(frozen=True)
class DTCriterion:
    """A sum of log determinants."""

    terms: tuple[LogDetTerm, ...]

    def value(self, mass: Array) -> float:
        """The criterion at information ``mass`` (p, p)."""
        total = 0.0
        for term in self.terms:
            total += term.weight * float(np.linalg.slogdet(term.of(mass))[1])
        return total

    def slope(self, mass: Array) -> Array:
        """Its derivative X (p, p)."""
        out = np.zeros_like(mass)
        for term in self.terms:
            out += term.weight * (term.basis @ np.linalg.solve(term.of(mass), term.basis.T))
        return np.asarray((out + out.T) / 2)

    def roots(self, mass: Array) -> list[tuple[float, Array]]:
        """Weight of each term, and (p, k) a matrix that makes its T'MT one."""
        out = []
        for term in self.terms:
            lower = np.linalg.cholesky(term.of(mass))
            out.append((term.weight, np.linalg.solve(lower, term.basis.T).T))
        return out


def noncentrality(
    frame: PoolCoordinates, mass: Array, question: DiscriminationQuestion, beside: bool = True
) -> tuple[float, Array]:
    """Noncentrality at information ``mass`` (p, p), and the direction (p,) in which the truth shows beyond the other.

    ``beside`` the other effect, else beside the model alone.
    """
    basis = frame.span(question.taken if beside else question.base)
    signal = frame.columns[:, : len(question.signal)] @ question.signal
    fit = basis @ (np.linalg.pinv(basis.T @ mass @ basis, rcond=1e-13, hermitian=True) @ (basis.T @ (mass @ signal)))
    left = signal - fit
    return max(0.0, float(left @ mass @ left)), left


def dt_criterion(
    frame: PoolCoordinates, own: np.ndarray, questions: Sequence[DiscriminationQuestion], weights: Array
) -> DTCriterion:
    """Return the criterion for questions of some weights; ``own``: columns of the plan's own parameters."""
    basis = frame.span(own)
    terms = [LogDetTerm(OWN_SHARE / basis.shape[1], basis)]
    for question, share in zip(questions, weights * ((1.0 - OWN_SHARE) / weights.sum()), strict=True):
        others = frame.span(question.taken)
        signal = frame.columns @ question.signal
        left = signal - others @ (others.T @ signal)
        terms.append(LogDetTerm(float(share), np.column_stack([others, left / np.linalg.norm(left)])))
        terms.append(LogDetTerm(-float(share), others))
    return DTCriterion(tuple(terms))
