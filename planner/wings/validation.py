"""Validation: what a laser tracker, or a head's repeated centrings, say of a robot."""

from planner.common.commands import register_call
from planner.session.evaluations import Evaluation, register_evaluation
from planner.workflow.accuracy_call import AccuracyCall

PARTS = (
    "accuracy/validation.py", "accuracy/reference_frame.py", "workflow/accuracy.py", "workflow/accuracy_call.py",
    "report/accuracy_report.py",
)  # fmt: skip

register_call(AccuracyCall)
register_evaluation(
    Evaluation("edbb accuracy {run} --cell {cell} --plan {plan} -o accuracy", calibrates=False),
)
