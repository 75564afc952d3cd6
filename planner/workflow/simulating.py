"""``edbb simulate``: the run that a plan would give, on a robot with known errors."""

from pathlib import Path

from planner.cell.reading import read_cell
from planner.circular import is_circular
from planner.errors import InputError
from planner.plan import read_plan
from planner.repeatable import single_threaded
from planner.simulation import SimulatedRun, drawn, read_truth, samples_of, simulate, told_impossible
from planner.workflow.circle_reading import simulate_circles
from planner.workflow.export import _course


@single_threaded
def simulate_plan(plan_file: Path, truth: Path | None, seed: int) -> SimulatedRun:
    """Simulate the measured run of the plan at ``plan_file``; errors are drawn where no ``truth`` is given.

    A smoke test of the chain, as planner and identifier share its model; the run carries what is true.

    Raises:
        InputError: no plan, no cell beside it, the two do not belong together, or a truth that is wrong.
    """
    if is_circular(plan_file):
        return simulate_circles(plan_file, truth, seed)
    plan = read_plan(plan_file)
    beside = plan_file.parent / "cell.toml"
    if not beside.is_file():
        raise InputError(f"{beside} is missing: a plan is simulated together with the cell that was planned")
    cell = read_cell(beside, "cell")
    samples = samples_of(cell, plan, [_course(plan_file, cell, d) for d in plan.drives])
    known = drawn(cell, seed) if truth is None else read_truth(truth, cell, samples)
    return told_impossible(cell, simulate(cell, plan.plan_id, samples, known, seed), samples)
