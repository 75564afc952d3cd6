"""How many poses bring the error of the tool down to a goal, or that no number of them does."""

from bisect import bisect_left
from collections.abc import Callable

import numpy as np

from planner.common.units import Array, to_mm
from planner.design.assumptions import FEWEST_POSES_AT_A_PLACE
from planner.design.expected_errors import ExpectedErrors, GoalOutOfReachError, error_limit


def settle_until(
    unknown: ExpectedErrors,
    white: Array,
    order: np.ndarray,
    until: float,
    settle: Callable[[int], np.ndarray],
    factor: Callable[[np.ndarray], float] = lambda _: 1.0,
) -> np.ndarray:
    """Return as many candidates as bring the error down to ``until`` [m] once they are settled.

    Exchanges lower the mean square, which the limit follows in general only, and poses at a fixture that had none take
    the places of others: a few more are taken then.

    Args:
        unknown: what may be wrong.
        white: its rows of all candidates, (n, P).
        order: candidates in the order in which they are taken, (k,).
        until: what 95 of 100 robots are to stay below [m].
        settle: returns so many candidates, the best that are found.
        factor: by which the limit after some candidates is larger than ``unknown`` says.

    Raises:
        GoalOutOfReachError: as of ``_count_until``.
    """
    count = _count_until(unknown, white, order, until, factor(order))
    for _ in range(2):  # the factor of fewer poses is another one
        count = _count_until(unknown, white, order, until, factor(order[:count]))
    while factor(chosen := settle(count)) * error_limit(unknown, white[chosen]) > until and count < len(order):
        count = min(count + max(count // 10, 4), len(order))  # a tenth more
    return chosen


def _count_until(unknown: ExpectedErrors, white: Array, order: np.ndarray, until: float, factor: float) -> int:
    """Return how many of the readings ``order`` (k,) of ``white`` (n, P) bring the error down to ``until`` [m].

    Not fewer than tell where the gauge stands.

    Raises:
        GoalOutOfReachError: not even all of them do.
    """

    def limit(count: int) -> float:
        """Return the error that 95 of 100 such robots stay below after the first ``count`` readings [m]."""
        return factor * error_limit(unknown, white[order[:count]])

    if (best := limit(len(order))) > until:
        every = factor * error_limit(unknown, white)
        raise GoalOutOfReachError(
            f"an error of {to_mm(until):.3g} mm {unknown.where} (95 % sure) cannot be reached "
            f"with this gauge at these places: {to_mm(best):.3g} mm at best, by {len(order)} poses (all {len(white)} "
            f"candidates: {to_mm(every):.3g} mm); ask for more than that, or measure from another place as well",
            unknown, white, until, len(order), best, factor,
        )  # fmt: skip
    count = bisect_left(range(len(order)), True, 1, key=lambda count: limit(count) <= until)
    return max(count, FEWEST_POSES_AT_A_PLACE)
