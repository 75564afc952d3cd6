"""The verbs that are declared: each gives a command, and those that a service does a request and a form."""

from planner.common.calls import Call
from planner.workflow.plan_call import PlanCall

CALLS: tuple[type[Call], ...] = (PlanCall,)
DECLARED = {call.verb: call for call in CALLS}
"""Every declaration by its command."""
