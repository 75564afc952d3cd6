"""The convex relaxation of pose selection on a few hundred candidates.

A weight w_i for each candidate takes the place of "chosen or not"; M(w) = sum_i w_i J_i'J_i. For a set of exactly n
poses no weight may exceed c = sum(w) / n. All problems are scaled so that no equality is needed:

    O2   min t                       subject to  I <= M(w) <= t I
    O3   min c                       subject to  I <= M(w)
    O1   min P c - log det M(w)
    O5   min c + 2 tr M(w)^(-1/2)        each with 0 <= w, and w <= c for exactly n poses

Solved by :mod:`.interior`. Source: Boyd and Vandenberghe 2004, 7.5 (experiment design as semidefinite programme).
"""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array

CAP_ROUNDS = 200  # of weights that start at their cap


@dataclass(frozen=True)
class RelaxationProblem:
    """One relaxation on ``rows`` (K, r, P): ``poses`` as in c = sum(w) / poses, ``capped`` for exactly that many.

    The unknowns z are the weights (K,), followed by t for O2.
    """

    index: str
    rows: Array
    poses: int
    capped: bool

    @property
    def count(self) -> int:
        """The number of active candidates K."""
        return len(self.rows)

    def mass(self, weights: Array) -> Array:
        """M(w), (P, P)."""
        tall = self.rows.reshape(-1, self.rows.shape[2])
        return np.asarray((tall * np.repeat(weights, self.rows.shape[1])[:, None]).T @ tall)

    def matrices(self, z: Array) -> list[Array]:
        """The matrices (P, P) that must be positive semidefinite at z: M - I, and t I - M for O2."""
        if self.index not in ("O2", "O3"):
            return []
        mass, eye = self.mass(z[: self.count]), np.eye(self.rows.shape[2])
        return [mass - eye] if self.index == "O3" else [mass - eye, z[-1] * eye - mass]

    def changes(self, step: Array) -> list[Array]:
        """The change of :meth:`matrices` along a step."""
        if self.index not in ("O2", "O3"):
            return []
        mass = self.mass(step[: self.count])
        return [mass] if self.index == "O3" else [mass, step[-1] * np.eye(len(mass)) - mass]

    def pull(self, duals: list[Array]) -> Array:
        """Adjoint of :meth:`changes`: <dA/dz_j, X> summed over the matrices, like z."""
        if not duals:
            return np.zeros(self.count)
        lower = quadratic_form(self.rows, duals[0])
        if self.index == "O3":
            return lower
        return np.append(lower - quadratic_form(self.rows, duals[1]), np.trace(duals[1]))

    def coupling(self, inverses: list[Array], duals: list[Array]) -> Array:
        """tr(A_i S^-1 A_j X) for all pairs of unknowns, summed over the matrices (S^-1 and X symmetric)."""
        size, count = self.count + (self.index == "O2"), self.count
        out = np.zeros((size, size))
        for inverse, dual in zip(inverses, duals, strict=True):
            out[:count, :count] += _pairwise(self.rows, inverse, dual)
        if self.index == "O2":
            both = inverses[1] @ duals[1]
            out[:count, -1] = out[-1, :count] = -quadratic_form(self.rows, (both + both.T) / 2)
            out[-1, -1] = np.trace(both)
        return out

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

    def objective(self, z: Array) -> float:
        """The value that is minimised."""
        cap = float(np.sum(z[: self.count])) / self.poses
        if self.index == "O2":
            return float(z[-1])
        if self.index == "O3":
            return cap
        mu = np.linalg.eigvalsh(self.mass(z))
        if mu[0] <= 0:
            return np.inf
        return len(mu) * cap - float(np.sum(np.log(mu))) if self.index == "O1" else cap + 2 * float(np.sum(mu**-0.5))

    def slope(self, z: Array, hessian: Array) -> Array:
        """Gradient of the objective; its second derivative is added to ``hessian``."""
        if self.index == "O2":
            return np.append(np.zeros(self.count), 1.0)
        if self.index == "O3":
            return np.full(self.count, 1.0 / self.poses)
        mu, axes = np.linalg.eigh(self.mass(z))
        if self.index == "O1":
            inverse = (axes / mu) @ axes.T
            hessian += _pairwise(self.rows, inverse, inverse)
            return np.asarray(len(mu) / self.poses - quadratic_form(self.rows, inverse))
        hessian += _root_curvature(self.rows, mu, axes)
        return np.asarray(1.0 / self.poses - quadratic_form(self.rows, (axes * mu**-1.5) @ axes.T))

    def proof(self, z: Array, duals: list[Array]) -> tuple[Array, Array]:
        """The matrices X, Y (P, P) that a certificate is made of (Y is zero but for O2)."""
        size = self.rows.shape[2]
        if duals:
            return duals[0], duals[1] if self.index == "O2" else np.zeros((size, size))
        mu, axes = np.linalg.eigh(self.mass(z))
        return (axes * mu ** (-1.0 if self.index == "O1" else -1.5)) @ axes.T, np.zeros((size, size))


def quadratic_form(rows: Array, matrix: Array) -> Array:
    """Return <matrix, J_i'J_i> (n,) for rows (n, r, P) and a symmetric matrix (P, P)."""
    tall = rows.reshape(-1, rows.shape[2])
    values = np.einsum("ij,ij->i", tall @ matrix, tall)
    return np.asarray(values.reshape(len(rows), -1).sum(axis=1))


def _pairwise(rows: Array, left: Array, right: Array) -> Array:
    """tr(left M_i right M_j) for all pairs, (K, K)."""
    tall = rows.reshape(-1, rows.shape[2])
    products = tall @ left @ tall.T
    products *= products if right is left else tall @ right @ tall.T
    r = rows.shape[1]
    return np.asarray(products if r == 1 else products.reshape(len(rows), r, len(rows), r).sum(axis=(1, 3)))


def _root_curvature(rows: Array, mu: Array, axes: Array) -> Array:
    """Second derivative of 2 tr M^(-1/2), by divided differences in the eigenbasis (Daleckii and Krein)."""
    # (l^-3/2 - m^-3/2) / (m - l), written in square roots so that equal eigenvalues need no care
    root = np.sqrt(mu)
    a, b = root[:, None], root[None, :]
    kernel = (a * a + a * b + b * b) / ((a * b) ** 3 * (a + b))
    turned = rows @ axes
    pairs = np.einsum("kra,krb->kab", turned, turned) * np.sqrt(kernel)
    flat = pairs.reshape(len(pairs), -1)
    return np.asarray(flat @ flat.T)


def interior_start(problem: RelaxationProblem, weights: Array) -> Array:
    """Return a strictly feasible z near the given weights: some of each, none at its cap, M above I."""
    w = 0.9 * weights + 0.1 * np.mean(weights)
    if problem.capped:
        for _ in range(CAP_ROUNDS):
            if np.max(w) < 0.97 * np.sum(w) / problem.poses:
                break
            w = np.minimum(w, 0.9 * np.sum(w) / problem.poses) + 0.02 * np.mean(w)
        else:  # hardly more rows than poses: only weights that are all alike keep from the cap
            w = np.full(len(w), np.mean(w))
    if problem.index == "O1":
        return np.asarray(w * (problem.poses / np.sum(w)))
    mu = np.linalg.eigvalsh(problem.mass(w))
    if problem.index == "O5":  # the scale at which c = tr M^(-1/2)
        return np.asarray(w * float(np.sum(mu**-0.5) * problem.poses / np.sum(w)) ** (2 / 3))
    w = w * (1.5 / mu[0])
    return np.append(w, 2.0 * mu[-1] / mu[0]) if problem.index == "O2" else w
