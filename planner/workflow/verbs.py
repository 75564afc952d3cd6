"""The verbs that are declared: each gives a command, and those that a service does a request and a form."""

from functools import cache

from planner.common.calls import Call, check_call
from planner.common.commands import extension_commands
from planner.common.extensions import broken_extensions
from planner.workflow.compensate_call import CompensateCall
from planner.workflow.core_calls import ExportCall, IdentifyCall, ImportCall, PlanCall, SimulateCall

CORE: tuple[type[Call], ...] = (PlanCall, ExportCall, SimulateCall, IdentifyCall, ImportCall, CompensateCall)
"""The chain; every other verb is an extension's."""


@cache
def declared_calls() -> dict[str, type[Call]]:
    """Return every declaration by its command: those of the core, then those of the extensions that can be used.

    Raises:
        DeclarationError: one of the core is wrong.
    """
    broken_extensions()  # all are imported, and those that cannot be used are left out
    for call in CORE:
        check_call(call)
    core = {call.verb: call for call in CORE}
    brought = {name: c.call for name, c in extension_commands().items() if c.call is not None}
    return core | {name: call for name, call in brought.items() if name not in core}
