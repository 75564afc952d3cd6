"""Work beside the caller's on another processor: a copy of this process does it and sends back what it returns.

A copy (fork) needs neither imports nor pickled arguments, so work of a tenth of a second is worth one. Threads are not
copied: a copy works on one processor, as it would wait for ever for those of OpenMP, and it must use no data frames.
"""

import os
import pickle
import sys
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from multiprocessing import Pipe
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from planner.common.lazy_modules import psutil
from planner.common.system import end_with_parent

A = TypeVar("A")
T = TypeVar("T")
ENDED = "a process that worked beside this one was ended from outside: is there memory enough?"
_inside = False  # of a copy: it starts no further ones, and no threads of OpenMP


def available_threads() -> int:
    """Return the number of processors that this process may use; a copy uses one."""
    if _inside:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


class ForkedTask(Generic[T]):
    """A task that a copy of this process has begun; where there can be none it is done once its result is wanted.

    What the task changes in memory may be lost: it must be a function of what it is given.
    """

    def __init__(self, task: Callable[[], T]) -> None:
        self._task, self.pid, self._read = task, 0, -1
        if sys.platform == "linux" and available_threads() >= 2:
            self._fork(task)

    def _fork(self, task: Callable[[], T]) -> None:
        if sys.platform == "linux":  # elsewhere a copy is dear, or not safe
            parent, (self._read, write) = os.getpid(), os.pipe()
            self.pid = os.fork()
            if self.pid == 0:
                os.close(self._read)
                _answer(task, write, parent)
            os.close(write)
            del self._task  # what it holds may go, though the copy lives

    def result(self) -> T:
        """Wait for what the task returns, or raise its error; to be called once.

        Raises:
            RuntimeError: the copy was ended from outside.
        """
        if not self.pid:
            return self._task()
        with os.fdopen(self._read, "rb") as pipe:
            told = pipe.read()
        os.waitpid(self.pid, 0)
        self.pid = 0
        if not told:
            raise RuntimeError(ENDED)
        answer, error = pickle.loads(told)
        if error is not None:
            raise error
        return answer  # type: ignore[no-any-return]

    def stop(self) -> None:
        """End the copy: nobody waits for it any more."""
        if self.pid:
            psutil.Process(self.pid).kill()
            os.waitpid(self.pid, 0)
            os.close(self._read)
            self.pid = 0

    def __enter__(self) -> Self:
        """Return the running task."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the task if the caller failed or was interrupted; else let it go on."""
        if kind is not None:
            self.stop()


def map_in_copies(task: Callable[[A], T], arguments: Iterable[A], processes: int | None = None) -> Iterator[T]:
    """Yield what a task returns for each argument, in their order, by copies of this process side by side.

    Args:
        task: a function of its argument alone.
        arguments: as many as there are tasks.
        processes: copies at a time; by default as many as there are processors.

    Raises:
        RuntimeError: a copy was ended from outside.
    """
    most, running = processes or available_threads(), deque[ForkedTask[T]]()
    try:
        for argument in arguments:
            if len(running) == most:
                yield running.popleft().result()
            running.append(ForkedTask(partial(task, argument)))
        while running:
            yield running.popleft().result()
    finally:
        for left in running:
            left.stop()


class ForkedWorker(Generic[A, T]):
    """A copy of this process that does one task for one argument after the other, until nobody refers to it.

    Each argument and result is sent: that takes a tenth of what a new copy takes.

    Args:
        task: what is done with each argument; a function of it alone.
    """

    def __init__(self, task: Callable[[A], T]) -> None:
        self._here, there = Pipe()
        self._copy, self._parent = ForkedTask(partial(_serve, task, there)), os.getpid()
        there.close()
        self._end = weakref.finalize(self, _end_copy, self._copy, self._here, self._parent)

    @property
    def runs(self) -> bool:
        """Whether the copy exists and was made by this process, not by its parent."""
        return self._copy.pid > 0 and os.getpid() == self._parent

    def begin(self, argument: A) -> None:
        """Let it do the task for ``argument`` once it has done what was asked before."""
        with suppress(OSError):  # it has ended: told by who waits for the result
            self._here.send(argument)

    def result(self) -> T:
        """Wait for the result of the first argument that has not been answered yet, or raise its error.

        Raises:
            RuntimeError: the copy was ended from outside.
        """
        try:
            answer, error = self._here.recv()
        except (EOFError, OSError) as ended:
            raise RuntimeError(ENDED) from ended
        if error is not None:
            raise error
        return answer  # type: ignore[no-any-return]

    def stop(self) -> None:
        """End the copy of this process."""
        self._end()


def _serve(task: Callable[[A], object], asked: Any) -> None:
    while True:
        argument = asked.recv()
        try:
            answer: tuple[object, BaseException | None] = task(argument), None
        except Exception as error:
            answer = None, error
        asked.send(answer)


def _end_copy(copy: ForkedTask[None], pipe: Any, parent: int) -> None:
    if os.getpid() == parent:
        copy.stop()
    pipe.close()


def _answer(task: Callable[[], object], write: int, parent: int) -> None:
    """Do the task and send its answer or error; never returns into the caller's code."""
    global _inside
    _inside = True
    threading.Thread(target=end_with_parent, args=(parent,), daemon=True).start()
    try:
        try:
            told = pickle.dumps((task(), None), protocol=5)
        except BaseException as error:
            told = pickle.dumps((None, error), protocol=5)
        with os.fdopen(write, "wb") as pipe:
            pipe.write(told)
    finally:
        os._exit(0)
