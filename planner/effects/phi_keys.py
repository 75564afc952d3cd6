"""Reads the keys that basis functions have in files: ``torque:2`` back to the function."""

import re
from collections.abc import Callable
from functools import lru_cache
from math import isfinite

from planner.common.errors import InputError, did_you_mean
from planner.common.extensions import HINT
from planner.effects.basis import FUNCTIONS, BasisFunction, key_words
from planner.effects.catalogue import registrations

LARGEST_INDEX = 1_000_000  # of a joint or sample, where their number is not known
INDEX_RANGES: dict[str, tuple[int, Callable[[int], int]]] = {  # first, and last on an arm of N joints
    "JOINT": (1, lambda n: n),
    "LINK": (1, lambda n: n + 1),  # the last stands for the payload
    "STATION": (0, lambda n: n + 1),
    "AXIS": (0, lambda n: 2),
    "PART": (0, lambda n: 5),
    "INDEX": (0, lambda n: LARGEST_INDEX),
}


def key_patterns() -> tuple[str, ...]:
    """Return how the keys of all basis functions are made up."""
    registrations()
    return tuple(sorted(f.pattern for f in FUNCTIONS))


def functions_in(key: str) -> tuple[type[BasisFunction], ...]:
    """Return the class of the basis function ``key``, and those of the keys inside it.

    Raises:
        InputError: no basis function is called so, or an argument is missing.
    """
    return tuple([FUNCTIONS[k] for k in positions_in(key)])


@lru_cache(maxsize=10_000)
def positions_in(key: str) -> tuple[int, ...]:
    """Return where the classes of :func:`functions_in` stand; a class that is defined anew stands in the same place."""
    patterns = key_patterns()
    word, *arguments = key.split(":")
    found = [k for k, f in enumerate(FUNCTIONS) if re.fullmatch(f.pattern.split(":")[0], word)]
    if not found:
        near = did_you_mean(word, [w for p in patterns for w in key_words(p)])
        raise InputError(f"the basis function '{key}' is unknown{near} (known: {', '.join(patterns)}){HINT}")
    pattern = FUNCTIONS[found[0]].pattern
    kinds = pattern.split(":")[1:]
    nested = "PHI" in kinds
    if len(arguments) < len(kinds) or (len(arguments) > len(kinds) and not nested):
        raise InputError(f"the basis function '{key}' must read {pattern}")
    return (found[0], *positions_in(":".join(arguments[len(kinds) - 1 :]))) if nested else (found[0],)


def is_static(key: str) -> bool:
    """Tell whether ``key`` stands for a function of joint angles and loads alone; raises as :func:`functions_in`."""
    return all(f.is_static for f in functions_in(key))


def needs_loads(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the loads; raises as :func:`functions_in`."""
    return any(f.needs_loads for f in functions_in(key))


def depends_on_run(key: str) -> bool:
    """Tell whether ``key`` depends on the clock or sessions of one run; raises as :func:`functions_in`."""
    return any(f.of_run for f in functions_in(key))


def columns_of(key: str) -> tuple[str, ...]:
    """Return which columns of the samples the function ``key`` needs; raises what :func:`functions_in` raises."""
    return tuple(f.column for f in functions_in(key) if f.column)


def belongs_to_gauge(key: str) -> bool:
    """Tell whether ``key`` stands for a function of the gauge; raises as :func:`functions_in`."""
    return any(f.of_gauge for f in functions_in(key))


def phi_from_key(key: str, n_joints: int | None = None) -> BasisFunction:
    """Return the basis function whose ``key`` this is.

    Args:
        key: as :attr:`planner.effects.basis.BasisFunction.key` writes it.
        n_joints: number N of the robot's joints, where that is known.

    Raises:
        InputError: no basis function is called so, or its arguments are wrong.
    """
    function: Callable[..., BasisFunction] = functions_in(key)[0]
    first, *kinds = functions_in(key)[0].pattern.split(":")
    word, *texts = key.split(":", len(kinds))
    match = re.fullmatch(first, word)
    alternative = match.groups() if match else ()
    return function(*alternative, *(_parse(key, k, t, n_joints) for k, t in zip(kinds, texts, strict=True)))


def _parse(key: str, kind: str, text: str, n_joints: int | None) -> int | float | BasisFunction:
    if kind == "PHI":
        return phi_from_key(text, n_joints)
    if kind == "NUMBER":
        return _parse_number(key, text)
    first, end = INDEX_RANGES[kind]
    last = end(LARGEST_INDEX if n_joints is None else n_joints)
    if not (text.isascii() and text.isdigit()) or not first <= int(text) <= last:
        allowed = (
            f"{first}, {first + 1}, {first + 2} …" if last >= LARGEST_INDEX else f"a number from {first} to {last}"
        )
        raise InputError(f"the basis function '{key}' has '{text}' as {kind}, where {allowed} may stand")
    return int(text) - first


def _parse_number(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"the basis function '{key}' has '{text}' where a number belongs")
    return value
