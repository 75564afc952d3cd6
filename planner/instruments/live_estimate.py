"""What the poses that were read so far leave of the tool's error, pose by pose, and what further ones would bring.

The model is linear about what was expected of the robot; its information matrix grows by a reading at a time, and how
large the errors of each kind are is learnt from the same matrix. Nothing is identified anew: ``edbb identify`` says
what holds, from the whole run.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.linalg import solve_triangular

from planner.cell.cell import Cell
from planner.common.units import Array, read_only
from planner.design.assumptions import LIMIT_QUANTILE
from planner.design.expected_errors import ExpectedErrors
from planner.design.free_parameters import UndeclaredErrors, undeclared_errors
from planner.design.learnt_sizes import LearntErrors, learn_errors
from planner.instruments.next_session import CalibratedState, RemainingErrors, tool_names
from planner.runs.run import Readings, Samples

GAUGE = "gauge"


@dataclass(frozen=True)
class Progress:
    """Where a session stands.

    Attributes:
        poses: read so far.
        error, at_most: of the tool over the workspace [m], expected, and what 95 of 100 such robots stay below.
        more: further poses of the plan that would bring ``at_most`` down to the goal; ``None``: all do not, or no goal.
        then: the expected error after those, or after all that are left [m].
        surprise: how far the last reading was from what was expected of it, in standard deviations of that.
    """

    poses: int
    error: float
    at_most: float
    more: int | None
    then: float
    surprise: float


@dataclass
class LiveEstimate:
    """The estimate of a session while it is measured.

    Attributes:
        unknown: what may be wrong with the robot, and where the gauge stands.
        samples: the poses of the plan that may be read.
        until: the error that is wanted for 95 of 100 such robots [m]; ``None``: all poses are read.
        read: which were read, in their order.
        history: where the session stood after each of them.
    """

    unknown: ExpectedErrors
    samples: Samples
    until: float | None = None
    read: list[int] = field(default_factory=list)
    history: list[Progress] = field(default_factory=list)

    def __post_init__(self) -> None:
        model, errors = self.unknown.model, mean_errors(self.unknown)
        self.white = self.unknown.white(self.samples)
        self.noise = model.noise(self.samples)
        self.expected = model.reading(self.samples, errors)[:, 0]
        self.family, self.known = families(self.unknown)
        self.root = _root(self.unknown.weight_per_prior)
        self.off: list[float] = []
        self.learnt = LearntErrors(
            np.zeros(self.white.shape[1]), np.ones(self.white.shape[1]), np.ones(len(self.known))
        )

    @classmethod
    def of(
        cls, cell: Cell, q: Array, place: np.ndarray, until: float | None = None, after: Path | None = None
    ) -> "LiveEstimate":
        """Begin the estimate of a session.

        Args:
            cell: where it is measured.
            q, place: the poses that may be read, (n, N) [rad], and the number of the fixture of each, (n,).
            until: see above.
            after: folder of an identification of the robot by earlier sessions.
        """
        samples = Samples(read_only(q), place)
        unknown: ExpectedErrors
        if after is None:
            unknown = undeclared_errors(cell, samples)
        else:
            unknown = RemainingErrors.of(CalibratedState.read(after, cell), cell, samples)
        return cls(unknown, samples, until)

    def add(self, pose: int, length: float) -> Progress:
        """Take a reading [m] at the pose of this number among ``samples``; return where the session stands."""
        one = np.array([pose])
        setup = self.unknown.model.setup
        target = setup.targets(self.samples.take(one), Readings(length=read_only([length])))
        assert target.length is not None
        row, off = self.white[pose], float((target.length[0] - self.expected[pose]) / self.noise[pose])
        surprise = abs(off - row @ self.learnt.mean) / np.sqrt(1.0 + self._spread(row))
        self.read.append(pose)
        self.off.append(off)
        self.learnt = learn_errors(self.white[self.read], np.array(self.off), self.family, self.known)
        self.history.append(self._progress(float(surprise)))
        return self.history[-1]

    def unread_poses(self) -> list[int]:
        """Return the poses that are not read yet, in the order of the plan."""
        done = set(self.read)
        return [k for k in range(len(self.samples)) if k not in done]

    def adds_nothing(self, pose: int, beside: Sequence[int]) -> bool:
        """Tell whether a pose may be passed: once those ``beside`` it are read as well, the error is the same."""
        # 2e-3: of the mean square error, a tenth of a per cent of the error
        return self._square([*self.read, *beside]) <= (1.0 + 2e-3) * self._square([*self.read, *beside, pose])

    @property
    def reached(self) -> bool:
        """Whether the goal is reached by what was read."""
        return self.until is not None and bool(self.history) and self.history[-1].at_most <= self.until

    def _progress(self, surprise: float) -> Progress:
        left = self.unread_poses()
        at_most = self._limit(self.read)
        more: int | None = None
        if self.until is not None:
            goal = self.until
            counts = range(len(left) + 1)
            first = bisect_left(counts, True, key=lambda c: self._limit([*self.read, *left[:c]]) <= goal)
            more = first if first < len(counts) else None
        then = [*self.read, *left[: len(left) if more is None else more]]
        return Progress(len(self.read), self._error(self.read), at_most, more, self._error(then), surprise)

    def _spread(self, row: Array) -> float:
        """Variance of a reading of row (P,) that is expected after those that were read, in its noise."""
        size = self.learnt.factors[self.family]
        white, own = self.white[self.read] * size, row * size
        told = np.linalg.solve(np.eye(len(white)) + white @ white.T, white @ own)
        return float(max(own @ own - (white @ own) @ told, 0.0))

    def _remaining(self, which: Sequence[int]) -> Array:
        """Return the matrix whose trace is the mean square error of the tool after some readings, (r, r) [m²].

        It is Rᵀ C R, with R the root of the weight and C the covariance that the readings leave.
        """
        size = self.learnt.factors[self.family]
        root, white = self.root * size[:, None], self.white[list(which)] * size
        seen = solve_triangular(np.linalg.cholesky(np.eye(len(white)) + white @ white.T), white @ root, lower=True)
        return np.asarray(root.T @ root - seen.T @ seen)

    def _square(self, which: Sequence[int]) -> float:
        return float(np.trace(self._remaining(which)))

    def _error(self, which: Sequence[int]) -> float:
        return self.unknown.state(self._square(which))

    def _limit(self, which: Sequence[int]) -> float:
        """Return what 95 of 100 such robots stay below after some readings [m], see ``square_limit``."""
        values = np.maximum(np.linalg.eigvalsh(self._remaining(which))[::-1], 0.0)
        few = values[: DRAWS.shape[1]]
        square = np.quantile(DRAWS[:, : len(few)] @ few, LIMIT_QUANTILE) + values[len(few) :].sum()
        return self.unknown.state_limit(float(square))


DRAWS = np.random.default_rng(11).chisquare(1.0, (4000, 60))
"""Squared normal numbers of robots, (robots, values): the largest values of a sum; what is beyond them is certain."""


def _root(weight: Array) -> Array:
    """Return a root (P, r) of a symmetric matrix, without what adds nothing to its trace."""
    values, axes = np.linalg.eigh(weight)
    kept = values > 1e-9 * values.sum()
    return np.asarray(axes[:, kept] * np.sqrt(values[kept]))


def families(unknown: ExpectedErrors) -> tuple[np.ndarray, np.ndarray]:
    """Return the family of each error, (P,), and which families have a stated size, (F,): where the gauge stands.

    Errors of a robot that was calibrated have the sizes that its runs say, all together one factor on them.
    """
    if not isinstance(unknown, UndeclaredErrors):
        return np.where(unknown.of_gauge, 0, 1), np.array([True, False])
    names = [GAUGE]
    names += [f"geometry, {p.unit}" if p.group == "geometry" else p.group for p in unknown.model.parameters]
    distinct = list(dict.fromkeys(names))
    number = np.array([distinct.index(n) for n in names[1:]])
    return number, np.array([n == GAUGE for n in distinct])


def mean_errors(unknown: ExpectedErrors) -> Array:
    """Return what is expected of each parameter of the model before the session, (P,) [m, rad, …]."""
    names = unknown.model.names
    mean = np.zeros(len(names))
    if isinstance(unknown, RemainingErrors):
        file = unknown.before.known.file
        known = {p.name: -value for p, value in zip(file.parameters, file.nominal, strict=True)}
        tool = dict(zip(tool_names(unknown.model.setup), (f"map_{a}" for a in "xyz"), strict=True))
        mean = np.array([known.get(tool.get(n, n), 0.0) for n in names])
    return mean
