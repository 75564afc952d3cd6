"""What the bar shows where axes turn round: backlash, friction and windup jump there, geometry does not."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import DEG, Array

BIN = 0.5 * DEG  # of the circle's angle, in which angles of the joints are averaged
LEAST = 0.1 * DEG  # a joint must turn by this before and after, to have reversed
BESIDE = 10.0 * DEG  # of the circle's angle, on either side of which it must
TOGETHER = 3.0 * DEG  # reversals nearer than this cannot be told apart
WINDOW = 12.0 * DEG  # on either side of a reversal, from which its jump is read
FEWEST = 12  # readings on either side
FEW = 5  # places without a reversal, to know how large a jump is by chance


@dataclass(frozen=True)
class Reversal:
    """Joints (from 0) that reverse at an angle of the circle [rad], and the jump there.

    ``step`` [m] is how much longer the bar reads after the reversal than before it, in the direction of driving, what
    geometry does over the window taken off; ``std`` [m] is what such a jump is where nothing reverses, or from the
    scatter of the readings, whichever is larger. Both are NaN where the sweep leaves no room on one side.
    """

    angle: float
    joints: tuple[int, ...]
    step: float
    std: float


def find_reversals(angle: Array, q: Array, radial: Array, direction: int) -> tuple[Reversal, ...]:
    """Find the reversals of a sweep and what they do.

    Args:
        angle: of the circle, in the order of driving (n,) [rad].
        q: joint angles (n, N) [rad].
        radial: radial deviation (n,) [m].
        direction: 1 where the angle grows, −1 where it falls.
    """
    order = np.argsort(angle, kind="stable")
    angle, q, radial = angle[order], q[order], radial[order]
    places = sorted((place, j) for j, column in enumerate(q.T) for place in _joint_extremes(angle, column))
    groups: list[list[tuple[float, int]]] = []
    for place in places:
        if groups and place[0] - groups[-1][-1][0] < TOGETHER:
            groups[-1].append(place)
        else:
            groups.append([place])
    middle = [float(np.mean([p for p, _ in g])) for g in groups]
    chance = _chance_jump(angle, radial, middle)
    edges = [float(angle[0]), *middle, float(angle[-1])]
    out = []
    for k, group in enumerate(groups):
        low, high = (abs(edges[k + 1] - e) for e in (edges[k], edges[k + 2]))
        step, std = _jump(angle - middle[k], radial, min(low, WINDOW), min(high, WINDOW))
        out.append(Reversal(middle[k], tuple(sorted({j for _, j in group})), direction * step, max(std, chance)))
    return tuple(out)


def _chance_jump(angle: Array, radial: Array, middle: list[float]) -> float:
    """Size of the jump [m] at angles where no joint reverses: readings wander, their scatter alone says too little."""
    places = np.arange(angle[0] + WINDOW, angle[-1] - WINDOW, WINDOW / 2)
    away = [p for p in places if all(abs(p - m) > WINDOW for m in middle)]
    jumps = np.array([_jump(angle - p, radial, WINDOW, WINDOW)[0] for p in away])
    jumps = jumps[np.isfinite(jumps)]
    return float(np.sqrt(np.mean(jumps**2))) if len(jumps) >= FEW else 0.0


def _joint_extremes(angle: Array, q: Array) -> list[float]:
    """Angles at which one joint's angle (n,) has an extreme within the sweep, by a parabola through its bins."""
    count = max(3, round((angle[-1] - angle[0]) / BIN))
    which = np.clip(((angle - angle[0]) / (angle[-1] - angle[0]) * count).astype(int), 0, count - 1)
    filled = np.flatnonzero(np.bincount(which, minlength=count))
    place = np.bincount(which, angle, count)[filled] / np.bincount(which, minlength=count)[filled]
    mean = np.bincount(which, q, count)[filled] / np.bincount(which, minlength=count)[filled]
    side = max(1, round(BESIDE / BIN))
    found = []
    for k in range(1, len(mean) - 1):
        before, after = mean[max(0, k - side) : k + 1], mean[k : k + side + 1]
        for sense in (1.0, -1.0):
            top = sense * mean[k] >= (sense * np.concatenate([before, after])).max()
            if top and min(np.ptp(before), np.ptp(after)) > LEAST:
                found.append(_vertex(place, mean, max(0, k - 4), min(len(mean), k + 5)))
    return found


def _vertex(place: Array, mean: Array, low: int, high: int) -> float:
    a, b, _ = np.polyfit(place[low:high] - place[low], mean[low:high], 2)
    return float(place[low] + np.clip(-b / (2 * a), 0.0, place[high - 1] - place[low]))


def _jump(past: Array, radial: Array, low: float, high: float) -> tuple[float, float]:
    """Jump of ``radial`` at 0 beside a parabola that goes through, and its standard deviation [m]."""
    rows = np.flatnonzero((past >= -low) & (past <= high))
    x = past[rows] / WINDOW
    if min((x < 0).sum(), (x > 0).sum()) < FEWEST or min(low, high) < TOGETHER:
        return float("nan"), float("nan")
    A = np.column_stack([np.sign(x) / 2.0, np.ones(len(x)), x, x**2])
    found, *_ = np.linalg.lstsq(A, radial[rows])
    left = radial[rows] - A @ found
    variance = float(left @ left) / max(len(x) - 4, 1) * np.linalg.inv(A.T @ A)[0, 0]
    return float(found[0]), float(np.sqrt(variance))
