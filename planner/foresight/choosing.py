"""Which candidates leave the smallest error of the tool, one after the other, and how good any other set could be.

The posterior covariance C of all errors under prior and readings is that of a Bayesian fit; a reading a with noise σ
takes a C W C aᵀ / (σ² + a C aᵀ) off the mean square error trace(W C) of the tool (Bayesian I-optimal design;
Chaloner & Verdinelli 1995, Statistical Science 10(3), 3.1; greedy as Krause, Singh & Guestrin 2008, JMLR 9).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.candidates import PoseSet
from planner.cell import Cell
from planner.errors import NoSolutionError
from planner.foresight.bound import least_error
from planner.foresight.posterior import Posterior
from planner.foresight.unknown import ASSUMED, Unknown, unknown_of
from planner.repeatable import single_threaded
from planner.units import Array, to_mm

LEFT = 1 / 3  # of what stays untraced: so far the error is brought down where no number of poses is given
FEWEST, MOST = 100, 400  # poses, where no number is given
BEGUN = 1e-2  # of the prior sizes of the gauge's places, in the greedy choice
PASSES = 2  # through the chosen, in which each may give way to another
SHORT = 12_000  # candidates that promise most, among which the chosen are exchanged
FLAT = 0.01  # of the error: where the last tenth of the poses lessened it by no more, others would not either
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Foresight:
    """The poses that show most of what may be wrong, and the error that the robot would keep.

    Attributes:
        unknown: what may be wrong.
        chosen: positions in the pool in the order in which they were taken, (n,) int.
        after: expected error of the tool [m] after the first 1 … n of them.
        bound: no n candidates leave a smaller error than this [m].
        left: expected error of the tool [m] after the poses that are driven, some of which others may have replaced.
    """

    unknown: Unknown
    chosen: np.ndarray
    after: Array
    bound: float
    left: float

    @property
    def gap(self) -> float:
        """How much smaller, at most, the error of another set of candidates could be, as a part of the bound."""
        return float(self.after[-1]) / self.bound - 1.0

    def with_poses(self, q: Array, fixture: np.ndarray) -> float:
        """Return the expected error [m] after readings at other poses q (n, N) [rad] on the fixtures (n,)."""
        white = self.unknown.white(q, fixture)
        covariance = np.linalg.inv(white.T @ white + np.eye(white.shape[1]))
        return float(np.sqrt((self.unknown.scaled * covariance).sum()))


@single_threaded
def foresee(cell: Cell, pool: PoseSet, poses: int | None, progress: Progress | None = None) -> Foresight:
    """Choose ``poses`` candidates for a bar, or as many as bring the error down to a third of what stays untraced.

    Raises:
        NoSolutionError: the pool has fewer candidates.
    """
    if poses is not None and poses > len(pool):
        raise NoSolutionError(
            f"{poses} poses are wanted, and only {len(pool)} candidates are left: widen the cones, the cable's "
            "budget or the clearance, or raise plan.candidates"
        )
    unknown = unknown_of(cell, pool.q, pool.fixture)
    white, weight = unknown.white(pool.q, pool.fixture), unknown.scaled
    target = 0.0 if poses else LEFT * unknown.untraced
    begun = Posterior.before(white * _begun(unknown), weight)
    chosen = greedy(begun, min(poses or MOST, len(pool)), target, progress)
    short = np.union1d(chosen, np.argsort(-begun.gains, kind="stable")[:SHORT])
    at = np.searchsorted(short, chosen)
    chosen = short[exchanged(Posterior.before(white[short], weight).with_readings(at), at)]
    after = errors_after(white[chosen], weight)
    return Foresight(unknown, chosen, after, least_error(white, weight, chosen), float(after[-1]))


def _begun(unknown: Unknown) -> Array:
    """Factors (P,) of the rows, by which the greedy choice takes the gauge's places for nearly known.

    The first readings about a fixture only tell where it stands; one step ahead it would never look worth beginning.
    """
    return np.array([BEGUN if p.group == "gauge" else 1.0 for p in unknown.model.parameters])


def greedy(posterior: Posterior, most: int, target: float, progress: Progress | None = None) -> np.ndarray:
    """Take one candidate after the other into ``posterior``, always the one that leaves the smallest error.

    Args:
        posterior: what is known before; what is known after.
        most: how many are taken at most.
        target: the error at which to stop [m]; with zero there is no stopping before.
        progress: called with (taken, most).

    Returns:
        Positions of the candidates in the order in which they were taken, (k,) int.
    """
    chosen: list[int] = []
    squares: list[float] = []
    while len(chosen) < most and posterior.square > target**2 and not (target and _flat(squares)):
        gains = posterior.gains
        gains[chosen] = -1.0
        chosen.append(int(np.argmax(gains)))
        posterior.add(chosen[-1])
        squares.append(posterior.square)
        if progress is not None:
            progress(len(chosen), most)
    return np.array(chosen)


def _flat(squares: list[float]) -> bool:
    """Tell whether the last tenth of the poses hardly lessened the error: the rest cannot be seen from here."""
    before = int(0.9 * len(squares))
    return len(squares) >= FEWEST and squares[-1] > (1 - FLAT) ** 2 * squares[before - 1]


def exchanged(posterior: Posterior, chosen: np.ndarray) -> np.ndarray:
    """Give each of the chosen up for the candidate that leaves the smallest error, those that count least first."""
    out = chosen.copy()
    for _ in range(PASSES):
        before = out.copy()
        for k in np.argsort(posterior.loss(out), kind="stable"):
            posterior.add(int(out[k]), -1)
            gains = posterior.gains
            gains[np.delete(out, k)] = -1.0
            best = int(np.argmax(gains))
            if gains[best] > gains[out[k]] * (1 + 1e-9):
                out[k] = best
            posterior.add(int(out[k]))
        if np.array_equal(out, before):
            break
    return out


def errors_after(white: Array, weight: Array) -> Array:
    """Return the error of the tool [m] after the first 1 … n readings of ``white`` (n, P), (n,)."""
    known = Posterior.before(white, weight)
    out = np.empty(len(white))
    for k in range(len(white)):
        known.add(k)
        out[k] = np.sqrt(max(known.square, 0.0))
    return out


def foreseen(ahead: Foresight) -> str:
    """Return what is foreseen in a sentence."""
    left, bound, untraced = (f"{float(to_mm(v)):.3f}" for v in (ahead.left, ahead.bound, ahead.unknown.untraced))
    few = " (too few poses to gain by tracing)" if ahead.left > ahead.unknown.untraced else ""
    return (
        f"the tool would keep an error of {left} mm (rms, anywhere in the workspace) once the run is traced{few}; a "
        f"fit of the geometry alone leaves {untraced} mm even after endless readings; no {len(ahead.chosen)} "
        f"candidates leave less than {bound} mm; all this if {ASSUMED}"
    )
