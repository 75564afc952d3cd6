"""What is known of all errors once some candidates are measured, kept up to date reading by reading."""

from dataclasses import dataclass, replace

import numpy as np

from planner.units import Array


@dataclass
class Posterior:
    """The covariance C of all errors, in prior sizes, and what the candidates would change of it.

    A reading moves every number below by the products of all candidates with two vectors (Sherman–Morrison), so that
    one step costs one look at the rows, however many numbers there are.

    Attributes:
        white: rows of the candidates in standard deviations of their readings per prior size, (n, P).
        weight: mean square error of the tool per squared errors in prior sizes, W (P, P).
        covariance: C, (P, P).
        shown: a C W C aᵀ of each candidate's row a, (n,) [m²].
        spread: variance of each reading that C foretells, a C aᵀ, in its own noise, (n,).
        square: mean square error of the tool under C [m²].
    """

    white: Array
    weight: Array
    covariance: Array
    shown: Array
    spread: Array
    square: float

    @classmethod
    def before(cls, white: Array, weight: Array) -> "Posterior":
        """Return what the priors say."""
        shown = np.einsum("ij,ij->i", white @ weight, white)
        spread = np.einsum("ij,ij->i", white, white)
        return cls(white, weight, np.eye(white.shape[1]), shown, spread, float(np.trace(weight)))

    @property
    def gains(self) -> Array:
        """How much each candidate would take off the mean square error, (n,) [m²]."""
        return np.asarray(self.shown / (1.0 + self.spread))

    def loss(self, which: np.ndarray) -> Array:
        """How much the mean square error would grow without each of the readings ``which``, (k,) [m²]."""
        return np.asarray(self.shown[which] / (1.0 - self.spread[which]))

    def with_readings(self, which: np.ndarray) -> "Posterior":
        """Return what is known once the candidates ``which`` (k,) are measured as well."""
        out = replace(self)
        for k in which:
            out.add(int(k))
        return out

    def add(self, k: int, sign: int = 1) -> None:
        """Take candidate ``k`` among the readings, or out of them where ``sign`` is −1."""
        scale = sign / (1.0 + sign * self.spread[k])
        seen = self.covariance @ self.white[k]
        pull = self.weight @ seen
        size = float(seen @ pull)
        by, through = self.white @ seen, self.white @ (self.covariance @ pull)
        self.square -= size * scale
        self.shown = self.shown - scale * by * (2.0 * through - scale * size * by)
        self.spread = self.spread - scale * by**2
        self.covariance = self.covariance - scale * np.outer(seen, seen)
