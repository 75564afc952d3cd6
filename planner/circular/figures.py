"""Figures of a circular test by ISO 230-4, from least-squares and minimum-zone circles, with the peaks at reversals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from planner.circular.assumptions import REVERSAL
from planner.circular.sweeps import MeasuredCircle, Sweep
from planner.common.units import Array, mean_by_group, read_only


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
        if groups and place[0] - groups[-1][-1][0] < REVERSAL.reversals_apart:
            groups[-1].append(place)
        else:
            groups.append([place])
    middle = [float(np.mean([p for p, _ in g])) for g in groups]
    chance = _chance_jump(angle, radial, middle)
    edges = [float(angle[0]), *middle, float(angle[-1])]
    out = []
    for k, group in enumerate(groups):
        low, high = (abs(edges[k + 1] - e) for e in (edges[k], edges[k + 2]))
        step, std = _jump(angle - middle[k], radial, min(low, REVERSAL.jump_window), min(high, REVERSAL.jump_window))
        out.append(Reversal(middle[k], tuple(sorted({j for _, j in group})), direction * step, max(std, chance)))
    return tuple(out)


def _chance_jump(angle: Array, radial: Array, middle: list[float]) -> float:
    """Size of the jumps [m] that chance gives, from angles where no joint reverses.

    Neighbouring readings depend on each other, so that their scatter alone would give too small a size.
    """
    places = np.arange(angle[0] + REVERSAL.jump_window, angle[-1] - REVERSAL.jump_window, REVERSAL.jump_window / 2)
    away = [p for p in places if all(abs(p - m) > REVERSAL.jump_window for m in middle)]
    jumps = np.array([_jump(angle - p, radial, REVERSAL.jump_window, REVERSAL.jump_window)[0] for p in away])
    jumps = jumps[np.isfinite(jumps)]
    return float(np.sqrt(np.mean(jumps**2))) if len(jumps) >= REVERSAL.chance_places else 0.0


def _joint_extremes(angle: Array, q: Array) -> list[float]:
    """Angles at which one joint's angle (n,) has an extreme within the sweep, by a parabola through its bins."""
    count = max(3, round((angle[-1] - angle[0]) / REVERSAL.angle_step))
    which = np.clip(((angle - angle[0]) / (angle[-1] - angle[0]) * count).astype(int), 0, count - 1)
    place, mean = (mean_by_group(v, which)[np.unique(which)] for v in (angle, q))
    side = max(1, round(REVERSAL.beside_reversal / REVERSAL.angle_step))
    found = []
    for k in range(1, len(mean) - 1):
        before, after = mean[max(0, k - side) : k + 1], mean[k : k + side + 1]
        for sense in (1.0, -1.0):
            top = sense * mean[k] >= (sense * np.concatenate([before, after])).max()
            if top and min(np.ptp(before), np.ptp(after)) > REVERSAL.least_travel:
                found.append(_vertex(place, mean, max(0, k - 4), min(len(mean), k + 5)))
    return found


def _vertex(place: Array, mean: Array, low: int, high: int) -> float:
    a, b, _ = np.polyfit(place[low:high] - place[low], mean[low:high], 2)
    return float(place[low] + np.clip(-b / (2 * a), 0.0, place[high - 1] - place[low]))


def _jump(past: Array, radial: Array, low: float, high: float) -> tuple[float, float]:
    """Jump of ``radial`` at 0 beside a parabola that goes through, and its standard deviation [m]."""
    rows = np.flatnonzero((past >= -low) & (past <= high))
    x = past[rows] / REVERSAL.jump_window
    if min((x < 0).sum(), (x > 0).sum()) < REVERSAL.jump_readings or min(low, high) < REVERSAL.reversals_apart:
        return float("nan"), float("nan")
    A = np.column_stack([np.sign(x) / 2.0, np.ones(len(x)), x, x**2])
    found, *_ = np.linalg.lstsq(A, radial[rows])
    left = radial[rows] - A @ found
    variance = float(left @ left) / max(len(x) - 4, 1) * np.linalg.inv(A.T @ A)[0, 0]
    return float(found[0]), float(np.sqrt(variance))


