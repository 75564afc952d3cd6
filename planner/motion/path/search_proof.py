"""The proofs of searches: closed forms and planes where they tell enough, a collision engine elsewhere."""

from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.motion.collision.round_bounds import ScreenedDistances
from planner.motion.path.planes import PlaneBounds
from planner.motion.path.proof import Prover


@dataclass(frozen=True)
class SearchProver(Prover):
    """A prover that also looks along the shortest ways between bodies: it needs a sixth of the neighbourhoods.

    What it finds is judged by provers that know nothing of planes.

    Attributes:
        distances: an engine that tells these ways.
        planes: the bounds along them.
    """

    distances: ScreenedDistances
    planes: PlaneBounds

    def _measure(self, q: Array, spokes: Array, asked: np.ndarray, loss: Array) -> tuple[Array, Array]:
        seen = self.distances.separations(q, asked, loss + self.clearance)
        left = np.where(asked, seen.distance - loss, np.inf)
        at = seen.rows, seen.columns
        open_ = (seen.distance[at] > self.clearance) & ~(left[at] > self.clearance)
        rows, columns = seen.rows[open_], seen.columns[open_]
        kept = self.planes.gaps(q, spokes, rows, columns, seen.normal[open_])
        left[rows, columns] = np.fmax(left[rows, columns], kept)
        return seen.distance, left
