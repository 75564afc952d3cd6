"""``edbb circular``: from the log of a circular test to its figures, and their folder."""

from collections.abc import Sequence
from pathlib import Path

from planner.circular import CircularTest, evaluate_circles, read_circular_plan
from planner.circular.results import circular_test_text
from planner.files import write_text
from planner.repeatable import single_threaded
from planner.run import load_runs
from planner.workflow.circle_reading import circular_cell
from planner.workflow.planning import Stages
from planner.workflow.writing import drafted, move_all


@single_threaded
def evaluate_circular_runs(runs: Sequence[Path], plan: Path, stages: Stages) -> CircularTest:
    """Evaluate one or more runs of the circular test at ``plan``; the cell beside it says where the bar stood.

    Raises:
        InputError: a file is wrong, or run, cell and plan do not belong together.
    """
    file = read_circular_plan(plan)
    cell = circular_cell(plan, file)
    with stages.stage("reading"):
        run = load_runs(runs, cell.robot.n_joints)
    with stages.stage("evaluation"):
        return evaluate_circles(cell, file, run)


def write_circular_test(test: CircularTest, folder: Path, stages: Stages) -> list[Path]:
    """Write ``circular.json``, ``report.html`` and its pictures: all of it, or nothing."""
    from planner.report.circular import write_test_report  # matplotlib: other commands start quicker without

    with drafted(folder) as draft, stages.stage("report"):
        write_text(draft / "circular.json", circular_test_text(test))
        write_test_report(test, draft)
        return move_all(draft, folder)
