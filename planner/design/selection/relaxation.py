"""The convex relaxation of pose selection on a few hundred candidates, in the form that :mod:`.interior_point` solves.

A weight w_i for each candidate takes the place of "chosen or not"; M(w) = sum_i w_i J_i'J_i. For a set of exactly n
poses no weight may exceed c = sum(w) / n. All problems are scaled so that no equality is needed:

    O2             min t                    subject to  I <= M(w) <= t I
    O3             min c                    subject to  I <= M(w)
    any concave f  min k c - f(M(w))        each with 0 <= w, and w <= c for exactly n poses

with f = log det M and k = P for O1, f = -2 tr M^(-1/2) and k = 1 for O5, and k = 1 for the discrimination of rivals.
Source: Boyd and Vandenberghe 2004, 7.5 (experiment design as semidefinite programme).
"""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from planner.common.units import Array
from planner.design.selection.matrix_forms import pairwise_form, quadratic_form


@dataclass(frozen=True)
class _CappedWeights:
    """One relaxation on ``rows`` (K, r, P): ``poses`` as in c = sum(w) / poses, ``capped`` for exactly that many.

    The unknowns z are the weights (K,), followed by t for O2.
    """

    rows: Array
    poses: int
    capped: bool

    @property
    def count(self) -> int:
        """The number of active candidates K."""
        return len(self.rows)

    def cap(self, z: Array) -> float:
        """The cap c of the weights."""
        return float(np.sum(z[: self.count])) / self.poses

    def mass(self, weights: Array) -> Array:
        """Information matrix M(w) of the weights w, (P, P)."""
        tall = self.rows.reshape(-1, self.rows.shape[2])
        return np.asarray((tall * np.repeat(weights, self.rows.shape[1])[:, None]).T @ tall)

    def slacks(self, z: Array) -> Array:
        """What must not be negative beside the matrices: w, and c - w when capped."""
        w = z[: self.count]
        return np.concatenate([w, np.sum(w) / self.poses - w]) if self.capped else w

    def slack_pull(self, duals: Array, size: int) -> Array:
        """Adjoint of :meth:`slacks`, padded to the ``size`` of z."""
        out = np.zeros(size)
        out[: self.count] = duals[: self.count]
        if self.capped:
            upper = duals[self.count :]
            out[: self.count] += np.sum(upper) / self.poses - upper
        return out

    def add_slack_coupling(self, ratio: Array, hessian: Array) -> None:
        """Add G' diag(ratio) G, G the derivative of :meth:`slacks`, to the leading block."""
        count = self.count
        diagonal = ratio[:count]
        if self.capped:
            upper = ratio[count:]
            share = upper / self.poses
            hessian[:count, :count] += np.sum(share) / self.poses - share[:, None] - share[None, :]
            diagonal = diagonal + upper
        hessian[np.arange(count), np.arange(count)] += diagonal

    def inner_weights(self, weights: Array) -> Array:
        """Return weights (K,) near the given ones, all of them above 0 and below their cap."""
        w = 0.9 * weights + 0.1 * np.mean(weights)
        if self.capped:
            for _ in range(200):  # rounds at most, of weights that start at their cap
                if np.max(w) < 0.97 * np.sum(w) / self.poses:
                    break
                w = np.minimum(w, 0.9 * np.sum(w) / self.poses) + 0.02 * np.mean(w)
            else:  # hardly more rows than poses: only weights that are all alike keep from the cap
                w = np.full(len(w), np.mean(w))
        return np.asarray(w)


@dataclass(frozen=True)
class EigenvalueProblem(_CappedWeights):
    """The relaxation for O3: I ≤ M(w). With ``bounded``, for O2, M(w) ≤ t I holds as well."""

    bounded: bool
    curved: ClassVar[bool] = False
    logarithmic: ClassVar[bool] = False

    def start(self, weights: Array) -> Array:
        """Return a strictly feasible point z near the given weights, where M(w) exceeds I."""
        w = self.inner_weights(weights)
        mu = np.linalg.eigvalsh(self.mass(w))
        w = w * (1.5 / mu[0])
        return np.append(w, 2.0 * mu[-1] / mu[0]) if self.bounded else w

    def objective(self, z: Array) -> float:
        """The value that is minimised: t for O2, c for O3."""
        return float(z[-1]) if self.bounded else self.cap(z)

    def slope(self, z: Array, hessian: Array) -> Array:
        """Gradient of the objective, which is not curved."""
        if self.bounded:
            return np.append(np.zeros(self.count), 1.0)
        return np.full(self.count, 1.0 / self.poses)

    def matrices(self, z: Array) -> list[Array]:
        """M - I, and t I - M for O2."""
        mass, eye = self.mass(z[: self.count]), np.eye(self.rows.shape[2])
        return [mass - eye, z[-1] * eye - mass] if self.bounded else [mass - eye]

    def changes(self, step: Array) -> list[Array]:
        """The change of :meth:`matrices` along a step."""
        mass = self.mass(step[: self.count])
        return [mass, step[-1] * np.eye(len(mass)) - mass] if self.bounded else [mass]

    def pull(self, duals: list[Array]) -> Array:
        """Adjoint of :meth:`changes`."""
        lower = quadratic_form(self.rows, duals[0])
        if not self.bounded:
            return lower
        return np.append(lower - quadratic_form(self.rows, duals[1]), np.trace(duals[1]))

    def coupling(self, inverses: list[Array], duals: list[Array]) -> Array:
        """tr(A_i S^-1 A_j X) for all pairs of unknowns, summed over the matrices."""
        size, count = self.count + self.bounded, self.count
        out = np.zeros((size, size))
        for inverse, dual in zip(inverses, duals, strict=True):
            out[:count, :count] += pairwise_form(self.rows, inverse, dual)
        if self.bounded:
            both = inverses[1] @ duals[1]
            out[:count, -1] = out[-1, :count] = -quadratic_form(self.rows, (both + both.T) / 2)
            out[-1, -1] = np.trace(both)
        return out

    def proof(self, z: Array, duals: list[Array]) -> tuple[Array, Array]:
        """Return the two dual matrices that prove the bound: those of the constraints."""
        return duals[0], duals[1] if self.bounded else np.zeros_like(duals[0])


