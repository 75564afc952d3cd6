"""What every gauge needs of a run to place itself: names that the cell knows, and where the flange stood."""

from dataclasses import dataclass

import numpy as np

from planner.cell.placement import Placement
from planner.cell.site import Site
from planner.common.errors import InputError, did_you_mean
from planner.common.units import MM, Array, IntArray, read_only
from planner.runs.run import Run

LOCATED_SIGMA = 20.0 * MM  # [m] one sigma of a frame or tool point that was placed on a robot still millimetres off
LOCATED_TURN_SIGMA = 0.02  # [rad] the same of a frame's orientation


def index_in_cell(run: Run, name: str, known: tuple[str, ...], what: str, cell: Site) -> int:
    """Return which of the cell's names a name of the run is.

    Raises:
        InputError: it is none of them, or the run leaves out which of several.
    """
    if name in known:
        return known.index(name)
    if name == "" and len(known) == 1:
        return 0
    if name == "":
        raise InputError(
            f"{run.name}: the column '{what}' is missing, and {cell.path} has several ({', '.join(known)})"
        )
    named = {"point": (run.points, run.samples.point), "ball": (run.balls, run.readings.ball)}
    names, which = named.get(what, (run.places, run.samples.place))
    where = run.name if which is None else run.where(int(np.argmax(which == names.index(name))))
    raise InputError(
        f"{where}: {what} '{name}' is not in {cell.path}{did_you_mean(name, list(known))} (there: {', '.join(known)})"
    )


def nominal_flange_poses(setup: Placement, q: Array) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and orientations (n, 3, 3) of the flange of the nominal robot."""
    motion = setup.robot.chain.forward(setup.robot.theta(q))
    return motion.x.T.copy(), motion.R.transpose(2, 0, 1).copy()


@dataclass(frozen=True)
class FlangePoses:
    """Where the flange stood at n samples, and which place and point each belongs to.

    Attributes:
        p_BF, R_BF: flange poses by the nominal robot, (n, 3) [m] and (n, 3, 3).
        place, point: fixture, plate or station, and target on the tool, (n,) int.
        n_places, n_points: S and T; where they are not given each place and point has a sample.

    Raises:
        InputError: there is no sample, or none of a place or point.
    """

    p_BF: Array
    R_BF: Array
    place: IntArray
    point: IntArray
    n_places: int = 0
    n_points: int = 0

    def __post_init__(self) -> None:
        """Count the places and points that are not counted yet."""
        if len(self) == 0:
            raise InputError("the run has no samples, so nothing can be placed")
        for name, index, count in (("place", self.place, self.n_places), ("point", self.point, self.n_points)):
            unused = np.setdiff1d(np.arange(index.max() + 1), index)
            if len(unused) and not count:
                raise InputError(f"no sample was taken with {name} {unused[0] + 1}, so it cannot be located")
            object.__setattr__(self, f"n_{name}s", count or int(index.max()) + 1)

    @classmethod
    def of_one(cls, p_BF: Array, R_BF: Array) -> "FlangePoses":
        """Return flange poses (n, 3) [m] and (n, 3, 3) that all belong to one place and one point."""
        none = np.zeros(len(p_BF), dtype=int)
        return cls(p_BF, R_BF, none, none)

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.p_BF)

    def take(self, which: IntArray) -> "FlangePoses":
        """Return the samples at ``which``."""
        rows = (self.p_BF[which], self.R_BF[which], self.place[which], self.point[which])
        return FlangePoses(*rows, self.n_places, self.n_points)

    def target_positions(self, p_FM: Array) -> Array:
        """Return the targets (k, n, 3) [m] in the base frame for points p_FM (k, T, 3) on the flange."""
        m = p_FM[:, self.point]
        return np.asarray(np.matmul(self.R_BF, m[..., None])[..., 0] + self.p_BF)

    def largest_pair(self) -> IntArray:
        """Return the rows of the (place, point) pair with the most samples."""
        pair = self.place * self.n_points + self.point
        return np.flatnonzero(pair == np.argmax(np.bincount(pair)))

    def spread(self, most: int) -> IntArray:
        """Return at most about ``most`` row numbers, evenly over each (place, point) pair."""
        if len(self) <= most:
            return np.arange(len(self))
        pair = self.place.astype(np.int64) * self.n_points + self.point
        kinds, counts = np.unique(pair, return_counts=True)
        share = np.maximum(most * counts // len(self), min(12, most // len(kinds)))
        picks = [
            np.flatnonzero(pair == kind)[np.unique(np.linspace(0, count - 1, min(count, take)).round().astype(int))]
            for kind, count, take in zip(kinds, counts, share, strict=True)
        ]
        return np.sort(np.concatenate(picks))


def flange_poses(setup: Placement, run: Run, p_FM: Array | None = None, p_BX: Array | None = None) -> FlangePoses:
    """Return where the flange of the nominal robot stood at the samples of a run.

    ``p_FM`` (T, 3) and ``p_BX`` (S, 3) [m] are the targets and fixtures where they are known, measured or not.
    """
    places, points = (0 if known is None else len(known) for known in (p_BX, p_FM))
    where = nominal_flange_poses(setup, run.samples.q)
    return FlangePoses(*where, run.samples.place, run.samples.point_numbers, places, points)


def largest_group(index: IntArray, ready: np.ndarray) -> tuple[int, IntArray] | None:
    """Return the index with the most rows that are ready, and those rows; ``None`` where none is."""
    if not ready.any():
        return None
    k = int(np.argmax(np.bincount(index[ready])))
    return k, np.flatnonzero(ready & (index == k))


def tool_grid() -> Array:
    """Return tool points to start from, (43, 3) [m]: the flange, and 14 directions at three distances."""
    return np.concatenate([np.zeros((1, 3)), *(r * directions() for r in (0.1, 0.25, 0.5))])


def directions() -> Array:
    """Return the unit vectors to the faces and corners of a cube, (14, 3)."""
    corners = np.array(np.meshgrid([1, -1], [1, -1], [1, -1], indexing="ij")).reshape(3, -1).T / np.sqrt(3.0)
    return read_only(np.concatenate([np.eye(3), -np.eye(3), corners]))


@dataclass(frozen=True)
class PlacementFrames:
    """k sets of frames: R_BG (k, S, 3, 3), p_BG (k, S, 3), p_FM (k, T, 3), R_FM (k, T, 3, 3)."""

    R_BG: Array
    p_BG: Array
    p_FM: Array
    R_FM: Array

    def pack(self) -> Array:
        """Return the states (k, D)."""
        k = len(self.R_BG)
        return np.concatenate([v.reshape(k, -1) for v in (self.R_BG, self.p_BG, self.p_FM, self.R_FM)], axis=1)


def unpack_frames(state: Array, s: FlangePoses) -> PlacementFrames:
    """Return the frames of states (k, D)."""
    k, S, T = len(state), s.n_places, s.n_points
    R_BG, p_BG, p_FM, R_FM = np.split(state, np.cumsum([9 * S, 3 * S, 3 * T]), axis=1)
    return PlacementFrames(
        R_BG.reshape(k, S, 3, 3), p_BG.reshape(k, S, 3), p_FM.reshape(k, T, 3), R_FM.reshape(k, T, 3, 3)
    )
