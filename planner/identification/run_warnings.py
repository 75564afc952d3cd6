"""What a person must know of a run, its cell and the readings that do not fit it."""

from collections.abc import Sequence

import numpy as np

from planner.cell.cell import Cell
from planner.cell.file import FIRST_POINT
from planner.common.advice import Occasion, advice
from planner.common.summary import Aside
from planner.common.units import MM, Array
from planner.fit.artifact_pose import declared_pose_warnings
from planner.fit.assumptions import COUNTED, STRONG_PULL
from planner.fit.cross_validation import validation_residual
from planner.fit.least_squares import Fit
from planner.fit.run_setup import setup_for_run
from planner.fit.wild_rows import validation_weights
from planner.model.identification_document import error_size
from planner.runs.run import Run


def collect_warnings(run: Run, cell: Cell, found: Fit, weight: Array, off: Array) -> list[str]:
    """Return warnings about the run, the cell and the rows that stand outside.

    Args:
        run, cell: what was measured where.
        found: the fit.
        weight: by how much each row counts, (n,).
        off: how far each is off where it is held out, (n,) [m].
    """
    out, setup = [], found.setup
    if cell.controller.accuracy_model == "on":
        out.append("the controller already corrects the robot: what was identified is what its correction leaves")
    out += [*_of_pull(run), *_other_point(run, cell), *declared_pose_warnings(cell, setup)]
    out += [*_wild_rows_text(run, weight, off, cell.gauge.unit), *found.problem.whitener.noise.remarks]
    if all(m is None for m in setup.robot.masses):
        masses = "what its own weight does is known link by link at best, not in Nm"
        out.append(Aside(f"{setup.robot.name} has no link masses: {masses}"))
    return out


def _wild_rows_text(run: Run, weight: Array, off: Array, unit: str) -> list[str]:
    """Name the rows that stand outside the noise, and by how much each of them counts."""
    wild = np.flatnonzero(weight < COUNTED)
    if not len(wild):
        return []
    named = []
    for part in np.split(wild, np.flatnonzero(np.diff(wild) != 1) + 1):
        where = " to ".join(run.where(int(k)) for k in dict.fromkeys((part[0], part[-1])))
        each = "each counts" if len(part) > 1 else "counts"
        share = f"{100 * weight[part].max():.2g} %" if weight[part].max() > 1e-3 else "less than 0.1 %"
        named.append(f"{where}: {off[part].max() / MM:.3g} {unit} off, {each} for {share} of a reading")
    stand = "1 row stands" if len(wild) == 1 else f"{len(wild)} rows stand"
    return [f"{stand} far outside the noise of the others ({_name_some(named)})"]


def warn_of_validation(found: Fit, cell: Cell, validation: Run | None) -> list[str]:
    """Return warnings about a run that no fit saw, if there is one."""
    if validation is None:
        return []
    out, setup = [], found.setup
    if setup.gauge.needs_new_frames(setup, validation):
        out.append("the frames of the validation run were fitted on it: its errors leave out what a frame can take up")
    residual = validation_residual(found, validation, setup_for_run(cell, validation))
    return out + _wild_validation_text(validation, residual, cell.gauge.unit)


def _wild_validation_text(run: Run, residual: Array, unit: str) -> list[str]:
    """Name rows of a validation that are off far more than its others, and say what is left without them."""
    size, fine = error_size(residual), validation_weights(residual) >= COUNTED
    if fine.all():
        return []
    named = _name_some([f"{run.where(k)} by {size[k] / MM:.3g} {unit}" for k in np.flatnonzero(~fine).tolist()])
    rows, they = ("1 row", "it") if (~fine).sum() == 1 else (f"{(~fine).sum()} rows", "them")
    return [
        f"of the validation's rows {rows} may be wrong, being off far more than the others ({named}): exchanged, "
        f"mistyped, or the ball was badly seated? The mean error is {size.mean() / MM:.3g} {unit} with {they}, and "
        f"{size[fine].mean() / MM:.3g} {unit} without"
    ]


def _name_some(rows: Sequence[str]) -> str:
    """Name the first few of some rows, and how many more there are."""
    named = 5  # rows, or stretches of neighbours, that a warning names
    more = [f"and {len(rows) - named} more"] if len(rows) > named else []
    return "; ".join([*rows[:named], *more])


def _of_pull(run: Run) -> list[str]:
    force = run.samples.force
    if run.readings.length is None or force is None or np.abs(force).max() <= STRONG_PULL:
        return []
    return [
        f"the bar pulled with up to {np.abs(force).max():.0f} N: its moments are those about the robot by its data "
        f"sheet{advice(Occasion.STRONG_PULL)}"
    ]


def _other_point(run: Run, cell: Cell) -> list[str]:
    """Return a warning if the run names a tool point and the cell has a single one without a name."""
    if (
        len(run.points) > 1
        or run.points[0] in ("", FIRST_POINT)
        or not cell.gauge.is_attached
        or len(cell.tool.points) > 1
    ):
        return []
    return [
        f"{run.name} was measured at tool point '{run.points[0]}', and {cell.path.name} has only one: it was taken "
        "for that; if it is another, give it in [[tool.points]]"
    ]
