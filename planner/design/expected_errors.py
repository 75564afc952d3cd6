"""What may be wrong with a robot before a session is planned, and the error of its tool by it: one protocol."""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Protocol, Self

import numpy as np

from planner.cell.cell import Cell
from planner.common.errors import NoSolutionError
from planner.common.units import Array, read_only
from planner.design.assumptions import LIMIT_QUANTILE
from planner.design.drawn_errors import draw_remaining_errors
from planner.model.model import Model
from planner.runs.run import Samples

EVERYWHERE = "over the workspace"


class ExpectedErrors(Protocol):
    """Random errors of a robot and its gauge, normal and of unit size, and what they do to readings and tool."""

    @property
    def model(self) -> Model:
        """The measurement model behind them."""

    @property
    def root(self) -> Array:
        """Root of the covariance of the model's parameters, (parameters, P): what each error does to them."""

    @property
    def of_gauge(self) -> np.ndarray:
        """Which of them only say where the gauge stands, (P,) bool."""

    @property
    def usual(self) -> np.ndarray:
        """Family of those of which most robots have little and few much, (P,) int; −1 of all others."""

    @property
    def weight_per_prior(self) -> Array:
        """Mean square error of the tool per squared errors, (P, P) [m²]."""

    @property
    def where(self) -> str:
        """Where the error of the tool counts, as the end of a sentence says it."""

    @property
    def untraced_error(self) -> float:
        """Error of the tool [m] that the session is to bring down."""

    @property
    def untraced_label(self) -> str:
        """What that error is, in a few words."""

    @property
    def before_label(self) -> str:
        """A few words that say which robots the error before any reading belongs to."""

    @property
    def doubt(self) -> float:
        """One sigma of the logarithm of what is left of the errors, as their sizes have to be learnt."""

    @property
    def assumptions(self) -> str:
        """A sentence on what the expected errors assume."""

    @property
    def condition(self) -> str:
        """A further sentence that says the same, behind a stop; empty where none is needed."""

    def on(self, model: Model) -> Self:
        """Return the same errors in another model of the same parameters, one in which the gauge stands elsewhere."""

    def white(self, samples: Samples) -> Array:
        """Return the change of each number of the readings by each error, in standard deviations, (n r, P)."""

    def state(self, square: float) -> float:
        """Return the error of the tool that is stated [m], where the errors have the mean square ``square`` [m²]."""

    def state_limit(self, square: float) -> float:
        """Return the error [m] that 95 of 100 robots stay below, from that quantile of its square."""

    def describe(self, left: float, left_mm: str, at_most_mm: str) -> str:
        """Say what the session would leave [m], written and as a limit [mm]; the last sentence has no stop."""


class GoalOutOfReachError(NoSolutionError):
    """No number of the candidates brings the error down to what is wanted.

    Attributes:
        unknown: what may be wrong.
        white: rows of all candidates, (n, P).
        until: what 95 of 100 robots were to stay below [m].
        most: the most poses of a plan.
        best: what 95 of 100 robots stay below after so many [m].
        factor: by which that is larger than ``unknown`` says.
    """

    def __init__(
        self, text: str, unknown: ExpectedErrors, white: Array, until: float, most: int, best: float, factor: float
    ) -> None:
        super().__init__(text)
        self.unknown, self.white, self.until, self.most = unknown, white, until, most
        self.best, self.factor = best, factor


@dataclass(frozen=True)
class ErrorByNumber:
    """What another number of poses would give: expected error of the tool [m], and minutes of driving where known."""

    poses: int
    error: float
    minutes: float | None = None


@dataclass(frozen=True)
class ErrorForecast:
    """The error of the tool that such robots have before a session and keep after it.

    Attributes:
        unknown: what may be wrong.
        left: expected error after the poses that are driven [m].
        at_most: what 95 of 100 such robots stay below then [m].
        by_number: of other numbers of poses, and of this one.
    """

    unknown: ExpectedErrors
    left: float
    at_most: float
    by_number: tuple[ErrorByNumber, ...]

    @classmethod
    def of(
        cls, unknown: ExpectedErrors, samples: Samples, minutes: Callable[[int], float] | None = None
    ) -> "ErrorForecast":
        """Return the forecast for the poses ``samples`` of any gauge, and for half and twice as many poses like them.

        ``minutes``: that a number of poses takes.
        """
        white, numbers = unknown.white(samples), []
        for share in (0.5, 1.0, 2.0):
            squares = _weights_of_squares(unknown.weight_per_prior, white * np.sqrt(share))
            poses = round(share * len(samples))
            took = None if minutes is None else minutes(poses)
            numbers.append(ErrorByNumber(poses, expected_error(unknown, float(squares.sum())), took))
        return cls(unknown, numbers[1].error, error_limit(unknown, white), tuple(numbers))

    @property
    def before(self) -> float:
        """Expected error of the tool [m] before any of the readings."""
        return self.unknown.state(float(np.trace(self.unknown.weight_per_prior)))


