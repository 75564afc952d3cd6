"""D-optimal sets: DETMAX (O1), which adds the best and drops the worst pose with excursions in size, and augmentation.

Source: Mitchell 1974. One addition or removal costs one pass over the candidates (rank-r update of the inverse and of
every candidate's prediction variance), refreshed from scratch now and then. Fedorov's exchange has the last word.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.common.determinism import Positions, first_maximum, on_one_thread
from planner.common.errors import InputError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array
from planner.design.selection.index_criterion import BarrierPotential, PotentialCriterion
from planner.design.selection.matrix_forms import information_matrix
from planner.design.selection.search import add_greedily, descend, exchange_singly, search_starts

LEAST_GAIN = 1e-9  # of the logarithm of the determinant: less is rounding
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class EqualShares:
    """Equal shares as a constraint: each of the groups gives ``quota`` of the chosen; ``group`` (N,) int.

    A set below its size only grows where a group is short, one above it only shrinks where a group has too many. So a
    search may wander, and comes back to equal shares.
    """

    group: Positions
    quota: int

    @classmethod
    def of(cls, group: Positions, n: int) -> "EqualShares":
        """Share ``n`` poses between the groups that occur.

        Raises:
            InputError: they cannot be shared evenly, or a group has too few candidates.
        """
        size = np.bincount(group)
        if n % len(size):
            raise InputError(f"{n} poses cannot be shared evenly between {len(size)} balls: ask for a multiple")
        if size.min() < n // len(size):
            raise InputError(f"a ball has only {size.min()} candidates, fewer than its share of {n // len(size)}")
        return cls(group, n // len(size))

    def allows(self, within: Mask, sign: int) -> Mask:
        """Tell which candidates may come (sign 1) or go (-1), (N,) bool."""
        count = np.bincount(self.group[within], minlength=int(self.group.max()) + 1)
        missing = int(count.sum()) - self.quota * len(count)
        if sign * missing >= 0:
            return np.ones(len(self.group), dtype=bool)
        return np.asarray((count < self.quota if sign > 0 else count > self.quota)[self.group])


class _DOptimalSet:
    """A set of candidates with its inverse information and the variance blocks of all candidates, kept in step."""

    def __init__(self, rows: Array, chosen: Positions, ridge: float, share: "EqualShares | None" = None) -> None:
        self.rows, self.ridge, self.share = rows, ridge, share
        self.within = np.zeros(len(rows), dtype=bool)
        self.within[chosen] = True
        self.moves = 0
        self._refresh()

    def _refresh(self) -> None:
        size = self.rows.shape[2]
        self.mass = information_matrix(self.rows[self.within]) + self.ridge * np.eye(size)
        self.inverse = np.linalg.inv(self.mass)
        self.blocks = (self.rows @ self.inverse) @ np.swapaxes(self.rows, 1, 2)  # (N, r, r)
        self.logdet = float(np.linalg.slogdet(self.mass)[1])

    def change(self, candidate: int, sign: int = 1) -> None:
        """Add (sign 1) or remove (sign -1) one candidate."""
        row, eye = self.rows[candidate], np.eye(self.rows.shape[1])
        small = eye + sign * self.blocks[candidate]
        self.logdet += float(np.linalg.slogdet(small)[1])
        gain = self.inverse @ row.T
        core = sign * np.linalg.inv(small)
        cross = self.rows @ gain  # (N, r, r)
        self.blocks -= cross @ core @ np.swapaxes(cross, 1, 2)
        self.inverse -= gain @ core @ gain.T
        self.within[candidate] = sign > 0
        self.moves += 1
        if self.moves % 50 == 0:  # moves after which rounding is taken out
            self._refresh()

    def at(self, chosen: Positions) -> "_DOptimalSet":
        """Return the design of an earlier set."""
        if np.array_equal(np.flatnonzero(self.within), chosen):
            return self
        now = self.within.copy()
        wanted = np.zeros_like(now)
        wanted[chosen] = True
        for candidate in np.flatnonzero(wanted & ~now):
            self.change(int(candidate), 1)
        for candidate in np.flatnonzero(now & ~wanted):
            self.change(int(candidate), -1)
        return self

    def gains(self, sign: int = 1) -> Array:
        """What each candidate's addition gains, or its removal (-1) loses, of the determinant; −inf if not allowed."""
        if self.rows.shape[1] == 1:
            gain = sign * self.blocks[:, 0, 0]
        else:
            gain = np.linalg.det(np.eye(self.rows.shape[1]) + sign * self.blocks)
        allowed = ~self.within if sign > 0 else self.within
        if self.share is not None:
            allowed = allowed & self.share.allows(self.within, sign)
        return np.where(allowed, gain, -np.inf)


