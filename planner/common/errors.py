"""One root for every error that a person can cause or cure, with the exit code of its class."""

from difflib import get_close_matches

PARTLY_DONE = 5
"""Exit code of a command that has written its result, and has left parts of the input as they were."""


class PlannerError(Exception):
    """Root of all errors raised on purpose; the message is one clear sentence for the person at the cell."""

    exit_code = 1


class InputError(PlannerError):
    """The user's input is wrong: the message names file, key or line, what was found, what is allowed."""

    exit_code = 2


class NoSolutionError(PlannerError):
    """The task has no solution: the message says which stage emptied, with counts, and what would help."""

    exit_code = 3


class MissingProgramError(PlannerError):
    """A program that was asked for by name is not on this machine."""

    exit_code = 4


def did_you_mean(word: str, known: list[str]) -> str:
    """Return ``'; did you mean "x"?'`` for the nearest of ``known``, or an empty string."""
    match = get_close_matches(word, known, n=1, cutoff=0.5)
    return f'; did you mean "{match[0]}"?' if match else ""
