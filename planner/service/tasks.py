"""What the service itself computes for its pages, in the process of a job: checks and views of cells, runs and plans.

Run in the folder of a job, with the words of the job's command; a failure ends as one of ``edbb`` does.
"""

import sys
from pathlib import Path

from pydantic import BaseModel

from planner.common.errors import InputError, PlannerError

RESULT = Path("out/view.json")


def run_task(words: list[str]) -> BaseModel:
    """Return what the task of these words finds.

    Raises:
        InputError: the cell, the plan or the run is wrong.
    """
    name, *rest = words
    if name == "cell-check":
        return _check_cell(rest[0])
    if name == "plan-view":
        from planner.service.plan_views import plan_view

        return plan_view(Path("plan/plan.json"))
    if name == "error-map":
        return _map_errors(rest[0])
    if name == "run-check":
        return _check_run(rest)
    raise InputError(f"there is no task '{name}'")


def _check_cell(reference: str) -> BaseModel:
    from planner import load_cell
    from planner.motion.collision.surroundings import check_surroundings
    from planner.service.views import check_view

    cell = load_cell(reference)
    check_surroundings(cell)
    return check_view(cell)


def _map_errors(reference: str) -> BaseModel:
    from planner import load_cell
    from planner.service.error_views import map_errors

    return map_errors(load_cell(reference), Path("calibrated/expected_error.csv"))


def _check_run(words: list[str]) -> BaseModel:
    from planner import load_cell
    from planner.service.run_views import check_run

    cell = load_cell(words[words.index("--cell") + 1], planning=False)
    options = {k + j for k, w in enumerate(words) if w in ("--cell", "--plan") for j in (0, 1)}
    return check_run([Path(w) for k, w in enumerate(words) if k not in options], cell)


def main() -> None:
    """Run the task, and write what it found."""
    try:
        found = run_task(sys.argv[1:])
        RESULT.parent.mkdir(exist_ok=True)
        RESULT.write_text(found.model_dump_json(), encoding="utf-8")
    except PlannerError as err:
        sys.stderr.write(f"edbb: {err}\n")
        raise SystemExit(err.exit_code) from err


if __name__ == "__main__":
    main()
