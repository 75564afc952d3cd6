"""Readings on a circle by their harmonics, each with a noise of its own.

Turns differ from their repeats by smooth curves. On a circle a noise that is alike at all angles has independent
harmonics, so generalised least squares weighs each by the inverse of its own variance; what all loads have in common
is taken off first, which is the same as a free offset at every angle.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.units import Array

LOW = 5  # harmonics in which the deflections lie
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Told:
    """What one circle says of the compliances, its fixture's height left open within its prior.

    Attributes:
        information: (N, N); ``pulled``: rows against residual, (N,), about the compliances looked at.
        height_row: (N + 1,): what the height is at no change of the compliances [m], and how it follows them.
    """

    information: Array
    pulled: Array
    height_row: Array

    def height(self, step: Array) -> float:
        """Likeliest height [m] for a change ``step`` (N,) of the compliances."""
        return float(self.height_row[0] - self.height_row[1:] @ step)


@dataclass(frozen=True)
class Waves:
    """Rows and residuals of a circle, harmonic by harmonic, what all loads have in common taken off.

    Attributes:
        rows: of N compliances and the height, (D, K, H, N + 1); residual: (D, K, H) [m].
        weight: repeats of every turn, (D, K).
        count: how often a harmonic counts, (H,).
    """

    rows: Complex
    residual: Complex
    weight: Array
    count: Array

    @classmethod
    def of(cls, columns: Array, weight: Array) -> "Waves":
        """Take the rows and, last, the residual, (D, K, B, C), of turns driven ``weight`` (D, K) times."""
        common = np.einsum("dk,dkbn->dbn", weight / weight.sum(axis=1, keepdims=True), columns)
        waves = np.fft.rfft(columns - common[:, None], axis=2, norm="ortho")
        return cls(waves[..., :-1], waves[..., -1], weight, counts(columns.shape[2]))

    @property
    def readings(self) -> int:
        """Numbers that are left when the loads' common part is taken off."""
        D, K = self.weight.shape
        return int(D * (K - 1) * self.count.sum())

    @property
    def scatter(self) -> Array:
        """Variance of one turn's harmonics by what the loads differ, (H,) [m²]; the lowest, as fitted, pooled."""
        D, K = self.weight.shape
        square = (self.weight[..., None] * np.abs(self.residual) ** 2).sum(axis=(0, 1)) / (D * (K - 1))
        pooled = float((self.count * square)[:LOW].sum() / self.count[:LOW].sum())
        return np.concatenate([np.full(LOW, pooled), smoothed(square)[LOW:]])

    def after(self, step: Array, height: float) -> "Waves":
        """Return what is left after a change of the compliances (N,) and of the height [m]."""
        return Waves(self.rows, self.residual - self.rows @ np.append(step, height), self.weight, self.count)

    def told(self, noise: Array, prior: float, height: float = 0.0) -> Told:
        """Say what the circle tells.

        Args:
            noise: variance of a turn's harmonics, (H,) [m²].
            prior: one-sigma size of the fixture's height [m]; ``height`` the one looked at.
        """
        w = self._weights(noise)
        A = np.einsum("dkh,dkhi,dkhj->ij", w, self.rows.conj(), self.rows).real
        b = np.einsum("dkh,dkhi,dkh->i", w, self.rows.conj(), self.residual).real
        open_ = A[-1, -1] + 1.0 / prior**2
        b[-1] -= height / prior**2
        across = A[:-1, -1] / open_
        information = A[:-1, :-1] - np.outer(across, A[-1, :-1])
        return Told(information, b[:-1] - across * b[-1], np.append(b[-1] / open_, across))

    def misfit(self, noise: Array) -> float:
        """Weighted sum of squares."""
        return float((self._weights(noise) * np.abs(self.residual) ** 2).sum())

    def averaged(self, noise: Array) -> Array:
        """Variance of an averaged reading, for every sense and load, (D, K) [m²]."""
        return np.asarray((noise * self.count).sum() / self.count.sum() / self.weight)

    def _weights(self, noise: Array) -> Array:
        return np.asarray(self.weight[..., None] * self.count / noise)


def turn_noise(turns: Array) -> Array:
    """Squares of the harmonics of turns (R, B) [m] about their mean, (B // 2 + 1,) [m²], summed over the turns."""
    return np.asarray((np.abs(np.fft.rfft(turns - turns.mean(axis=0), axis=1, norm="ortho")) ** 2).sum(axis=0))


def counts(bins: int) -> Array:
    """How often each of the harmonics of an even grid counts in a sum over angles, (bins // 2 + 1,)."""
    out = np.full(bins // 2 + 1, 2.0)
    out[0] = 1.0
    if bins % 2 == 0:
        out[-1] = 1.0
    return out


def smoothed(square: Array) -> Array:
    """Average a spectrum (H,) over neighbours, but for the mean and the first harmonic, which have causes of their own.

    The higher the harmonic, the wider: a spectrum changes by its octaves.
    """
    return np.array(list(_windows(square)))


def _windows(square: Array) -> Iterator[float]:
    floor = 1e-6 * float(np.mean(square)) + 1e-30
    for n in range(len(square)):
        reach = 0 if n < 2 else max(1, n // 4)
        first = n if n < 2 else max(2, n - reach)
        yield max(float(np.mean(square[first : n + reach + 1])), floor)
