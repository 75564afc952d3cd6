"""What the best possible fit leaves: geometry projected out of an effect, and a fit that knows the effects.

Everything is linear about the truth: an error of the fit is microns, its square is nothing.
RMS is that of the whole reading of a sample: of the length, or of the distance between two points in space.
"""

import numpy as np

WIDE = 1e-2  # [m, rad] how far a geometric fit may go: what it would need more for, it cannot take


def rms(residual):
    """RMS over samples of the norm of (n, k) residuals."""
    return float(np.sqrt(np.mean(np.sum(np.asarray(residual) ** 2, axis=1))))


def fit(columns, y, sigma, wide=WIDE):
    """Parameters (P,) for residuals y (n, k) by columns (n, k, P), each held softly to ``wide``, a number or (P,)."""
    A, b = columns.reshape(-1, columns.shape[2]), y.ravel()
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-30)
    hold = np.diag(sigma / (wide * size))
    found = np.linalg.lstsq(np.vstack([A / size, hold]), np.concatenate([b, np.zeros(len(size))]), rcond=None)[0]
    return found / size


def left_over(columns, y, sigma, wide=WIDE):
    """What is left (n, k) of y when the columns have taken what they can."""
    return y - columns @ fit(columns, y, sigma, wide)


def held_out(columns, y, folds, sigma, wide=WIDE):
    """Residuals (n, k) of samples that the fit never saw; ``folds`` (n,) tells which are left out together."""
    out = np.empty_like(y)
    for f in np.unique(folds):
        out[folds == f] = y[folds == f] - columns[folds == f] @ fit(columns[folds != f], y[folds != f], sigma, wide)
    return out
