"""Robust Levenberg-Marquardt over many starts at once, and the sentence that names directions which the data leave
open.

What every gauge needs of a run to place itself: names that the cell knows, and where the flange stood.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, Self, TypeVar

import numpy as np

from planner.cell.placement import Placement
from planner.cell.site import Site
from planner.common.errors import InputError, NoSolutionError, did_you_mean
from planner.common.robust import HUBER_SIGMAS, MEDIAN_NORM, huber_costs, huber_weights, tukey_costs, tukey_weights
from planner.common.units import MM, Array, IntArray, Rows, read_only, to_mm
from planner.kinematics.geometry import log3
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


class PlacementProblem(Protocol):
    """Residuals of n rows, each a block of d numbers [m], over k states at once."""

    @property
    def stand(self) -> FlangePoses:
        """Where the flange stood at the rows."""

    @property
    def unknowns(self) -> "tuple[PlacementUnknown, ...]":
        """What each column of the derivatives belongs to."""

    def take(self, which: IntArray) -> Self:
        """Return the problem of only the rows ``which``."""

    def evaluate(self, state: Array) -> tuple[Array, Array]:
        """Return residuals (k, n, d) [m] and their derivatives (k, n, d, P) at states (k, D)."""

    def advance(self, state: Array, step: Array) -> Array:
        """Return the states (k, D) moved by steps (k, P)."""


@dataclass(frozen=True)
class RefinedStates(Rows):
    """States (k, D), block norms of their residuals (k, n) [m], and derivatives (k, n, d, P)."""

    state: Array
    error: Array
    jacobian: Array


def robust_scale(error: Array, d: int) -> Array:
    """Return the standard deviation of one number from the medians of block norms (..., n), (..., 1) [m]."""
    # 4e-3: [m] nominal robots are wrong by up to five times this: no such residual is called an outlier
    return np.asarray(np.maximum(np.median(error, axis=-1, keepdims=True) / MEDIAN_NORM[d], 4e-3))


def outlier_limit(d: int) -> float:
    """Return the multiple of the scale from which a block of d numbers is an outlier."""
    return 3.5 + 1.2 * float(np.sqrt(d))


Schedule = tuple[tuple[int, str], ...]
# steps under each weight function: Huber finds the valley, Tukey then leaves out what is wrong
LAST: Schedule = ((15, "huber"), (20, "tukey"), (20, "tukey"))
MANY_ROWS = 400  # for the few states that are left


def refine(problem: PlacementProblem, state: Array, schedule: Schedule, floor: float = 0.0) -> RefinedStates:
    """Refine k states by Levenberg–Marquardt with weights that follow the residual.

    Args:
        problem: gives residuals and derivatives.
        state: starts, (k, D).
        schedule: rounds (iterations, weights): ``huber`` converges from afar, ``tukey`` forgets outliers. The scale
            of the weights is the residual's median, found anew for each round.
        floor: directions that move the readings by less than this per unit (rms) are held where they are.

    Source: Marquardt, SIAM 11 (1963); Holland and Welsch, Comm. Stat. A6 (1977), for the weights.
    """
    r, J = problem.evaluate(state)
    d = r.shape[2]
    for iterations, kind in schedule:
        scale = robust_scale(np.linalg.norm(r, axis=2), d)
        damping = np.full(len(state), 1e-3)
        for _ in range(iterations):
            weight, cost = _weights(np.linalg.norm(r, axis=2) / scale, kind, d)
            trial = problem.advance(state, _step(r, J, weight, damping, floor))
            r_new, J_new = problem.evaluate(trial)
            _, cost_new = _weights(np.linalg.norm(r_new, axis=2) / scale, kind, d)
            better = cost_new <= cost
            state = np.where(better[:, None], trial, state)
            r = np.where(better[:, None, None], r_new, r)
            J = np.where(better[:, None, None, None], J_new, J)
            damping = np.clip(np.where(better, damping * 0.1, damping * 10.0), 1e-12, 1e6)
            if np.all(np.abs(cost_new - cost) <= 1e-13 * cost):
                break
    return RefinedStates(state, np.linalg.norm(r, axis=2), J)


def order_starts(found: RefinedStates) -> IntArray:
    """Return the order of the states, best first: squared residuals, each cut off at the smallest scale's limit."""
    d = found.jacobian.shape[2]
    limit = outlier_limit(d) * robust_scale(found.error, d).min()
    cost = (np.minimum(found.error, limit) ** 2).sum(axis=1)
    # beyond the limit all are alike: the median decides there; equal costs keep the order of the starts
    return np.lexsort((np.median(found.error, axis=1), np.round(cost / limit**2, 9)))


P = TypeVar("P", bound=PlacementProblem)


def find_placement(problem: P, starts: Callable[[P], Array], few: int, rounds: Sequence[tuple[Schedule, int]]) -> Array:
    """Return the best state (1, D): ever fewer starts are refined, the last of them on many rows.

    Args:
        problem: of all rows.
        starts: gives states (k, D) from the problem of many rows.
        few: rows for the many starts.
        rounds: how they are refined, and how many are kept each time.

    Raises:
        NoSolutionError: the poses leave a direction open; the sentence says which and what would help.
    """
    part, many = (problem.take(problem.stand.spread(rows)) for rows in (few, MANY_ROWS))
    state = starts(many)
    for schedule, kept in rounds:
        found = refine(part, state, schedule)
        state = found.state[order_starts(found)[:kept]]
    found = refine(many, state, LAST)
    best = found.take(order_starts(found)[:1])
    require_determined_unknowns(best.jacobian[0], best.error[0], many)
    return best.state


