"""The methods HEAD and OPTIONS, which no route has to know: answers without a body, and what may be asked of a path.

The log of accesses, a line a request in the common log format with the time that it took [s] at its end.

What may wait at the door: a connection that has not said its request yet is closed in time, and few come from one.

A request is known, and refused or let in, only when its headers have come, and answered when its body has. Until then a
connection costs its sender nothing, and a thousand of them would hold off all others.
"""

import asyncio
import logging
import sys
import time
from collections import OrderedDict
from logging.handlers import WatchedFileHandler
from typing import Any, ClassVar
from urllib.parse import quote

from starlette.applications import Starlette
from starlette.responses import Response
from starlette.routing import Match, Mount
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from planner.common.errors import InputError

ASKED = ("GET", "POST", "PUT", "PATCH", "DELETE")


class PlainMethods:
    """ASGI middleware that answers HEAD as GET without the body, and OPTIONS with the methods that a path takes."""

    def __init__(self, app: ASGIApp, routes: Starlette) -> None:
        self._app, self._routes = app, routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer HEAD and OPTIONS; pass on all else."""
        method = scope.get("method") if scope["type"] == "http" else None
        if method == "HEAD":
            await self._answer_head(scope, send)
        elif method == "OPTIONS" and (allowed := self._allowed_methods(scope)):
            await Response(status_code=204, headers={"allow": ", ".join(allowed)})(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _allowed_methods(self, scope: Scope) -> list[str]:
        """Return the methods that a path takes; none of a path that is not there."""
        taken = set()
        for route in self._routes.routes:
            asked = ASKED[:1] if isinstance(route, Mount) else ASKED  # files that come with the package are read alone
            taken |= {m for m in asked if route.matches({**scope, "method": m})[0] == Match.FULL}
        return sorted(taken | {"OPTIONS"} | ({"HEAD"} if "GET" in taken else set())) if taken else []

    async def _answer_head(self, scope: Scope, send: Send) -> None:
        """Ask as GET would, and send only what comes before the body; no file is read, a stream ends at once."""
        ended = asyncio.Event()
        asked_before: list[bool] = []

        async def receive_nothing() -> Message:
            """Return the empty body once; then wait until the answer has ended."""
            if not asked_before:
                asked_before.append(True)
                return {"type": "http.request", "body": b"", "more_body": False}
            await ended.wait()
            return {"type": "http.disconnect"}

        async def send_head(message: Message) -> None:
            """Send the head of the answer alone."""
            if message["type"] == "http.response.start":
                await send(message)
            elif not ended.is_set():
                ended.set()
                await send({"type": "http.response.body", "body": b"", "more_body": False})

        known: dict[str, object] = {"http.response.pathsend": {}}  # files are handed over by their path
        asked = {**scope, "method": "GET", "extensions": {**scope.get("extensions", {}), **known}}
        await self._app(asked, receive_nothing, send_head)


LOG = logging.getLogger("edbb.access")


def open_log(path: str) -> None:
    """Let accesses be written to a file, or to standard error where it is called ``-``; ``logrotate`` may move it.

    Raises:
        InputError: it cannot be written.
    """
    try:
        handler = logging.StreamHandler(sys.stderr) if path == "-" else WatchedFileHandler(path, encoding="utf-8")
    except OSError as err:
        raise InputError(f"--access-log {path}: cannot be written ({err.strerror})") from err
    handler.setFormatter(logging.Formatter("%(message)s"))
    LOG.handlers[:] = [handler]
    LOG.setLevel(logging.INFO)
    LOG.propagate = False


class AccessLog:
    """ASGI middleware that writes a line when an answer has gone out."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, and note it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        begun, answered = time.monotonic(), {"status": 500, "bytes": 0}

        async def count(message: Message) -> None:
            """Pass a part of the answer on, and count its bytes."""
            if message["type"] == "http.response.start":
                answered["status"] = message["status"]
            answered["bytes"] += len(message.get("body", b""))
            await send(message)

        try:
            await self._app(scope, receive, count)
        finally:
            LOG.info("%s", access_line(scope, answered["status"], answered["bytes"], time.monotonic() - begun))


def access_line(scope: Scope, status: int, size: int, seconds: float) -> str:
    """Return the line of a request; nothing of it can begin a line of its own or end a quotation."""
    caller = scope.get("edbb.caller")
    address = quote((caller.address if caller else "") or str((scope.get("client") or ("-",))[0]), safe=":.")
    person = quote(caller.name, safe="") if caller and caller.name else "-"
    path = quote(scope.get("raw_path") or scope["path"].encode(), safe="/%:@!$&'()*+,;=~")
    query = quote(scope.get("query_string", b""), safe="/%:@!$&'()*+,;=~?")
    asked = f"{scope['method']} {path}{'?' + query if query else ''} HTTP/{scope.get('http_version', '1.1')}"
    now = time.strftime("%d/%b/%Y:%H:%M:%S +0000", time.gmtime())
    return f'{address} - {person} [{now}] "{asked}" {status} {size} {seconds:.3f}'


HEADER_S = 10.0  # for the headers of a request, from the first byte or the opening of the connection
MOST_WAITING = 100  # connections of one address that have not said all of their request yet; a browser opens 6


class TimedProtocol(HttpToolsProtocol):
    """HTTP/1.1 as uvicorn speaks it, with limits to time and size of headers and to what one address begins."""

    waiting: ClassVar[dict[str, OrderedDict["TimedProtocol", None]]] = {}
    """Of each address those that have not said all of their request, the longest silent first."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._deadline: asyncio.TimerHandle | None = None
        self._address, self._head_bytes = "", 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Let a connection in; where too many of its address wait already, the one that is silent the longest goes."""
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self._expect_headers()

    def data_received(self, data: bytes) -> None:
        """Receive what has come, as long as the headers do not go on for ever."""
        most_head = 64 << 10  # bytes of headers
        self._head_bytes += len(data) if self._deadline else 0
        if self in self.waiting.get(self._address, ()):
            self.waiting[self._address].move_to_end(self)
        super().data_received(data)
        if self._deadline and self._head_bytes > most_head:
            self.transport.abort()

    def on_message_begin(self) -> None:
        """Begin the time limit of a further request over the same connection."""
        super().on_message_begin()
        self._expect_headers()

    def on_headers_complete(self) -> None:
        """End the time limit: the request is known."""
        self._end_deadline()
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Make room for others of the address: the body has come."""
        self._end_waiting()
        super().on_message_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget a connection that was lost."""
        self._end_deadline()
        self._end_waiting()
        super().connection_lost(exc)

    def _expect_headers(self) -> None:
        if self._deadline is None:
            self._deadline, self._head_bytes = self.loop.call_later(HEADER_S, self.transport.abort), 0
        own = self.waiting.setdefault(self._address, OrderedDict())
        own[self] = None
        if len(own) > MOST_WAITING:
            next(iter(own)).give_up()

    def give_up(self) -> None:
        """End a connection that has not said its request."""
        self._end_waiting()
        self.transport.abort()

    def _end_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _end_waiting(self) -> None:
        own = self.waiting.get(self._address)
        if own is not None:
            own.pop(self, None)
            if not own:
                del self.waiting[self._address]
