"""Bayesian I-optimal design: the candidates that leave the smallest expected error of the tool, and a bound on it.

The posterior covariance C of all errors under prior and readings is that of a Bayesian fit. A reading a with noise s
takes a C W C a' / (s^2 + a C a') off the mean square error trace(W C) of the tool (Chaloner and Verdinelli 1995,
Statistical Science 10(3), 3.1; greedy as Krause, Singh and Guestrin 2008, JMLR 9).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import even_positions, on_one_thread
from planner.common.errors import NoSolutionError
from planner.common.progress import UNLIMITED, StageProgress, TimeLimit
from planner.common.second_process import ForkedTask
from planner.common.units import Array
from planner.design.assumptions import (
    FEWEST_POSES,
    FEWEST_POSES_AT_A_PLACE,
    FLAT_SHARE,
    GREEDY_PLACE_PRIOR_SHARE,
    MOST_POSES,
    UNTRACED_TARGET_SHARE,
)
from planner.design.candidates.pool import PoseSet
from planner.design.expected_errors import (
    ErrorByNumber,
    ErrorForecast,
    ExpectedErrors,
    error_limit,
    expected_error,
    share_below,
)
from planner.design.free_parameters import undeclared_errors
from planner.design.goal_of_poses import settle_until
from planner.design.selection.search import add_greedily, exchange_singly
from planner.design.tool_error_bound import bound_tool_error
from planner.design.unnamed_errors import identified_errors
from planner.runs.run import Samples


@dataclass
class BayesianPosterior:
    """The covariance C of all errors, in prior sigmas, and what the candidates would change of it.

    A reading moves every number below by the products of all candidates with two vectors (Sherman–Morrison), so that
    one step costs one look at the rows, however many numbers there are.

    Attributes:
        white: rows of the candidates in standard deviations of their readings per prior sigma, (n, P).
        weight: mean square error of the tool per squared errors in prior sigmas, W (P, P).
        covariance: C, (P, P).
        shown: a C W C aᵀ of each candidate's row a, (n,) [m²].
        spread: variance of each reading that C foretells, a C aᵀ, in its own noise, (n,).
        square: mean square error of the tool under C [m²].
    """

    white: Array
    weight: Array
    covariance: Array
    shown: Array
    spread: Array
    square: float

    @classmethod
    def prior(cls, white: Array, weight: Array) -> "BayesianPosterior":
        """Return the posterior before any reading: the priors."""
        shown = np.einsum("ij,ij->i", white @ weight, white)
        spread = np.einsum("ij,ij->i", white, white)
        by_column = np.asfortranarray(white)  # products with vectors read it twice as quickly
        return cls(by_column, weight, np.eye(white.shape[1]), shown, spread, float(np.trace(weight)))

    def gains(self) -> Array:
        """How much each candidate would take off the mean square error, (n,) [m²]."""
        return np.asarray(self.shown / (1.0 + self.spread))

    def order(self, chosen: np.ndarray) -> np.ndarray:
        """Return positions in a chosen set, that first without which the mean square error would grow least."""
        return np.argsort(self.shown[chosen] / (1.0 - self.spread[chosen]), kind="stable")

    def with_readings(self, which: np.ndarray) -> "BayesianPosterior":
        """Return the posterior after measuring the candidates ``which`` (k,) too."""
        out = replace(self)
        for k in which:
            out.change(int(k))
        return out

    def change(self, candidate: int, sign: int = 1) -> None:
        """Take a candidate among the readings, or out of them where ``sign`` is −1."""
        scale = sign / (1.0 + sign * self.spread[candidate])
        seen = self.covariance @ self.white[candidate]
        pull = self.weight @ seen
        size = float(seen @ pull)
        by, through = self.white @ seen, self.white @ (self.covariance @ pull)
        self.square -= size * scale
        self.shown = self.shown - scale * by * (2.0 * through - scale * size * by)
        self.spread = self.spread - scale * by**2
        self.covariance = self.covariance - scale * np.outer(seen, seen)


EXCHANGE_PASSES = 2  # through the chosen poses, in which each may give way to another
FORESEEN_NUMBERS = (40, 80, 120, 200)  # [poses] of which the error is foreseen beside the number that is asked for


@dataclass(frozen=True)
class BayesianDesign(ErrorForecast):
    """The poses that show most of what may be wrong, and the error that the robot would keep.

    Attributes:
        chosen: positions in the pool in the order in which they were taken, (n,) int.
        after: expected error of the tool [m] after the first 1 … n of them, as driven.
        on_grid: expected error of the tool [m] after the chosen candidates, before any of them was moved or replaced.
        bound: no n of the candidates that were considered leave a smaller error than this [m].
        floor: expected error of the tool [m] after all candidates: what these places cannot show.
        forecast: of this number, foreseen as the others are: among few candidates [m].
        until: what 95 of 100 robots are to stay below [m]; ``None``: nobody has asked for that.
        share_below: of such robots that are below ``until`` after the poses that are driven.
    """

    chosen: np.ndarray
    after: Array
    on_grid: float
    bound: float
    floor: float
    forecast: float
    until: float | None = None
    share_below: float | None = None

    @property
    def gap(self) -> float:
        """How much smaller, at most, the error of another set of candidates could be, as a part of the bound."""
        return self.on_grid / self.bound - 1.0

    def with_driven_poses(
        self, samples: Samples, minutes: Callable[[int], float], unknown: ExpectedErrors | None = None
    ) -> "BayesianDesign":
        """Return the design with the errors after the driven poses, and the minutes that each number of poses takes.

        Other numbers, chosen among few candidates, are foreseen better or worse by as much as this one came out so.

        Args:
            samples: the poses that are driven.
            minutes: that a number of poses takes.
            unknown: what they leave unknown, where that is more than what chose them.
        """
        unknown = self.unknown if unknown is None else unknown
        white = unknown.white(samples)
        after = errors_after(white, unknown)
        left, n, at_most = float(after[-1]), len(after), error_limit(unknown, white)
        floor = self.floor * left / _remaining_error(self.unknown.white(samples), self.unknown)
        others = [f for f in self.by_number if f.poses not in (n, len(self.after))]
        found = [ErrorByNumber(f.poses, max(left / self.forecast * f.error, floor)) for f in others]
        found = sorted([*found, ErrorByNumber(n, left)], key=lambda f: f.poses)
        by_number = tuple(replace(f, minutes=minutes(f.poses)) for f in found)
        below = None if self.until is None else share_below(unknown, white, self.until)
        return replace(
            self, unknown=unknown, after=after, left=left, at_most=at_most, floor=floor, by_number=by_number,
            share_below=below,
        )  # fmt: skip


class BackgroundDesign:
    """Chosen poses. Other processes compute their bound meanwhile, and the error that other numbers of poses leave.

    Attributes:
        unknown: what may be wrong.
        chosen: positions in the pool, (n,) int.
        until: as of :class:`BayesianDesign`.
    """

    def __init__(
        self,
        unknown: ExpectedErrors,
        chosen: np.ndarray,
        after: Array,
        limits: ForkedTask[tuple[float, float, float, float]],
        others: ForkedTask[dict[int, float]],
        until: float | None = None,
    ) -> None:
        self.unknown, self.chosen, self.until = unknown, chosen, until
        self._after, self._limits, self._others = after, limits, others

    def result(self) -> BayesianDesign:
        """Wait for the whole design; to be called once."""
        bound, floor, at_most, forecast = self._limits.result()
        left, after = float(self._after[-1]), self._after
        by_number = {len(self.chosen): left} | self._others.result()
        numbers = tuple(ErrorByNumber(n, e) for n, e in sorted(by_number.items()))
        return BayesianDesign(
            unknown=self.unknown,
            chosen=self.chosen,
            after=after,
            on_grid=left,
            bound=bound,
            left=left,
            at_most=at_most,
            floor=floor,
            by_number=numbers,
            forecast=forecast,
            until=self.until,
        )

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End the processes if the caller failed."""
        if kind is not None:
            self._limits.stop()
            self._others.stop()


