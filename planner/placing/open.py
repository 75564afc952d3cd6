"""Which frames the poses leave open, and the sentence that says so."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.errors import NoSolutionError
from planner.placing.inputs import Stand
from planner.placing.rotations import log3
from planner.placing.solver import open_directions
from planner.units import Array

Kind = Literal["point", "fixture", "zero", "position", "rotation", "turn"]

LIMIT = 0.25  # [m] or [rad] standard deviation from which a direction counts as open
_ERROR = 1e-3  # [m] the least that a nominal robot is taken to be wrong by
_NAMES: dict[Kind, str] = {
    "point": "tool point {}",
    "fixture": "position of fixture {}",
    "zero": "zero of the bar",
    "position": "position of gauge frame {}",
    "rotation": "rotation of gauge frame {}",
    "turn": "orientation of probe {}",
}


@dataclass(frozen=True)
class Unknown:
    """What a column belongs to: a kind, and which one of it (from 0)."""

    kind: Kind
    index: int

    def __str__(self) -> str:
        """Return the name as a person says it."""
        return _NAMES[self.kind].format(self.index + 1)


def left_open(jacobian: Array, error: Array, unknowns: tuple[Unknown, ...]) -> tuple[Unknown, ...]:
    """Return the unknowns that the rows leave open by more than ``LIMIT``, in the order of their columns.

    Args:
        jacobian: (n, d, P) at the solution; rows that are outliers count like all others.
        error: block norms of the residuals, (n,) [m].
        unknowns: what each of the P columns belongs to.
    """
    if not unknowns:
        return ()
    sigma = max(_ERROR, float(np.median(error)))
    directions = open_directions(jacobian, sigma / LIMIT / np.sqrt(len(error)))
    touched = np.abs(directions).max(axis=0, initial=0.0) > 0.2
    return tuple(dict.fromkeys(u for u, hit in zip(unknowns, touched, strict=True) if hit))


def demand(jacobian: Array, error: Array, unknowns: tuple[Unknown, ...], stand: Stand) -> None:
    """Raise where the poses leave an unknown open.

    Raises:
        NoSolutionError: names what is open and what would help.
    """
    missing = left_open(jacobian, error, unknowns)
    if missing:
        names = " and ".join(
            (", ".join(str(u) for u in missing[:-1]), str(missing[-1])) if missing[1:] else [str(missing[0])]
        )
        raise NoSolutionError(
            f"the {len(stand)} poses do not determine the {names}; {advice(missing, stand)} would help"
        )


def advice(missing: tuple[Unknown, ...], stand: Stand) -> str:
    """Return what would determine the missing unknowns."""
    kinds = {u.kind for u in missing}
    turns = turning(stand)
    if ("point" in kinds or "turn" in kinds) and turns[1] < 0.1:
        axes = "about no axis" if turns[0] < 0.1 else "about one axis only"
        return f"poses that turn the flange about two axes or more (now it turns {axes}), or a measured tool point,"
    if "zero" in kinds:
        return "a wider range of lengths, or a bar with a known zero,"
    return "more poses, spread over all three directions,"


def turning(stand: Stand) -> Array:
    """Return the spread (rms) of the flange's orientation along its principal axes, strongest first, (3,) [rad]."""
    w = log3(np.matmul(stand.R_BF[len(stand) // 2].T, stand.R_BF))
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(w.T @ w / len(w))[::-1], 0.0)))
