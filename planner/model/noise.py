"""The one model of noise: planning, fitting, tracing and judging all take the scatter of a reading from here."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array


@dataclass(frozen=True)
class ReadingNoise:
    """How much readings are declared to scatter, by the gauge and by the robot's repeatability.

    The covariance of a reading is diag(gauge²) + J_q Σ_q J_qᵀ, with Σ_q = joint_sigma² I.

    Attributes:
        gauge: standard deviation of each number of a reading by the gauge alone, (r,) [m, rad].
        joint_sigma: repeatability of one joint [rad].
        joint_rows: derivative J_q of the readings by the joint angles, (n, r, N).
    """

    gauge: Array
    joint_sigma: float
    joint_rows: Array

    @property
    def gauge_variance(self) -> Array:
        """Variance of each number by the gauge alone, (r,) [m², rad²]."""
        return self.gauge**2

    @property
    def robot_variance(self) -> Array:
        """Variance of each number by the robot's repeatability alone, (n, r) [m², rad²]."""
        return np.asarray(self.joint_sigma**2 * (self.joint_rows**2).sum(axis=2))

    @property
    def robot_covariance(self) -> Array:
        """Covariance by the robot's repeatability alone, (n, r, r) [m², m rad, rad²]."""
        return np.asarray(self.joint_sigma**2 * self.joint_rows @ self.joint_rows.transpose(0, 2, 1))

    @property
    def std(self) -> Array:
        """Standard deviation of the noisiest number of each reading, (n,) [m]."""
        return np.asarray(np.sqrt(self.gauge_variance + self.robot_variance).max(axis=1))

    @property
    def square(self) -> Array:
        """Expected square of a reading's whole error, (n,) [m²]."""
        return np.asarray(self.gauge_variance.sum() + self.robot_variance.sum(axis=1))