def expected_error(errors: ExpectedErrors, square: float) -> float:
    """Return the error of the tool that is expected [m], where known sizes would leave the mean square ``square``."""
    return errors.state(square * float(np.exp(2.0 * errors.doubt**2)))


def error_limit(errors: ExpectedErrors, white: Array) -> float:
    """Return the error of the tool [m] that 95 of 100 robots stay below after readings ``white`` (n, P)."""
    return errors.state_limit(square_error_limit(errors.weight_per_prior, white, errors.usual, errors.doubt))


def share_below(errors: ExpectedErrors, white: Array, until: float) -> float:
    """Return the share of robots whose tool errs by no more than ``until`` [m] after readings ``white`` (n, P)."""
    squares = np.sort(_draw_remaining_squares(errors.weight_per_prior, white, errors.usual, errors.doubt))
    below = bisect_right(range(len(squares)), until, key=lambda k: errors.state_limit(float(squares[k])))
    return below / len(squares)


def square_error_limit(weight: Array, white: Array, usual: np.ndarray | None = None, doubt: float = 0.0) -> float:
    """Return the square [m²] that 95 of 100 robots stay below, of errors of unit size after readings ``white`` (n, P).

    ``weight`` (P, P) as ``weight_per_prior``, ``usual`` and ``doubt`` as of :class:`ExpectedErrors`.
    """
    return float(np.quantile(_draw_remaining_squares(weight, white, usual, doubt), LIMIT_QUANTILE))


def _draw_remaining_squares(weight: Array, white: Array, usual: np.ndarray | None, doubt: float) -> Array:
    """Return the square of the tool's error [m²] of each robot drawn.

    Without ``usual`` families it is a sum of squares, weighted by the eigenvalues of ``weight`` times the covariance
    that the readings leave.
    """
    if usual is None or (usual < 0).all():
        return _draw_squares(_weights_of_squares(weight, white), doubt=doubt)
    left = draw_remaining_errors(white, usual, doubt)
    return np.asarray((left * (weight @ left)).sum(axis=0))


def _weights_of_squares(weight: Array, white: Array) -> Array:
    """Return the eigenvalues of ``weight`` (P, P) times the covariance after readings ``white`` (n, P), (P,) [m²]."""
    root = np.linalg.inv(np.linalg.cholesky(white.T @ white + np.eye(len(weight))))
    return np.asarray(np.maximum(np.linalg.eigvalsh(root @ weight @ root.T), 0.0))


def limit_of_sum(weights: Array, sure: float = 0.0, doubt: float = 0.0) -> float:
    """Return the value that a weighted sum of squared normal numbers stays below in 95 of 100 draws.

    Args:
        weights: of the squares, (k,) (Imhof 1961, Biometrika 48(3/4)).
        sure: what is added to the sum and does not vary.
        doubt: standard deviation of the logarithm of the root of the whole.
    """
    return float(np.quantile(_draw_squares(weights, sure, doubt), LIMIT_QUANTILE))


def _draw_squares(weights: Array, sure: float = 0.0, doubt: float = 0.0) -> Array:
    """Return draws of the sum of :func:`limit_of_sum`, (robots,)."""
    squares, normal = _draw_robots(len(weights))
    sums = squares @ weights + sure
    return np.asarray(sums * np.exp(2.0 * doubt * normal) if doubt else sums)


@cache
def _draw_robots(values: int) -> tuple[Array, Array]:
    """Return squared normal numbers of robots, (robots, values), and normal ones, (robots,)."""
    seed = 11  # fixed: the same errors give the same limit
    robots = 4000  # drawn: the 95 % quantile of the error to about a per cent
    rng = np.random.default_rng(seed)
    return rng.chisquare(1.0, (robots, values)), rng.standard_normal(robots)


def with_stated_frames(unknown: ExpectedErrors, cell: Cell) -> ExpectedErrors:
    """Return the errors in a model whose gauge frames stand where the cell states them; lengths have no such frame.

    The model of a plan has these frames in the base, since a plan needs no reading.
    """
    model = unknown.model
    if not (model.setup.has_own_frames and cell.fixtures):
        return unknown
    R_BG = read_only(np.array([f.R_BX for f in cell.fixtures]))
    p_BG = read_only(np.array([f.p_BX for f in cell.fixtures]))
    return unknown.on(replace(model, setup=replace(model.setup, R_BG=R_BG, p_BG=p_BG)))