@on_one_thread
def choose_bayesian_poses(
    cell: Cell,
    pool: PoseSet,
    poses: int | None,
    progress: StageProgress | None = None,
    unknown: ExpectedErrors | None = None,
    until: float | None = None,
    limit: TimeLimit = UNLIMITED,
) -> BackgroundDesign:
    """Choose ``poses`` candidates for a bar, or as many as bring the error down to a third of what stays untraced.

    Args:
        cell, pool, poses, progress: see above.
        unknown: what may be wrong; everything that nobody has declared, where it is not given.
        until: as many poses as bring down to this what 95 of 100 such robots stay below [m].
        limit: of the time that a plan may take.

    Raises:
        NoSolutionError: the pool has fewer candidates, or no number of them brings the error down to ``until``.
    """
    if poses is not None and poses > len(pool):
        raise NoSolutionError(
            f"{poses} poses are wanted, and only {len(pool)} candidates are left: widen the cones, the cable's "
            "budget or the clearance, or raise plan.candidates"
        )
    unknown = undeclared_errors(cell, pool.samples) if unknown is None else unknown
    # 24_000: candidates considered, evenly spread over the pool
    considered = even_positions(len(pool), max(24_000, poses or 0))
    white, weight = unknown.white(pool.samples.take(considered)), unknown.weight_per_prior
    target = 0.0 if poses or until is not None else UNTRACED_TARGET_SHARE * unknown.untraced_error
    start = _start_factors(unknown)
    few = even_positions(len(white), 2000)  # candidates, enough for a forecast
    others = ForkedTask(lambda: _expected_errors(white[few], unknown, start, FORESEEN_NUMBERS, limit))
    begun = BayesianPosterior.prior(white * start, weight)
    first = select_greedily(begun, min(poses or MOST_POSES, len(white)), target, progress)
    likely = np.argsort(-begun.gains(), kind="stable")[:6000]  # candidates that promise most
    place = pool.samples.place[considered]

    def settle(count: int) -> np.ndarray:
        """Return ``count`` candidates, bettered by exchanges, some of them at every fixture."""
        promising = np.union1d(first[:count], likely)
        chosen = promising[_exchange(white[promising], weight, np.searchsorted(promising, first[:count]), limit)]
        return _use_every_place(place, chosen, white * start, weight)

    def factor(which: np.ndarray) -> float:
        """Return by how much more an identification leaves after some candidates: it learns what acts."""
        left = identified_errors(unknown, cell, there := pool.samples.take(considered[which]))
        return error_limit(left, left.white(there)) / error_limit(unknown, white[which])

    chosen = settle(len(first)) if until is None else settle_until(unknown, white, first, until, settle, factor)
    after = errors_after(white[chosen], unknown)

    def limits() -> tuple[float, float, float, float]:
        """Return bound, floor, 95 % limit and forecast of the tool error [m]."""
        bound = unknown.state(bound_tool_error(white, weight, chosen, limit) ** 2)
        forecast = _expected_errors(white[few], unknown, start, (len(chosen),), limit)
        alike = forecast.get(len(chosen), float(after[-1]))
        return bound, _remaining_error(white, unknown), error_limit(unknown, white[chosen]), alike

    return BackgroundDesign(unknown, considered[chosen], after, ForkedTask(limits), others, until)


