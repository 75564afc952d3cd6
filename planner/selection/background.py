"""The index curve on the second processor: a worker process of our own, because the search holds the interpreter."""

import pickle
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from types import TracebackType
from typing import Self

from planner.units import Array

from .curve import IndexCurve, index_curve


class CurveInBackground:
    """Computes :func:`index_curve` in another process; the context ends that process if its caller fails.

    The process is a plain call of this module, not :mod:`multiprocessing`, so that scripts need no main guard.

    Args:
        rows: of the candidates, (N, r, P), reduced to identifiable columns.
        sizes: numbers of poses.
        index: name of the index.
        seed: of the searches.
        help_out: whoever waits for the curve has nothing else to do: it computes every other size itself.
    """

    def __init__(self, rows: Array, sizes: Sequence[int], index: str, seed: int, help_out: bool = False) -> None:
        self._own = (rows, list(sizes)[1::2] if help_out else [], index, seed)
        task = pickle.dumps((rows, [n for n in sizes if n not in self._own[1]], index, seed))
        command = [sys.executable, "-c", "from planner.selection.background import work; work()"]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self._thread = ThreadPoolExecutor(1)
        self._answer = self._thread.submit(self._process.communicate, task)

    def result(self) -> IndexCurve:
        """Wait for the curve.

        Raises:
            RuntimeError: the worker failed; its last words are in the message.
        """
        return self._curve

    @cached_property
    def _curve(self) -> IndexCurve:
        mine = index_curve(*self._own) if self._own[1] else None
        answer, words = self._answer.result()
        self._thread.shutdown()
        if self._process.returncode != 0:
            raise RuntimeError(f"the worker for the index curve failed: {words.decode(errors='replace')[-2000:]}")
        curve = pickle.loads(answer)
        assert isinstance(curve, IndexCurve)
        return curve if mine is None else curve.joined(mine)

    def __enter__(self) -> Self:
        """Return the running task."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the worker if the caller failed or was interrupted; else let it go on."""
        if kind is not None:
            self._process.kill()
            self._thread.shutdown()


def work() -> None:
    """Body of the worker: a task on standard input, the curve on standard output."""
    rows, sizes, index, seed = pickle.load(sys.stdin.buffer)
    sys.stdout.buffer.write(pickle.dumps(index_curve(rows, sizes, index, seed)))
