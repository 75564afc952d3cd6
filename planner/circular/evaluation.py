"""From a run of circles to the figures of each circle and to ``circular.json``."""

from dataclasses import dataclass

from planner.cell.cell import Cell
from planner.circular.document import CircularDocument
from planner.circular.figures import CircleFigures, PathFigures, circle_figures
from planner.circular.sweeps import find_sweeps, measured_circles
from planner.common.units import in_units
from planner.runs.run import Run


@dataclass(frozen=True)
class CircularTest:
    """A measured circular test: plan, run and robot by name, the figures of its circles, what a person should know."""

    plan_id: str
    run: str
    robot: str
    circles: tuple[CircleFigures, ...]
    warnings: tuple[str, ...]


def evaluate_circles(cell: Cell, plan: CircularDocument, run: Run) -> CircularTest:
    """Evaluate the run of a circular test, planned for the robot of this cell.

    Raises:
        InputError: the run holds no whole sweep.
    """
    rings = measured_circles(cell, [c.name for c in plan.circles])
    traces = find_sweeps(cell, rings, run)
    keys = sorted({(t.ring, t.load or 0.0) for t in traces})
    circles = []
    for k, load in keys:
        mine = [t for t in traces if (t.ring, t.load or 0.0) == (k, load)]
        circles.append(circle_figures(rings[k], mine[0].load, mine))
    return CircularTest(
        plan.plan_id, run.name, cell.robot.name, tuple(circles), _test_warnings(cell, plan, run, circles)
    )


def _test_warnings(cell: Cell, plan: CircularDocument, run: Run, circles: list[CircleFigures]) -> tuple[str, ...]:
    out = list(run.warnings)
    for c in plan.circles:
        mine = [f for f in circles if f.ring.circle.name == c.name]
        driven = {p.direction for f in mine for p in f.paths}
        missing = [d for d in c.directions if d not in driven]
        if not mine:
            out.append(f"circle {c.name} is not in the run")
        elif missing:
            out.append(f"circle {c.name}: no whole sweep {missing[0]} in the run")
        if mine and c.sweep_deg < 360.0:
            std = max(float(f.centre.std.max()) for f in mine)
            out.append(
                f"circle {c.name} is a part of a circle: its centre, and with it what is left, is less well known "
                f"({1e6 * std:.1f} µm)"
            )
    if cell.gauge.zero_free:
        out.append("the bar's zero is not known: the mean radial deviation holds that zero's error as well")
    if run.samples.q_read is None and run.samples.q_cmd is not None:
        out.append("the run has no joint angles as read: angles along the circles are those commanded")
    return tuple(out)


UM_DECIMALS = 3  # of a nanometre


def circular_test_content(test: CircularTest) -> dict[str, object]:
    """Return what ``circular.json`` says."""
    return {
        "schema": "edbb-circular/1",
        "plan_id": test.plan_id,
        "run": test.run,
        "robot": test.robot,
        "circles": [_circle(c) for c in test.circles],
        "warnings": list(test.warnings),
    }


def _circle(c: CircleFigures) -> dict[str, object]:
    return {
        "name": c.ring.circle.name,
        "plane": c.ring.circle.plane,
        **({} if c.load is None else {"load_N": c.load}),
        **in_units(9, radius_mm=c.ring.circle.radius),
        **in_units(UM_DECIMALS, centre_um=c.centre.centre, centre_std_um=c.centre.std),
        "paths": [_path(p) for p in c.paths],
        **in_units(UM_DECIMALS, G_b_um=c.G_b, G_b_least_squares_um=c.G_b_ls, D_um=c.D, H_um=c.H, H_mean_um=c.H_mean),
        **in_units(6, length_range_mm=c.length_range, deviation_from_joint_angles_range_mm=c.calculated_range),
    }


def _path(p: PathFigures) -> dict[str, object]:
    return {
        "direction": p.direction,
        "sweeps": p.sweeps,
        "samples": p.samples,
        **in_units(UM_DECIMALS, G_um=p.G, G_least_squares_um=p.G_ls, F_max_um=p.F_max, F_min_um=p.F_min),
        **in_units(UM_DECIMALS, mean_radial_um=p.mean, centre_um=p.offset),
        "reversals": [
            {
                **in_units(2, angle_deg=r.angle),
                "joints": [j + 1 for j in r.joints],
                **in_units(UM_DECIMALS, step_um=r.step, std_um=r.std),
            }
            for r in p.reversals
        ],
    }
