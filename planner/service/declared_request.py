"""A request, made of the declaration of its verb: its fields, and the words of the command that it becomes."""

from collections.abc import Callable
from inspect import getdoc
from typing import Annotated, Any

from pydantic import Field, create_model

from planner.common.calls import SENT, Call, ServedField, served_fields
from planner.service.job_folder import FileReference, JobId
from planner.service.job_request import JobRequest
from planner.workflow.verbs import declared_calls


def typed_options(verb: str, *others: str) -> list[ServedField]:
    """Return the fields of a verb that a form shows as they are declared, all but those named in ``others``."""
    return [s for s in served_fields(declared_calls()[verb]) if s.is_typed and s.name not in others]


def take_fields(call: type[Call], *laid: str) -> Callable[[type[JobRequest]], type[JobRequest]]:
    """Return a decorator that gives a request the fields that its verb declares.

    Those that the class has by itself stay as they are: it lays them into the folder of the job, and so it does with
    those called ``laid``, which no request names.
    """

    def decorate(request: type[JobRequest]) -> type[JobRequest]:
        """Return the request with the fields of the declaration."""
        served = tuple(
            s for s in served_fields(call) if s.name not in request.model_fields and s.field.name not in laid
        )
        new: dict[str, Any] = {s.name: _annotate(s) for s in served}
        about: dict[str, Any] = {"__module__": request.__module__, "__doc__": getdoc(call), **new}
        made: type[JobRequest] = create_model(request.__name__, __base__=request, **about)
        made.verb, made.declared = call.verb, served
        return made

    return decorate


def _annotate(served: ServedField) -> tuple[Any, Any]:
    """Return type and default of a field of a request."""
    field, option = served.field, served.option
    kind = field.kind if option.typed is None else option.typed
    required, empty = field.is_required, served.is_list
    if option.from_service is not None:
        kind = FileReference if option.from_service == SENT else JobId
    elif empty:
        # 10: of a list in a request
        kind = Annotated[list[Annotated[str, Field(pattern=option.pattern)]], Field(max_length=10)]
    else:
        kind = Annotated[kind, Field(ge=option.min, le=served.maximum, pattern=option.pattern)]
    default: Any = ... if required else [] if empty else field.default
    if default in (None, "", ()):  # not given: as a request says it
        kind, default = kind | None, None
    return kind, Field(default, description=option.help)