class ConcaveFunction(Protocol):
    """A concave function f of the information matrix, which is to be as large as can be."""

    @property
    def cap_factor(self) -> float:
        """Factor k of the cap in the objective."""

    @property
    def logarithmic(self) -> bool:
        """Whether f grows by a constant when M grows by a factor; else f goes with the root of 1 / M."""

    def value(self, mass: Array) -> float:
        """f at the information ``mass`` (P, P); −inf where it is not positive definite."""

    def slope(self, mass: Array) -> Array:
        """Return the derivative of f at ``mass`` (P, P), (P, P)."""

    def curvature(self, rows: Array, mass: Array) -> Array:
        """Minus its second derivative by the weights of ``rows`` (K, r, P), (K, K)."""


@dataclass(frozen=True)
class ConcaveProblem(_CappedWeights):
    """min k c - f(M(w)) for a concave f of the information."""

    f: ConcaveFunction
    curved: ClassVar[bool] = True

    @property
    def logarithmic(self) -> bool:
        """Whether the objective is a logarithm, of which a gap is compared as it is."""
        return self.f.logarithmic

    def start(self, weights: Array) -> Array:
        """Return a strictly feasible z near the given weights."""
        w = self.inner_weights(weights)
        if self.f.logarithmic:
            return np.asarray(w * (self.poses / np.sum(w)))
        mu = np.linalg.eigvalsh(self.mass(w))  # the scale at which c = tr M^(-1/2)
        return np.asarray(w * float(np.sum(mu**-0.5) * self.poses / np.sum(w)) ** (2 / 3))

    def objective(self, z: Array) -> float:
        """The value that is minimised."""
        return self.f.cap_factor * self.cap(z) - self.f.value(self.mass(z))

    def slope(self, z: Array, hessian: Array) -> Array:
        """Gradient of the objective; its second derivative is added to ``hessian``."""
        mass = self.mass(z)
        hessian += self.f.curvature(self.rows, mass)
        return np.asarray(self.f.cap_factor / self.poses - quadratic_form(self.rows, self.f.slope(mass)))

    def matrices(self, z: Array) -> list[Array]:
        """Return no matrix: this problem has no matrix constraint."""
        return []

    changes = matrices

    def pull(self, duals: list[Array]) -> Array:
        """Return zeros: there is no constraint on matrices."""
        return np.zeros(self.count)

    def coupling(self, inverses: list[Array], duals: list[Array]) -> Array:
        """Return zeros: there is no constraint on matrices."""
        return np.zeros((self.count, self.count))

    def proof(self, z: Array, duals: list[Array]) -> tuple[Array, Array]:
        """Return the two matrices that prove the bound: the derivative of f, and zero."""
        slope = self.f.slope(self.mass(z))
        return slope, np.zeros_like(slope)


RelaxationProblem = EigenvalueProblem | ConcaveProblem


@dataclass(frozen=True)
class LogDeterminant:
    """f = log det M, for O1; ``cap_factor`` is the degree of the determinant."""

    cap_factor: float
    logarithmic: bool = True

    def value(self, mass: Array) -> float:
        """Return log det M."""
        mu = np.linalg.eigvalsh(mass)
        return float(np.sum(np.log(mu))) if mu[0] > 0 else -np.inf

    def slope(self, mass: Array) -> Array:
        """Return M^-1."""
        mu, axes = np.linalg.eigh(mass)
        return np.asarray((axes / mu) @ axes.T)

    def curvature(self, rows: Array, mass: Array) -> Array:
        """Return the pairwise products under M^-1."""
        inverse = self.slope(mass)
        return pairwise_form(rows, inverse, inverse)


@dataclass(frozen=True)
class RootTrace:
    """f = -2 tr M^(-1/2), for O5."""

    cap_factor: float = 1.0
    logarithmic: bool = False

    def value(self, mass: Array) -> float:
        """Return -2 tr M^(-1/2)."""
        mu = np.linalg.eigvalsh(mass)
        return -2 * float(np.sum(mu**-0.5)) if mu[0] > 0 else -np.inf

    def slope(self, mass: Array) -> Array:
        """Return M^(-3/2)."""
        mu, axes = np.linalg.eigh(mass)
        return np.asarray((axes * mu**-1.5) @ axes.T)

    def curvature(self, rows: Array, mass: Array) -> Array:
        """By divided differences in the eigenbasis (Daleckii and Krein).

        The kernel (l^-3/2 - m^-3/2) / (m - l) is written in square roots, so that equal eigenvalues need no care.
        """
        mu, axes = np.linalg.eigh(mass)
        root = np.sqrt(mu)
        a, b = root[:, None], root[None, :]
        kernel = (a * a + a * b + b * b) / ((a * b) ** 3 * (a + b))
        turned = rows @ axes
        pairs = np.einsum("kra,krb->kab", turned, turned) * np.sqrt(kernel)
        flat = pairs.reshape(len(pairs), -1)
        return np.asarray(flat @ flat.T)
