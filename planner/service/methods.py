"""The methods HEAD and OPTIONS, which no route has to know: answers without a body, and what may be asked of a path."""

import asyncio

from starlette.applications import Starlette
from starlette.responses import Response
from starlette.routing import Match, Mount
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
