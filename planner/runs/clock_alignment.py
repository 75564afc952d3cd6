"""The offset of two clocks from the readings themselves, where no marks tell it.

Of any arm, the position of a point, and the square of its distance from another, are sums of products of sines and
cosines of the joint angles. The readings are fitted by products of two at every shift of their clock; at the true one
they fit best.
"""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array

GRID = 3000  # samples of the stretch that is compared
STRETCH = 0.6  # share of the angles' time that is compared; the rest is room for the shift
LEAST_PER_WAVE = 8.0  # samples a wave of the fit, below which anything fits
SMALLEST = 0.1  # [s] offsets below are left to the fit, as the gauge's lag
SURE = 3.0  # times more is left of the variance at any shift that is not next to the best, and without a shift


@dataclass(frozen=True)
class AlignedClocks:
    """What the readings say of two clocks: add ``seconds`` to the gauge's.

    ``left`` is the share of the readings' variance that stays unexplained there, ``rival`` the least elsewhere.
    """

    seconds: float
    left: float
    rival: float


def align_clocks(t_gauge: Array, reading: Array, t_axes: Array, q: Array) -> AlignedClocks | None:
    """Return the offset at which readings (n, r) [m] fit angles (m, N) [rad] best; ``None`` where that is not sure.

    Args:
        t_gauge, t_axes: the times of both, (n,) and (m,) [s], each rising.
        reading: what the gauge read.
        q: the angles.
    """
    length = t_axes[-1] - t_axes[0]
    room = (1 - STRETCH) / 2 * length
    step = max(length * STRETCH / GRID, float(np.median(np.diff(t_axes))), float(np.median(np.diff(t_gauge))))
    start = t_axes[0] + room
    grid = start + step * np.arange(int(STRETCH * length / step))
    overlap = min(t_gauge[-1], t_axes[-1]) - max(t_gauge[0], t_axes[0])
    guess = 0.0 if overlap > STRETCH * min(length, t_gauge[-1] - t_gauge[0]) else t_axes[0] - t_gauge[0]
    waves = _waves(np.stack([np.interp(grid, t_axes, a) for a in q.T], axis=1))
    if len(grid) < LEAST_PER_WAVE * waves.shape[1]:
        return None
    shifts = step * np.arange(-int(room / step), int(room / step) + 1)
    linear = reading if reading.shape[1] > 1 else reading**2
    left = _variance_left(waves, grid, step, len(shifts) // 2, t_gauge + guess, linear)
    return _judge(left, shifts, guess)


def _waves(q: Array) -> Array:
    """Orthonormal columns (n, k) that span 1, the sines and cosines of angles (n, N), and products of two of them."""
    moving = q[:, np.ptp(q, axis=0) > 1e-3]
    single = np.concatenate([np.cos(moving), np.sin(moving)], axis=1)
    n = moving.shape[1]
    pairs = [single[:, i] * single[:, j] for i in range(2 * n) for j in range(i + 1, 2 * n) if (j - i) % n]
    columns = np.stack([np.ones(len(q)), *single.T, *pairs], axis=1)
    U, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(U[:, size > 1e-6 * size[0]])


def _variance_left(waves: Array, grid: Array, step: float, reach: int, t: Array, reading: Array) -> Array:
    """Share of the readings' variance that the waves leave at each shift of −reach … reach steps, (2·reach + 1,)."""
    from scipy.signal import correlate

    wide = grid[0] + step * np.arange(-reach, len(grid) + reach)
    inside = (wide >= t[0]) & (wide <= t[-1])
    x = np.stack([np.interp(wide, t, r) for r in reading.T], axis=1)
    x = np.where(inside[:, None], x - x[inside].mean(axis=0), 0.0)
    count = np.convolve(inside, np.ones(len(grid)), "valid")
    explained, whole = np.zeros(2 * reach + 1), np.zeros(2 * reach + 1)
    for one in x.T:
        explained += sum(correlate(one, wave, "valid") ** 2 for wave in waves.T)
        whole += np.convolve(one**2, np.ones(len(grid)), "valid")
    left = 1.0 - explained / np.maximum(whole, 1e-300)
    return np.asarray(np.where(count == len(grid), left, np.nan)[::-1])  # later readings: an earlier clock


def _judge(left: Array, shifts: Array, guess: float) -> AlignedClocks | None:
    """Take the best shift, refined by a parabola, where no other comes near and it is not at the end of the room."""
    if np.isnan(left).all():
        return None
    best = int(np.nanargmin(left))
    if not 0 < best < len(left) - 1 or np.isnan(left[best - 1 : best + 2]).any():
        return None
    below, at, above = left[best - 1 : best + 2]
    step = shifts[1] - shifts[0]
    curve = below - 2 * at + above
    seconds = guess + shifts[best] + (0.5 * step * (below - above) / curve if curve > 0 else 0.0)
    beside = np.abs(shifts - shifts[best]) < _width(left, best) * step
    rival = float(np.nanmin(np.where(beside, np.nan, left), initial=1.0))
    found = AlignedClocks(float(seconds), float(at), rival)
    return found if rival > SURE * at and abs(seconds) > SMALLEST else None


def _width(left: Array, best: int) -> int:
    """Steps from the best shift to where the share stops rising on either side: the valley that it lies in."""
    width = 1
    for side in (left[best:], left[best::-1]):
        fall = np.flatnonzero(~(np.diff(side) > 0))
        width = max(width, int(fall[0]) + 1 if len(fall) else len(side))
    return width
