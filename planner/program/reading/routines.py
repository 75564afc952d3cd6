"""Programs that call their parts: runs the statements in the order in which the controller would."""

from collections.abc import Callable, Iterator

from planner.errors import InputError

Body = list[str]


def walk(bodies: dict[str, Body], start: str, called: Callable[[str], str | None], depth: int = 0) -> Iterator[str]:
    """Yield the statements of ``bodies[start]``, with each call replaced by what it runs."""
    if depth > 3:
        raise InputError(f"'{start}' is called by itself")
    for statement in bodies[start]:
        name = called(statement)
        if name is not None and name in bodies:
            yield from walk(bodies, name, called, depth + 1)
        else:
            yield statement