def _use_every_place(place: np.ndarray, chosen: np.ndarray, white: Array, weight: Array) -> np.ndarray:
    """Let each fixture at which nothing was chosen have some poses: a person who set it up wants to know where it is.

    Args:
        place: fixture of each considered reading, (n,) int.
        chosen: positions of the chosen ones, (k,) int; the last of them give way.
        white: the readings, the gauge's places taken for nearly known, (n, P).
        weight: as of :class:`BayesianPosterior`.
    """
    parts = [chosen]
    for p in np.setdiff1d(place, place[chosen]):
        there = np.flatnonzero(place == p)
        begun = BayesianPosterior.prior(white[there], weight)
        parts.append(there[select_greedily(begun, min(FEWEST_POSES_AT_A_PLACE, len(there)), 0.0)])
    more = sum(map(len, parts[1:]))
    return np.concatenate([chosen[: max(len(chosen) - more, 0)], *parts[1:]]).astype(np.intp)


def _exchange(white: Array, weight: Array, chosen: np.ndarray, limit: TimeLimit) -> np.ndarray:
    """Let each of the chosen give way to another of the readings ``white`` (n, P)."""
    known = BayesianPosterior.prior(white, weight).with_readings(chosen)
    return exchange_singly(known, chosen, EXCHANGE_PASSES, known.order, limit)


