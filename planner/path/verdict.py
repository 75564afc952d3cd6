"""Both engines' verdict on a whole path, by the same continuous argument."""

import numpy as np

from planner.path.constraints import Constraints
from planner.path.extremes import Extremes
from planner.path.proof import Proof
from planner.path.result import Verdict
from planner.units import Array

TOLERANCE = 5e-4  # [m] to which the clearance and the bar's lengths on a path are found


def judge(constraints: Constraints, q: Array, triangles: Array | None = None) -> tuple[Verdict, Verdict]:
    """Prove a path of straight joint motions with coal's distances and again with python-fcl's.

    Args:
        constraints: what every state keeps.
        q: way points (m, N) [rad].
        triangles: (entry, corner, exit) of every blended corner, (k, 3, N) [rad]; the blend stays in the triangle.

    Returns:
        The verdict of coal and that of python-fcl; a path is released only if both are clear.
    """
    motions = np.stack([q[:-1], q[1:]], axis=1) if len(q) > 1 else np.stack([q, q], axis=1)
    parts = [(motions, [f"motion {k + 1}" for k in range(len(motions))])]
    if triangles is not None and len(triangles):
        parts.append((triangles, [f"blend {k + 1}" for k in range(len(triangles))]))
    found = [constraints.extremes(c, TOLERANCE) for c, _ in parts]
    by_coal = [(constraints.prove_corners(c), n) for c, n in parts]
    by_fcl = [(constraints.judge(c), n) for c, n in parts]
    return verdict(constraints, "coal", by_coal, found), verdict(constraints, "python-fcl", by_fcl, found)


def verdict(
    constraints: Constraints, engine: str, parts: list[tuple[Proof, list[str]]], found: list[Extremes]
) -> Verdict:
    """Sum up proofs of named motions; both engines' own sightings count beside the extremes found."""
    failures = [
        f"{name}: {constraints.failure(proof, k)}"
        for proof, names in parts
        for k, name in enumerate(names)
        if not proof.proven[k]
    ]
    proofs = [proof for proof, _ in parts]
    unproven = np.flatnonzero(~np.concatenate([proof.proven for proof in proofs]))
    return Verdict(
        engine,
        not failures,
        clearance=min([float(p.clearance.min(initial=np.inf)) for p in proofs] + [e.clearance for e in found]),
        length_min=min(e.length_min for e in found),
        length_max=max(e.length_max for e in found),
        evaluations=sum(p.evaluations for p in proofs),
        failures=tuple(failures),
        unproven=tuple(unproven.tolist()),
    )
