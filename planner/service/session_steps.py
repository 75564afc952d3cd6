"""What a person does at the cell, step by step, from the plan and its cell."""

from dataclasses import dataclass
from pathlib import Path

from planner.cell.file import CellFile
from planner.service.answers import OutputFile
from planner.session.document import PlanDocument


@dataclass(frozen=True)
class SessionStep:
    """One step, and the files that it needs."""

    title: str
    text: str
    files: tuple[OutputFile, ...] = ()


def session_steps(plan: PlanDocument, cell: CellFile, files: list[OutputFile]) -> list[SessionStep]:
    """Return the steps from an empty cell to a saved log, in order."""
    minutes = f"{plan.trajectory.duration_s / 60:.0f} minutes" if plan.trajectory else "a while"
    return [
        SessionStep(
            "Clear the cell",
            "Nobody and nothing stands within reach that the cell file does not name. Keep the stop at hand.",
        ),
        SessionStep("Switch off what corrects", "Accuracy options of the controller are off."),
        SessionStep(
            "Bring the program to the controller",
            f"It bears the plan {plan.plan_id} in its first lines.",
            _programs(plan, files),
        ),
        SessionStep("Fixture and tool", _places(cell)),
        SessionStep("Warm up", "Drive for half an hour as in work, so that the robot is as warm as when it works."),
        SessionStep(
            "Drive to the start slowly",
            "Run the first move at low override and watch: the way from where the robot stands to home is not planned.",
        ),
        *_attach(cell),
        SessionStep("Start the log", _log_text(cell)),
        SessionStep("Run the program", f"It drives for {minutes} through {len(plan.poses)} poses. Stay beside it."),
        SessionStep("Save the log", f"As CSV, with the line '# plan_id: {plan.plan_id}' above the columns."),
    ]


def _programs(plan: PlanDocument, files: list[OutputFile]) -> tuple[OutputFile, ...]:
    """The programs of the plan, with the files that go with them."""
    stems = {Path(p["file"]).stem for p in plan.programs}
    return tuple(f for f in files if any(f.name.startswith(s) for s in stems))


def _places(cell: CellFile) -> str:
    where = "; ".join(f"{f.name or 'A'} at {_numbers(f.position_mm)} mm" for f in cell.fixtures)
    fixture = f"Fixture {where} in the base frame, to about 1 mm. " if where else ""
    tool = f"Measured point at {_numbers(cell.tool.map_mm)} mm in the flange. " if cell.tool else ""
    return f"{fixture}{tool}Balls and magnets are clean, everything is tight."


def _attach(cell: CellFile) -> list[SessionStep]:
    if not cell.fixtures:
        return []
    zero = "Set it to zero as the program asks." if cell.gauge.zero == "free" else "Check its known zero."
    return [SessionStep("Attach the gauge", f"Where the program pauses: put both balls into their cups. {zero}")]


def _log_text(cell: CellFile) -> str:
    reading = "the gauge's length" if cell.fixtures else "the gauge's reading"
    return (
        f"One row a {'pose' if cell.motion.measure == 'static' else 'sample'}: time, joint angles as read, {reading}."
    )


def _numbers(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:g}" for v in values)