def _expected_errors(
    white: Array, unknown: ExpectedErrors, start: Array, wanted: Sequence[int], limit: TimeLimit
) -> dict[int, float]:
    """Return the expected error [m] by ``wanted`` numbers of poses, chosen among the readings ``white`` (n, P)."""
    weight = unknown.weight_per_prior
    numbers = [n for n in wanted if n < len(white)]
    taken = select_greedily(BayesianPosterior.prior(white * start, weight), max(numbers, default=0), 0.0)
    return {n: _remaining_error(white[_exchange(white, weight, taken[:n], limit)], unknown) for n in numbers}


def foresee_error(cell: Cell, samples: Samples, poses: int) -> tuple[float, float]:
    """Return the expected error [m] before any reading, and after ``poses`` of the samples, chosen greedily."""
    unknown = undeclared_errors(cell, samples)
    white, weight = unknown.white(samples), unknown.weight_per_prior
    chosen = select_greedily(BayesianPosterior.prior(white * _start_factors(unknown), weight), poses, 0.0)
    return _remaining_error(white[:0], unknown), _remaining_error(white[chosen], unknown)


def _remaining_error(white: Array, unknown: ExpectedErrors) -> float:
    """Return the expected error [m] after all readings of ``white`` (n, P)."""
    covariance = np.linalg.inv(white.T @ white + np.eye(white.shape[1]))
    return expected_error(unknown, float((unknown.weight_per_prior * covariance).sum()))


def _start_factors(unknown: ExpectedErrors) -> Array:
    """Factors (P,) of the rows, by which the greedy choice takes the gauge's places for nearly known.

    The first readings about a fixture only tell where it stands; one step ahead it would never look worth beginning.
    """
    return np.where(unknown.of_gauge, GREEDY_PLACE_PRIOR_SHARE, 1.0)


def select_greedily(
    posterior: BayesianPosterior, most: int, target: float, progress: StageProgress | None = None
) -> np.ndarray:
    """Take one candidate after the other into ``posterior``, always the one that leaves the smallest error.

    Args:
        posterior: what is known before; what is known after.
        most: how many are taken at most.
        target: the error at which to stop [m]; with zero there is no stopping before.
        progress: called with (taken, most).

    Returns:
        Positions of the candidates in the order in which they were taken, (k,) int.
    """
    squares: list[float] = []

    def stop(chosen: Sequence[int]) -> bool:
        """Tell of the progress, and whether the error is down to the target or falls no more."""
        if chosen:
            squares.append(posterior.square)
            if progress is not None:
                progress(len(chosen), most)
        return posterior.square <= target**2 or (target > 0 and _is_flat(squares))

    return add_greedily(posterior, most, stop)


def _is_flat(squares: list[float]) -> bool:
    """Tell whether the last tenth of the poses hardly lessened the error: the rest cannot be seen from here."""
    before = int(0.9 * len(squares))
    return len(squares) >= FEWEST_POSES and squares[-1] > (1 - FLAT_SHARE) ** 2 * squares[before - 1]


def errors_after(white: Array, unknown: ExpectedErrors) -> Array:
    """Return the error of the tool [m] after the first 1 … n readings of ``white`` (n, P), (n,)."""
    known = BayesianPosterior.prior(white, unknown.weight_per_prior)
    out = np.empty(len(white))
    for k in range(len(white)):
        known.change(k)
        out[k] = expected_error(unknown, known.square)
    return out
