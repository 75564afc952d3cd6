"""The bound of an index off the grid of candidates: poses that violate its dual most are sought and joined to them.

A dual of :mod:`.selection.index_bound` gives every pose a price. Between the candidates the price is a smooth function
of the joint angles; random steps from the candidates with the lowest prices go down it, every filter kept. What they
find joins the candidates, the bound is proven over all of them anew, and so on while it moves. The bound that results
is proven for these poses, and sought, not proven, for those between them.
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell
from planner.cell.workspace import SAFETY_MARGIN, Workspace
from planner.common.determinism import on_one_thread, round_significant
from planner.common.progress import BOUND, must_stop
from planner.common.units import Array
from planner.design.candidates.pool import PoseSet
from planner.design.pose_selection import PoseChoice
from planner.design.selection.certificate import Certificate, Dual
from planner.design.selection.index_bound import WholePool, certify_bound
from planner.model.model import Model
from planner.motion.collision.engines import CollisionWorld
from planner.runs.run import Samples

TOLERANCE = 1e-3  # of the bound
ROUNDS, SETTLED = 6, 2e-3  # of descents, and the relative move of the bound after which no more are made
STARTS, STEPS = 400, 60
REACH, LONGER, SHORTER = 0.15, 1.3, 0.93  # [rad] of a step at first, and times that after a success and a failure


@on_one_thread
def certify_off_grid(cell: Cell, pool: PoseSet, choice: PoseChoice) -> Certificate:
    """Bound the sets of candidates, of poses as chosen off the grid, and of those that descents find beside them.

    The certificate of the candidates alone is returned where the poses were not moved off the grid. It may be done in
    a copy of the process.
    """
    found = choice.certificate
    if choice.value == choice.on_grid_value:
        return found
    samples = Samples.concatenate([pool.samples, choice.samples])
    rows = choice.model.rows(samples)
    for number in range(ROUNDS):
        before = found.value
        found = certify_bound(rows, choice.index, found.poses, TOLERANCE, near=found)
        settled = number > 0 and abs(found.value / before - 1.0) < SETTLED
        if settled or number == ROUNDS - 1 or must_stop(BOUND, "poses off the grid were sought only in part"):
            break
        duals = [d for d in found.duals if not isinstance(d, WholePool)]
        more = [_Descent.of(cell, choice.model, samples, rows, found, d).lowest(number) for d in duals]
        samples = Samples.concatenate([samples, *more])
        rows = np.concatenate([rows, *(choice.model.rows(s) for s in more)])
    return found


@dataclass(frozen=True)
class _Descent:
    """Steps down the price of a dual.

    Attributes:
        start: poses of low price; support: rows of the bound's support, by which the dual is scaled.
        filters: which of the starts each pair of workspace and world is for.
    """

    model: Model
    dual: Dual
    start: Samples
    support: Array
    clearance: float
    filters: tuple[tuple[np.ndarray, Workspace, CollisionWorld], ...]

    @classmethod
    def of(cls, cell: Cell, model: Model, samples: Samples, rows: Array, found: Certificate, dual: Dual) -> "_Descent":
        price = round_significant(dual.prices(rows, found.support))
        start = samples.take(np.lexsort((np.arange(len(price)), price))[:STARTS])
        filters = tuple(
            (start.at_mounting(m), Workspace(cell, m), CollisionWorld.from_cell(cell, m)) for m in cell.mountings
        )
        return cls(model, dual, start, rows[found.support], cell.motion.clearance + SAFETY_MARGIN, filters)

    def lowest(self, seed: int) -> Samples:
        """Return the poses at the end of the descents from all starts."""
        rng, q = np.random.default_rng(seed), self.start.q.copy()
        reach, best = np.full(len(q), REACH), self._price(np.arange(len(q)), q)
        for _ in range(STEPS):
            tried = q + rng.normal(size=q.shape) * reach[:, None]
            which = self._within(tried)
            price = self._price(which, tried[which])
            lower = price < best[which]
            which, price = which[lower], price[lower]
            free = self._free(which, tried[which])
            which, price = which[free], price[free]
            reach *= SHORTER
            q[which], best[which] = tried[which], price
            reach[which] *= LONGER / SHORTER
        return replace(self.start, q=q)

    def _price(self, which: np.ndarray, q: Array) -> Array:
        rows = np.concatenate([self.support, self.model.rows(replace(self.start.take(which), q=q))])
        return round_significant(self.dual.prices(rows, np.arange(len(self.support)))[len(self.support) :])

    def _within(self, q: Array) -> np.ndarray:
        """Which states of all starts keep the limits of joints, gauge and cable."""
        ok = np.zeros(len(q), dtype=bool)
        for mine, workspace, _ in self.filters:
            ok[mine] = workspace.inside(q[mine], SAFETY_MARGIN)
        return np.flatnonzero(ok)

    def _free(self, which: np.ndarray, q: Array) -> np.ndarray:
        """Tell which states collide with nothing, one by one: a copy of the process must not start OpenMP's threads."""
        ok = np.zeros(len(which), dtype=bool)
        for mine, _, world in self.filters:
            ok[mine[which]] = ~world.near(q[mine[which]], self.clearance)
        return ok
