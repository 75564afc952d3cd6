"""The figures of a circular test, by the definitions of ISO 230-4.

Circular deviation G: the smallest radial separation of two concentric circles that hold the path between them; G(b)
holds both directions. Radial deviation F: from the planned circle about the least-squares centre. Mean bidirectional
radial deviation D: radius of the least-squares circle of both directions less the planned one. Hysteresis H: the
largest radial difference of the two directions at one angle (of the standard's earlier edition).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.circular.concentric import FittedCircle, fitted, narrowest
from planner.circular.measured import Ring, Trace
from planner.circular.reversal import Reversal, reversals
from planner.units import DEG, Array, frozen

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

    ring: Ring
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
        return self.centre.radius - self.ring.radius


def circle_figures(ring: Ring, load: float | None, traces: Sequence[Trace]) -> CircleFigures:
    """Evaluate the sweeps of one circle at one load."""
    points = [ring.in_plane(t.angle, t.length) for t in traces]
    common = fitted(np.concatenate(points))
    both = [d for d in (1, -1) if any(t.direction == d for t in traces)]
    paths = tuple(_path(ring, d, common, traces, points) for d in both)
    length, calculated = (np.concatenate([getattr(t, a) for t in traces]) for a in ("length", "calculated"))
    two = len(both) == 2
    everything = np.concatenate([p.radial for p in paths])
    difference = _difference(ring, *paths) if two else np.zeros(1)
    return CircleFigures(
        ring=ring,
        load=load,
        paths=paths,
        centre=common,
        G_b=narrowest(np.concatenate(points), common) if two else None,
        G_b_ls=float(np.ptp(everything)) if two else None,
        H=float(np.abs(difference).max()) if two else None,
        H_mean=float(difference.mean()) if two else None,
        length_range=float(np.ptp(length)),
        calculated_range=float(np.ptp(length - calculated)),
    )


def _path(
    ring: Ring, direction: int, common: FittedCircle, traces: Sequence[Trace], points: Sequence[Array]
) -> PathFigures:
    mine = [k for k, t in enumerate(traces) if t.direction == direction]
    own = np.concatenate([points[k] for k in mine])
    angle, q = np.concatenate([traces[k].angle for k in mine]), np.concatenate([traces[k].q for k in mine])
    alone, radial = fitted(own), common.deviation(own, ring.radius)
    return PathFigures(
        direction=NAMES[direction],
        sweeps=len(mine),
        samples=len(own),
        G=narrowest(own, alone),
        G_ls=float(np.ptp(alone.deviation(own, ring.radius))),
        F_max=float(radial.max()),
        F_min=float(radial.min()),
        mean=alone.radius - ring.radius,
        offset=alone.centre,
        reversals=reversals(angle, q, radial, direction),
        angle=frozen(angle),
        radial=frozen(radial),
    )


def _difference(ring: Ring, ccw: PathFigures, cw: PathFigures) -> Array:
    """Radial deviation ccw less cw at even angles of the sweep, (k,) [m]."""
    grid = np.linspace(ring.start, ring.start + ring.sweep, 1 + int(np.ceil(ring.sweep / GRID)))
    values = []
    for path in (ccw, cw):
        which = np.clip(
            np.round((path.angle - ring.start) / ring.sweep * (len(grid) - 1)).astype(int), 0, len(grid) - 1
        )
        count = np.bincount(which, minlength=len(grid))
        full = np.flatnonzero(count)
        mean = np.bincount(which, path.radial, len(grid))[full] / count[full]
        values.append(np.interp(grid, grid[full], mean))
    return np.asarray(values[0] - values[1])
