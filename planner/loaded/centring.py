"""The circle's centre beside the bar's fixed ball: the sine that it leaves in the averaged curve (paper, eq. 9)."""

import numpy as np
from scipy.optimize import fminbound

from planner.loaded.types import Offset
from planner.units import Array

LOWEST, HIGHEST, STEP = 0.2, 3.0, 0.01  # frequencies that the paper's form is searched over


def centring_offset(theta: Array, y: Array) -> Offset:
    """Fit a sin(θ − φ) to y (B,) [m] over whole turns θ (B,) [rad]: linear, so that there is nothing to guess.

    A centre that is off its ball shows once a turn and no otherwise, so that b of eq. 9 is 1.
    """
    return _at(1.0, theta, y)


def paper_offset(theta: Array, y: Array) -> Offset:
    """Fit a sin(b θ − φ) with b free, as the paper does (eq. 9): best of all b, whatever the first guess.

    For each b the rest is linear, so only b is searched, all over its range (separable least squares, Golub and
    Pereyra 1973); a first guess as in the paper can end in another minimum.
    """
    grid = np.arange(LOWEST, HIGHEST + STEP / 2, STEP)
    rms = np.array([_at(float(b), theta, y).rms for b in grid])
    best = float(grid[int(np.argmin(rms))])
    near = (best - STEP, best + STEP)
    return _at(float(fminbound(lambda b: _at(float(b), theta, y).rms, *near, xtol=1e-7)), theta, y)


def sine(offset: Offset, theta: Array) -> Array:
    """Value of the fitted sine, like ``theta`` [m]."""
    return np.asarray(offset.amplitude * np.sin(offset.frequency * theta - offset.phase))


def _at(b: float, theta: Array, y: Array) -> Offset:
    """Best amplitude and phase for one b."""
    A = np.column_stack([np.sin(b * theta), np.cos(b * theta)])
    (along, across), *_ = np.linalg.lstsq(A, y)
    rms = float(np.sqrt(np.mean((y - A @ np.array([along, across])) ** 2)))
    return Offset(float(np.hypot(along, across)), b, float(np.arctan2(-across, along)), rms)
