"""What stands before every request: who may ask, how much may be sent, and what a browser may do with the answer."""

import asyncio
import ipaddress
import logging
import socket
import sqlite3
import time
from urllib.parse import urlsplit

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from planner.service.callers import CALLER, Caller, Refusal
from planner.service.context import ServiceContext
from planner.service.login import login_address
from planner.service.problems import ProblemResponse, problem_of
from planner.service.rendering import ROOT, render
from planner.service.settings import LOOPBACK, Role

UPLOADS = ("/api/files", "/api/runs")
OPEN = ("/login", "/logout", "/static/")  # what is there for everybody
LOG = logging.getLogger("edbb.service")
SAFE = ("GET", "HEAD", "OPTIONS")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
EMBEDDING_POLICY = POLICY.replace("style-src 'self'", "style-src 'self' 'unsafe-inline'")
"""A page that holds a report, whose charts have styles of their own; scripts inside it stay forbidden."""
REPORT_POLICY = (  # a report has its scripts inside; in a sandbox it is of no origin and reaches nothing
    "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; frame-ancestors 'none'"
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "same-origin",  # without any a browser says no origin with the form of the log-in
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "x-frame-options": "DENY",
}


class BodyTooLargeError(HTTPException):
    """More was sent than may be."""

    def __init__(self, most: int) -> None:
        super().__init__(413, f"at most {most} bytes are taken")


