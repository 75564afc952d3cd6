"""Continuous proof that motions keep every constraint, by adaptive bisection, and the extremes over motions by
branch and bound."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.second_process import ForkedWorker
from planner.common.units import Array, Rows
from planner.motion.path.margins import PairBounds, WorkspaceBounds
from planner.motion.tolerances import CLEARANCE_TOLERANCE, MOST_BISECTIONS


@dataclass(frozen=True)
class Neighbourhoods(Rows):
    """Open neighbourhoods: the hull of K corners each.

    Two for an interval of a motion, 3 for a triangle, 4 for a plane convex quadrilateral, corners in turn round it.

    Attributes:
        motion: which motion each belongs to, (n,).
        corners: (n, K, N) [rad].
        place: where each corner lies along its motion, (n, K), 0 … 1.
    """

    motion: np.ndarray
    corners: Array
    place: Array

    @classmethod
    def of(cls, corners: Array) -> "Neighbourhoods":
        """One cell for each motion with corners (m, K, N) [rad]."""
        m, K, _ = corners.shape
        return cls(np.arange(m), corners, np.tile(np.linspace(0.0, 1.0, K), (m, 1)))

    @property
    def q(self) -> Array:
        """Centres (n, N) [rad]."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def spokes(self) -> Array:
        """From centre to corners (n, K, N) [rad]; one of the two is enough for an interval."""
        spread = self.corners - self.q[:, None]
        return spread[:, :1] if self.corners.shape[1] == 2 else spread

    def bisect_cells(self) -> "Neighbourhoods":
        """Cut every cell at the middle of its longest edge; the halves of cell i are i and n + i.

        A quadrilateral is cut at the middle of the edge opposite too: its halves are quadrilaterals, and a narrow one
        becomes as many cells as a motion of its length, where narrow triangles lie over each other.
        """
        n, K = self.place.shape
        if K == 4:
            return self._quadrilateral_halves()
        ends = [(a, b) for a in range(K) for b in range(a + 1, K)]
        length = np.stack([np.abs(self.corners[:, a] - self.corners[:, b]).sum(axis=1) for a, b in ends])
        first, last = np.array(ends)[np.argmax(length, axis=0)].T
        rows = np.arange(n)
        middle = (self.corners[rows, first] + self.corners[rows, last]) / 2
        centre = (self.place[rows, first] + self.place[rows, last]) / 2
        one, two = self.corners.copy(), self.corners.copy()
        one[rows, last], two[rows, first] = middle, middle
        place_one, place_two = self.place.copy(), self.place.copy()
        place_one[rows, last], place_two[rows, first] = centre, centre
        return Neighbourhoods(
            np.tile(self.motion, 2), np.concatenate([one, two]), np.concatenate([place_one, place_two])
        )

    def _quadrilateral_halves(self) -> "Neighbourhoods":
        length = np.abs(self.corners - np.roll(self.corners, -1, axis=1)).sum(axis=2)
        turn = (np.argmax(length, axis=1) % 2)[:, None] + np.arange(4)  # the edges from 0 to 1 and from 2 to 3 are cut
        rows = np.arange(len(turn))[:, None]
        corners, place = self.corners[rows, turn % 4], self.place[rows, turn % 4]
        one, two = [], []
        for whole in (corners, place):
            middle, opposite = (whole[:, 0] + whole[:, 1]) / 2, (whole[:, 2] + whole[:, 3]) / 2
            one.append(np.stack([whole[:, 0], middle, opposite, whole[:, 3]], axis=1))
            two.append(np.stack([middle, whole[:, 1], whole[:, 2], opposite], axis=1))
        (q_one, place_one), (q_two, place_two) = one, two
        return Neighbourhoods(
            np.tile(self.motion, 2), np.concatenate([q_one, q_two]), np.concatenate([place_one, place_two])
        )


class Distances(Protocol):
    """What a collision engine answers."""

    def pair_distances(self, q: Array, rows: np.ndarray, columns: np.ndarray, enough: Array | None = None) -> Array:
        """Distances (m,) [m] of the pairs ``columns`` (m,) at the states ``rows`` (m,), ascending, of q (n, N) [rad].

        Where a lower bound of ``enough`` (m,) [m] will do, it may be that.
        """


@dataclass(frozen=True)
class Doubts(Rows):
    """Pairs of bodies not known to stay apart: ``columns`` (m,) in the neighbourhoods ``rows`` (m,), ascending."""

    rows: np.ndarray
    columns: np.ndarray

    @classmethod
    def of_all(cls, n: int, pairs: int) -> "Doubts":
        """Return every pair in each of n neighbourhoods."""
        return cls(*np.divmod(np.arange(n * pairs), max(pairs, 1)))

    def in_halves(self, kept: np.ndarray) -> "Doubts":
        """Return what is doubted in both halves of the neighbourhoods that are ``kept`` (n,) bool; see ``halves()``."""
        mine, place = self.take(kept[self.rows]), np.cumsum(kept) - 1
        rows = place[mine.rows]
        return Doubts(np.concatenate([rows, np.count_nonzero(kept) + rows]), np.tile(mine.columns, 2))


