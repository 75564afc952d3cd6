"""The kinematic error by a tracker on the same circle, unloaded, as the bar would have seen it."""

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.gauge import bar_state
from planner.identification.placed import flanges
from planner.loaded.centring import centring_offset, sine
from planner.loaded.circle import NEAR, points, polar
from planner.loaded.types import Comparison, Curves, Evaluated
from planner.placing import place_points
from planner.repeatable import evenly
from planner.rig import Rig
from planner.run import Run
from planner.units import MM, Array, frozen

PLACED = 400  # samples that tell where the tracker stands
SEEN = 0.2  # part of a tracker's samples that make a sense of travel
LEAST = 0.9  # part of the angles that the tracker's samples must cover


def compared(cell: Cell, rig: Rig, circle: Evaluated, run: Run) -> Comparison:
    """Compare the kinematic error of a circle with a tracker's run of it.

    The tracker's frame is found from the run itself on the nominal robot. What that takes up, shifts and turns of the
    whole circle, shows in the bar's length as a constant and a first harmonic, which are taken off both.

    Raises:
        InputError: it is no run of a tracker, or not of this circle.
    """
    if run.readings.position is None:
        raise InputError(f"{run.name}: the comparison needs a tracker's x_mm, y_mm, z_mm")
    curves = circle.curves
    x = points(rig, run.samples.q)
    theta, off = polar(curves.circle, x)
    on = np.flatnonzero(off < NEAR * curves.circle.radius)
    if len(on) < len(curves.theta) // 4:
        raise InputError(
            f"{run.name}: only {len(on)} of its samples lie on the circle about "
            f"{np.round(curves.circle.centre / MM, 1).tolist()} mm: it is a run of another path"
        )
    error = _radial(rig, curves.circle.p_BX, run.take(on), x[on])
    seen = _on_grid(run, theta[on], error, curves.theta)
    bar = circle.kinematic[_senses(curves, theta[on])].mean(axis=0)
    bar, seen = _without_offset(curves.theta, bar), _without_offset(curves.theta, seen)
    apart = np.abs(bar - seen)
    return Comparison(curves.theta, frozen(bar), frozen(seen), float(apart.mean()), float(apart.max()))


def _senses(curves: Curves, theta: Array) -> list[int]:
    """Which of the bar's senses of travel the tracker's run has too, as positions; all where it has none of them."""
    way = np.sign(np.diff(np.unwrap(theta)))
    share = {d: float(np.mean(way == d)) for d in curves.directions}
    return [k for k, d in enumerate(curves.directions) if share[d] > SEEN] or list(range(len(curves.directions)))


def _radial(rig: Rig, p_BX: Array, run: Run, x: Array) -> Array:
    """Error of the measured point along the bar, (n,) [m]."""
    few = run.take(evenly(len(run), PLACED))
    p_BF, R_BF = flanges(rig, few.samples.q)
    assert few.readings.position is not None
    assert run.readings.position is not None
    place = np.zeros(len(few), dtype=int)
    found = place_points(p_BF, R_BF, few.readings.position, place, place, rig.p_FM[:1])
    p_BM = run.readings.position @ found.R_BG[0].T + found.p_BG[0]
    return np.asarray(np.einsum("ni,ni->n", p_BM - x, bar_state(x, p_BX).direction))


def _on_grid(run: Run, theta: Array, error: Array, grid: Array) -> Array:
    """Mean error at every angle of the grid, (B,) [m]; short gaps are bridged by straight lines."""
    B = len(grid)
    where = np.minimum((theta % (2 * np.pi) / (2 * np.pi / B)).astype(int), B - 1)
    count = np.bincount(where, minlength=B)
    if np.mean(count > 0) < LEAST:
        raise InputError(
            f"{run.name}: its samples cover {100 * float(np.mean(count > 0)):.0f} % of the circle only; a whole turn "
            "is needed"
        )
    there = np.flatnonzero(count)
    mean = np.bincount(where, error, B)[there] / count[there]
    return np.asarray(np.interp(grid, grid[there], mean, period=2 * np.pi))


def _without_offset(theta: Array, y: Array) -> Array:
    y = y - y.mean()
    return np.asarray(y - sine(centring_offset(theta, y), theta))
