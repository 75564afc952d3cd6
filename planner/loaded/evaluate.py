"""``evaluate()``: a loaded run as the EDBB paper evaluates it (sections 2.2, 4.2), with what each number is worth."""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell import Cell
from planner.errors import InputError
from planner.identification.placed import rig_for
from planner.loaded.averaging import averaged_curves
from planner.loaded.balance import raised
from planner.loaded.centring import centring_offset, paper_offset, sine
from planner.loaded.checks import check_cell, check_loads, check_reach, check_sign, problems_of, warnings_of
from planner.loaded.compliance import bar_deflection, compliances
from planner.loaded.sentences import sentences_of
from planner.loaded.told import Compliances
from planner.loaded.tracker import compared
from planner.loaded.types import Curves, Evaluated, Loaded
from planner.repeatable import single_threaded
from planner.rig import Rig
from planner.run import Run
from planner.units import DEG, Array, frozen

PAPER = 180.0 * DEG
TWICE = 2  # rounds: the second with the fixture where the first found it


@dataclass(frozen=True)
class Options:
    """What the caller may choose.

    Attributes:
        overshoot: how much of either end of a pass is overshoot [rad]; ``None``: as the cell says.
        paper: whether eq. 9 is fitted in the paper's form as well, with b free; only its reproduction needs that.
    """

    overshoot: float | None = None
    paper: bool = False


@single_threaded
def evaluate(run: Run, cell: Cell, tracker: Run | None = None, options: Options | None = None) -> Loaded:
    """Evaluate a run of loaded circles, one or more fixtures.

    Raises:
        InputError: run and cell do not belong together, the loads are too few, too large or of the wrong sign, or what
            was driven is no circle.
        NoSolutionError: the fit does not come to rest.
    """
    check_cell(cell)
    rig = rig_for(cell, run)
    options = options or Options()
    curves = averaged_curves(rig, run, _dropped(cell, options.overshoot))
    check_loads(cell, curves, run.name)
    for c in curves:
        check_reach(cell, rig, c, run.name)
        check_sign(c, run.name)
    circles: tuple[Evaluated, ...] = ()
    for _ in range(TWICE):
        told = compliances(rig, curves)
        found = told.compliances
        circles = tuple(
            _evaluated(raised(rig, c, float(h)), c, found, options.paper)
            for c, h in zip(curves, told.heights, strict=True)
        )
        rig = _replaced(rig, circles)
    if tracker is not None:
        circles = _beside_tracker(cell, rig, circles, tracker)
    return Loaded(
        run.name, cell.robot.name, circles, found, sentences_of(circles, found), problems_of(found),
        (*run.warnings, *warnings_of(circles, found)),
    )  # fmt: skip


def _dropped(cell: Cell, wanted: float | None) -> float:
    """What is left out at either end of a pass [rad]."""
    there = overshoot_of(cell)
    if wanted is not None and cell.circles and wanted > there + 1e-9:
        raise InputError(
            f"--overshoot {wanted / DEG:g} would drop more than the passes of {cell.path} run over at either end of "
            f"their turn, {there / DEG:g} degrees (circles.overshoot_deg)"
        )
    return there if wanted is None else wanted


def overshoot_of(cell: Cell) -> float:
    """Return what the cell's circles run over before and after their sweep [rad]; the paper's 180° without any."""
    return min((c.overshoot for c in cell.circles), default=PAPER)


def _evaluated(rig: Rig, curves: Curves, found: Compliances, paper: bool) -> Evaluated:
    yielded = bar_deflection(rig, curves, found.value)
    compensated = curves.length - yielded
    apart = np.ptp(compensated, axis=1)
    averaged = compensated.mean(axis=1)
    averaged = averaged - averaged.mean(axis=1, keepdims=True)
    both = averaged.mean(axis=0)
    offset = centring_offset(curves.theta, both)
    return Evaluated(
        curves=curves,
        predicted=frozen(yielded[:, 1:] - yielded[:, :1]),
        compensated=frozen(compensated),
        spread=float(apart.max()),
        spread_rms=float(np.sqrt(np.mean(compensated.std(axis=1) ** 2))),
        bent=_bent(curves),
        averaged=frozen(averaged),
        offset=offset,
        paper_offset=paper_offset(curves.theta, both) if paper else None,
        centre_offset=frozen(_centre_offset(curves, offset.amplitude, offset.phase)),
        kinematic=frozen(averaged - sine(offset, curves.theta)),
    )


def _bent(curves: Curves) -> float:
    """Largest distance of the loads' curves at one angle after the best straight line over the load [m]."""
    force = curves.force - curves.force.mean(axis=1, keepdims=True)
    length = curves.length - curves.length.mean(axis=1, keepdims=True)
    slope = (force * length).sum(axis=1, keepdims=True) / (force**2).sum(axis=1, keepdims=True)
    return float(np.ptp(length - slope * force, axis=1).max())


def _centre_offset(curves: Curves, amplitude: float, phase: float) -> Array:
    """Offset of the circle's centre from the fixture's axis, (2,) [m], from the sine that it makes.

    The bar leans by γ to the circle's plane; a shift m of the centre changes its length by cos γ (m · direction).
    """
    lean = curves.circle.radius / float(np.hypot(curves.circle.radius, _height(curves)))
    return np.array([-amplitude * np.sin(phase), amplitude * np.cos(phase)]) / lean


def _height(curves: Curves) -> float:
    """Height of the circle above the fixture's ball, along the circle's normal [m]."""
    return float((curves.circle.centre - curves.circle.p_BX) @ curves.circle.axes[2])


def _replaced(rig: Rig, circles: tuple[Evaluated, ...]) -> Rig:
    """Return the rig with every fixture where its centring offset says it is."""
    p_BX = np.array(rig.p_BX)
    for c in circles:
        circle = c.curves.circle
        below = circle.centre - _height(c.curves) * circle.axes[2]
        p_BX[circle.place] = below - c.centre_offset @ circle.axes[:2]
    return replace(rig, p_BX=frozen(p_BX))


def _beside_tracker(cell: Cell, rig: Rig, circles: tuple[Evaluated, ...], run: Run) -> tuple[Evaluated, ...]:
    if len(circles) > 1:
        raise InputError(
            f"{run.name}: a tracker's run is compared with one circle, but the bar was driven at {len(circles)} "
            "fixtures; evaluate the fixture of that run alone"
        )
    if run.robot is not None and run.robot != cell.robot.name:
        raise InputError(
            f"{run.name}: was measured on '{run.robot}', but {cell.path} has the robot '{cell.robot.name}'"
        )
    return (replace(circles[0], tracker=compared(cell, rig, circles[0], run)),)
