"""What may wait at the door: a connection that has not said its request yet is closed in time, and few come from one.

A request is known, and refused or let in, only when its headers have come. Until then a connection costs its sender
nothing, and a thousand of them would hold off all others.
"""

import asyncio
from collections import Counter
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

HEADER_S = 10.0  # for the headers of a request, from the first byte or the opening of the connection
MOST_WAITING = 100  # connections of one address that have not said their request yet; a browser opens 6


class TimedProtocol(HttpToolsProtocol):
    """HTTP/1.1 as uvicorn speaks it, with a time limit for headers and a limit for each address that has none yet."""

    waiting: Counter[str] = Counter()

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._deadline: asyncio.TimerHandle | None = None
        self._address = ""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Let a connection in, where not too many of its address wait already."""
        super().connection_made(transport)
        self._address = self.client[0] if self.client else ""
        self._expect_headers()
        if self.waiting[self._address] > MOST_WAITING:
            transport.abort()

    def on_message_begin(self) -> None:
        """Begin the time limit of a further request over the same connection."""
        super().on_message_begin()
        self._expect_headers()

    def on_headers_complete(self) -> None:
        """End the time limit: the request is known."""
        self._end_waiting()
        super().on_headers_complete()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._end_waiting()
        super().connection_lost(exc)

    def _expect_headers(self) -> None:
        if self._deadline is None:
            self.waiting[self._address] += 1
            self._deadline = self.loop.call_later(HEADER_S, self.transport.abort)

    def _end_waiting(self) -> None:
        if self._deadline is None:
            return
        self._deadline.cancel()
        self._deadline = None
        self.waiting[self._address] -= 1
        if not self.waiting[self._address]:
            del self.waiting[self._address]
