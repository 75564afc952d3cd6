"""Whether the positions of a run are in the unit that their columns say: the nominal arm knows how far it moved."""

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import setup_of
from planner.common.determinism import even_positions
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array, to_mm
from planner.gauges.placement.frames import place_frames
from planner.gauges.run_places import flange_poses
from planner.runs.run import Run

ROWS = 200  # of a run that are looked at
NEAR = 3.0  # factor within which a ratio is "about a thousand"
BETTER = 0.1  # share of what is left in the unit as written that may be left in the other one
UNITS = (  # factor to what was meant, what it looks like, what to call the columns
    (1e3, "metres in columns of millimetres", "x_m, y_m, z_m"),
    (1e-3, "millimetres in columns of metres", "x_mm, y_mm, z_mm"),
)


def check_unit(run: Run, cell: Cell) -> None:
    """Refuse positions that fit the arm's movement a thousand times larger or smaller, and not as they are.

    A point that hardly moves while the arm turns about it is none of these: it fits as it is.

    Raises:
        InputError: with both movements and the names that the columns should have.
    """
    if run.readings.position is None:
        return
    few = run.take(even_positions(len(run), ROWS))
    p_BF, R_BF = flange_poses(setup_of(cell), few.samples.q)
    group = few.samples.place if few.samples.point is None else few.samples.place * len(run.points) + few.samples.point
    read, arm = _spread_rms(np.asarray(few.readings.position), group), _spread_rms(p_BF, group)
    for factor, words, names in UNITS:
        near = 1 / NEAR < read * factor / max(arm, 1e-12) < NEAR
        if near and _placement_rms(few, p_BF, R_BF, factor) < BETTER * _placement_rms(few, p_BF, R_BF, 1.0):
            raise InputError(
                f"{run.name}: the points lie {to_mm(read):.3g} mm from their middle, but the arm moved its flange by "
                f"{to_mm(arm):.3g} mm: these look like {words}; if so, call them {names}"
            )


def _spread_rms(p: Array, group: np.ndarray) -> float:
    """Root of the mean square distance of points (n, 3) from the middle of their group (n,) [m]."""
    apart = np.concatenate([p[group == g] - p[group == g].mean(axis=0) for g in np.unique(group)])
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def _placement_rms(run: Run, p_BF: Array, R_BF: Array, factor: float) -> float:
    """What no frame and no tool point explain of the positions times a factor, rms [m]."""
    point = np.zeros(len(run), dtype=int) if run.samples.point is None else run.samples.point
    p_GM = factor * np.asarray(run.readings.position)
    try:
        return place_frames(p_BF, R_BF, p_GM, run.samples.place, point, None).rms
    except (InputError, NoSolutionError):
        return float("inf")
