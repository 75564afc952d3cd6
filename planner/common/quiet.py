"""Keeps what libraries print on their own off standard output: that belongs to the results of a command."""

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock

STANDARD_OUTPUT, STANDARD_ERROR = (
    1,
    2,
)  # the descriptors: compiled code does not know what stands in for Python's sys.stdout
C_LIBRARY = "ucrtbase" if sys.platform == "win32" else None  # of this process, whose buffers libraries print into
_ONE_AT_A_TIME = Lock()


@contextmanager
def quiet_output() -> Iterator[None]:
    """Drop what is written to the descriptor of standard output inside; Python's own text waits in its buffer.

    For moments in which one call prints a banner whatever it is told: other threads share the descriptor, so what they
    write to it within these microseconds is dropped too.
    """
    with _ONE_AT_A_TIME:
        try:
            kept = os.dup(STANDARD_OUTPUT)
        except OSError:  # closed: nothing can be printed there
            yield
            return
        try:
            _flush_compiled_code()
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, STANDARD_OUTPUT)
            os.close(nowhere)
            yield
        finally:
            _flush_compiled_code()
            os.dup2(kept, STANDARD_OUTPUT)
            os.close(kept)


@contextmanager
def results_alone() -> Iterator[None]:
    """Let Python's ``sys.stdout`` alone write to standard output; what compiled code and programs print goes to errors.

    Whatever a library prints, and whenever, what a command writes there stays what it says it is, such as JSON.
    What does not go to a screen has the line ends that are written.
    Nothing is done where ``sys.stdout`` is not the process's own, or either of the two is closed.
    """
    plain = sys.stdout
    try:
        own = plain is not None and plain.fileno() == STANDARD_OUTPUT
        kept = os.dup(STANDARD_OUTPUT) if own else -1
        if own:
            os.fstat(STANDARD_ERROR)
    except (OSError, ValueError):
        own = False
    if not own:
        yield
        return
    plain.flush()
    os.dup2(STANDARD_ERROR, STANDARD_OUTPUT)
    screen = os.isatty(kept)
    try:
        newline = None if screen else ""
        with open(kept, "w", 1 if screen else -1, plain.encoding, plain.errors, newline, closefd=False) as results:
            sys.stdout = results
            yield
    finally:
        sys.stdout = plain
        _flush_compiled_code()
        os.dup2(kept, STANDARD_OUTPUT)
        os.close(kept)


def _flush_compiled_code() -> None:
    """Write out what C libraries have in their buffers, where the system lets us."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(C_LIBRARY).fflush(None)
