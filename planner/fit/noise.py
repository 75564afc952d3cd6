"""One noise model for planning, fitting and tracing: σ² = gauge² + J_q Σ_q J_qᵀ, full over the numbers of a reading."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.common.units import Array
from planner.fit.assumptions import ENOUGH_FREEDOM, LEAST_NOISE_SHARE, LOG_NOISE_RANGE
from planner.model.model import Model
from planner.runs.run import Samples

RATIO = np.log(2.0)  # one sigma of the logarithm of gauge over joints: data sheets are good to a factor of two
MOST_SCORINGS = 30  # steps of Fisher's scoring at most


@dataclass(frozen=True)
class Noise:
    """How large the parts of the noise are, as multiples of what is declared.

    Attributes:
        gauge: of the gauge's noise; ``angle`` the same for a probe's orientation.
        joints: of the joints' repeatability.
    """

    gauge: float = 1.0
    joints: float = 1.0
    angle: float = 1.0

    @property
    def remarks(self) -> tuple[str, ...]:
        """Say that there is none, and what is assumed; nothing where there is some."""
        if self.gauge != least_noise():
            return ()
        return (
            "the readings fit as if they had no noise: computed readings, or the cell declares too much noise "
            f"([gauge]); {least_noise():.0%} of the declared noise is assumed",
        )


@dataclass(frozen=True)
class Whitener:
    """Turns residuals and rows into multiples of their standard deviation.

    Attributes:
        declared: variances of the gauge alone, (n, r) [m², rad²].
        shaken: covariance that the joints' repeatability adds, (n, r, r).
        noise: how large both really are.
    """

    declared: Array
    shaken: Array
    noise: Noise

    @classmethod
    def of(cls, model: Model, samples: Samples, noise: Noise | None = None) -> "Whitener":
        """Build it for the samples of a run."""
        declared = model.reading_noise(samples)
        each = np.broadcast_to(declared.gauge_variance, (len(samples), model.width))
        return cls(each, declared.robot_covariance, noise or Noise())

    def noise_axes(self, block: slice) -> tuple[Array, Array, Array]:
        """Return the axes in which the noise of gauge and joints do not mix, for the numbers ``block`` of readings.

        With D the declared covariance of the gauge and S what the joints add, S v = ρ D v (Golub and Van Loan, 8.7).

        Returns:
            Variance of the joints over the gauge's, as declared, (n, b); axes, the columns of (n, b, b), of numbers
            times ``unit``; unit (n, b), one over the gauge's standard deviations.
        """
        unit = 1 / np.sqrt(self.declared[:, block])
        ratio, axes = np.linalg.eigh(self.shaken[:, block, block] * unit[:, :, None] * unit[:, None])
        return np.maximum(ratio, 0.0), axes, unit

    @property
    def declared_rms(self) -> float:
        """Root mean square of the readings' errors by their declared noise [m]; rotations of a probe are left out."""
        robot = np.einsum("nii->n", self.shaken[:, :3, :3]).mean()
        return float(np.sqrt(self.declared[:, :3].sum(axis=1).mean() + robot))

    def take(self, which: np.ndarray) -> "Whitener":
        """Return the whitener of the readings at ``which`` (indices or a mask)."""
        return Whitener(self.declared[which], self.shaken[which], self.noise)

    def with_noise(self, noise: Noise) -> "Whitener":
        """Return the whitener for another size of the noise."""
        return Whitener(self.declared, self.shaken, noise)

    def times(self, factor: float) -> "Whitener":
        """Return the whitener for a noise that is larger by ``factor``."""
        noise = self.noise
        return self.with_noise(Noise(noise.gauge * factor, noise.joints * factor, noise.angle * factor))

    def covariance(self) -> Array:
        """Covariance of the readings, (n, r, r)."""
        noise = self.noise
        width = self.declared.shape[1]
        gauge = np.array([noise.gauge] * min(3, width) + [noise.angle] * (width - 3))
        return noise.joints**2 * self.shaken + np.eye(width) * (gauge**2 * self.declared)[:, None]

    def white(self, values: Array) -> Array:
        """Return L⁻¹ values, with L Lᵀ the covariance of the readings; values (n, r, m)."""
        return np.asarray(np.einsum("nij,njm->nim", self.root, values))

    @cached_property
    def root(self) -> Array:
        """L⁻¹ of every reading, with L Lᵀ its covariance, (n, r, r)."""
        C = self.covariance()
        if C.shape[1] == 1:
            return np.asarray(1 / np.sqrt(C))
        return np.asarray(np.linalg.inv(np.linalg.cholesky(C)))


