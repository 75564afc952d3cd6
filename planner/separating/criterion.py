"""The criterion DT: how well poses tell rivals apart, and, for a smaller part, how well they see everything else.

With M the information of all columns (in the coordinates of :mod:`.frame`) over the chosen poses, a noncentrality is
the sum of squares that is left of a truth's predicted readings, in noise variances, after the plan's own parameters and
the rival took what they can: det M(own, rival, signal) / det M(own, rival), a Schur complement. The criterion

    f(M) = (1 - k) mean over questions of log noncentrality + k / P log det M(own)

is the compound of T- and D-optimality (Atkinson 2008, J. Stat. Plan. Inference 138: DT-optimum designs; T: Atkinson and
Fedorov 1975, Biometrika 62). It is a sum of log determinants of blocks T'MT, with weights a of both signs, and concave,
since a Schur complement is concave and grows with M. It grows by log c when M grows c-fold, so that for any M*

    f(M) <= f(M*) + log <X, M>,   X = sum of a T (T'M*T)^-1 T',   <X, M*> = 1:  the certificate.

M stands with a trace of the pool's own information (RIDGE), so that poses that miss a question have a value too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.separating.frame import Frame
from planner.units import Array

OWN_SHARE = 0.25  # k: what is measured must still identify the robot


RIDGE = 1e-8  # of the information of the whole pool


@dataclass(frozen=True)
class Question:
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
class Term:
    """``weight`` times log det T'MT; ``basis`` T (p, k), orthonormal."""

    weight: float
    basis: Array

    def of(self, mass: Array) -> Array:
        """T'MT, (k, k)."""
        return np.asarray(self.basis.T @ mass @ self.basis + RIDGE * np.eye(self.basis.shape[1]))


@dataclass(frozen=True)
class Criterion:
    """A sum of log determinants."""

    terms: tuple[Term, ...]

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


def noncentrality(frame: Frame, mass: Array, question: Question, beside: bool = True) -> tuple[float, Array]:
    """Noncentrality at information ``mass`` (p, p), and the direction (p,) in which the truth shows beyond the other.

    ``beside`` the other effect, else beside the model alone.
    """
    basis = frame.span(question.taken if beside else question.base)
    signal = frame.columns[:, : len(question.signal)] @ question.signal
    fit = basis @ (np.linalg.pinv(basis.T @ mass @ basis, rcond=1e-13, hermitian=True) @ (basis.T @ (mass @ signal)))
    left = signal - fit
    return max(0.0, float(left @ mass @ left)), left


def criterion(frame: Frame, own: np.ndarray, questions: Sequence[Question], weights: Array) -> Criterion:
    """Return the criterion for questions of some weights; ``own``: columns of the plan's own parameters."""
    basis = frame.span(own)
    terms = [Term(OWN_SHARE / basis.shape[1], basis)]
    for question, share in zip(questions, weights * ((1.0 - OWN_SHARE) / weights.sum()), strict=True):
        others = frame.span(question.taken)
        signal = frame.columns @ question.signal
        left = signal - others @ (others.T @ signal)
        terms.append(Term(float(share), np.column_stack([others, left / np.linalg.norm(left)])))
        terms.append(Term(-float(share), others))
    return Criterion(tuple(terms))
