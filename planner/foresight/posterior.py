"""What is known of all errors once some candidates are measured, kept up to date reading by reading."""

from dataclasses import dataclass, replace

import numpy as np

from planner.units import Array


@dataclass
class Posterior:
    """The covariance C of all errors, in prior sizes, as the candidates see it.

    Attributes:
        white: rows of the candidates in standard deviations of their readings per prior size, (n, P).
        seen: rows times C, (n, P); ``shown`` rows times C times a root of the weight of the errors, (n, K).
        spread: variance of each reading that C foretells, in its own noise, (n,).
        square: mean square error of the tool under C [m²].
    """

    white: Array
    seen: Array
    shown: Array
    spread: Array
    square: float

    @classmethod
    def before(cls, white: Array, weight: Array) -> "Posterior":
        """Return what the priors say; ``weight`` (P, P): mean square error per squared errors in prior sizes."""
        size, axes = np.linalg.eigh(weight)
        along = size > 1e-12 * size[-1]
        root = axes[:, along] * np.sqrt(size[along])
        return cls(white, white.copy(), white @ root, (white**2).sum(axis=1), float(np.trace(weight)))

    @property
    def gains(self) -> Array:
        """How much each candidate would take off the mean square error, (n,) [m²]."""
        return np.asarray((self.shown**2).sum(axis=1) / (1.0 + self.spread))

    def loss(self, which: np.ndarray) -> Array:
        """How much the mean square error would grow without each of the readings ``which``, (k,) [m²]."""
        return np.asarray((self.shown[which] ** 2).sum(axis=1) / (1.0 - self.spread[which]))

    def with_readings(self, which: np.ndarray) -> "Posterior":
        """Return what is known once the candidates ``which`` (k,) are measured as well."""
        out = replace(self)
        for k in which:
            out.add(int(k))
        return out

    def add(self, k: int, sign: int = 1) -> None:
        """Take candidate ``k`` among the readings, or out of them where ``sign`` is −1 (Sherman–Morrison)."""
        scale = sign / (1.0 + sign * self.spread[k])
        share = (self.white @ self.seen[k]) * scale
        self.square -= float((self.shown[k] ** 2).sum() * scale)
        self.spread = self.spread - share**2 / scale
        self.seen = self.seen - np.outer(share, self.seen[k])
        self.shown = self.shown - np.outer(share, self.shown[k])
