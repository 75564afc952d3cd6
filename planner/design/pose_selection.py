"""Which poses are measured: what can be identified, how many poses, the selection and its certificate."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.common.choices import SelectionMethod
from planner.common.determinism import Positions, even_positions, on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import UNLIMITED, TimeLimit
from planner.common.units import Array
from planner.design.assumptions import (
    CANDIDATES_PER_PARAMETER,
    CLEARLY_TOO_FEW_SHARE,
    SPARE_READINGS,
    TRACEABLE_READINGS,
)
from planner.design.candidates.pool import PoseSet, explain_few
from planner.design.free_parameters import (
    add_dropped_parameters,
    hold_measured_tool,
    planned_model,
    preference_order,
    unloaded_compliances,
)
from planner.design.observability.identifiability import Identifiability, find_identifiable
from planner.design.observability.information import all_indices, find_rule, index_value
from planner.design.selection.certificate import Certificate
from planner.design.selection.d_optimal import EqualShares, detmax
from planner.design.selection.index_bound import certify_bound, price_candidates
from planner.design.selection.index_criterion import index_of_information
from planner.design.selection.index_search import BackgroundCurve, exchange_poses
from planner.design.selection.matrix_forms import information_matrix
from planner.design.selection.pruning import PrunedPoses
from planner.model.model import Model
from planner.runs.run import Samples

SHOWN_SIZES = (22, 28, 40, 60, 100, 200)  # [poses] where their number is given, and the curve is only shown
ROUGH_TOLERANCE = 5e-3  # [1] of the bound where the index did not choose the poses, and only judges them


@dataclass(frozen=True)
class Pruning:
    """How poses were left of the candidates when one at a time was taken away.

    Attributes:
        left: what is left for each number of poses.
        exchanged: the index that exchange reaches with as many poses as were chosen.
    """

    left: PrunedPoses
    exchanged: float


@dataclass(frozen=True)
class PoseChoice:
    """The poses that a plan measures, and why.

    Attributes:
        model: the measurement model with the identifiable parameters only.
        seen: what the candidates can see, and why the rest is dropped.
        chosen: positions of the chosen candidates in the pool, (n,) int.
        candidates: the chosen candidates.
        certificate: no set of as many candidates beats its value.
        q: controller angles (n, N) [rad], those of the candidates or moved off their grid.
        approach: wanted sign of each axis' last movement before each pose, (n, N), 0 where any will do.
        pruning: how the poses were left of the candidates, where one at a time was taken away.
    """

    model: Model
    seen: Identifiability
    chosen: Positions
    candidates: PoseSet
    certificate: Certificate
    q: Array
    approach: np.ndarray | None = None
    pruning: Pruning | None = None

    @classmethod
    def of_candidates(
        cls, pool: PoseSet, chosen: Positions, model: Model, seen: Identifiability, certificate: Certificate
    ) -> "PoseChoice":
        """Return the choice of some candidates of a pool as they are."""
        candidates = pool.take(chosen)
        return cls(model, seen, chosen, candidates, certificate, candidates.q)

    def with_candidates(self, pool: PoseSet, chosen: Positions, q: Array | None = None) -> "PoseChoice":
        """Return the choice of other candidates, moved to ``q`` if given; the certificate holds for any of them."""
        candidates = pool.take(chosen)
        return replace(self, chosen=chosen, candidates=candidates, q=candidates.q if q is None else q)

    @property
    def ball(self) -> Positions | None:
        """At which ball, (n,), where an artifact's balls are measured."""
        return self.candidates.ball

    @property
    def index(self) -> str:
        """Name of the index."""
        return self.certificate.index

    @cached_property
    def samples(self) -> Samples:
        """The poses, and how the gauge is held there."""
        return replace(self.candidates.samples, q=self.q)

    @cached_property
    @on_one_thread
    def raw_indices(self) -> dict[str, float]:
        """O1 … O5 in metres and radians."""
        return all_indices(self.model.rows(self.samples))

    @cached_property
    @on_one_thread
    def scaled_indices(self) -> dict[str, float]:
        """O1 … O5, unit-free by the parameters' prior sigmas."""
        return all_indices(self.model.rows(self.samples), self.model.prior)

    @property
    def value(self) -> float:
        """The index of the poses."""
        return self.raw_indices[self.index]

    @cached_property
    @on_one_thread
    def on_grid_value(self) -> float:
        """The index of the chosen candidates."""
        return index_value(self.index, self.model.rows(self.candidates.samples))


