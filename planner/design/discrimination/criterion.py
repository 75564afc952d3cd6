"""The criterion DT: how well poses tell rivals apart, and, for a smaller part, how well they see everything else.

With M the information of all columns (in the coordinates of :class:`PoolCoordinates`) over the chosen poses, a
noncentrality is the sum of squares that is left of a truth's predicted readings, in noise variances, after the plan's
own parameters and the rival took what they can: det M(own, rival, signal) / det M(own, rival), a Schur complement.

    f(M) = (1 - k) mean over questions of log noncentrality + k / P log det M(own)

is the compound of T- and D-optimality (Atkinson 2008, J. Stat. Plan. Inference 138: DT-optimum designs; T: Atkinson and
Fedorov 1975, Biometrika 62). It is a sum of log determinants of blocks T'MT, with weights a of both signs, and concave,
since a Schur complement is concave and grows with M. It grows by log c when M grows c-fold, so that for any M*

    f(M) <= f(M*) + log <X, M>,   X = sum of a T (T'M*T)^-1 T',   <X, M*> = 1:  the certificate.

M stands with a trace of the pool's own information (``INFORMATION_RIDGE``), so that poses that miss a
question have a value too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.assumptions import INFORMATION_RIDGE, INFORMATION_SHARE, SPAN_SHARE, UNSEEN_SHARE
from planner.design.observability.information import r_factor
from planner.design.selection.matrix_forms import pairwise_form, swap_log_ratios


@dataclass(frozen=True)
class PoolCoordinates:
    """Coordinates of the columns in which the information of the whole pool is one, so that all is well conditioned.

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
        seen = mu > UNSEEN_SHARE * mu[0]
        return cls((axes[seen].T / mu[seen]) / size[:, None], mu[seen, None] * axes[seen] * size)

    def rows(self, rows: Array) -> Array:
        """Rows (n, r, P) in the new coordinates, (n, r, p)."""
        return np.asarray(rows @ self.to)

    def span(self, which: np.ndarray) -> Array:
        """Orthonormal basis (p, k) of what some columns span."""
        return orthonormal_span(self.columns[:, which], SPAN_SHARE)


def orthonormal_span(columns: Array, least: float) -> Array:
    """Orthonormal basis (m, p) of what columns (m, P) span above ``least`` of the largest singular value."""
    size = np.linalg.norm(columns, axis=0)
    out, mu, _ = np.linalg.svd(columns[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(out[:, mu > least * mu[0]])


@dataclass(frozen=True)
class DiscriminationQuestion:
    """Would readings of a truth be taken for another effect?

    Attributes:
        truth: its name.
        shows: columns of the parameters by which the truth shows, (k,) ints, and their ``values``.
        base: columns that are in the model anyway, (p,) ints; ``rival`` those of the other effect.
    """

    truth: str
    shows: np.ndarray
    values: Array
    base: np.ndarray
    rival: np.ndarray

    @property
    def alternatives(self) -> np.ndarray:
        """Columns that may explain the truth otherwise."""
        return np.union1d(self.base, self.rival)


@dataclass(frozen=True)
class LogDetTerm:
    """``weight`` times log det T'MT; ``basis`` T (p, k), orthonormal."""

    weight: float
    basis: Array

    def of(self, mass: Array) -> Array:
        """Return Tᵀ M T, (k, k)."""
        return np.asarray(self.basis.T @ mass @ self.basis + INFORMATION_RIDGE * np.eye(self.basis.shape[1]))


@dataclass(frozen=True)
class DTCriterion:
    """A sum of log determinants; ``cap_factor`` and ``logarithmic`` as in the relaxation of pose selection."""

    terms: tuple[LogDetTerm, ...]
    cap_factor: float = 1.0
    logarithmic: bool = True

    def value(self, mass: Array) -> float:
        """The criterion at information ``mass`` (p, p)."""
        return float(sum(term.weight * np.linalg.slogdet(term.of(mass))[1] for term in self.terms))

    def slope(self, mass: Array) -> Array:
        """Its derivative X (p, p)."""
        out = np.asarray(sum(weight * inverse for weight, inverse in self._inverses(mass)))
        return np.asarray((out + out.T) / 2)

    def curvature(self, rows: Array, mass: Array) -> Array:
        """Minus its second derivative by the weights of ``rows`` (n, r, p), (n, n)."""
        return np.asarray(sum(weight * pairwise_form(rows, inv, inv) for weight, inv in self._inverses(mass)))

    def swap_gains(self, inner: Array, outer: Array, mass: Array) -> Array:
        """Exact change, (n, m), when each of ``outer`` (m, r, p) takes the place of one of ``inner`` (n, r, p)."""
        return np.asarray(sum(weight * swap_log_ratios(inner, outer, inv) for weight, inv in self._inverses(mass)))

    def _inverses(self, mass: Array) -> list[tuple[float, Array]]:
        """Weight and T (T'MT)^-1 T' (p, p) of each term."""
        return [(t.weight, t.basis @ np.linalg.solve(t.of(mass), t.basis.T)) for t in self.terms]


def noncentrality(
    frame: PoolCoordinates, mass: Array, question: DiscriminationQuestion, beside: bool = True
) -> tuple[float, Array]:
    """Noncentrality at information ``mass`` (p, p), and the direction (p,) in which the truth shows beyond the other.

    ``beside`` the other effect, else beside the model alone.
    """
    basis = frame.span(question.alternatives if beside else question.base)
    signal = frame.columns[:, question.shows] @ question.values
    fit = basis @ (np.linalg.pinv(basis.T @ mass @ basis, rcond=1e-13, hermitian=True) @ (basis.T @ (mass @ signal)))
    left = signal - fit
    return max(0.0, float(left @ mass @ left)), left


def dt_criterion(
    frame: PoolCoordinates, own: np.ndarray, questions: Sequence[DiscriminationQuestion], weights: Array
) -> DTCriterion:
    """Return the criterion for questions of some weights; ``own``: columns of the plan's own parameters."""
    basis = frame.span(own)
    terms = [LogDetTerm(INFORMATION_SHARE / basis.shape[1], basis)]
    for question, share in zip(questions, weights * ((1.0 - INFORMATION_SHARE) / weights.sum()), strict=True):
        others = frame.span(question.alternatives)
        signal = frame.columns[:, question.shows] @ question.values
        left = signal - others @ (others.T @ signal)
        terms.append(LogDetTerm(float(share), np.column_stack([others, left / np.linalg.norm(left)])))
        terms.append(LogDetTerm(-float(share), others))
    return DTCriterion(tuple(terms))
