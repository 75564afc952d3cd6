"""Circles: the circular test, and circles under load."""

from planner.cell.section_registry import register_section
from planner.common.advice import Occasion, register_advice
from planner.common.commands import register_call, register_names
from planner.session.evaluations import Evaluation, register_evaluation
from planner.workflow.circle_calls import CircularCall, LoadedCall, LoadedPlacesCall, PlanBothCall
from planner.workflow.plan_kinds import PlanKind, register_plan_kind

PARTS = (
    "circular", "loaded", "workflow/circle_calls.py", "workflow/circle_evaluation.py",
    "workflow/loaded_planning.py", "report/circular_report.py",
    "report/loaded_report.py", "report/templates/circular.html.j2", "report/templates/circular_plan.html.j2",
    "report/templates/loaded.html.j2",
)  # fmt: skip
CELLS = ("abb-irb6700/ldbb", "comau-nj130/circular")  # shipped cells that have the section of this extension

for call in (CircularCall, LoadedCall, LoadedPlacesCall, PlanBothCall):
    register_call(call)
register_section("circles", "planner.circular.section:READER")
register_plan_kind(PlanKind("circular", "circles", "planner.workflow.loaded_planning:CircularMaker"))
register_evaluation(
    Evaluation(
        "edbb circular {run} --plan {plan} -o circular; under load edbb loaded {run} --cell {cell} -o loaded",
        kind="circular",
    )
)
register_advice(Occasion.STRONG_PULL, "; edbb loaded fits circles under load with the arm in balance")
register_advice(
    Occasion.LOADED_RUN,
    "; edbb loaded brings {run} into a static run, averaged.csv, or fits both at once (--unloaded)",
)
register_names("planner.workflow.loaded_planning", "CircularPlanResult")
