"""A linear model with normal parameters and normal noise: evidence, marginals, predictions, another prior.

    y = X z + e,    z ~ N(0, diag(s²)),    e ~ N(0, diag(σ²)),    so that    y ~ N(0, C),  C = diag(σ²) + X diag(s²) Xᵀ

(Rasmussen and Williams 2006, Gaussian Processes for Machine Learning, 2.1; Bishop 2006, Pattern Recognition and Machine
Learning, 3.3 and 3.5). A parameter with s = 0 is absent. All is computed among the readings, by σ C⁻¹ σ: a prior that
changes is then a change of low rank, however many parameters there are.

Example:
    >>> import numpy as np
    >>> model = LinearGaussian(np.ones((4, 1)), prior=np.array([2.0]), noise=np.ones(4))
    >>> known = model.marginal(np.array([1.0, 2.0, 1.5, 1.5]))
    >>> bool(np.isclose(known.mean[0], 4 * 1.5 / (4 + 1 / 2.0**2)))
    True
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dtrtri

from planner.common.units import Array
from planner.model.row_basis import posterior_basis

EVERY = slice(None)
LEAST_LEFT_SHARE = 1e-12  # of a direction's variance that a smaller prior leaves: below, rounding alone is left


class Normal(NamedTuple):
    """Mean (k,) and covariance (k, k)."""

    mean: Array
    covariance: Array


@dataclass(frozen=True)
class LinearGaussian:
    """The model of the module's text.

    Attributes:
        columns: X, (n, P).
        prior: s, standard deviations of the parameters, (P,); 0: absent.
        noise: σ, standard deviations of the readings, (n,).
    """

    columns: Array
    prior: Array
    noise: Array

    @cached_property
    def white(self) -> Array:
        """Columns in standard deviations of the noise, σ⁻¹ X, (n, P)."""
        return np.asarray(self.columns / self.noise[:, None])

    @cached_property
    def acting(self) -> np.ndarray:
        """Positions of the parameters that act, (a,) int."""
        return np.flatnonzero(self.prior)

    @cached_property
    def _factors(self) -> tuple[Array | None, Array]:
        """Q (n, a) with K = 1 − Q Qᵀ, and R, upper triangular, of 1 + AᵀA with A = σ⁻¹ X s of what acts.

        Where more parameters act than there are readings, no Q, and R of 1 + AAᵀ. By an orthonormal basis: priors wider
        than the noise by many orders of magnitude leave K as exact.
        """
        A = self.white[:, self.acting] * self.prior[self.acting]
        n, a = A.shape
        if a <= n:
            return posterior_basis(A, 1.0)
        return None, np.asarray(np.linalg.qr(np.vstack([A.T, np.eye(n)]), mode="r"))

    @cached_property
    def inverse(self) -> Array:
        """K = σ C⁻¹ σ, (n, n)."""
        Q, R = self._factors
        if Q is not None:
            return np.eye(len(Q)) - Q @ Q.T
        root = np.asarray(dtrtri(R)[0])
        return np.asarray(root @ root.T)

    @cached_property
    def log_det(self) -> float:
        """Logarithm of the determinant of σ⁻¹ C σ⁻¹."""
        if "inverse" in self.__dict__ and "_factors" not in self.__dict__:
            return -float(np.linalg.slogdet(self.inverse)[1])
        return 2.0 * float(np.log(np.abs(np.diag(self._factors[1]))).sum())

    def log_evidence(self, y: Array) -> float:
        """Return the log density of readings y (n,)."""
        white = y / self.noise
        constant = 2.0 * float(np.log(self.noise).sum()) + len(y) * float(np.log(2 * np.pi))
        return -0.5 * (float(white @ self.inverse @ white) + self.log_det + constant)

    def products(self, which: slice | np.ndarray) -> Array:
        """Return XᵀC⁻¹X of some columns, (k, k)."""
        own = self.white[:, which]
        return np.asarray(own.T @ self.inverse @ own)

    def through(self, vectors: Array) -> tuple[Array, Array]:
        """Return u (m, r) and v (m, k) with which vectors (m, n) have the products w K wᵀ = u uᵀ − v vᵀ."""
        Q, R = self._factors
        if Q is not None:
            return vectors, vectors @ Q
        return np.asarray(vectors @ dtrtri(R)[0]), np.zeros((len(vectors), 0))

    def toward(self, y: Array, which: slice | np.ndarray = EVERY) -> Array:
        """Return XᵀC⁻¹y of some columns, (k,)."""
        return np.asarray(self.white[:, which].T @ (self.inverse @ (y / self.noise)))

    def mean(self, y: Array) -> Array:
        """Return the mean of all parameters after readings y (n,), (P,)."""
        return np.asarray(self.prior**2 * self.toward(y))

    def variance(self) -> Array:
        """Return the variance of all parameters after the readings, (P,)."""
        shown = np.einsum("nj,nj->j", self.white, self.inverse @ self.white)
        return np.asarray(np.maximum(self.prior**2 - self.prior**4 * shown, 0.0))

    def marginal(self, y: Array, which: np.ndarray | slice = EVERY) -> Normal:
        """Return what readings y (n,) say of parameters ``which`` (k,) int, of all if not given."""
        square = self.prior[which] ** 2
        covariance = np.diag(square) - square[:, None] * self.products(which) * square
        return Normal(square * self.toward(y, which), covariance)

    def reduction(self, rows: Array) -> Array:
        """Return what the readings take off the covariance of others without noise, ``rows`` (m, P), (m, m)."""
        through = (rows * self.prior**2) @ self.white.T
        return np.asarray(through @ self.inverse @ through.T)

    def predict(self, rows: Array, y: Array) -> Normal:
        """Return what readings y (n,) say of others without noise, ``rows`` (m, P) of the same parameters."""
        return Normal(rows @ self.mean(y), (rows * self.prior**2) @ rows.T - self.reduction(rows))

    def scale_noise(self, factor: float) -> "LinearGaussian":
        """Return the model with all noise a factor as large."""
        kept, axes = np.linalg.eigh(self.inverse)  # of each direction the noise's share in the readings' variance
        kept, more = np.clip(kept, 1e-300, 1.0), factor**2
        now = more / (more + 1.0 / kept - 1.0)
        out = replace(self, noise=self.noise * factor)
        out.__dict__["inverse"] = (axes * now) @ axes.T
        return out

    def change(self, which: slice | np.ndarray, prior: Array | float, least: float = LEAST_LEFT_SHARE) -> "Change":
        """Return what other priors (k,) of parameters ``which`` change of K (Woodbury's identity, principal axes).

        What becomes wider is taken first, then what becomes narrower. Directions of which the readings' variance
        changes by less than a share ``least`` are left out.
        """
        square = self.prior[which] ** 2
        more = np.broadcast_to(np.square(prior), square.shape) - square
        own, growth = self.white[:, which], 0.0
        sides, signs = list[Array](), list[Array]()
        for sign in (1.0, -1.0):
            moved = own[:, sign * more > 0] * np.sqrt(np.abs(more[sign * more > 0]))
            if not moved.shape[1]:
                continue
            through = self.inverse @ moved
            for side in sides:  # what has become wider just now
                through = through - side @ (side.T @ moved)
            values, axes = np.linalg.eigh(moved.T @ through)
            grown = np.maximum(1.0 + sign * np.maximum(values, 0.0), LEAST_LEFT_SHARE)
            told = values > least
            sides.append(through @ (axes[:, told] / np.sqrt(grown[told])))
            signs.append(np.full(sides[-1].shape[1], sign))
            growth += float(np.log(grown).sum())
        if not sides:
            return Change(np.zeros((len(own), 0)), np.zeros(0), 0.0)
        return Change(np.hstack(sides), np.concatenate(signs), growth)

    def update(self, which: slice | np.ndarray, prior: Array | float) -> "LinearGaussian":
        """Return the model with other priors (k,) of parameters ``which``, by a change of rank k."""
        return self.with_change(self.change(which, prior), which, prior)

    def with_change(self, change: "Change", which: slice | np.ndarray, prior: Array | float) -> "LinearGaussian":
        """Return the same where the change is known."""
        own = self.prior.copy()
        own[which] = prior
        out = replace(self, prior=own)
        known = {"white": self.white, "inverse": self.inverse - (change.sides * change.signs) @ change.sides.T}
        out.__dict__.update(known, log_det=self.log_det + change.log_growth)  # cached properties, known already
        return out


class Change(NamedTuple):
    """K falls by U diag(``signs``) Uᵀ, with U the ``sides`` (n, r), and ``log_det`` grows by ``log_growth``."""

    sides: Array
    signs: Array
    log_growth: float