@on_one_thread
def detmax(
    rows: Array,
    n: int,
    starts: int = 2,
    seed: int = 0,
    excursion: int = 6,
    group: Positions | None = None,
    likely: Positions | None = None,
    limit: TimeLimit = UNLIMITED,
) -> Positions:
    """Return ``n`` distinct candidates (n,) of ``rows`` (N, r, P), ascending, with a large determinant.

    The first start is greedy, the others ``starts - 1`` seeded samples. ``excursion``: how far the size of the
    set may wander from n before the search gives up (Mitchell's six). ``group`` (N,) int: each group, a ball of an
    artifact, gives an equal share. ``likely`` (K,): candidates among which it is searched; the last exchange looks at
    all of them.

    Raises:
        InputError: n outside what the candidates and parameters allow, or not to be shared evenly.
    """
    least = -(-rows.shape[2] // rows.shape[1])
    if not least <= n <= len(rows):
        raise InputError(f"{n} poses cannot be chosen: ask for {least} (the parameters) to {len(rows)} (the pool)")
    scale = np.sqrt(np.mean(rows**2, axis=(0, 1)))
    white = rows / np.where(scale > 0, scale, 1.0)
    everything = np.arange(len(rows))
    among = everything if likely is None else likely
    some = white[among]
    share = None if group is None else EqualShares.of(group[among], n)

    def search(turn: int) -> tuple[Positions, float]:
        """Return the set of one start and the logarithm of its determinant."""
        design = _greedy_start(some, n, share) if turn == 0 else _sample_start(some, n, seed + turn, share)
        return _search_excursions(design, n, excursion)

    best, _ = search_starts(search, range(starts), lambda value, than: value > than + LEAST_GAIN)
    criterion = PotentialCriterion(white, BarrierPotential("O1", 1.0), group)
    return np.sort(descend(criterion, among[best], everything, limit))


def _greedy_start(rows: Array, n: int, share: EqualShares | None) -> _DOptimalSet:
    """Add the most informative pose n times, from a faint prior that the last refresh takes away."""
    design = _DOptimalSet(rows, np.zeros(0, dtype=np.intp), 1e-6 * len(rows), share)
    return _DOptimalSet(rows, np.sort(add_greedily(design, n)), _ridge(rows), share)


def _sample_start(rows: Array, n: int, seed: int, share: EqualShares | None) -> _DOptimalSet:
    order = np.random.default_rng(seed).permutation(len(rows))
    if share is not None:  # the first of each group
        rank = np.empty(len(order), dtype=int)
        for group in range(int(share.group.max()) + 1):
            mine = share.group[order] == group
            rank[mine] = np.arange(mine.sum())
        order = order[rank < share.quota]
    return _DOptimalSet(rows, order[:n], _ridge(rows), share)


def _ridge(rows: Array) -> float:
    """A ridge too small to matter in a set that sees everything, large enough to invert one that does not."""
    return 1e-10 * float(rows.shape[1])


def _search_excursions(design: _DOptimalSet, n: int, excursion: int) -> tuple[Positions, float]:
    """Excursions up and back, then down and back, longer ones only when the shorter fail; a success begins anew."""
    best, value, length = np.flatnonzero(design.within), design.logdet, 1
    while length <= excursion:
        for sign in (1, -1):
            if not len(design.rows) > n + sign * length > 0:
                continue
            for move in [sign] * length + [-sign] * length:
                design.change(first_maximum(design.gains(move)), move)
            if design.logdet > value + LEAST_GAIN:
                best, value, length = np.flatnonzero(design.within), design.logdet, 0
                break
            design = design.at(best)
        length += 1
    return best, value


@dataclass
class _Augmentation:
    """Information (P, P) so far, and that of each candidate, (M, P, P)."""

    mass: Array
    blocks: Array

    def gains(self) -> Array:
        """What each candidate would add to the logarithm of the determinant, (M,)."""
        return np.asarray(np.linalg.slogdet(self.mass + self.blocks)[1] - np.linalg.slogdet(self.mass)[1])

    def change(self, candidate: int, sign: int = 1) -> None:
        """Add or remove one candidate."""
        self.mass = self.mass + sign * self.blocks[candidate]


def augment_design(base: Array, blocks: Array, count: int) -> Positions:
    """Return the ``count`` blocks (M, P, P) that together with ``base`` (P, P) have a large determinant, ascending.

    Greedily, then by exchange as long as any gains (Fedorov 1972).
    """
    design = _Augmentation(base, blocks)
    # 100: passes at most: no augmentation was seen to take a tenth of them
    return np.sort(exchange_singly(design, add_greedily(design, count), 100))
