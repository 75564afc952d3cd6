"""The offset between two clocks, from marks that both logs hold."""

from dataclasses import dataclass

import numpy as np

from planner.errors import InputError
from planner.units import Array


def rising_edges(t: Array, mark: Array) -> Array:
    """Return the times (k,) [s] at which a mark (n,) of 0 and 1 rises: half way between the two samples."""
    rise = 1 + np.flatnonzero((mark[1:] > 0.5) & (mark[:-1] <= 0.5))
    return np.asarray(0.5 * (t[rise] + t[rise - 1]))


@dataclass(frozen=True)
class Offset:
    """What the marks say of two clocks: add ``seconds`` to the gauge's; ``marks`` agree on it, within ``rms`` [s]."""

    seconds: float
    marks: int
    rms: float


def edge_offset(gauge: Array, axes: Array, reach: float) -> Offset:
    """Return the offset at which most marks of two logs meet.

    Every pair of marks proposes an offset; the window of ``reach`` [s] that holds most proposals wins, so that a mark
    lost in either log does no harm. The offset is the median in it.

    Args:
        gauge: times of the marks by the gauge's clock, (j,) [s].
        axes: by the controller's, (k,) [s].
        reach: the resolution of a mark, the sum of both logs' steps of time [s].

    Raises:
        InputError: a log has no mark, the marks do not belong together, or fit as well at another offset.
    """
    if len(gauge) == 0 or len(axes) == 0:
        raise InputError("the column sync never rises from 0 to 1")
    proposed = np.sort(np.subtract.outer(axes, gauge).ravel())
    end = np.searchsorted(proposed, proposed + reach, side="right")
    agreeing = end - np.arange(len(proposed))
    count = int(agreeing.max())
    if 2 * count < min(len(gauge), len(axes)):
        raise InputError(
            f"the sync marks do not belong together: of {len(gauge)} in one log and {len(axes)} in the other "
            f"{count} meet"
        )
    best = np.flatnonzero(agreeing == count)
    first = int(best[np.argmin(proposed[end[best] - 1] - proposed[best])])
    found = proposed[first : end[first]]
    offset = float(np.median(found))
    rivals = proposed[best][np.abs(proposed[best] - offset) > 2.0 * reach]
    if len(rivals):
        raise InputError(
            f"the sync marks fit as well at an offset of {offset:g} s as at {rivals[0]:g} s; "
            "marks at uneven times, or none lost at either end, would tell"
        )
    return Offset(offset, count, float(np.sqrt(np.mean((found - offset) ** 2))))
