"""Plan, certify and write measurement programs that calibrate robots with simple gauges, and identify the robot.

Ten lines from a cell to a corrected program::

    from planner import compensate, identify, plan, simulate

    session = plan("comau-nj130/edbb", poses=60)
    session.write("session")
    run = simulate(session)
    robot = identify(run, plan=session)
    print(robot.summary())
    robot.write("calibrated")
    compensate("program.src", model=robot).write("corrected.src")
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "1.0.0"

if TYPE_CHECKING:  # for type checkers and editors
    from planner.cell.cell import Cell as Cell
    from planner.cell.reading import load_cell as load_cell
    from planner.common.result import Plot as Plot
    from planner.common.result import Result as Result
    from planner.documents.forward import forward as forward
    from planner.kinematics.robot import Robot as Robot
    from planner.kinematics.robot_reader import load_robot as load_robot
    from planner.runs.loader import load_run as load_run
    from planner.runs.run import Run as Run
    from planner.runs.writer import frame_of_run as frame_of_run
    from planner.runs.writer import run_of_frame as run_of_frame
    from planner.wings.names import *  # noqa: F403  (extensions say what they give)
    from planner.workflow.compensation import CompensationResult as CompensationResult
    from planner.workflow.compensation import compensate as compensate
    from planner.workflow.identification import CalibrationResult as CalibrationResult
    from planner.workflow.identification import identify as identify
    from planner.workflow.many import identify_many as identify_many
    from planner.workflow.many import simulate_many as simulate_many
    from planner.workflow.plan_results import ExportResult as ExportResult
    from planner.workflow.plan_results import PlanResult as PlanResult
    from planner.workflow.plan_results import SimulationResult as SimulationResult
    from planner.workflow.plan_use import export as export
    from planner.workflow.plan_use import simulate as simulate
    from planner.workflow.planning import plan as plan

_MODULES = {
    "cell.cell": ("Cell",),
    "cell.reading": ("load_cell",),
    "common.result": ("Plot", "Result"),
    "documents.forward": ("forward",),
    "kinematics.robot": ("Robot",),
    "kinematics.robot_reader": ("load_robot",),
    "runs.loader": ("load_run",),
    "runs.run": ("Run",),
    "runs.writer": ("frame_of_run", "run_of_frame"),
    "workflow.compensation": ("CompensationResult", "compensate"),
    "workflow.identification": ("CalibrationResult", "identify"),
    "workflow.many": ("identify_many", "simulate_many"),
    "workflow.plan_use": ("export", "simulate"),
    "workflow.plan_results": ("ExportResult", "PlanResult", "SimulationResult"),
    "workflow.planning": ("plan",),
}
_HOME = {name: f"planner.{module}" for module, names in _MODULES.items() for name in names}  # imported when first used


def _homes() -> dict[str, str]:
    """Return the module of each name: those of the core, and what extensions give."""
    from planner.common.commands import extension_names
    from planner.common.extensions import load_extensions

    load_extensions()
    return {**extension_names(), **_HOME}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        return ["__version__", *sorted(_homes())]
    home = _HOME.get(name) or (None if name.startswith("_") else _homes().get(name))
    if home is None:
        raise AttributeError(f"module 'planner' has no attribute '{name}' (there: {', '.join(__dir__())})")
    return getattr(import_module(home), name)


def __dir__() -> list[str]:
    return ["__version__", *sorted(_homes())]
