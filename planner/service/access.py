"""Which role each route takes, and what its use is called in the log of deeds; without a rule there is no route."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import cast

from fastapi import FastAPI, Request
from fastapi.routing import APIRoute
from starlette.routing import BaseRoute

from planner.service.callers import CALLER
from planner.service.job_requests import REQUESTS
from planner.service.settings import Role


@dataclass(frozen=True)
class Rule:
    """What a route takes.

    Attributes:
        role: that may use it; ``None``: everybody, logged in or not.
        deed: what its use is called in the log; empty where it is not noted.
    """

    role: Role | None
    deed: str = ""


LOOKED_AT = (
    "/", "/jobs", "/jobs/{id}", "/jobs/{id}/session", "/jobs/{id}/certificate", "/jobs/{id}/correct",
    "/sessions/{id}", "/certificates/{number}", "/robots/{serial}", "/compare",
    "/cells/{robot}/{cell}", "/cells/{cell}", "/calibrate", "/metrics",
    "/api/health", "/api/robots", "/api/robots/{name}", "/api/dialects", "/api/cells", "/api/cells/{robot}/{cell}",
    "/api/runs", "/api/files/{id}", "/api/jobs", "/api/jobs/{id}", "/api/jobs/{id}/result", "/api/jobs/{id}/report",
    "/api/jobs/{id}/files/{name:path}", "/api/events", "/api/records", "/api/records/{serial}",
    "/api/contents/{sha256}", "/api/sessions", "/api/sessions/{id}", "/api/records/{serial}/opcua",
    "/api/records/{serial}/export", "/worker.js", "/api/certificates/{number}", "/api/certificates/{number}/pdf",
)  # fmt: skip
PLURALS = {"study": "studies"}


def submit_path(kind: str) -> str:
    """Return where jobs of a kind are asked for."""
    return f"/{PLURALS.get(kind, f'{kind}s')}"


RULES = {
    **{f"GET {path}": Rule(Role.LOOK) for path in LOOKED_AT},
    # what only serves a page is a look, though it is computed
    **{
        f"POST /api{submit_path(kind)}": Rule(Role.LOOK) if r.task else Rule(Role.WORK, f"asked for: {kind}")
        for kind, r in REQUESTS.items()
    },
    "POST /api/files": Rule(Role.WORK, "sent a file"),
    "POST /api/runs": Rule(Role.WORK, "sent a run"),
    "POST /api/cells": Rule(Role.WORK, "sent a cell"),
    "DELETE /api/files/{id}": Rule(Role.WORK, "deleted a file"),
    "PATCH /api/cells/{id}": Rule(Role.WORK, "changed a cell"),
    "PATCH /api/jobs/{id}": Rule(Role.WORK, "changed a job"),
    "DELETE /api/jobs/{id}": Rule(Role.WORK, "deleted a job"),
    "POST /api/jobs/{id}/cancel": Rule(Role.WORK, "stopped a job"),
    "POST /api/sessions": Rule(Role.WORK, "began a session at the cell"),
    "POST /api/sessions/{id}/ticks": Rule(Role.WORK, "ticked a checklist"),
    "POST /api/records/{serial}/withdrawal": Rule(Role.WORK, "withdrew a robot"),
    "POST /api/certificates": Rule(Role.WORK, "issued a certificate"),
    "POST /api/certificates/{number}/withdrawal": Rule(Role.WORK, "withdrew a certificate"),
    "PUT /api/records/{serial}": Rule(Role.WORK, "began a robot's record"),
    "POST /api/records/{serial}/entries/{number}/withdrawal": Rule(Role.WORK, "withdrew an entry of a record"),
    "POST /api/records/{serial}/entries": Rule(Role.WORK, "added to a robot's record"),
    "GET /api/deeds": Rule(Role.ADMINISTER),
    "GET /deeds": Rule(Role.ADMINISTER),
    "GET /login": Rule(None),
    "GET /password": Rule(Role.LOOK),
    "POST /password": Rule(Role.LOOK, "changed the password"),
    "POST /login": Rule(None, "logged in"),
    "POST /logout": Rule(None, "logged out"),
}
"""The rule of each method and path."""


def rule_of(request: Request) -> Rule:
    """Return the rule of the route that a request came to."""
    route = cast(APIRoute, request.scope["route"])
    return RULES[f"{request.method} {route.path}"]


async def check_access(request: Request) -> None:
    """Refuse what the caller's role does not allow; every route depends on it.

    Raises:
        ForbiddenError: it is not allowed.
    """
    rule = rule_of(request)
    request.scope["edbb.deed"] = rule.deed
    if rule.role is not None:
        CALLER.get().check_role(rule.role)


def routes_of(routes: Iterable[BaseRoute]) -> Iterator[str]:
    """Yield method and path of every route that depends on a role."""
    for route in routes:
        included = getattr(route, "original_router", None)  # how later versions of FastAPI keep a router
        if included is not None:
            yield from routes_of(included.routes)
        elif isinstance(route, APIRoute):
            yield from (f"{method} {route.path}" for method in sorted((route.methods or set()) - {"HEAD"}))


def check_rules(app: FastAPI) -> None:
    """Make sure that every route has a rule, and every rule a route."""
    found = set(routes_of(app.routes))
    assert found == set(RULES), f"routes and rules differ: {sorted(found ^ set(RULES))}"
