"""A process that stands by with matplotlib loaded: pictures are drawn beside what else is done for a plan."""

import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from planner.common.second_process import ForkedWorker

if TYPE_CHECKING:
    from planner.report.cell_view import CellView
    from planner.report.chart import Chart

Pictures = dict[str, bytes]
"""PNGs by name."""


def draw_pictures(pictures: "Sequence[Chart | CellView]", small: bool) -> Pictures:
    """Return the PNGs of charts and of the cell in space, by name; ``small`` ones of charts have few colours."""
    # imported where it draws: matplotlib takes the other processor most of a second
    from planner.report.cell_view_print import view_png
    from planner.report.chart import Chart
    from planner.report.matplotlib_backend import chart_png

    return {p.name: chart_png(p, small) if isinstance(p, Chart) else view_png(p) for p in pictures}


class DrawingProcess:
    """Draws one page's pictures at a time; the same page is drawn once, however often it is asked for."""

    def __init__(self) -> None:
        self._copy = ForkedWorker[bytes, Pictures](_draw, partial(_draw, pickle.dumps(((), False))))
        self._drawn: dict[bytes, Pictures] = {}
        self._asked: list[bytes] = []

    @property
    def runs(self) -> bool:
        """Whether there is such a process: not on a machine with one processor."""
        return self._copy.runs

    def begin(self, content: bytes) -> None:
        """Let it draw pickled charts, view and size of the pictures."""
        if content not in self._drawn and content not in self._asked:
            self._asked.append(content)
            self._copy.begin(content)

    def result(self, content: bytes) -> Pictures:
        """Wait for the pictures, or raise the error that ended the process."""
        self.begin(content)
        while content not in self._drawn:
            self._drawn[self._asked.pop(0)] = self._copy.result()
        return self._drawn[content]

    def stop(self) -> None:
        """End the process that draws."""
        self._copy.stop()


def _draw(content: bytes) -> Pictures:
    return draw_pictures(*pickle.loads(content))


_standing_by: DrawingProcess | None = None


@contextmanager
def stand_by() -> Iterator[None]:
    """Keep a process at hand that draws: begun before this one has loaded what it needs, it loads its own beside."""
    global _standing_by
    process = DrawingProcess()
    try:
        _standing_by = process if process.runs else None
        yield
    finally:
        process.stop()
        _standing_by = None


def drawing_process() -> DrawingProcess | None:
    """Return the process that stands by, if one does."""
    return _standing_by
