"""Many simulated runs and many identifications, side by side on all processors."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from planner.common.calls import called_with
from planner.common.notebook import shown_progress
from planner.common.progress import Progress, no_progress
from planner.common.second_process import map_in_copies
from planner.runs.run import Run
from planner.workflow.core_calls import IdentifyCall
from planner.workflow.identification import CalibrationResult, fit_runs
from planner.workflow.measured_runs import read_measured_runs
from planner.workflow.plan_results import SimulationResult
from planner.workflow.plan_use import simulate

if TYPE_CHECKING:
    from planner.workflow.plan_results import SessionResult

A = TypeVar("A")
T = TypeVar("T")


def simulate_many(
    plan: "SessionResult | Path | str",
    seeds: Iterable[int],
    *,
    processes: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> list[SimulationResult]:
    """Simulate a plan once for each seed, each as :func:`planner.simulate` does.

    Args:
        plan: as of ``simulate``.
        seeds: one for each run.
        processes: at a time; as many as there are processors by default.
        progress: called with the stage, how many are done, and of how many.
        options: the others of ``simulate``, such as ``truth``.

    Raises:
        InputError: as of ``simulate``.

    Example:
        >>> made = simulate_many("session/plan.json", range(100))  # doctest: +SKIP
    """

    def one(seed: int) -> SimulationResult:
        """Return the run of a seed."""
        return simulate(plan, seed=seed, **options)

    return _each(one, list(seeds), "simulated runs", processes, progress)


def identify_many(
    runs: "Sequence[Run | SimulationResult | Path | str]",
    *,
    release: bool = False,
    no_trace: bool = True,
    processes: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> list[CalibrationResult]:
    """Identify each of many runs by itself, as :func:`planner.identify` does.

    Without causes and without the released robot's posterior, which a trial of many runs seldom needs; that takes a
    hundredth of the time. ``release=True, no_trace=False`` gives what ``identify`` gives.

    Args:
        runs: one identification for each.
        release, no_trace: as of ``identify``.
        processes: at a time; as many as there are processors by default.
        progress: called with the stage, how many are done, and of how many.
        options: the others of ``identify``, such as ``plan``, ``cell``, ``priors``.

    Raises:
        InputError: as of ``identify``.
        NoSolutionError: a fit does not come to rest.

    Example:
        >>> fits = identify_many(runs, plan="session/plan.json")  # doctest: +SKIP
        >>> np.std([fit.values for fit in fits], axis=0)  # doctest: +SKIP
    """
    read = called_with(IdentifyCall)(read_measured_runs)
    given = {"release": release, "no_trace": no_trace, "progress": no_progress, **options}
    # files are read here: data frames hang in a copy
    return _each(fit_runs, [read(run, **given) for run in runs], "identified runs", processes, progress)


def _each(
    task: Callable[[A], T], arguments: Sequence[A], stage: str, processes: int | None, progress: Progress | None
) -> list[T]:
    out = list[T]()
    with shown_progress(progress) as say:
        say(stage, 0, len(arguments))
        for result in map_in_copies(task, arguments, processes):
            out.append(result)
            say(stage, len(out), len(arguments))
    return out