class Guard:
    """ASGI middleware: Host, Origin, who asks, size of the body, headers of the answer, and the log of deeds.

    ``body_s``: in which a body that is no upload has to come [s].
    """

    body_s = 30.0

    def __init__(self, app: ASGIApp, context: ServiceContext) -> None:
        self._app, self._context, self._settings = app, context, context.settings
        names = (*LOOPBACK, *self._settings.names, self._settings.host, socket.gethostname())
        self._names = {n.lower() for n in names}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        guarded, root = self._add_headers(send), self._settings.root_path
        if root and str(scope["path"]).startswith(f"{root}/"):  # a proxy that leaves the path as it is
            scope.update(path=scope["path"][len(root) :], raw_path=scope["raw_path"][len(root) :])
        ROOT.set(root)
        caller = self._refusal(scope) or self._find_caller(scope)
        if isinstance(caller, Response):
            await caller(scope, receive, guarded)
            return
        CALLER.set(caller)
        scope["edbb.caller"] = caller
        if caller.unnoted:
            await run_in_threadpool(self._context.people.note_use, caller.cookie)
        answered: dict[str, str] = {}
        taken = _count_bytes(receive, self._most_body(scope), None if scope["path"] in UPLOADS else self.body_s)
        await self._app(scope, taken, _note_answer(guarded, answered))
        if scope.get("edbb.deed") and answered:
            await run_in_threadpool(self._note_deed, scope, caller, answered)

    def _find_caller(self, scope: Scope) -> Caller | Response:
        """Return who asks, or the answer to somebody who is not known."""
        try:
            found = self._context.finder.find(scope)
        except sqlite3.Error as err:
            return problem_of(err)
        if isinstance(found, Refusal):
            return _refuse(scope, found) or Caller(role=Role.LOOK, address=found.address)
        return found

    def _note_deed(self, scope: Scope, caller: Caller, answered: dict[str, str]) -> None:
        person, status = scope.get("edbb.person", caller.name), int(answered["status"])
        deed = "tried to log in" if scope["path"] == "/login" and status >= 400 else scope["edbb.deed"]
        try:
            self._context.deeds.add(person, caller.address, deed, answered.get("location") or scope["path"], status)
        except sqlite3.Error as err:
            LOG.error("%s: '%s' could not be noted: %s", person, deed, err)

    def _refusal(self, scope: Scope) -> Response | None:
        """Return why a request is refused whoever sends it."""
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self._is_known(host):
            return ProblemResponse(421, "this service is not known by that name; see edbb serve --name")
        origin = headers.get("origin")
        if origin is not None and _host_of(origin) != host.lower():
            return ProblemResponse(403, "requests from other sites are refused")
        if headers.get("sec-fetch-site") == "cross-site" and scope["method"] not in SAFE:
            return ProblemResponse(403, "requests from other sites are refused")
        length = headers.get("content-length", "0")
        if not length.isdigit() or int(length) > self._most_body(scope):
            return ProblemResponse(413, f"at most {self._most_body(scope)} bytes are taken")
        return None

    def _is_known(self, host: str) -> bool:
        """An address cannot be pointed elsewhere by a foreign name server; a name must be one of ours."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
            ipaddress.ip_address(name)
        except ValueError:
            return host.partition(":")[0].lower() in self._names
        return True

    def _most_body(self, scope: Scope) -> int:
        # 1 << 20: bytes of any body but an upload's
        return self._settings.most_upload if scope["path"] in UPLOADS else (1 << 20)

    def _add_headers(self, send: Send) -> Send:
        root = self._settings.root_path

        async def with_headers(message: Message) -> None:
            """Send the answer with the headers of safety."""
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
                if headers.get("location", "").startswith("/"):
                    headers["location"] = root + headers["location"]
                if headers.get("link", "").startswith("</"):
                    headers["link"] = f"<{root}{headers['link'][1:]}"
                headers.setdefault("content-security-policy", POLICY)
                headers.setdefault("cache-control", "no-store")
            await send(message)

        return with_headers


def _host_of(origin: str) -> str:
    """Return host and port of an origin; nothing of one that is none, such as ``null``."""
    try:
        return urlsplit(origin).netloc.lower()
    except ValueError:
        return ""


def _count_bytes(receive: Receive, most: int, within_s: float | None) -> Receive:
    taken, left, begun = 0, True, time.monotonic()

    async def receive_some() -> Message:
        """Receive a part of the body, as long as it is not too large and comes in time."""
        nonlocal taken, left
        try:
            rest_s = within_s and left and begun + within_s - time.monotonic()
            message = await (asyncio.wait_for(receive(), rest_s) if rest_s else receive())
        except TimeoutError as err:
            raise HTTPException(408, f"the request did not come within {within_s:g} s; send it again") from err
        taken, left = taken + len(message.get("body", b"")), bool(message.get("more_body"))
        if taken > most:
            raise BodyTooLargeError(most)
        return message

    return receive_some


def _refuse(scope: Scope, refusal: Refusal) -> Response | None:
    """Return the answer to somebody who is not known; nothing where everybody may go."""
    path = str(scope["path"])
    if path.startswith(OPEN):
        return None
    answer: Response
    if path.startswith("/api/") or scope["method"] not in SAFE or path == "/metrics":
        how = "; a program sends the header 'Authorization: Bearer …' (edbb --server: EDBB_TOKEN)"
        words = how if refusal.status == 401 else ""
        answer = ProblemResponse(refusal.status, f"{refusal.words}{words}")
    elif refusal.status == 401:
        return RedirectResponse(login_address(path), 303)
    else:
        answer = _problem_page(refusal)
    if refusal.status == 401:
        answer.headers["www-authenticate"] = "Bearer"
    if refusal.wait_s:
        answer.headers["retry-after"] = f"{refusal.wait_s:.0f}"
    return answer


def _problem_page(refusal: Refusal) -> HTMLResponse:
    return render("problem", refusal.status, detail=f"{refusal.words[:1].upper()}{refusal.words[1:]}.")


def _note_answer(send: Send, answered: dict[str, str]) -> Send:
    """Pass an answer on, and keep its status and where it leads."""

    async def pass_on(message: Message) -> None:
        """Send a part of the answer; of its head keep status and address."""
        if message["type"] == "http.response.start":
            answered["status"] = str(message["status"])
            leads = Headers(raw=message["headers"]).get("location", "")
            answered["location"] = leads if message["status"] < 300 else ""
        await send(message)

    return pass_on