def least_noise() -> float:
    """Return the least part of the declared noise that is believed, about a fiftieth: less is rounding, or computed."""
    return float(np.exp(LOG_NOISE_RANGE[0]))


def estimate_noise(white: Whitener, residual: Array, leverage: Array, weight: Array | None = None) -> Noise:
    """Estimate how large the noise really is from the residuals (n, r) of a fit and their leverages h (n, r).

    Rows count by their ``weight`` (n,), all alike if none is given: one outside the noise does not tell its size.

    A residual is as large as its noise times √(1 − h) (Cook and Weisberg 1982): without that the readings which hold
    the fit most would seem the least noisy, whatever their noise. Few readings keep the declared ratio of gauge and
    joints, and so do readings without noise: they have the least that is believed.
    """
    weight = np.ones(len(residual)) if weight is None else weight
    dof = float(weight.sum()) * residual.shape[1] - float(leverage.sum())
    if dof < 1:
        return white.noise
    residual = residual / np.sqrt(np.maximum(1.0 - leverage, LEAST_NOISE_SHARE))
    spread = _Spread.of(white, residual, slice(0, 3), weight)
    one = float(np.sqrt(np.average(spread.square / (1 + spread.variance_ratio), weights=spread.weight)))
    if one < least_noise():
        return Noise(least_noise(), least_noise(), least_noise())
    if dof < ENOUGH_FREEDOM:
        return Noise(one, one, one)
    joints = _fit_two_sizes(spread, one)
    if residual.shape[1] <= 3:
        return joints
    turns = _Spread.of(white, residual, slice(3, 6), weight)
    return Noise(joints.gauge, joints.joints, turns.gauge_beside(joints.joints))


def _fit_two_sizes(spread: "_Spread", one: float) -> Noise:
    """Gauge and joints with sizes of their own, at their likeliest; their ratio is known within a factor beforehand."""

    logs = np.log([one, one])
    apart = np.array([-1.0, 1.0]) / RATIO
    for _ in range(MOST_SCORINGS):  # Fisher scoring: the expected curvature is never indefinite
        slope, curvature = spread.slope(logs)
        slope = slope + 2 * apart * (apart @ logs)
        step = np.linalg.solve(curvature + 2 * np.outer(apart, apart), slope)
        logs = logs - np.clip(step, -1.0, 1.0)
        if np.abs(step).max() < 1e-4:
            break
    return Noise(*(float(v) for v in np.exp(np.maximum(logs, np.log(one) - 5))))


@dataclass(frozen=True)
class _Spread:
    """Residuals in axes in which gauge and joints do not mix.

    ``square`` (m,) squared residuals; ``variance_ratio`` (m,): noise variance of the joints over the gauge's;
    ``weight`` (m,): by how much each counts.
    """

    square: Array
    variance_ratio: Array
    weight: Array

    @classmethod
    def of(cls, white: Whitener, residual: Array, block: slice, weight: Array) -> "_Spread":
        """Split the numbers ``block`` of every reading."""
        ratio, axes, unit = white.noise_axes(block)
        turned = np.einsum("nij,ni->nj", axes, residual[:, block] * unit)
        return cls((turned**2).ravel(), ratio.ravel(), np.repeat(weight, ratio.shape[1]))

    def slope(self, logs: Array) -> tuple[Array, Array]:
        """Gradient and expected curvature of minus twice the log likelihood of (log gauge, log joints)."""
        a, b = np.exp(2 * logs)
        variance = a + b * self.variance_ratio
        parts = 2 * np.stack([a / variance, b * self.variance_ratio / variance])
        return parts @ (self.weight * (1 - self.square / variance)), parts * self.weight @ parts.T

    def gauge_beside(self, joints: float) -> float:
        """Likeliest size of the gauge's part when the joints' is known."""
        log = 0.5 * float(np.log(np.average(self.square, weights=self.weight) + 1e-300))
        for _ in range(MOST_SCORINGS):
            slope, curvature = self.slope(np.array([log, np.log(joints)]))
            step = float(np.clip(slope[0] / max(curvature[0, 0], 1e-12), -1.0, 1.0))
            log -= step
            if abs(step) < 1e-4:
                break
        return float(np.exp(max(log, np.log(1e-3))))
