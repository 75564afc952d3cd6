"""The fit with each draw of the sizes, and the mixture of them all."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.linalg.lapack import dpotri, dtrtri

from planner.common.arrays import mirror_lower
from planner.common.units import Array

EACH = 8  # robots drawn with each of the sizes


@dataclass(frozen=True)
class SizeMixture:
    """Draws of the sizes, all equally likely.

    Attributes:
        size: of every parameter over its prior sigma, (d, P), 0 where it does not act.
        ease: variance of the noise over that of the problem, (d,).
    """

    size: Array
    ease: Array

    @property
    def scaled_sizes(self) -> Array:
        """Sizes that go with the problem's noise as it is, (d, P): of them mean and shrinkage are the same."""
        return np.asarray(self.size / np.sqrt(self.ease)[:, None])

    def mean(self, gram: Array, z: Array) -> Array:
        """Return the mean (P,) in prior sigmas.

        Args:
            gram: products of rows per prior sigma and residuals, (P + 1, P + 1), linearised about ``z``.
            z: values in prior sigmas, (P,).
        """
        return np.asarray(np.mean([draw.mean for draw in self._fit_each_draw(gram, z)], axis=0))

    def moments(self, gram: Array, z: Array, each: int = EACH, seed: int = 0) -> "MixtureMoments":
        """Return mean and information of the mixture, and so many robots drawn with each draw of the sizes."""
        covariance, means, drawn = np.zeros((len(z), len(z))), [], [np.zeros((len(z), 0))]
        rng = np.random.default_rng(seed)
        for draw in self._fit_each_draw(gram, z):
            unit = solve_triangular(draw.factor, rng.standard_normal((len(draw.own), each)), trans=1, lower=True)
            drawn.append(np.repeat(draw.mean[:, None], each, axis=1))
            drawn[-1][draw.acting] += np.sqrt(draw.ease) * draw.own[:, None] * unit
            means.append(draw.mean)
            within = dpotri(draw.factor, lower=1, overwrite_c=1)[0]  # what stands above the diagonal is nothing
            within *= draw.ease / len(self.size) * draw.own[:, None]
            within *= draw.own
            covariance[np.ix_(draw.acting, draw.acting)] += within
        mean = np.mean(means, axis=0)
        apart = np.array(means) - mean
        mirror_lower(covariance)
        covariance += apart.T @ apart / len(means)
        unit = np.sqrt(np.diag(covariance))
        unit = np.where(unit > 0, unit, 1.0)  # of what acts in no draw
        covariance /= np.outer(unit, unit)
        covariance.flat[:: len(z) + 1] += 1e-12  # of every direction, so that the information stays finite
        root = np.linalg.cholesky(covariance[::-1, ::-1])[::-1, ::-1]  # from the last to the first: upper triangular
        return MixtureMoments(mean, np.asarray(dtrtri(unit[:, None] * root)[0]), np.concatenate(drawn, axis=1))

    def _fit_each_draw(self, gram: Array, z: Array) -> Iterator["_DrawnFit"]:
        for size, ease in zip(self.scaled_sizes, self.ease, strict=True):
            acting, own = np.flatnonzero(size), size[size > 0]
            information = gram[np.ix_(acting, acting)]
            information *= own[:, None]
            information *= own
            information.flat[:: len(own) + 1] += 1.0
            factor = cho_factor(information.T, lower=True, overwrite_a=True, check_finite=False)[0]
            idle = np.where(size > 0, 0.0, z)  # goes to zero
            right = gram[acting, -1] + gram[acting, :-1] @ idle
            mean = np.zeros(len(z))
            mean[acting] = z[acting] + own * cho_solve((factor, True), own * right - z[acting] / own)
            yield _DrawnFit(mean, acting, own, factor, float(ease))


@dataclass(frozen=True)
class _DrawnFit:
    """The fit with one draw of the sizes.

    ``mean`` (P,) in prior sigmas; ``own`` (a,) sizes of the parameters ``acting`` (a,), and ``factor``, Cholesky's, of
    the information per these sizes, its lower triangle; ``ease`` is the variance of the noise over the problem's.
    """

    mean: Array
    acting: np.ndarray
    own: Array
    factor: Array
    ease: float


@dataclass(frozen=True)
class MixtureMoments:
    """What a mixture says of the parameters, in prior sigmas.

    Attributes:
        mean: of all parameters, (P,).
        information_root: R (P, P), upper triangular, with (RᵀR)⁻¹ the covariance within and between the draws.
        drawn: parameters drawn from it, (P, n).
    """

    mean: Array
    information_root: Array
    drawn: Array