@dataclass(frozen=True)
class FittedCircle:
    """A least-squares circle: centre (2,) [m], radius [m], standard deviation of the centre's coordinates (2,) [m]."""

    centre: Array
    radius: float
    std: Array

    def deviation(self, points: Array, radius: float) -> Array:
        """Distances of points (n, 2) [m] from the centre, less ``radius`` [m], (n,)."""
        return np.asarray(np.linalg.norm(points - self.centre, axis=1) - radius)


def fit_circle(points: Array) -> FittedCircle:
    """Fit a circle to points (n, 2) [m] by least squares of their distances from it (Gauss–Newton, exact)."""
    centre = points.mean(axis=0)
    for _ in range(8):  # rounds of Gauss-Newton
        away = points - centre
        distance = np.linalg.norm(away, axis=1)
        A = np.column_stack([away / distance[:, None], np.ones(len(points))])
        step, *_ = np.linalg.lstsq(A, distance)
        # at the start the centre of an arc is its centroid, far inside; a step is the whole way to the circle's
        centre = centre + step[:2]
        if np.abs(step[:2]).max() < 1e-12:
            break
    distance = np.linalg.norm(points - centre, axis=1)
    radius = float(distance.mean())
    scatter = float(np.sum((distance - radius) ** 2)) / max(len(points) - 3, 1)
    std = np.sqrt(scatter * np.diag(np.linalg.inv(A.T @ A))[:2])
    return FittedCircle(read_only(centre), radius, read_only(std))


def minimum_zone(points: Array, about: FittedCircle) -> float:
    """Smallest radial separation [m] of two concentric circles that hold points (n, 2) [m] between them.

    The minimum zone of ISO 230-4: a linear programme in the centre's shift and both radii. The centre lies so near to
    that of the least-squares circle that what a shift does to the distances is linear (to shift² / 2 radius).
    """
    away = points - about.centre
    distance = np.linalg.norm(away, axis=1)
    unit = away / distance[:, None]
    rows = _extremes(np.arctan2(unit[:, 1], unit[:, 0]), distance - about.radius)
    r, u = distance[rows] - about.radius, unit[rows]
    size = max(float(np.ptp(r)), 1e-9)
    one = np.ones(len(r))
    # unknowns: shift (2), inner and outer radius, in units of the range: inner <= r - u·shift <= outer
    bounds_on = np.vstack([np.column_stack([u, one, 0 * one]), np.column_stack([-u, 0 * one, -one])])
    right = np.concatenate([r, -r]) / size
    found = linprog([0, 0, -1, 1], A_ub=bounds_on, b_ub=right, bounds=[(None, None)] * 4, method="highs")
    inner, outer = np.asarray(found.x, dtype=float)[2:]
    return float(outer - inner) * size


def _extremes(angle: Array, r: Array) -> np.ndarray:
    """Rows of the smallest and largest value in every angular bin."""
    # 1440: angular bins; only the innermost and outermost point of each can touch a circle
    which = np.floor((angle + np.pi) / (2 * np.pi) * 1440).astype(int)
    order = np.lexsort((r, which))
    ends = np.flatnonzero(np.diff(which[order]) != 0)
    return np.unique(np.concatenate([order[np.append(0, ends + 1)], order[np.append(ends, len(order) - 1)]]))


NAMES = {1: "ccw", -1: "cw"}
COLUMNS = ("angle", "length", "calculated")


@dataclass(frozen=True)
class PathFigures:
    """One direction, all its sweeps together; lengths in m.

    Attributes:
        direction: "ccw" or "cw"; sweeps: how many; samples: how many.
        G: circular deviation; G_ls: range about this path's own least-squares circle.
        F_max, F_min: radial deviation about the common centre.
        mean: radius of this path's least-squares circle less the planned one; offset: its centre (2,).
        reversals: of the joints, and what they do.
        angle, radial: the path, with the common centre taken off (n,).
    """

    direction: str
    sweeps: int
    samples: int
    G: float
    G_ls: float
    F_max: float
    F_min: float
    mean: float
    offset: Array
    reversals: tuple[Reversal, ...]
    angle: Array
    radial: Array


