"""The log of accesses, a line a request in the common log format with the time that it took [s] at its end."""

import logging
import sys
import time
from logging.handlers import WatchedFileHandler
from urllib.parse import quote

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from planner.common.errors import InputError

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
