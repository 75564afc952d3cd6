"""Figures of a circular test by the definitions of ISO 230-4, from least-squares and minimum-zone circles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from planner.common.units import DEG, Array, read_only
from planner.instruments.circular.reversal import Reversal, find_reversals
from planner.instruments.circular.sweeps import MeasuredCircle, Sweep

ROUNDS = 8
BINS = 1440  # angular bins; only the innermost and outermost point of each can touch a circle


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
    for _ in range(ROUNDS):
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
    which = np.floor((angle + np.pi) / (2 * np.pi) * BINS).astype(int)
    order = np.lexsort((r, which))
    ends = np.flatnonzero(np.diff(which[order]) != 0)
    return np.unique(np.concatenate([order[np.append(0, ends + 1)], order[np.append(ends, len(order) - 1)]]))


GRID = 0.5 * DEG  # of angles at which the two directions are compared
NAMES = {1: "ccw", -1: "cw"}


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
    points = [ring.in_plane(t.angle, t.length) for t in traces]
    common = fit_circle(np.concatenate(points))
    both = [d for d in (1, -1) if any(t.direction == d for t in traces)]
    paths = tuple(_path(ring, d, common, traces, points) for d in both)
    length, calculated = (np.concatenate([getattr(t, a) for t in traces]) for a in ("length", "calculated"))
    two = len(both) == 2
    everything = np.concatenate([p.radial for p in paths])
    difference = _direction_difference(ring, *paths) if two else np.zeros(1)
    return CircleFigures(
        ring=ring,
        load=load,
        paths=paths,
        centre=common,
        G_b=minimum_zone(np.concatenate(points), common) if two else None,
        G_b_ls=float(np.ptp(everything)) if two else None,
        H=float(np.abs(difference).max()) if two else None,
        H_mean=float(difference.mean()) if two else None,
        length_range=float(np.ptp(length)),
        calculated_range=float(np.ptp(length - calculated)),
    )


def _path(
    ring: MeasuredCircle, direction: int, common: FittedCircle, traces: Sequence[Sweep], points: Sequence[Array]
) -> PathFigures:
    mine = [k for k, t in enumerate(traces) if t.direction == direction]
    own = np.concatenate([points[k] for k in mine])
    angle, q = np.concatenate([traces[k].angle for k in mine]), np.concatenate([traces[k].q for k in mine])
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
    grid = np.linspace(start, start + sweep, 1 + int(np.ceil(sweep / GRID)))
    values = []
    for path in (ccw, cw):
        place = np.round((path.angle - start) / sweep * (len(grid) - 1)).astype(int)
        which = np.clip(place, 0, len(grid) - 1)
        count = np.bincount(which, minlength=len(grid))
        full = np.flatnonzero(count)
        mean = np.bincount(which, path.radial, len(grid))[full] / count[full]
        values.append(np.interp(grid, grid[full], mean))
    return np.asarray(values[0] - values[1])
