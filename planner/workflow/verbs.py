"""The verbs that are declared: each gives a command, and those that a service does a request and a form."""

from planner.common.calls import Call
from planner.studies.study_call import StudyCall
from planner.workflow.check_calls import AccuracyCall, CheckCall, PlanCheckCall
from planner.workflow.circle_calls import CircularCall, LoadedCall, LoadedPlacesCall, PlanBothCall
from planner.workflow.compensate_call import CompensateCall
from planner.workflow.identify_call import IdentifyCall
from planner.workflow.plan_call import PlanCall
from planner.workflow.plan_use_calls import ExportCall, ImportCall, SimulateCall

CALLS: tuple[type[Call], ...] = (
    PlanCall, StudyCall, ExportCall, SimulateCall, IdentifyCall, ImportCall, CompensateCall, AccuracyCall,
    PlanCheckCall, CheckCall, CircularCall, LoadedCall, LoadedPlacesCall, PlanBothCall,
)  # fmt: skip
DECLARED = {call.verb: call for call in CALLS}
"""Every declaration by its command."""
