"""The path that joins the poses of a tour, and both collision engines' verdict on it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.common.second_process import ForkedTask
from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.path.proof import Extremes, Proof
from planner.motion.tolerances import READING_TOLERANCE


@dataclass(frozen=True)
class PathLeg:
    """The way from one pose of the tour to the next.

    Attributes:
        start, end: rows of the joined poses.
        supports: support poses between the two, (k, N) [rad].
    """

    start: int
    end: int
    supports: Array

    @property
    def direct(self) -> bool:
        """Whether the path is one straight motion of the joints, without a point between."""
        return len(self.supports) == 0


@dataclass(frozen=True)
class Verdict:
    """What one collision engine says of a whole path.

    Attributes:
        engine: its name.
        clearance: distance that no two bodies on the path come nearer than, wherever its angles are printed [m].
        length_min, length_max: shortest and longest bar on the path, to half a millimetre [m].
        failures: a sentence for each motion that is not proven.
        unproven: which these are, counted from 0; blends count on after the motions.
    """

    engine: str
    clearance: float
    length_min: float
    length_max: float
    failures: tuple[str, ...]
    unproven: tuple[int, ...] = ()

    @property
    def clear(self) -> bool:
        """Whether every motion is proven."""
        return not self.failures


@dataclass(frozen=True)
class ProvenPath:
    """The whole way of a tour and both engines' verdict on it; released only if :attr:`clear`.

    Attributes:
        q: way points, supports included, (m, N) [rad].
        node: row of the pose at each way point, −1 at a support, (m,).
        legs: one from each pose to the next.
        verdict: what coal says.
        second: what python-fcl says.
    """

    q: Array
    node: np.ndarray
    legs: tuple[PathLeg, ...]
    verdict: Verdict
    second: Verdict

    @property
    def clear(self) -> bool:
        """Whether both engines prove every motion."""
        return self.verdict.clear and self.second.clear

    @property
    def clearance(self) -> float:
        """Smallest distance of two bodies that either engine found [m]."""
        return min(self.verdict.clearance, self.second.clearance)

    @property
    def length_min(self) -> float:
        """Shortest bar on the path [m]."""
        return self.verdict.length_min

    @property
    def length_max(self) -> float:
        """Longest bar on the path [m]."""
        return self.verdict.length_max


@dataclass(frozen=True)
class PathGaps:
    """Legs that could not be joined.

    Attributes:
        failed: pairs of poses (rows) without a proven way between them, smaller row first.
        unreachable: poses in parts of the roadmap that no way leads to from the first pose's; to be replaced.
        reasons: a sentence for each failed pair.
    """

    failed: tuple[tuple[int, int], ...]
    unreachable: tuple[int, ...]
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class SeparateMotions:
    """Motions of a path that keep constraints of their own: ``motions``, counted from 0, ascending."""

    constraints: Constraints
    motions: np.ndarray


def judge_path(
    constraints: Constraints, q: Array, triangles: Array | None = None, apart: Sequence[SeparateMotions] = ()
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
    common = SeparateMotions(constraints, np.setdiff1d(np.arange(len(motions)), others))
    names = [f"motion {k + 1}" for k in range(len(motions))]
    parts = [
        Motions(a.constraints, motions[a.motions], a.motions, [names[k] for k in a.motions]) for a in (common, *apart)
    ]
    if triangles is not None:
        blends = np.arange(len(triangles))
        parts.append(Motions(constraints, triangles, len(motions) + blends, [f"blend {k + 1}" for k in blends]))
    return judge_motions(parts, [p.constraints.extremes(p.corners, READING_TOLERANCE) for p in parts if len(p.numbers)])


@dataclass(frozen=True)
class Motions:
    """Motions or triangles (m, K, N) [rad] under one set of constraints, with a number (m,) and a name of each."""

    constraints: Constraints
    corners: Array
    numbers: np.ndarray
    names: Sequence[str]


def judge_motions(parts: Sequence[Motions], found: Sequence[Extremes] = ()) -> tuple[Verdict, Verdict]:
    """Prove motions and triangles, each part under its own constraints, with coal's distances and with python-fcl's.

    ``found``: the extremes on them; without, the verdicts tell those that the engines have seen alone, and no lengths.
    """
    parts = [p for p in parts if len(p.numbers)]
    with _begin_proofs(parts) as judging:
        by_coal = [p.constraints.judge_by_coal(p.corners) for p in parts]
    by_fcl = judging.result()
    for part, proof in zip(parts, by_fcl, strict=True):
        part.constraints.remember(part.corners, proof)
    return _summarize("coal", parts, by_coal, found), _summarize("python-fcl", parts, by_fcl, found)


def _begin_proofs(parts: Sequence[Motions]) -> ForkedTask[list[Proof]]:
    """Return the proofs by python-fcl's distances, which a copy of this process makes meanwhile."""
    return ForkedTask(lambda: [p.constraints.judge(p.corners) for p in parts])


def _summarize(engine: str, parts: Sequence[Motions], proofs: list[Proof], found: Sequence[Extremes]) -> Verdict:
    """Sum up proofs of named motions; both engines' own sightings count beside the extremes found."""
    failures = [
        (number, f"{part.names[k]}: {part.constraints.failure(proof, k)}")
        for part, proof in zip(parts, proofs, strict=True)
        for k, number in enumerate(part.numbers.tolist())
        if not proof.proven[k]
    ]
    failures.sort(key=lambda failure: failure[0])
    return Verdict(
        engine,
        clearance=min([float(p.clearance.min(initial=np.inf)) for p in proofs] + [e.clearance for e in found]),
        length_min=min((e.length_min for e in found), default=np.inf),
        length_max=max((e.length_max for e in found), default=0.0),
        failures=tuple(text for _, text in failures),
        unproven=tuple(number for number, _ in failures),
    )
