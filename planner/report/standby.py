"""A process that stands by with matplotlib loaded: pictures are drawn beside what else is done for a plan."""

import pickle
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import Pipe
from multiprocessing.connection import Connection

from planner.common.second_process import Beside

Pictures = dict[str, bytes]
"""PNGs by name."""


class DrawingProcess:
    """Draws one page's pictures at a time; the same page is drawn once, however often it is asked for."""

    def __init__(self) -> None:
        self._here, there = Pipe()
        self._copy = Beside(partial(_draw_for, there))
        there.close()
        self._drawn: dict[bytes, Pictures] = {}
        self._asked: list[bytes] = []

    @property
    def runs(self) -> bool:
        """Whether there is such a process: not on a machine with one processor."""
        return self._copy.pid > 0

    def begin(self, content: bytes) -> None:
        """Let it draw pickled charts, view and size of the pictures."""
        if content not in self._drawn and content not in self._asked:
            self._asked.append(content)
            with suppress(OSError):  # it has ended: told by who waits for the pictures
                self._here.send_bytes(content)

    def result(self, content: bytes) -> Pictures:
        """Wait for the pictures, or raise the error that ended the process."""
        self.begin(content)
        try:
            while content not in self._drawn:
                self._drawn[self._asked.pop(0)] = self._here.recv()
        except (EOFError, OSError):
            self._copy.result()
            raise
        return self._drawn[content]

    def stop(self) -> None:
        """End it."""
        self._copy.stop()
        self._here.close()


def _draw_for(asked: Connection) -> None:
    from planner.report.page import draw_pictures

    draw_pictures((), None, small=False)  # loads what draws
    while True:
        asked.send(draw_pictures(*pickle.loads(asked.recv_bytes())))


_wanted = False
_standing_by: DrawingProcess | None = None


@contextmanager
def stand_by() -> Iterator[None]:
    """Keep a process at hand that draws, from :func:`begin_standing_by` to the end."""
    global _wanted, _standing_by
    _wanted = True
    try:
        yield
    finally:
        if _standing_by:
            _standing_by.stop()
        _wanted, _standing_by = False, None


def begin_standing_by() -> None:
    """Begin the process, where one is wanted: early, while a copy of this one costs little."""
    global _standing_by
    if _wanted and not _standing_by and (process := DrawingProcess()).runs:
        _standing_by = process


def drawing_process() -> DrawingProcess | None:
    """Return the process that stands by, if one does."""
    return _standing_by
