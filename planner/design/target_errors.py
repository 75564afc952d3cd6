"""What 95 of 100 targets stay within, before a session and after it, of robots as the plan expects them."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell, setup_of
from planner.common.units import MM, Array
from planner.design.assumptions import LIMIT_QUANTILE
from planner.design.expected_errors import ExpectedErrors
from planner.design.free_parameters import UndeclaredErrors
from planner.effects.usual_errors import TYPICAL_FACTOR, is_usual, usual_factors
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
    # the errors with a name are the model's first parameters, in their order
    groups = [p.group for p in unknown.model.parameters[: white.shape[1]]]
    families = list(dict.fromkeys(filter(is_usual, groups)))
    usual = np.array([families.index(g) if g in families else -1 for g in groups])
    before, after = (_target_limits(moved, rows, usual, unknown.doubt) for rows in (white[:0], white))
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


def _target_limits(moved: Array, white: Array, usual: np.ndarray, doubt: float) -> Array:
    """Return what 95 of 100 targets stay within, of each robot drawn (d,) [m], after readings ``white`` (n, P).

    ``usual``: family (P,) int of the errors of which most robots have little and few much; −1 of all others.
    """
    robots = 1000  # drawn: the 95 % quantile over them is known to 3 per cent
    rng = np.random.default_rng(12)  # a fixed seed: the same errors give the same limits
    rare = usual >= 0
    rest, own = white[:, ~rare], white[:, rare]
    root = np.linalg.inv(np.linalg.cholesky(rest.T @ rest + np.eye(rest.shape[1])))
    taken_up = root.T @ (root @ (rest.T @ own))  # by the others, of each of these errors
    factors, probability = usual_factors()
    # each family's sizes as often as they are likely, so that the limit hangs less on the draws
    even = np.tile((np.arange(robots) + 0.5) / robots, (usual.max(initial=-1) + 1, 1))
    drawn = factors[np.searchsorted(np.cumsum(probability)[:-1], rng.permuted(even, axis=1))]
    sizes = drawn[usual[rare]].T / TYPICAL_FACTOR
    seen = sizes[:, :, None] * (own.T @ (own - rest @ taken_up)) * sizes[:, None]
    normal = rng.standard_normal((robots, len(sizes.T), 1))
    left = np.linalg.solve(np.linalg.cholesky(seen + np.eye(len(sizes.T))).transpose(0, 2, 1), normal)[..., 0]
    few = (sizes * left).T
    others = root.T @ rng.standard_normal((len(root), robots)) - taken_up @ few
    off = moved[:, ~rare] @ others + moved[:, rare] @ few
    scale = np.exp(doubt * rng.standard_normal(robots)) if len(white) else 1.0
    errors = np.sqrt((off.reshape(-1, 3, robots) ** 2).sum(axis=1))
    return np.asarray(np.quantile(errors, LIMIT_QUANTILE, axis=0) * scale)