def identify_candidates(cell: Cell, pool: PoseSet) -> tuple[Model, Identifiability, Array]:
    """Return the model of the identifiable parameters, why the others are dropped, and the rows of the pool.

    Raises:
        NoSolutionError: too few candidates to tell.
    """
    model = planned_model(cell, pool.samples)
    if len(pool) < CANDIDATES_PER_PARAMETER * len(model.names):
        raise NoSolutionError(
            f"only {len(pool)} candidate poses are left, too few to choose from for {len(model.names)} parameters: "
            + explain_few(cell, pool.funnel)
        )
    return _identify(cell, model, pool.samples)


def _identify(cell: Cell, model: Model, samples: Samples) -> tuple[Model, Identifiability, Array]:
    rows, names = model.rows(samples), model.names
    noise = float(np.median(model.noise(samples.take(slice(1000)))))
    out = hold_measured_tool(cell, model, rows, noise)
    free = [k for k, name in enumerate(names) if name not in {d.name for d in out}]
    if out:
        model, rows = model.subset(free), rows[:, :, free]
    seen = find_identifiable(rows, model.names, model.prior, prefer=preference_order(model), noise=noise)
    kept = list(seen.kept)
    seen = add_dropped_parameters(seen, names, (*out, *unloaded_compliances(cell.plan.effects, model)))
    return model.subset(kept), seen, np.ascontiguousarray(rows[:, :, kept])