@dataclass(frozen=True)
class CircleFigures:
    """One circle at one load; lengths in m.

    Attributes:
        ring: the circle; load [N] or ``None``.
        paths: its directions.
        centre: of the least-squares circle of all, from the planned centre, in the plane's axes; with its std.
        radius: of that circle.
        G_b: bidirectional circular deviation, ``None`` with one direction; G_b_ls: about the common centre.
        H, H_mean: largest and mean difference of ccw less cw at one angle.
        length_range: of the bar's readings; calculated_range: of readings less what the nominal robot has at the joint
            angles of the run, which leaves out the error of following the path.
    """

    ring: MeasuredCircle
    load: float | None
    paths: tuple[PathFigures, ...]
    centre: FittedCircle
    G_b: float | None
    G_b_ls: float | None
    H: float | None
    H_mean: float | None
    length_range: float
    calculated_range: float

    @property
    def D(self) -> float:
        """Mean (bidirectional) radial deviation [m]."""
        return self.centre.radius - self.ring.circle.radius


def circle_figures(ring: MeasuredCircle, load: float | None, traces: Sequence[Sweep]) -> CircleFigures:
    """Evaluate the sweeps of one circle at one load."""
    angle, length, calculated = (np.concatenate([getattr(t, a) for t in traces]) for a in COLUMNS)
    points = ring.in_plane(angle, length)
    common = fit_circle(points)
    each = [[t for t in traces if t.direction == d] for d in NAMES]
    paths = tuple(_path(ring, common, mine) for mine in each if mine)
    two = len(paths) == 2
    difference = _direction_difference(ring, *paths) if two else np.zeros(1)
    return CircleFigures(
        ring=ring,
        load=load,
        paths=paths,
        centre=common,
        G_b=minimum_zone(points, common) if two else None,
        G_b_ls=float(np.ptp(np.concatenate([p.radial for p in paths]))) if two else None,
        H=float(np.abs(difference).max()) if two else None,
        H_mean=float(difference.mean()) if two else None,
        length_range=float(np.ptp(length)),
        calculated_range=float(np.ptp(length - calculated)),
    )


def _path(ring: MeasuredCircle, common: FittedCircle, mine: Sequence[Sweep]) -> PathFigures:
    """Evaluate the sweeps in one direction."""
    angle, length, q = (np.concatenate([getattr(t, a) for t in mine]) for a in ("angle", "length", "q"))
    direction, own = mine[0].direction, ring.in_plane(angle, length)
    alone, radial = fit_circle(own), common.deviation(own, ring.circle.radius)
    return PathFigures(
        direction=NAMES[direction],
        sweeps=len(mine),
        samples=len(own),
        G=minimum_zone(own, alone),
        G_ls=float(np.ptp(alone.deviation(own, ring.circle.radius))),
        F_max=float(radial.max()),
        F_min=float(radial.min()),
        mean=alone.radius - ring.circle.radius,
        offset=alone.centre,
        reversals=find_reversals(angle, q, radial, direction),
        angle=read_only(angle),
        radial=read_only(radial),
    )


def _direction_difference(ring: MeasuredCircle, ccw: PathFigures, cw: PathFigures) -> Array:
    """Radial deviation ccw less cw at even angles of the sweep, (k,) [m]."""
    start, sweep = ring.circle.start, ring.circle.sweep
    grid = np.linspace(start, start + sweep, 1 + int(np.ceil(sweep / REVERSAL.angle_step)))
    values = []
    for path in (ccw, cw):
        place = np.round((path.angle - start) / sweep * (len(grid) - 1)).astype(int)
        which = np.clip(place, 0, len(grid) - 1)
        full = np.unique(which)
        values.append(np.interp(grid, grid[full], mean_by_group(path.radial, which)[full]))
    return np.asarray(values[0] - values[1])
