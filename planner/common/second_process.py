"""Work beside the caller's on another processor: a copy of this process does it and sends back what it returns.

A fork needs no import and no pickled arguments, so work of a fifth of a second is worth one. The copy must not start
parallel regions of OpenMP (their threads are not copied); everything else of this program may be done in it.
"""

import os
import pickle
import sys
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def available_threads() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


_inside = False  # of a copy: it starts no further ones


def run_beside(task: Callable[[], T]) -> Callable[[], T]:
    """Start ``task`` in a copy of this process, and return what waits for its answer, or raises its error.

    Where there is no second processor, or processes cannot be copied, the task is done at once. What it changes in
    memory is lost either way only in a copy: it must be a function of what it is given.
    """
    if _inside or sys.platform != "linux" or available_threads() < 2:
        value = task()
        return lambda: value
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        _answer(task, read, write)
    os.close(write)

    def wait() -> T:
        with os.fdopen(read, "rb") as pipe:
            told = pipe.read()
        os.waitpid(child, 0)
        if not told:
            raise RuntimeError("a process that worked beside this one was ended from outside")
        answer, error = pickle.loads(told)
        if error is not None:
            raise error
        return answer  # type: ignore[no-any-return]

    return wait


def _answer(task: Callable[[], object], read: int, write: int) -> None:
    """Do the task and send its answer or error; never returns into the caller's code."""
    global _inside
    _inside = True
    try:
        os.close(read)
        try:
            told = pickle.dumps((task(), None), protocol=5)
        except BaseException as error:
            told = pickle.dumps((None, error), protocol=5)
        with os.fdopen(write, "wb") as pipe:
            pipe.write(told)
    finally:
        os._exit(0)
