"""The verbs that are declared: each gives a command, and those that a service does a request and a form."""

from functools import cache

from planner.common.calls import Call
from planner.common.commands import extension_commands
from planner.common.errors import InputError
from planner.common.extensions import load_extensions
from planner.workflow.compensate_call import CompensateCall
from planner.workflow.identify_call import IdentifyCall
from planner.workflow.plan_call import PlanCall
from planner.workflow.plan_use_calls import ExportCall, ImportCall, SimulateCall

CORE: tuple[type[Call], ...] = (PlanCall, ExportCall, SimulateCall, IdentifyCall, ImportCall, CompensateCall)
"""The chain; every other verb is an extension's."""


@cache
def declared_calls() -> dict[str, type[Call]]:
    """Return every declaration by its command: those of the core, then those of the extensions.

    Raises:
        InputError: an extension cannot be loaded, or takes a command of the core.
    """
    load_extensions()
    core = {call.verb: call for call in CORE}
    brought = {name: c.call for name, c in extension_commands().items() if c.call is not None}
    if taken := sorted(core.keys() & extension_commands().keys()):
        raise InputError(f"command '{taken[0]}': an extension brings it, and the planner has it already")
    return core | brought