def _weights(u: Array, kind: str, d: int) -> tuple[Array, Array]:
    """Return weights (k, n) and costs (k,) of scaled block norms u (k, n)."""
    if kind == "huber":
        limit = HUBER_SIGMAS * float(np.sqrt(d))
        return huber_weights(u, limit), huber_costs(u, limit).sum(axis=1)
    limit = outlier_limit(d)
    return tukey_weights(u, limit), tukey_costs(u, limit).sum(axis=1)


def _step(r: Array, J: Array, weight: Array, damping: Array, floor: float) -> Array:
    """Return the damped step (k, P) within the directions that the data see."""
    k, n, d, P = J.shape
    flat = J.reshape(k, n * d, P)
    weighted = (J * weight[:, :, None, None]).reshape(k, n * d, P).transpose(0, 2, 1)
    values, V = np.linalg.eigh(weighted @ flat)
    gradient = (weighted @ r.reshape(k, n * d, 1))[:, :, 0]
    largest = np.maximum(values[:, -1:], 1e-300)
    seen = values > np.maximum(floor**2 * n, 1e-14 * largest)
    along = np.einsum("kpi,kp->ki", V, gradient) / (np.maximum(values, 0.0) + damping[:, None] * largest)
    return np.asarray(-np.einsum("kpi,ki->kp", V, np.where(seen, along, 0.0)))


UnknownKind = Literal["point", "fixture", "zero", "position", "rotation", "turn"]

OPEN_SIGMA = 0.25  # [m] or [rad] standard deviation from which a direction counts as open
_NAMES: dict[UnknownKind, str] = {
    "point": "tool point {}",
    "fixture": "position of fixture {}",
    "zero": "zero of the gauge",
    "position": "position of gauge frame {}",
    "rotation": "rotation of gauge frame {}",
    "turn": "orientation of probe {}",
}


@dataclass(frozen=True)
class PlacementUnknown:
    """The unknown of a column: its kind, and its number among those of this kind (from 0)."""

    kind: UnknownKind
    index: int

    def __str__(self) -> str:
        """Return the name as a person says it."""
        return _NAMES[self.kind].format(self.index + 1)


def _undetermined_unknowns(jacobian: Array, error: Array, problem: PlacementProblem) -> tuple[PlacementUnknown, ...]:
    """Return the unknowns that the rows leave open by more than ``OPEN_SIGMA``, in the order of their columns."""
    sigma = max(1e-3, float(np.median(error)))  # [m] the least that a nominal robot is taken to be wrong by
    flat = jacobian.reshape(-1, jacobian.shape[-1])
    values, vectors = np.linalg.eigh(flat.T @ flat / max(1, len(jacobian)))
    directions = vectors[:, values < (sigma / OPEN_SIGMA / np.sqrt(len(error))) ** 2].T
    touched = np.abs(directions).max(axis=0, initial=0.0) > 0.2
    return tuple(dict.fromkeys(u for u, hit in zip(problem.unknowns, touched, strict=True) if hit))


def require_determined_unknowns(jacobian: Array, error: Array, problem: PlacementProblem) -> None:
    """Raise where the poses leave an unknown open.

    Args:
        jacobian: (n, d, P) at the solution; rows that are outliers count like all others.
        error: block norms of the residuals, (n,) [m].
        problem: what the rows and the P columns belong to.

    Raises:
        NoSolutionError: names what is open and what would help.
    """
    missing = _undetermined_unknowns(jacobian, error, problem)
    if missing and not _undetermined_unknowns(jacobian, np.zeros_like(error), problem):
        raise NoSolutionError(
            f"the readings do not belong to these {len(problem.stand)} poses: placed as well as can be, half of them "
            f"are {to_mm(float(np.median(error))):.0f} mm off and more. Look for rows that were exchanged or shifted, "
            "another tool point, and units"
        )
    if missing:
        *others, last = map(str, missing)
        names = f"{', '.join(others)} and {last}" if others else last
        raise NoSolutionError(
            f"the {len(problem.stand)} poses do not determine the {names}; {advice(missing, problem.stand)} would help"
        )


def advice(missing: tuple[PlacementUnknown, ...], stand: FlangePoses) -> str:
    """Return the advice: which readings would determine the missing unknowns."""
    kinds = {u.kind for u in missing}
    turns = orientation_spread(stand)
    if ("point" in kinds or "turn" in kinds) and turns[1] < 0.1:
        axes = "about no axis" if turns[0] < 0.1 else "about one axis only"
        return f"poses that turn the flange about two axes or more (now it turns {axes}), or a measured tool point,"
    if "zero" in kinds:
        return "a wider range of lengths, or a gauge with a known zero,"
    return "more poses, spread over all three directions,"


def orientation_spread(stand: FlangePoses) -> Array:
    """Return the spread (rms) of the flange's orientation along its principal axes, strongest first, (3,) [rad]."""
    w = log3(np.matmul(stand.R_BF[len(stand) // 2].T, stand.R_BF))
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(w.T @ w / len(w))[::-1], 0.0)))
