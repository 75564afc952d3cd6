"""What 95 of 100 targets stay within, before a session and after it, of robots as the plan expects them."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.common.units import MM, Array
from planner.design.assumptions import LIMIT_QUANTILE
from planner.design.drawn_errors import draw_remaining_errors
from planner.design.expected_errors import ExpectedErrors
from planner.design.free_parameters import UndeclaredErrors
from planner.model.tool_error import aligned_rows, uniform_states
from planner.model.use_statement import ToolName
from planner.runs.run import Samples


@dataclass(frozen=True)
class TargetForecast:
    """How far such robots are off at their targets, with the first tool point that is measured.

    Attributes:
        before, within: what 95 of 100 targets stay within, of 95 of 100 robots, before the session and after it [m].
        tolerance: that the cell states for this tool point [m]; ``None`` where it states none.
        enough: share of the robots of which 95 of 100 targets are within the tolerance then.
        used: the tool that will be used; where it is another than the measured one, nothing is foreseen of that.
    """

    before: float
    within: float
    tolerance: float | None = None
    enough: float = 0.0
    used: ToolName = "measured"


def foresee_targets(cell: Cell, unknown: ExpectedErrors, samples: Samples) -> TargetForecast | None:
    """Return how far robots are off at their targets once poses ``samples`` are measured.

    It is what an identification states of one robot: targets all over the workspace, the base aligned to them, and
    the sizes of what every robot has as unknown as there.

    Of a robot that was calibrated before, the errors are known where programs go alone: ``None``.
    """
    if not isinstance(unknown, UndeclaredErrors):
        return None
    moved = _tool_motion(cell, unknown)
    white = unknown.white(samples)
    before, after = (
        _target_limits(moved, draw_remaining_errors(rows, unknown.usual, unknown.doubt)) for rows in (white[:0], white)
    )
    first, left = (float(np.quantile(v, LIMIT_QUANTILE)) for v in (before, after))
    use, own = cell.file.use, cell.tool.work is not None
    used = (None if use is None else use.tool) or ("own" if own else "measured")
    if use is None or use.tolerance_mm is None or used != "measured":
        return TargetForecast(first, left, used=used)
    stated = use.tolerance_mm * MM
    enough = 0.0 if stated < cell.robot.repeatability else float((after <= stated).mean())
    return TargetForecast(first, left, stated, enough)


def _tool_motion(cell: Cell, unknown: UndeclaredErrors) -> Array:
    """Return the motion of the tool at every target per error, (3 n, P) [m]."""
    targets = uniform_states(cell, 1000, seed=12)  # the 95 % quantile over so many is known to 2 per cent
    effects = [p for p in unknown.model.parameters if p.is_effect]
    names, rows = aligned_rows(Samples.at(targets), setup_of(cell), effects)
    every = list(unknown.model.names)
    known = [n for n in names if n in every]
    return np.asarray(rows[:, [names.index(n) for n in known]] @ unknown.root[[every.index(n) for n in known]])


def _target_limits(moved: Array, errors: Array) -> Array:
    """Return what 95 of 100 targets stay within, of robots with such ``errors`` (P, d), (d,) [m]."""
    off = (moved @ errors).reshape(-1, 3, errors.shape[1])
    return np.asarray(np.quantile(np.sqrt((off**2).sum(axis=1)), LIMIT_QUANTILE, axis=0))
