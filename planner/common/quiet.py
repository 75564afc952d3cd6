"""Keeps what a library prints on its own off standard output: that belongs to the results of a command."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Lock

STANDARD_OUTPUT = 1  # the descriptor: compiled code does not know what stands in for Python's sys.stdout
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


def _flush_compiled_code() -> None:
    """Write out what C libraries have in their buffers, where the system lets us."""
    with suppress(OSError, AttributeError, TypeError):
        ctypes.CDLL(None).fflush(None)
