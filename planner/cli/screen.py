"""What a person sees while waiting: one line a stage on standard error, silent when that is not a terminal."""

import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

if TYPE_CHECKING:
    from planner.workflow import Stages

errors = Console(stderr=True, soft_wrap=True, highlight=False)


class Screen:
    """Shows the stages of a long task."""

    def __init__(self) -> None:
        columns = (SpinnerColumn(), TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=errors, transient=True, disable=not sys.stderr.isatty())
        self._task = self._progress.add_task("starting", total=None)

    def __enter__(self) -> "Stages":
        """Start showing; returns the stages to hand to the workflow."""
        from planner.workflow import Stages  # with all its libraries: a command without stages starts quicker

        self._progress.start()
        return Stages(self._say)

    def __exit__(self, *_: object) -> None:
        """Stop showing; the line vanishes."""
        self._progress.stop()

    def _say(self, stage: str, done: int, of: int) -> None:
        self._progress.update(self._task, description=stage, completed=done, total=of or None)
