"""Index against number of poses, for all five indices, with the proven limit beside each."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.observability import RULES
from planner.selection import Certificate, bound, exchange, knee
from planner.units import Array, frozen

GROWTH = (1.04, 1.12, 1.25, 1.4, 1.6, 2.0, 2.5, 3.2, 4.0, 5.6, 8.0)  # numbers of poses, in parameters
WIDTH = 800  # candidates that the last descents look at
STEPS = 150  # of annealing, for the index that was asked for; the others descend only
TOLERANCE = 0.02  # relative: a curve is read by eye, its bound is a proof whatever the tolerance
Say = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Curve:
    """One index against the number of poses.

    Attributes:
        index: O1 … O5; ``scaled`` tells the unit-free one (columns times prior sizes) from the raw one.
        sizes: numbers of poses (k,); ``values`` (k,) what a selection reaches; ``bounds`` (k,) what none can beat.
        knee: the number of poses where the curve bends.
    """

    index: str
    scaled: bool
    sizes: np.ndarray
    values: Array
    bounds: Array
    knee: int

    @property
    def at_knee(self) -> float:
        """The index that a selection reaches at the bend."""
        return float(self.values[self.sizes == self.knee][0])

    @property
    def limit_at_knee(self) -> float:
        """What no set of as many poses as at the bend can beat."""
        return float(self.bounds[self.sizes == self.knee][0])


def index_curves(rows: Array, prior: Array, asked: str, seed: int, say: Say) -> tuple[Curve, ...]:
    """Return the curves of O1 … O5, first raw, then unit-free.

    Args:
        rows: identifiable columns of the candidates, (n, r, p).
        prior: sizes of the parameters, (p,) [m or rad].
        asked: the index that is searched for hardest.
        seed: of the selection.
        say: told of the progress.
    """
    fewest = -(-rows.shape[2] // rows.shape[1])
    sizes = np.unique([min(len(rows), max(fewest, round(fewest * g))) for g in GROWTH])
    out: list[Curve] = []
    for scaled in (False, True):
        scene = np.ascontiguousarray(rows * prior) if scaled else rows
        for index, certificates in _certificates(scene, seed).items():
            say("index curves", len(out), 2 * len(RULES))
            out.append(_curve(scene, index, scaled, sizes, certificates, seed, STEPS if index == asked else 0))
    return tuple(out)


def pick(curves: tuple[Curve, ...], index: str, scaled: bool) -> Curve:
    """Return the curve of one index."""
    return next(c for c in curves if c.index == index and c.scaled == scaled)


def _certificates(rows: Array, seed: int) -> dict[str, tuple[Certificate, ...]]:
    """Proofs for designs of any size: of a single unit of weight for the indices that grow with every pose."""
    proofs = {
        index: bound(rows, index, poses, TOLERANCE, seed)
        for index, poses in (("O1", None), ("O2", None), ("O3", 1), ("O5", 1))
    }
    pairs = {index: (proof,) for index, proof in proofs.items()} | {"O4": (proofs["O3"], proofs["O2"])}
    return {index: pairs[index] for index in RULES}


def _curve(
    rows: Array, index: str, scaled: bool, sizes: np.ndarray, proofs: tuple[Certificate, ...], seed: int, steps: int
) -> Curve:
    values = [exchange(rows, int(n), index, 1, seed, proofs[-1], steps, WIDTH).value for n in sizes]
    bounds = [limit(index, proofs, int(n)) for n in sizes]
    bend = int(knee(sizes, np.array(values), index))
    return Curve(index, scaled, sizes, frozen(values), frozen(bounds), bend)


def limit(index: str, proofs: tuple[Certificate, ...], poses: int) -> float:
    """Return what no set of ``poses`` candidates beats.

    O1 and O2 do not depend on the number; n poses carry at most n times the information of the best unit of
    weight, so that O3 and O5, which go with the root of it, grow at most with √n; O4 = O3 / O2.
    """
    if index in ("O1", "O2"):
        return proofs[0].value
    grown = proofs[0].value * float(np.sqrt(poses))
    return grown / proofs[1].value if index == "O4" else grown
