"""Checks and records: has a calibrated robot changed, and what happened to it over the years."""

from planner.checks.words import CHECK_NOTE, DRAWN_FOR_CHECK, FORECAST
from planner.common.commands import register_call, register_command, register_names
from planner.session.evaluations import Evaluation, register_drawn_warning, register_evaluation
from planner.workflow.check_calls import CheckCall, PlanCheckCall

PARTS = (
    "checks", "workflow/check_calls.py",
    "workflow/checking.py", "workflow/recording.py", "report/check_report.py",
    "report/templates/record.html.j2", "cli/record_commands.py",
)  # fmt: skip

register_call(PlanCheckCall)
register_call(CheckCall)
register_command(
    "record", "Keep the history of one robot, and show its drift.", "planner.cli.record_commands:record_command", "Keep"
)
register_evaluation(Evaluation("edbb check {run} --plan {plan} --model {model} -o checked", beside=FORECAST))
register_drawn_warning(CHECK_NOTE, DRAWN_FOR_CHECK)
register_names("planner.workflow.checking", "CheckPlanResult", "CheckResult", "check", "plan_check")
register_names("planner.workflow.recording", "record")
