"""Progress in a notebook: one line below the cell, which says the stage and how much of it is done."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from planner.common.progress import Progress, no_progress

EVERY = 0.25  # [s] between two looks of the line: a browser draws it anew each time


def runs_in_notebook() -> bool:
    """Tell whether a notebook shows what this process displays: IPython with a kernel, no terminal."""
    shell = sys.modules.get("IPython")
    running = None if shell is None else shell.get_ipython()
    return running is not None and hasattr(running, "kernel")


class NotebookProgress:
    """Shows a task's stages in one line below the cell of a notebook."""

    def __init__(self) -> None:
        self._line: Any = None
        self._stage, self._next = "", 0.0

    def __call__(self, stage: str, done: int, of: int) -> None:
        """Show a stage, where it is new or a quarter of a second has gone."""
        now = time.monotonic()
        if stage == self._stage and now < self._next:
            return
        self._stage, self._next = stage, now + EVERY
        notebook = import_module("IPython.display")
        share = f'<progress value="{done}" max="{of}"></progress> {done} of {of}' if of else "…"
        shown = notebook.HTML(f"<code>{stage} {share}</code>")
        if self._line is None:
            self._line = notebook.display(shown, display_id=True)
        else:
            self._line.update(shown)

    def end(self) -> None:
        """Clear the progress line."""
        if self._line is not None:
            self._line.update(import_module("IPython.display").HTML(""))


@contextmanager
def shown_progress(progress: Progress | None) -> Iterator[Progress]:
    """Yield what a task calls with its progress: ``progress``, or in its place the line of a notebook."""
    if progress is not None or not runs_in_notebook():
        yield progress or no_progress
        return
    line = NotebookProgress()
    try:
        yield line
    finally:
        line.end()
