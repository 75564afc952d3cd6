"""How much the readings are declared to scatter."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array


@dataclass(frozen=True)
class ReadingNoise:
    """How much readings are declared to scatter, by the gauge and by the robot's repeatability.

    The covariance of a reading is diag(gauge²) + J_q Σ_q J_qᵀ, with Σ_q = joint_sigma² I.

    Attributes:
        gauge: standard deviation of each number of a reading by the gauge alone, (n, r), or (1, r) for all [m, rad].
        joint_sigma: repeatability of one joint [rad].
        joint_rows: derivative J_q of the readings by the joint angles, (n, r, N).
    """

    gauge: Array
    joint_sigma: float
    joint_rows: Array

    @property
    def gauge_variance(self) -> Array:
        """Variance of each number by the gauge alone, (n, r) or (1, r) [m², rad²]."""
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
    def covariance(self) -> Array:
        """Covariance of the numbers of each reading, (n, r, r) [m², m rad, rad²]."""
        gauge = self.gauge_variance
        return np.asarray(self.robot_covariance + gauge[:, :, None] * np.eye(gauge.shape[1]))

    def white(self, rows: Array) -> Array:
        """Return rows (n, r, P) in standard deviations, the numbers of a reading made independent, (n r, P)."""
        if rows.shape[1] == 1:
            return np.asarray(rows[:, 0] / self.std[:, None])
        return np.asarray(np.linalg.solve(np.linalg.cholesky(self.covariance), rows)).reshape(-1, rows.shape[2])

    @property
    def std(self) -> Array:
        """Standard deviation of the noisiest number of each reading, (n,) [m]."""
        return np.asarray(np.sqrt(self.gauge_variance + self.robot_variance).max(axis=1))

    @property
    def square(self) -> Array:
        """Expected square of a reading's whole error, (n,) [m²]."""
        return np.asarray(self.gauge_variance.sum(axis=1) + self.robot_variance.sum(axis=1))
