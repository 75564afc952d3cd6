"""The fit with each draw of the sizes, and the mixture of them all."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri, dtrtri

from planner.common.determinism import with_fixed_signs
from planner.common.units import Array, mirror_lower

EACH = 32  # robots drawn with each of the sizes: what 95 % of all stay below then scatters by 3 %, by 8 each 6 %


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
        covariance, by_noise, means = np.zeros((len(z), len(z))), np.zeros((len(z), len(z))), []
        drawn, of_noise = [np.zeros((len(z), 0))], [np.zeros((len(z), 0))]
        rng, rows = np.random.default_rng(seed), _root(gram[:-1, :-1]) if each else np.zeros((len(z), 0))
        for draw in self._fit_each_draw(gram, z):
            acting, size = draw.acting, np.sqrt(draw.ease) * draw.own[:, None]
            means.append(draw.mean)
            within = dpotri(draw.factor, lower=1, overwrite_c=1)[0]  # what stands above the diagonal is nothing
            mirror_lower(within)
            # the mean is off by (1 + SGS)⁻¹ (z − S Xᵀe): by what the prior says, and by the noise
            prior = within @ rng.standard_normal((len(acting), each))
            noise = within @ (draw.own[:, None] * (rows[acting] @ rng.standard_normal((rows.shape[1], each))))
            of_noise.append(np.zeros((len(z), each)))
            of_noise[-1][acting] = size * noise
            drawn.append(np.repeat(draw.mean[:, None], each, axis=1))
            drawn[-1][acting] += size * (prior + noise)
            each_size = size * size.T / len(self.size)
            by_noise[np.ix_(acting, acting)] += each_size * (within - within @ within)
            covariance[np.ix_(acting, acting)] += each_size * within
        mean = np.mean(means, axis=0)
        apart = np.array(means) - mean
        covariance += apart.T @ apart / len(means)
        unit = np.sqrt(np.diag(covariance))
        unit = np.where(unit > 0, unit, 1.0)  # of what acts in no draw
        covariance /= np.outer(unit, unit)
        covariance.flat[:: len(z) + 1] += 1e-12  # of every direction, so that the information stays finite
        root = np.linalg.cholesky(covariance[::-1, ::-1])[::-1, ::-1]  # from the last to the first: upper triangular
        information = np.asarray(dtrtri(unit[:, None] * root)[0])
        parts = (np.concatenate(part, axis=1) for part in (drawn, of_noise))
        return MixtureMoments(mean, information, _root(by_noise), *parts)

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
        noise_root: a root (P, P) of the part of the covariance that the readings' noise makes, and not the priors.
        drawn: parameters drawn from it, (P, n).
        of_noise: the part of their distance from the mean that the readings' noise makes, (P, n).
    """

    mean: Array
    information_root: Array
    noise_root: Array
    drawn: Array
    of_noise: Array


def _root(square: Array) -> Array:
    """Return a root (P, P) of a symmetric matrix that is not negative but for rounding."""
    unit = np.sqrt(np.maximum(np.diag(square), 0.0))
    unit = np.where(unit > 0, unit, 1.0)
    values, axes = np.linalg.eigh(square / np.outer(unit, unit))
    return np.asarray(unit[:, None] * with_fixed_signs(axes) * np.sqrt(np.maximum(values, 0.0)))
