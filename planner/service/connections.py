"""What may wait at the door: a connection that has not said its request yet is closed in time, and few come from one.

A request is known, and refused or let in, only when its headers have come, and answered when its body has. Until then a
connection costs its sender nothing, and a thousand of them would hold off all others.
"""

import asyncio
from collections import OrderedDict
from typing import Any, ClassVar

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

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
