"""Reasons not to use a fit, and what a person should know of one that may be used."""

from collections.abc import Sequence

import numpy as np

from planner.cell import FIRST_POINT, Cell
from planner.identification.fit import Fit
from planner.identification.stages import Fitted
from planner.identification.standing import far_from_declared
from planner.identification.types import Estimate
from planner.identification.validation import new_frames
from planner.run import Run
from planner.units import DEG, MM

LARGEST = {"m": 50 * MM, "rad": 5 * DEG}  # no sound robot is further off than this
TRACEABLE = 20  # readings beyond the parameters, below which nothing is traced
ROUGH = 10 * MM  # held-out rms that no calibrated robot leaves
PULL = 50.0  # [N] from which on where the bar hangs matters to its moments
NAMED = 5  # outliers that a warning names


def problems_of(table: tuple[Estimate, ...], stages: Sequence[Fitted], found: Fit) -> tuple[str, ...]:
    """Return the reasons not to use the result; none when it passed."""
    out = [
        f"{e.name} came out {abs(e.value - e.nominal) / (MM if e.unit == 'm' else DEG):.1f} "
        f"{'mm' if e.unit == 'm' else 'deg'} from nominal: no sound robot is that far off; check robot, units and signs"
        for e in table
        if e.group == "geometry" and abs(e.value - e.nominal) > LARGEST.get(e.unit, np.inf)
    ]
    factor = found.solution.factor
    if len(factor) and not np.all(np.isfinite(factor)):
        out.append("the information of the fit is not finite")
    before, last = (min((s.stage.held_out for s in part), key=lambda m: m.rms) for part in (stages[:2], stages[-1:]))
    if last.rms > ROUGH:
        out.append(
            f"held-out poses are still {last.rms / MM:.1f} mm off: readings do not belong to these poses; look for "
            "rows that were exchanged, another ball, fixture or tool point, and units"
        )
    elif last.rms > before.rms:
        out.append(
            f"held-out poses got worse, {before.rms / MM:.3g} mm to {last.rms / MM:.3g} mm: too few readings for so "
            "many parameters, or an error that is nothing but noise"
        )
    return tuple(out)


def too_few(spare: int) -> str:
    """Say why nothing was traced."""
    return f"only {spare} readings beyond the parameters: too few to trace what is left; nothing was sought"


def warnings_of(run: Run, cell: Cell, found: Fit, validation: Run | None) -> list[str]:
    """Return what a person should know."""
    out, rig = [], found.model.rig
    if cell.file.controller.accuracy_model == "on":
        out.append("the controller already corrects the robot: what was identified is what its correction leaves")
    out += [*_of_bar(run, cell), *_other_point(run, cell), *far_from_declared(cell, rig)]
    if len(found.outliers):
        named = "; ".join(run.where(int(k)) for k in found.outliers[:NAMED])
        more = f"; and {len(found.outliers) - NAMED} more" if len(found.outliers) > NAMED else ""
        out.append(f"{len(found.outliers)} samples are outliers ({named}{more}); they were kept in the fit")
    if all(m is None for m in rig.robot.masses):
        out.append(
            f"{rig.robot.name} has no link masses: what its own weight does is known link by link at best, not in Nm"
        )
    if validation is not None and new_frames(rig, validation):
        out.append("the frames of the validation run were fitted on it: its errors leave out what a frame can take up")
    return out


def _of_bar(run: Run, cell: Cell) -> list[str]:
    length, force = run.readings.length, run.samples.force
    if length is None:
        return []
    out, beyond = [], int(np.sum((length < cell.gauge.length_min) | (length > cell.gauge.length_max)))
    if beyond:
        out.append(f"{beyond} readings lie outside the bar's range in {cell.path.name}")
    if force is not None and np.abs(force).max() > PULL:
        out.append(
            f"the bar pulled with up to {np.abs(force).max():.0f} N: its moments are those about the robot by its data "
            "sheet; edbb loaded fits circles under load with the arm in balance"
        )
    return out


def _other_point(run: Run, cell: Cell) -> list[str]:
    """What is to be told where a bar's run names a tool point and the cell has one without a name."""
    if len(run.points) > 1 or run.points[0] in ("", FIRST_POINT) or not cell.gauge.is_bar or cell.tool.points:
        return []
    return [
        f"{run.name} was measured at tool point '{run.points[0]}', and {cell.path.name} has only one: it was taken "
        "for that; if it is another, give it in [[tool.points]]"
    ]
