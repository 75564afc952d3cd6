"""Mean and covariance of parameters whose prior sizes are known by draws: the mixture over the draws."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, rq, solve_triangular

from planner.common.units import Array

EACH = 8  # robots drawn with each of the sizes
LEAST_VARIANCE = 1e-12  # of a direction in prior sizes, so that the information stays finite


@dataclass(frozen=True)
class SizeMixture:
    """Draws of the sizes, all equally likely.

    Attributes:
        size: of every parameter over its prior size, (d, P), 0 where it does not act.
        ease: variance of the noise over that of the problem, (d,).
    """

    size: Array
    ease: Array

    @property
    def scaled(self) -> Array:
        """Sizes that go with the problem's noise as it is, (d, P): of them mean and shrinkage are the same."""
        return np.asarray(self.size / np.sqrt(self.ease)[:, None])

    def mean(self, gram: Array, z: Array) -> Array:
        """Return the mean (P,) in prior sizes.

        Args:
            gram: products of rows per prior size and residuals, (P + 1, P + 1), linearised about ``z``.
            z: values in prior sizes, (P,).
        """
        return np.asarray(np.mean([draw.mean for draw in self._each(gram, z)], axis=0))

    def information_root(self, gram: Array, z: Array) -> Array:
        """Return R (P, P), upper triangular, with (RᵀR)⁻¹ the covariance within and between the draws."""
        within, means = np.zeros((len(z), len(z))), []
        for draw in self._each(gram, z):
            spread = draw.ease * draw.own[:, None] * cho_solve(draw.factor, np.diag(draw.own))
            within[np.ix_(draw.acting, draw.acting)] += spread / len(self.size)
            means.append(draw.mean)
        apart = np.array(means) - np.mean(means, axis=0)
        covariance = within + apart.T @ apart / len(means)
        unit = np.sqrt(np.diag(covariance))
        values, axes = np.linalg.eigh(covariance / np.outer(unit, unit))
        root = unit[:, None] * axes * np.sqrt(np.maximum(values, LEAST_VARIANCE))
        return np.asarray(np.linalg.inv(rq(root)[0]))

    def draw_errors(self, gram: Array, z: Array, seed: int = 0) -> Array:
        """Return parameters drawn from the mixture, in prior sizes, (P, d · EACH)."""
        rng = np.random.default_rng(seed)
        out = np.zeros((len(z), len(self.size), EACH))
        for k, draw in enumerate(self._each(gram, z)):
            unit = solve_triangular(draw.factor[0], rng.standard_normal((len(draw.own), EACH)), trans=1, lower=True)
            out[:, k] = draw.mean[:, None]
            out[draw.acting, k] += np.sqrt(draw.ease) * draw.own[:, None] * unit
        return out.reshape(len(z), -1)

    def _each(self, gram: Array, z: Array) -> Iterator["_DrawnFit"]:
        for size, ease in zip(self.scaled, self.ease, strict=True):
            acting, own = np.flatnonzero(size), size[size > 0]
            information = own[:, None] * gram[np.ix_(acting, acting)] * own + np.eye(len(acting))
            factor = cho_factor(information, lower=True)
            idle = np.where(size > 0, 0.0, z)  # goes to zero
            right = gram[acting, -1] + gram[acting, :-1] @ idle
            mean = np.zeros(len(z))
            mean[acting] = z[acting] + own * cho_solve(factor, own * right - z[acting] / own)
            yield _DrawnFit(mean, acting, own, factor, float(ease))


@dataclass(frozen=True)
class _DrawnFit:
    """The fit with one draw of the sizes.

    ``mean`` (P,) in prior sizes; ``own`` (a,) sizes of the parameters ``acting`` (a,), and ``factor``, Cholesky's, of
    the information per these sizes; ``ease`` is the variance of the noise over the problem's.
    """

    mean: Array
    acting: np.ndarray
    own: Array
    factor: tuple[Array, bool]
    ease: float