def check_pose_number(cell: Cell, poses: int, seed: int) -> None:
    """Refuse so few poses that no candidates could identify the parameters, before any are drawn.

    States that the gauge reaches stand for the candidates. What is left of them later may show a parameter or two less,
    so numbers near the limit are left to :func:`select_poses`.

    Raises:
        InputError: with the least number.
    """
    probed = 400  # states at each mounting tell how many parameters show
    parts = []
    for mounting in cell.mountings:
        q = cell.gauge.joint_sampler(cell, mounting, seed)(probed).q
        parts.append(Samples.at(q[even_positions(len(q), probed)], mounting))
    samples = Samples.concatenate(parts)
    if len(samples) < probed:
        return
    model, seen, _ = _identify(cell, planned_model(cell, samples), samples)
    if poses < CLEARLY_TOO_FEW_SHARE * seen.rank / model.width:
        _check_count(poses, -(-seen.rank // model.width), poses, seen.rank)


def select_poses(
    cell: Cell,
    pool: PoseSet,
    poses: int | None,
    index: str,
    seed: int,
    near: Certificate | None = None,
    method: SelectionMethod = "exchange",
    limit: TimeLimit = UNLIMITED,
) -> tuple[PoseChoice, BackgroundCurve]:
    """Choose the poses; ``poses`` ``None`` takes the number where the curve of the index bends.

    By exchange or by pruning, or by DETMAX with as many at each ball where an artifact's balls are measured. ``near``:
    a certificate of the index over the pool for some number of poses, where the bounds begin.

    Returns:
        The choice, and the curve, which is still being computed on the other processor.

    Raises:
        InputError: fewer poses than parameters.
        NoSolutionError: fewer candidates than poses.
    """
    curve_sizes = (22, 24, 26, 28, 30, 35, 40, 50, 60, 80, 100, 140, 200)  # [poses] dense where the index still bends
    model, seen, rows = identify_candidates(cell, pool)
    least = -(-seen.rank // model.width)
    _check_count(poses, least, len(pool), seen.rank)
    if pool.ball is not None and poses is not None:
        _ = EqualShares.of(pool.ball, poses)  # told before the bound is sought
    bends = poses is None and method == "exchange"
    wanted = curve_sizes if bends else sorted({*SHOWN_SIZES, *([poses] if poses else [])})
    sizes = [n for n in wanted if least < n <= len(pool)]
    with BackgroundCurve(rows, sizes, index, seed, near, bends, limit) as curve:
        left = PrunedPoses.of(rows, index, max(poses or 0, curve_sizes[-1])) if method == "pruning" else None
        n = poses or (left.knee if left else curve.result().knee)
        near = curve.result().certificate(n) if bends else near
        loose = 5e-4  # [1] gap of the bound, sought from nothing
        tight = 1e-4  # [1] gap of the bound, sought from a certificate nearby
        certificate = certify_bound(rows, index, n, tolerance=tight if near else loose, near=near, limit=limit)
        if pool.ball is None:
            chosen, pruning = _choose(rows, n, index, seed, certificate, left, limit)
        else:
            likely = _likely_at_balls(rows, pool.ball, certificate, n)
            chosen, pruning = detmax(rows, n, seed=seed, group=pool.ball, likely=likely, limit=limit), None
    return replace(PoseChoice.of_candidates(pool, chosen, model, seen, certificate), pruning=pruning), curve


def _choose(
    rows: Array, n: int, index: str, seed: int, certificate: Certificate, left: PrunedPoses | None, limit: TimeLimit
) -> tuple[Positions, Pruning | None]:
    """Return the candidates that exchange chooses, or those that pruning has left, with what exchange reaches."""
    found = exchange_poses(rows, n, index, seed=seed, certificate=certificate, limit=limit)
    return (left.choose(n), Pruning(left, found.value)) if left else (found.chosen, None)


def describe_pruning(choice: PoseChoice) -> str:
    """Say what pruning and exchange reach, and the bound of the candidates; nothing of poses chosen otherwise."""
    if choice.pruning is None:
        return ""
    gap, bound = find_rule(choice.index).gap, choice.certificate.value
    reached = (("pruning", choice.on_grid_value), ("exchange", choice.pruning.exchanged))
    told = [f"{how} {value:#.4g} (gap {100 * gap(value, bound):.1f} %)" for how, value in reached]
    return f"{', '.join(told)}, bound {bound:#.4g} in m, rad"


def _likely_at_balls(rows: Array, ball: Positions, certificate: Certificate, n: int) -> Positions:
    """Return the candidates that an optimal set may hold by their price in the certificate, enough of each ball."""
    order, core = price_candidates(rows, certificate, n)
    each = [order[ball[order] == k][:1000] for k in range(int(ball.max()) + 1)]  # candidates of each ball
    return np.union1d(core, np.concatenate(each))


def judge_poses(
    cell: Cell,
    pool: PoseSet,
    chosen: Positions,
    index: str,
    near: Certificate | None = None,
    limit: TimeLimit = UNLIMITED,
) -> PoseChoice:
    """Return the choice of poses that chance or another criterion made, as the index judges it (``near`` as above).

    Raises:
        InputError: fewer poses than parameters.
    """
    model, seen, rows = identify_candidates(cell, pool)
    _check_count(len(chosen), -(-seen.rank // model.width), len(pool), seen.rank)
    certificate = certify_bound(rows, index, len(chosen), tolerance=ROUGH_TOLERANCE, near=near, limit=limit)
    return PoseChoice.of_candidates(pool, chosen, model, seen, certificate)


def judge_few_poses(
    cell: Cell, pool: PoseSet, chosen: Positions, index: str, limit: TimeLimit = UNLIMITED
) -> PoseChoice:
    """As :func:`judge_poses`; poses that are fewer than the parameters are judged by the axes' zeros alone.

    Raises:
        InputError: fewer poses than axes.
    """
    model, seen, rows = identify_candidates(cell, pool)
    zeros = [k for k, name in enumerate(model.names) if name in model.setup.robot.zero_names]
    if len(chosen) * model.width < seen.rank and zeros:
        model, rows = model.subset(zeros), np.ascontiguousarray(rows[:, :, zeros])
    _check_count(len(chosen), -(-len(model.names) // model.width), len(pool), len(model.names))
    certificate = certify_bound(rows, index, len(chosen), tolerance=ROUGH_TOLERANCE, limit=limit)
    return PoseChoice.of_candidates(pool, chosen, model, seen, certificate)


def _check_count(poses: int | None, least: int, candidates: int, parameters: int) -> None:
    if poses is not None and poses < least:
        raise InputError(
            f"{poses} poses cannot identify {parameters} parameters: ask for at least {least}, better "
            f"{int(1.5 * least)}, or free fewer in [plan]"
        )
    if candidates < (poses or least):
        raise NoSolutionError(
            f"only {candidates} candidate poses are left, fewer than the {poses or least} wanted: "
            "widen the cones, the cable's budget or the clearance, or raise plan.candidates"
        )


def traceable_pose_count(cell: Cell, pool: PoseSet) -> int | None:
    """Number of poses where nobody gives one; ``None`` for a run in motion, which has readings in plenty."""
    if cell.motion.is_continuous:
        return None
    model, seen, _ = identify_candidates(cell, pool)
    return min(len(pool), -(-(seen.rank + TRACEABLE_READINGS + SPARE_READINGS) // model.width))


def warn_too_few_readings(readings: int, parameters: int) -> str | None:
    """Say that so few readings will not be traced, or nothing."""
    if readings - parameters >= TRACEABLE_READINGS:
        return None
    enough = parameters + TRACEABLE_READINGS + SPARE_READINGS
    return (
        f"{readings} readings for {parameters} parameters and the effects beside them: an identification of this run"
        f" alone traces nothing; ask for at least {enough} readings (--poses), or"
        " identify it together with the run before"
    )


def replace_all(
    pool: PoseSet,
    choice: PoseChoice,
    find_lost: Callable[[PoseChoice], np.ndarray],
    advice: str,
    find_doubtful: Callable[[], np.ndarray] | None = None,
) -> tuple[PoseChoice, int]:
    """Replace lost poses until none is lost; returned beside the choice: how many were.

    Args:
        pool: the candidates.
        choice: the chosen poses.
        find_lost: gives the positions of the chosen poses that are to be replaced.
        advice: what was tried in vain, and what would help.
        find_doubtful: gives the candidates that may be lost as well, and take no lost one's place; none without it.

    Raises:
        NoSolutionError: replacements are lost again and again.
    """
    count, gone = 0, np.zeros(0, dtype=int)
    for _ in range(8):  # rounds: what replaces a lost pose may be lost itself
        lost = find_lost(choice)
        if not len(lost):
            return choice, count
        gone = np.union1d(gone, choice.chosen[lost])
        if find_doubtful is not None:
            gone = np.union1d(gone, find_doubtful())
        for k in lost:
            choice = replace_pose(pool, choice, int(k), gone)
        count += len(lost)
    raise NoSolutionError(f"{count} chosen poses {advice}")


def replace_pose(pool: PoseSet, choice: PoseChoice, lost: int, gone: np.ndarray) -> PoseChoice:
    """Put the candidate that keeps the index best, of those on the same fixture, in the place of a lost pose.

    Candidates that are ``gone`` were lost themselves, and do not come back.

    Raises:
        NoSolutionError: no candidate is left for its place.
    """
    rng = np.random.default_rng(lost)
    there = choice.samples
    alike = pool.samples.at_mounting(there.mounting(lost))
    if pool.ball is not None:
        alike &= pool.ball == pool.ball[choice.chosen[lost]]
    others = np.setdiff1d(np.flatnonzero(alike), np.union1d(choice.chosen, gone))
    if not len(others):
        raise NoSolutionError(
            "a chosen pose that no path joins has no candidate left for its place: ask for fewer poses, or give "
            "another gauge.mount_deg"
        )
    tried = np.sort(rng.choice(others, min(3000, len(others)), replace=False))  # candidates that compete for one place
    kept = choice.model.rows(there.take(np.arange(len(there)) != lost))
    rows = choice.model.rows(pool.samples.take(tried))
    mass = information_matrix(kept) + np.swapaxes(rows, 1, 2) @ rows
    merit = find_rule(choice.index).merit(index_of_information(choice.index, mass, len(choice.q)))
    best = int(tried[np.argmax(merit)])
    q, chosen = choice.q.copy(), choice.chosen.copy()
    q[lost], chosen[lost] = pool.q[best], best
    return choice.with_candidates(pool, chosen, q)
