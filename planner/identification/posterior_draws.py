"""Sizes of random effects, drawn from their posterior: which families act at all, how large they are, and the noise.

The model is y = X S z + e with z ~ N(0, 1), S the diagonal of sizes and independent noise e whose variance is a sum of
components of unknown size. Columns of a family share a factor on their prior sizes. It is one of a few values; for the
families of the background the first is 0, and likely: a spike and a slab (Mitchell and Beauchamp 1988, JASA 83(404)).
The factors are drawn one after the other with z averaged over (Gibbs sampling, collapsed; George and McCulloch 1997,
Statistica Sinica 7(2)), the noise by Metropolis' rule. A single best set of sizes would hide how little a run says of
them; the average over the draws does not.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from planner.common.units import Array

SWEEPS, BURN_IN = 60, 15  # through all families, and how many of them are forgotten
NOISE_EVERY = 2  # sweeps between draws of the noise
NOISE_TRIES = 4  # proposals of one draw of the noise
NOISE_STEP = 1.5  # of a proposal's logarithm, times 1/√readings
NOISE_LOGS = (-4.0, 6.0)  # of the noise, beyond which nothing is believed
SURE = 1e-12  # least share of a direction's variance that the readings leave


@dataclass(frozen=True)
class SizePrior:
    """Factors (k,) that a family's sizes may have, and their probabilities (k,)."""

    factors: Array
    probability: Array


@dataclass(frozen=True)
class SizeDraw:
    """Factor of every family, (f,), and logarithms of the noise's components over the declared ones, (c,)."""

    factors: Array
    noise_logs: Array


@dataclass(frozen=True)
class RandomEffects:
    """A linear model of random effects in families.

    Attributes:
        columns: of the effects per prior size, (m, p).
        y: readings less what is expected, (m,).
        family: number of each column's family, −1 for those whose size is known, (p,) int.
        noise: variance of each reading by component of the noise as declared, (m, c).
        priors: of the factors of the families, (f,).
        noise_precision: of the normal prior about 0 on the logarithms of the noise's components, (c, c).
    """

    columns: Array
    y: Array
    family: np.ndarray
    noise: Array
    priors: tuple[SizePrior, ...]
    noise_precision: Array

    def sizes(self, factors: Array) -> Array:
        """Return the factor of each column, (p,), at factors of the families (f,)."""
        return np.asarray(np.append(factors, 1.0)[self.family])

    def variance(self, noise_logs: Array) -> Array:
        """Return the variance of each reading, (m,)."""
        return np.asarray(self.noise @ np.exp(2 * noise_logs))

    def deviance(self, draw: SizeDraw) -> float:
        """Minus twice the log density of the readings and of the noise's size, without a constant."""
        sizes, variance = self.sizes(draw.factors), self.variance(draw.noise_logs)
        white = (self.columns * sizes)[:, sizes > 0] / np.sqrt(variance)[:, None]
        y = self.y / np.sqrt(variance)
        few = white.shape[1] <= len(y)
        L = cholesky(np.eye(min(white.shape)) + (white.T @ white if few else white @ white.T), lower=True)
        half = solve_triangular(L, white.T @ y if few else y, lower=True)
        square = y @ y - half @ half if few else half @ half
        prior = draw.noise_logs @ self.noise_precision @ draw.noise_logs
        return float(np.log(variance).sum() + 2 * np.log(np.diag(L)).sum() + square + prior)


def draw_sizes(model: RandomEffects, start: SizeDraw, seed: int = 0) -> tuple[SizeDraw, ...]:
    """Return draws of the sizes from their posterior, (SWEEPS − BURN_IN,)."""
    rng = np.random.default_rng(seed)
    chain = _Chain(model, start)
    out = []
    for sweep in range(SWEEPS):
        if sweep % NOISE_EVERY == 0:
            chain.draw_noise(rng)
        for family in range(len(model.priors)):
            chain.draw_factor(family, rng)
        out.append(SizeDraw(chain.factors.copy(), chain.noise_logs))
    return tuple(out[BURN_IN:])


class _Chain:
    """Where the draws stand; with C the covariance of the readings: Q = XᵀC⁻¹X (p, p) and q = XᵀC⁻¹y (p,)."""

    def __init__(self, model: RandomEffects, start: SizeDraw):
        self.model = model
        self.factors = start.factors.copy()
        self.noise_logs = start.noise_logs
        self.members = [np.flatnonzero(model.family == f) for f in range(len(model.priors))]

    def draw_noise(self, rng: np.random.Generator) -> None:
        """Draw the noise with the sizes as they are, and compute Q and q anew."""
        here = self.model.deviance(SizeDraw(self.factors, self.noise_logs))
        step = NOISE_STEP / np.sqrt(len(self.model.y))
        for move in rng.standard_normal((NOISE_TRIES, len(self.noise_logs))) * max(step, 0.05):
            trial = np.clip(self.noise_logs + move, *NOISE_LOGS)
            there = self.model.deviance(SizeDraw(self.factors, trial))
            if np.log(rng.uniform()) < 0.5 * (here - there):
                self.noise_logs, here = trial, there
        self._compute()

    def _compute(self) -> None:
        """Compute Q and q: columns of known size by a QR decomposition, for they may be very wide, then the others."""
        model = self.model
        root = np.sqrt(model.variance(self.noise_logs))
        white = np.column_stack([model.columns, model.y]) / root[:, None]
        known = model.family < 0
        wide, count = white[:, :-1][:, known], int(known.sum())
        basis = np.linalg.qr(np.vstack([wide, np.eye(count)]))[0][: len(root)]
        wide = basis @ (basis.T @ white)
        left = white - wide
        gram = left.T @ white  # = whiteᵀ(1 − basis basisᵀ)white
        self.Q, self.q = gram[:-1, :-1], gram[:-1, -1]
        for family in np.flatnonzero(self.factors):
            values, axes = np.linalg.eigh(self.Q[np.ix_(self.members[family], self.members[family])])
            self._add(int(family), self.factors[family] ** 2, np.maximum(values, 0.0), axes)

    def draw_factor(self, family: int, rng: np.random.Generator) -> None:
        """Draw the factor of one family with all others as they are."""
        prior, which = self.model.priors[family], self.members[family]
        values, axes = np.linalg.eigh(self.Q[np.ix_(which, which)])
        values = np.maximum(values, 0.0)
        toward = (axes.T @ self.q[which]) ** 2
        more = (prior.factors**2 - self.factors[family] ** 2)[:, None]
        grown = np.maximum(1 + more * values, SURE)
        log = 0.5 * (more * toward / grown - np.log(grown)).sum(axis=1) + np.log(prior.probability)
        chance = np.exp(log - log.max())
        chosen = float(prior.factors[rng.choice(len(chance), p=chance / chance.sum())])
        if chosen != self.factors[family]:
            self._add(family, chosen**2 - self.factors[family] ** 2, values, axes)
            self.factors[family] = chosen

    def _add(self, family: int, variance: float, values: Array, axes: Array) -> None:
        """Add ``variance`` times the family's columns to C; values and axes of its part of Q (Woodbury)."""
        turned = self.Q[:, self.members[family]] @ axes
        gain = variance / np.maximum(1 + variance * values, SURE)
        toward = axes.T @ self.q[self.members[family]]
        self.q = self.q - turned @ (gain * toward)
        self.Q = self.Q - (turned * gain) @ turned.T
