"""Random effects of unknown size: evidence of a linear model, its gradient, and the sizes that maximise it.

The model is y = X S z + e with z ~ N(0, 1), S the diagonal of sizes, a common factor on those of each family, and
independent noise e whose variance is a sum of components of unknown size. The evidence is that of y with z averaged
over: restricted maximum likelihood where some columns have very wide sizes (Patterson and Thompson 1971, Biometrika
58(3); MacKay 1992, Neural Computation 4(3)). All is computed among columns or among readings, whichever are fewer.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from planner.common.units import Array

LOGS = (-7.0, 4.0)  # of the factor of a family, outside which nothing changes any more
NOISE_LOGS = (-4.0, 6.0)  # the same of the noise
MOST_STEPS = 150
FLAT = 1e-6  # relative fall of the objective that ends the search


@dataclass(frozen=True)
class GaussianPosterior:
    """What readings say of z, and how likely they are.

    Attributes:
        mean: of z, (p,).
        left: variance of each z that is left, 0 … 1, (p,).
        residual: y − X S mean in standard deviations, (m,).
        leverage: of each reading, 0 … 1, (m,).
        deviance: minus twice the logarithm of the evidence, without its constant.
    """

    mean: Array
    left: Array
    residual: Array
    leverage: Array
    deviance: float

    @classmethod
    def of(cls, columns: Array, y: Array, variance: Array) -> "GaussianPosterior":
        """Condition z on readings y (m,) with columns X S (m, p) and noise of ``variance`` (m,)."""
        root = np.sqrt(variance)
        white, scaled = columns / root[:, None], y / root
        few = white.shape[1] <= len(y)
        return (_among_columns if few else _among_readings)(white, scaled, float(np.log(variance).sum()))


def _among_columns(white: Array, y: Array, log_noise: float) -> GaussianPosterior:
    """Condition by the information WᵀW + 1, (p, p)."""
    L = cho_factor(white.T @ white + np.eye(white.shape[1]), lower=True)[0]
    half = solve_triangular(L, white.T @ y, lower=True)
    inverse = solve_triangular(L, np.eye(len(half)), lower=True)
    mean = inverse.T @ half
    spread = white @ inverse.T
    deviance = log_noise + 2 * float(np.log(np.diag(L)).sum()) + float(y @ y - half @ half)
    left = np.einsum("ij,ij->j", inverse, inverse)
    return GaussianPosterior(mean, left, y - white @ mean, np.einsum("ij,ij->i", spread, spread), deviance)


def _among_readings(white: Array, y: Array, log_noise: float) -> GaussianPosterior:
    """Condition by the covariance of the readings WWᵀ + 1, (m, m)."""
    L = cho_factor(white @ white.T + np.eye(len(y)), lower=True)[0]
    inverse = solve_triangular(L, np.eye(len(y)), lower=True)
    half, seen = inverse @ y, inverse @ white
    residual = inverse.T @ half
    deviance = log_noise + 2 * float(np.log(np.diag(L)).sum()) + float(half @ half)
    left = 1.0 - np.einsum("ij,ij->j", seen, seen)
    leverage = 1.0 - np.einsum("ij,ij->j", inverse, inverse)
    return GaussianPosterior(seen.T @ half, left, residual, leverage, deviance)


@dataclass(frozen=True)
class RandomEffects:
    """A linear model of random effects in families, each with a factor on its prior sizes.

    Attributes:
        columns: of the effects per prior size, (m, p).
        y: readings less what is expected, (m,).
        family: number of each column's family, −1 for those whose size is known, (p,) int.
        noise: variance of each reading by component of the noise as declared, (m, c).
        centre, precision: of the normal prior on the logarithms of the factors, those of the families first and then
            those of the noise's components, (f + c,) and (f + c, f + c).
    """

    columns: Array
    y: Array
    family: np.ndarray
    noise: Array
    centre: Array
    precision: Array

    @property
    def families(self) -> int:
        """Number f of families."""
        return len(self.centre) - int(self.noise.shape[1])

    def sizes(self, logs: Array) -> Array:
        """Factor of each column, (p,), at logarithms of all factors (f + c,)."""
        return np.asarray(np.exp(np.append(logs[: self.families], 0.0))[self.family])

    def posterior(self, logs: Array) -> GaussianPosterior:
        """Condition at logarithms of all factors, families first (f + c,)."""
        variance = self.noise @ np.exp(2 * logs[self.families :])
        return GaussianPosterior.of(self.columns * self.sizes(logs), self.y, variance)

    def objective(self, logs: Array) -> tuple[float, Array]:
        """Minus twice the logarithm of evidence times prior of the factors, and its gradient by their logarithms.

        With v the variance that is left of each z: ∂/∂log s = 2 Σ (1 − v − mean²) over a family; with h the leverage
        and r the residual of each reading in standard deviations: ∂/∂log v = 1 − h − r².
        """
        count = self.families
        found = self.posterior(logs)
        parts = self.noise * np.exp(2 * logs[count:])
        pull = 2 * (1 - found.left - found.mean**2)
        known = self.family >= 0
        of_family = np.bincount(self.family[known], pull[known], minlength=count)
        of_noise = 2 * (parts / parts.sum(axis=1)[:, None]).T @ (1 - found.leverage - found.residual**2)
        away = self.precision @ (logs - self.centre)
        prior = float((logs - self.centre) @ away)
        return found.deviance + prior, np.append(of_family, of_noise) + 2 * away

    def learn(self, start: Array | None = None, steps: int = MOST_STEPS) -> "LearntSizes":
        """Find the factors at which evidence times prior is largest, from ``start`` (f + c,), in ``steps`` at most."""
        from scipy.optimize import minimize

        first = self.centre if start is None else start
        bounds = [LOGS] * self.families + [NOISE_LOGS] * (len(first) - self.families)
        options = {"maxiter": steps, "ftol": FLAT}
        found = minimize(self.objective, first, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
        return LearntSizes(np.asarray(found.x), float(found.fun), self)


@dataclass(frozen=True)
class LearntSizes:
    """Factors that were learnt: logarithms, families first and then the noise (f + c,), and the objective there."""

    logs: Array
    objective: float
    model: RandomEffects

    @property
    def factors(self) -> Array:
        """Factor of each column, (p,)."""
        return self.model.sizes(self.logs)

    @property
    def noise(self) -> Array:
        """Size of each component of the noise over the declared one, (c,)."""
        return np.exp(self.logs[self.model.families :])
