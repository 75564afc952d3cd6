"""What noise that fades along a drive leaves open of the parameters, where a run is too short to look at in blocks.

The noise of one sample is taken to be ρ of that of the sample before and a part that is new (an autoregression of first
order): its integrated autocorrelation time is (1 + ρ)/(1 − ρ). Read from a residual that time is too small, since the
fit has taken slow noise up: with Q an orthonormal basis of the columns and M = 1 − QQᵀ the residual has the covariance
M Σ M. The time is the one with which sums over a window of the residual's autocovariance are expected as they were
read (by moments, as in restricted likelihood: Patterson and Thompson 1971, Biometrika 58(3)).
"""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.fit.least_squares import Fit

WINDOW_TIMES = 5  # times that the window is long, either way (Sokal 1997)


@dataclass(frozen=True)
class FadingNoise:
    """The covariance of the parameters with such noise.

    Attributes:
        covariance: per prior sigma, the prior's part included, (P, P).
        time: how many samples are worth one: by how much larger the variance of a parameter is than with noise that is
            new at each sample, in the mean over the parameters.
    """

    covariance: Array
    time: float

    @classmethod
    def of(cls, fit: Fit) -> "FadingNoise":
        """Look at the residual and the columns of a fit to a drive, all of the same spacing in time."""
        problem = fit.problem
        # 8_000: readings that are looked at: neighbours in time tell little
        step = -(-len(problem) * problem.model.width // 8_000)
        few = problem.take(np.arange(0, len(problem), step))
        white = few.white_columns(fit.errors)
        rows, n = white.rows, len(few)
        axes, size, turn = np.linalg.svd(rows.reshape(white.residual.size, rows.shape[2]), full_matrices=False)
        # 1e-9: of the largest: what no reading shows is known by its prior alone
        shown = size > 1e-9 * size.max(initial=1e-300)
        basis = axes[:, shown].reshape(n, rows.shape[1], int(shown.sum()))
        rho = fading_of_residual(white.residual, basis)
        flat = basis.reshape(white.residual.size, basis.shape[2])
        scatter = flat.T @ correlate(basis, rho).reshape(flat.shape)
        readings = white.residual.size
        # what the fit has taken up of slow noise is more than it takes up of noise that is new at each sample
        grown = max(1.0, (readings - basis.shape[2]) / max(readings - float(np.trace(scatter)), 0.05 * readings))
        back = (size[:, None] * turn)[shown]
        inverse = fit.solution.inverse @ fit.solution.inverse.T
        half = inverse @ back.T
        own = half @ scatter @ half.T * grown * step**2
        plain = ((half**2).sum(axis=1)) * step
        grown_by = np.diag(own) / np.maximum(plain, 1e-300) if len(own) else np.array([(1 + rho) / (1 - rho)])
        return cls(own + inverse @ inverse, max(1.0, float(grown_by.mean())))


def fading_of_residual(residual: Array, basis: Array) -> float:
    """Return ρ of the noise that leaves a residual (n, r), with an orthonormal basis (n, r, k) of what was fitted."""
    n, width = residual.shape
    read = window_time(residual)
    window = int(np.ceil(WINDOW_TIMES * read))
    near = window_sums(basis, window)
    flat, along = (columns.reshape(n * width, basis.shape[2]) for columns in (basis, near))
    both, expected = flat.T @ along, []
    times = read * np.geomspace(1.0, 30.0, 12)  # 30: times that the fit may have hidden
    for time in times:
        rho = (time - 1) / (time + 1)
        there = correlate(basis, rho).reshape(flat.shape)
        whole = n * width * (1 + 2 * rho * (1 - rho**window) / (1 - rho))
        sums = whole - 2 * float((along * there).sum()) + float((both * (flat.T @ there)).sum())
        expected.append(sums / max(n * width - float((flat * there).sum()), 1e-300))
    seen = np.maximum.accumulate(expected)
    time = float(np.interp(read, seen, times)) if seen[-1] > read else float(times[int(np.argmax(expected))])
    return (time - 1) / (time + 1)


def window_time(residual: Array) -> float:
    """Return the integrated autocorrelation time of a residual (n, r) in samples, within Sokal's window."""
    n = len(residual)
    power = (np.abs(np.fft.rfft(residual, 1 << (2 * n - 1).bit_length(), axis=0)) ** 2).sum(axis=1)
    rho = np.fft.irfft(power)[:n]
    total = 1 + 2 * np.cumsum(rho[1:] / max(rho[0], 1e-300))
    wide = np.flatnonzero(np.arange(1, n) >= WINDOW_TIMES * np.maximum(total, 1.0))
    return float(max(1.0, total[wide[0]] if len(wide) else total[-1]))


def correlate(columns: Array, rho: float) -> Array:
    """Return the correlation matrix of the samples, ρ^|i − k|, times columns (n, r, k)."""
    from scipy.signal import lfilter  # costs most of a second

    ahead, behind = (lfilter([1.0], [1.0, -rho], c, axis=0) for c in (columns, columns[::-1]))
    return np.asarray(ahead + behind[::-1] - columns)


def window_sums(columns: Array, window: int) -> Array:
    """Return for each sample the sum over those no farther than the window, of columns (n, r, k)."""
    total = np.cumsum(np.pad(columns, ((window + 1, window), (0, 0), (0, 0))), axis=0)
    return np.asarray(total[2 * window + 1 :] - total[: -2 * window - 1])
