"""Both engines' verdict on a whole path, by the same continuous argument."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.path.constraints import Constraints
from planner.path.extremes import Extremes
from planner.path.proof import Proof
from planner.path.result import Verdict
from planner.units import Array

TOLERANCE = 5e-4  # [m] to which the clearance and the bar's lengths on a path are found


@dataclass(frozen=True)
class Apart:
    """Motions of a path that keep constraints of their own: ``motions``, counted from 0, ascending."""

    constraints: Constraints
    motions: np.ndarray


def judge(
    constraints: Constraints, q: Array, triangles: Array | None = None, apart: Sequence[Apart] = ()
) -> tuple[Verdict, Verdict]:
    """Prove a path of straight joint motions with coal's distances and again with python-fcl's.

    Args:
        constraints: what every state keeps.
        q: way points (m, N) [rad].
        triangles: (entry, corner, exit) of every blended corner, (k, 3, N) [rad]; the blend stays in the triangle.
        apart: motions that keep other constraints instead.

    Returns:
        The verdict of coal and that of python-fcl; a path is released only if both are clear.
    """
    motions = np.stack([q[:-1], q[1:]], axis=1) if len(q) > 1 else np.stack([q, q], axis=1)
    others = np.concatenate([np.zeros(0, dtype=int), *(a.motions for a in apart)])
    common = Apart(constraints, np.setdiff1d(np.arange(len(motions)), others))
    parts = [
        _Part(a.constraints, motions[a.motions], a.motions, tuple(f"motion {k + 1}" for k in a.motions))
        for a in (common, *apart)
        if len(a.motions)
    ]
    if triangles is not None and len(triangles):
        numbers = np.arange(len(triangles))
        names = tuple(f"blend {k + 1}" for k in numbers)
        parts.append(_Part(constraints, triangles, len(motions) + numbers, names))
    found = [p.constraints.extremes(p.corners, TOLERANCE) for p in parts]
    by_coal = [p.constraints.prove_corners(p.corners) for p in parts]
    by_fcl = [p.constraints.judge(p.corners) for p in parts]
    return _verdict("coal", parts, by_coal, found), _verdict("python-fcl", parts, by_fcl, found)


@dataclass(frozen=True)
class _Part:
    """Motions or triangles (m, K, N) [rad] under one set of constraints, their numbers (m,) and names."""

    constraints: Constraints
    corners: Array
    numbers: np.ndarray
    names: tuple[str, ...]


def _verdict(engine: str, parts: list[_Part], proofs: list[Proof], found: list[Extremes]) -> Verdict:
    """Sum up proofs of named motions; both engines' own sightings count beside the extremes found."""
    failures = [
        (int(part.numbers[k]), f"{name}: {part.constraints.failure(proof, k)}")
        for part, proof in zip(parts, proofs, strict=True)
        for k, name in enumerate(part.names)
        if not proof.proven[k]
    ]
    failures.sort(key=lambda failure: failure[0])
    return Verdict(
        engine,
        not failures,
        clearance=min([float(p.clearance.min(initial=np.inf)) for p in proofs] + [e.clearance for e in found]),
        length_min=min(e.length_min for e in found),
        length_max=max(e.length_max for e in found),
        evaluations=sum(p.evaluations for p in proofs),
        failures=tuple(text for _, text in failures),
        unproven=tuple(number for number, _ in failures),
    )