@dataclass(frozen=True)
class Proof(Rows):
    """What is known of m motions; nothing is known against any when a proof begins.

    Attributes:
        clearance: smallest distance of two bodies seen, (m,) [m].
        failed_at: where along the motion (0 … 1) a constraint fails or could not be proven, (m,), NaN where proven.
        failed: which, (m,): a column of the workspace, or their number plus a pair; −1 where proven.
    """

    clearance: Array
    failed_at: Array
    failed: np.ndarray

    @classmethod
    def begin(cls, m: int) -> "Proof":
        """Return the proof of m motions of which nothing has been seen."""
        return cls(np.full(m, np.inf), np.full(m, np.nan), np.full(m, -1))

    @property
    def proven(self) -> np.ndarray:
        """Whether each keeps every constraint throughout, (m,) bool."""
        return np.asarray(self.failed < 0)

    def fail(self, cells: Neighbourhoods, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Record that ``columns`` (k,) fail in the cells ``rows`` (k,), ascending; tell of each cell if it is alive.

        The first cell of a motion tells what failed, and where.
        """
        motion, first = np.unique(cells.motion[rows], return_index=True)
        new = self.failed[motion] < 0
        motion, first = motion[new], first[new]
        self.failed[motion], self.failed_at[motion] = columns[first], cells.place[rows[first]].mean(axis=1)
        return np.asarray(self.failed[cells.motion] < 0)


@dataclass(frozen=True)
class Prover:
    """Bisection with the bounds of a cell and the distances of one engine.

    Attributes:
        bounds, pairs: of the workspace, and of the pairs of bodies.
        distances: the engine.
        clearance: smallest distance wanted [m].
        limit: of the time that proofs may take.
    """

    bounds: WorkspaceBounds
    pairs: PairBounds
    distances: Distances
    clearance: float
    limit: TimeLimit = UNLIMITED

    def prove(self, corners: Array) -> Proof:
        """Prove motions with corners (m, K, N) [rad]: K = 2 straight legs, K = 3 triangles; many on two processors."""
        if len(corners) < 48:  # motions are worth a second processor
            return self._prove(corners)
        both = Proof.concatenate(self._prove_halves(corners[::2], corners[1::2]))
        return both.take(np.argsort(np.concatenate([np.arange(k, len(corners), 2) for k in range(2)])))

    def _prove_halves(self, one: Array, other: Array) -> list[Proof]:
        if not self._assistant.runs:
            return [self._prove(one), self._prove(other)]
        self._assistant.begin(other)
        try:
            return [self._prove(one), self._assistant.result()]
        except BaseException:  # else its answer would be taken for that of the next question
            self._assistant.stop()
            raise

    @cached_property
    def _assistant(self) -> ForkedWorker[Array, Proof]:
        return ForkedWorker(self._prove)

    def _prove(self, corners: Array) -> Proof:
        proof, cells = Proof.begin(len(corners)), Neighbourhoods.of(corners)
        asked = Doubts.of_all(len(corners), len(self.pairs.scene.pairs))
        for level in range(MOST_BISECTIONS):
            if len(cells.motion) == 0:
                break
            self.limit.check("motions are proven")
            cells, asked = self._level(cells, asked, proof, last=level == MOST_BISECTIONS - 1)
        return proof

    def _level(self, cells: Neighbourhoods, asked: Doubts, proof: Proof, last: bool) -> tuple[Neighbourhoods, Doubts]:
        """Look at all centres; return the halves of the cells that are neither proven nor of a motion that failed."""
        q, spokes = cells.q, cells.spokes
        margins, change, far = self.bounds.look(q, spokes)
        beyond = np.flatnonzero((margins <= 0.0).any(axis=1))
        alive = proof.fail(cells, beyond, np.argmin(margins[beyond], axis=1))
        asked = asked.take(alive[asked.rows])
        # 1e6: [m] a bound that proves nothing
        loss = np.minimum(self.pairs.pair_changes(far, asked.rows, asked.columns), 1e6)
        place = np.cumsum(alive)[asked.rows] - 1
        spare = self.distances.pair_distances(q[alive], place, asked.columns, loss + self.clearance)
        np.minimum.at(proof.clearance, cells.motion[asked.rows], spare)
        spare -= self.clearance
        alive = proof.fail(cells, *self._find_worst(asked.take(spare <= 0.0), spare[spare <= 0.0], margins.shape[1]))
        left = ~(spare - loss > 0.0)
        open_ = np.asarray(~(margins - change > 0.0).all(axis=1))
        open_[asked.rows[left]] = True
        open_ &= alive
        # 4096: open cells of one motion: it runs along the edge of a constraint, and is not proven
        crowded = np.bincount(cells.motion[open_], minlength=len(proof.failed)) > (0 if last else 4096)
        crowded = crowded[cells.motion] & open_
        if crowded.any():
            stuck = np.flatnonzero(crowded)
            room = np.full((len(stuck), margins.shape[1] + len(self.pairs.scene.pairs)), np.inf)
            room[:, : margins.shape[1]] = (margins - change)[stuck]
            theirs = crowded[asked.rows]
            where = np.searchsorted(stuck, asked.rows[theirs]), margins.shape[1] + asked.columns[theirs]
            room[where] = (spare - loss)[theirs]
            proof.fail(cells, stuck, np.argmin(room, axis=1))
            open_ &= proof.failed[cells.motion] < 0
        return cells.take(open_).bisect_cells(), asked.take(left).in_halves(open_)

    @staticmethod
    def _find_worst(failing: Doubts, spare: Array, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the cells in which pairs fail, ascending, and the pair with the least ``spare`` (m,), ``first`` on."""
        order = np.lexsort((failing.columns, spare, failing.rows))
        rows, at = np.unique(failing.rows[order], return_index=True)
        return rows, first + failing.columns[order][at]


# neighbourhoods that may hold the smallest clearance, beyond which the search for it ends: a tool that goes round a
# ball keeps one distance throughout, none of a million is nearer than the others, their common bound is 0.1 mm below
MOST_NEIGHBOURHOODS = 30_000
PRINTED = np.deg2rad(5e-4)  # [rad] by which a printed angle may be off: half a digit of the coarsest dialect


@dataclass(frozen=True)
class Extremes:
    """Over all motions together.

    Attributes:
        clearance: smallest distance of two bodies [m], rounded angles included: none comes nearer.
        length_min, length_max: of the bar [m]; each is reached, and passed by none by more than the tolerance.
    """

    clearance: float
    length_min: float
    length_max: float


def find_extremes(prover: Prover, corners: Array, tolerance: float) -> Extremes:
    """Search motions with corners (m, K, N) [rad] until none can hold a value beyond by ``tolerance`` [m].

    The clearance is searched to ``CLEARANCE_TOLERANCE``, or as far as ``MOST_NEIGHBOURHOODS`` allow. What is left open
    counts against it.
    """
    cells = Neighbourhoods.of(corners)
    asked = Doubts.of_all(len(corners), len(prover.pairs.scene.pairs))
    nearest, shortest, longest = np.inf, np.inf, 0.0
    least = open_ = np.inf
    rounding = _rounding_losses(prover, corners)
    for _ in range(18):  # bisections at most
        if len(cells.motion) == 0:
            break
        q, spokes = cells.q, cells.spokes
        pose, far = prover.bounds.travel(q, spokes)
        change, lost = prover.pairs.pair_changes(far, asked.rows, asked.columns), rounding[asked.columns]
        enough = np.maximum(change, tolerance) + nearest + lost
        found = prover.distances.pair_distances(q, asked.rows, asked.columns, enough) - lost
        nearest = min(nearest, float(found.min(initial=np.inf)))
        shortest, longest = min(shortest, float(pose.length.min())), max(longest, float(pose.length.max()))
        bound = found - change
        settled = bound >= nearest - CLEARANCE_TOLERANCE
        if len(np.unique(asked.rows[~settled])) > MOST_NEIGHBOURHOODS:
            settled[:] = True
        least = min(least, float(bound[settled].min(initial=np.inf)))
        open_ = float(bound[~settled].min(initial=np.inf))
        shorter = pose.length - far.stretch < shortest - tolerance
        longer = pose.length + far.stretch > longest + tolerance
        if not prover.bounds.workspace.cell.has_bar():  # nothing whose length matters
            shorter, longer = np.zeros_like(shorter), np.zeros_like(longer)
        wanted = shorter | longer
        wanted[asked.rows[~settled]] = True
        cells, asked = cells.take(wanted).bisect_cells(), asked.take(~settled).in_halves(wanted)
    return Extremes(min(nearest, least, open_), shortest, longest)


def _rounding_losses(prover: Prover, corners: Array) -> Array:
    """Return what the distance of each pair can lose where all angles are rounded as they are printed, (pairs,) [m].

    The joints are turned one after the other, at the ends of the motions (m, K, N) [rad], where that is largest nearly.
    """
    q = np.unique(corners.reshape(-1, corners.shape[2]), axis=0)
    loss = np.zeros(len(prover.pairs.scene.pairs))
    for spoke in np.eye(corners.shape[2]) * PRINTED:
        _, far = prover.bounds.travel(q, np.broadcast_to(spoke, (len(q), 1, len(spoke))))
        loss += prover.pairs.changes(far).max(axis=0, initial=0.0)
    return loss
