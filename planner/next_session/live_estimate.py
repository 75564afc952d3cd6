"""What the poses that were read so far leave of the tool's error, pose by pose, and what further ones would bring.

Rows of the model are those of the robot as it was expected. Its information matrix grows by a reading at a time, and
how large the errors of each kind are is learnt from the same matrix. What a reading differs by is looked at about the
errors as they are estimated, so that large ones are no noise where the model bends (steps of Gauss and Newton, the rows
kept). Nothing is identified anew: ``edbb identify`` says what holds, from the whole run.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.determinism import on_one_thread
from planner.common.units import Array, read_only
from planner.design.expected_errors import ExpectedErrors, with_stated_frames
from planner.design.free_parameters import UndeclaredErrors, undeclared_errors
from planner.design.learnt_sizes import (
    ALWAYS,
    AT_TIMES,
    HARDLY_EVER,
    MOSTLY,
    Families,
    LearntForesight,
    LearntPosterior,
)
from planner.design.unnamed_errors import IdentifiedErrors, UnnamedErrors, add_unnamed_errors
from planner.effects.effect import tool_point_parameters
from planner.next_session.remaining_errors import CalibratedState, RemainingErrors, tool_names
from planner.runs.run import Readings, Samples

GAUGE = "gauge"


@dataclass(frozen=True)
class PoseReading:
    """What was read at a pose.

    Attributes:
        readings: of one sample.
        q: where the arm stood (N,) [rad]; ``None``: at the pose itself. A head is centred some millimetres beside it.
    """

    readings: Readings
    q: Array | None = None

    @classmethod
    def of_length(cls, length: float) -> "PoseReading":
        """Return the reading of a bar or wire [m]."""
        return cls(Readings(length=read_only([length])))


@dataclass(frozen=True)
class Progress:
    """Where a session stands.

    Attributes:
        poses: read so far.
        error, at_most: of the tool over the workspace [m], expected, and what 95 of 100 such robots stay below.
        more: further poses of the plan that would bring ``at_most`` down to the goal; ``None``: all do not, or no goal.
        then, then_at_most: ``error`` and ``at_most`` as expected after those, or after all that are left [m].
        surprise: how far the last reading was from what was expected of it, in standard deviations of that.
    """

    poses: int
    error: float
    at_most: float
    more: int | None
    then: float
    then_at_most: float
    surprise: float


@dataclass
class LiveEstimate:
    """The estimate of a session while it is measured.

    Attributes:
        unknown: what may be wrong with the robot, and where the gauge stands.
        samples: the poses of the plan that may be read.
        until: the error that is wanted for 95 of 100 such robots [m]; ``None``: all poses are read.
        read: which were read, in their order.
        readings: what was read there.
        history: where the session stood after each of them.
    """

    unknown: ExpectedErrors
    samples: Samples
    until: float | None = None
    read: list[int] = field(default_factory=list)
    readings: list[PoseReading] = field(default_factory=list)
    history: list[Progress] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.mean = mean_errors(self.unknown)
        self.whitener = _whitener(self.unknown, self.samples)
        white, weight = _white_rows(self.unknown, self.samples, self.whitener), self.unknown.weight_per_prior
        self.posterior = LearntPosterior.of(white, weight, families(self.unknown))
        self.off: list[float] = []

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
            unknown = add_unnamed_errors(undeclared_errors(cell, samples), cell, samples)
        else:
            unknown = RemainingErrors.of(CalibratedState.read(after, cell), cell, samples)
        return cls(with_stated_frames(unknown, cell), samples, until)

    def begin_anew(self) -> "LiveEstimate":
        """Return the estimate of the same session before its first reading."""
        return LiveEstimate(self.unknown, self.samples, self.until)

    @property
    def width(self) -> int:
        """Numbers in one reading."""
        return self.unknown.model.width

    @on_one_thread
    def add(self, pose: int, reading: PoseReading) -> Progress:
        """Take a reading at the pose of this number among ``samples``; return where the session stands."""
        own, learnt = self._rows([pose]), self.posterior.learnt
        off = self._deviations([pose], [reading]) - self.posterior.white[own] @ learnt.mean
        spread = [self.posterior.spread_of(row, self._rows(self.read)) for row in own]
        surprise = float((np.abs(off) / np.sqrt(spread)).max())
        self._learn_from([pose], [reading], 2)  # the next reading goes on
        self.history.append(self.stands(surprise))
        return self.history[-1]

    @on_one_thread
    def add_all(self, readings: Mapping[int, PoseReading]) -> Progress:
        """Take readings by the number of their pose, at once; return where the session stands then."""
        self._learn_from(list(readings), list(readings.values()), 8)
        self.history.append(self.stands())
        return self.history[-1]

    def _learn_from(self, poses: Sequence[int], readings: Sequence[PoseReading], most_steps: int) -> None:
        """Learn from these readings and all before them, about the errors as they are estimated with them.

        Steps end once no reading moves by a hundredth of its standard deviation, or where they do not come nearer.
        """
        self.read += poses
        self.readings += readings
        off, moved = self._deviations(self.read, self.readings), np.inf
        for _ in range(most_steps):
            self.off = off.tolist()
            self.posterior.learn(self._rows(self.read), off)
            off, before, last = self._deviations(self.read, self.readings), off, moved
            moved = float(np.abs(off - before).max(initial=0.0))
            if not 1e-2 < moved < last:
                break

    def _deviations(self, poses: Sequence[int], readings: Sequence[PoseReading]) -> Array:
        """Return what the errors change of readings, as a linear model of them would read, in standard deviations (k,).

        It is what the readings differ by from a robot with the errors as they are estimated, and what these errors
        change by the model's rows.
        """
        here = self.samples.take(np.array(poses, dtype=int))
        q = [own if r.q is None else r.q for r, own in zip(readings, here.q, strict=True)]
        here = replace(here, q=read_only(np.array(q)))
        model, z = self.unknown.model, self.posterior.learnt.mean
        targets = model.setup.targets(here, Readings.concatenate([r.readings for r in readings]))
        residual = model.residual(here, targets, self.mean + self.unknown.root @ z)
        white = np.einsum("kij,kj->ki", self.whitener[list(poses)], residual).ravel()
        return np.asarray(white + self.posterior.white[self._rows(poses)] @ z)

    def _rows(self, poses: Sequence[int]) -> list[int]:
        """Return the rows of the posterior that belong to poses: one for each number of a reading."""
        return [self.width * k + number for k in poses for number in range(self.width)]

    def unread_poses(self) -> list[int]:
        """Return the poses that are not read yet, in the order of the plan."""
        done = set(self.read)
        return [k for k in range(len(self.samples)) if k not in done]

    @on_one_thread
    def adds_nothing(self, pose: int, beside: Sequence[int]) -> bool:
        """Tell whether a pose may be passed: once those ``beside`` it are read as well, the error is the same."""
        # 2e-3: of the mean square error, a tenth of a per cent of the error
        without, beside_it = self._rows([*self.read, *beside]), self._rows([*self.read, *beside, pose])
        return self.posterior.square(without) <= (1.0 + 2e-3) * self.posterior.square(beside_it)

    @property
    def reached(self) -> bool:
        """Whether the goal is reached by what was read."""
        return self.until is not None and bool(self.history) and self.history[-1].at_most <= self.until

    def stands(self, surprise: float = 0.0) -> Progress:
        """Return where the session stands; ``surprise``: of the last reading, see :class:`Progress`."""
        read, left = self._rows(self.read), self.unread_poses()
        ahead = LearntForesight.of(self.posterior, read, np.array(self.off), self._rows(left))
        at_most = self._limit_after(ahead, 0)
        more = None if self.until is None else self._count_until(ahead, len(left), at_most, self.until)
        further = len(left) if more is None else more
        then, then_at_most = self._error_after(ahead, further), self._limit_after(ahead, further)
        return Progress(len(self.read), self._error_after(ahead, 0), at_most, more, then, then_at_most, surprise)

    def _count_until(self, ahead: LearntForesight, left: int, at_most: float, goal: float) -> int | None:
        """Return how many of the poses that are left bring ``at_most`` down to a goal [m]; ``None``: all do not."""
        if at_most <= goal:
            return 0
        if not left or self._limit_after(ahead, left) > goal:
            return None
        return bisect_left(range(left), True, lo=1, key=lambda c: self._limit_after(ahead, c) <= goal)

    def _error_after(self, ahead: LearntForesight, more: int) -> float:
        return self.unknown.state(ahead.square(self.width * more))

    def _limit_after(self, ahead: LearntForesight, more: int) -> float:
        """Return the error that 95 of 100 such robots are expected to stay below after so many more poses [m]."""
        return self.unknown.state_limit(ahead.square_error_limit(self.width * more))


def _whitener(unknown: ExpectedErrors, samples: Samples) -> Array:
    """Return the matrices (n, r, r) [1/m] that bring the numbers of each reading to unit variance."""
    noise = unknown.model.reading_noise(samples)
    square = noise.gauge_variance[:, :, None] * np.eye(unknown.model.width) + noise.robot_covariance
    return np.asarray(np.linalg.inv(np.linalg.cholesky(square)))


def _white_rows(unknown: ExpectedErrors, samples: Samples, whitener: Array) -> Array:
    """Return the change by each error of the readings' numbers, scaled to unit variance, (n r, P)."""
    rows = whitener @ unknown.model.rows(samples) @ unknown.root
    return np.asarray(rows.reshape(-1, rows.shape[2]))


def families(unknown: ExpectedErrors) -> Families:
    """Return which errors share a size: where the gauge stands has a stated one.

    Errors of a robot that was calibrated have the sizes that its runs say, all together one factor on them.
    """
    if not isinstance(unknown, UndeclaredErrors):
        return Families(np.where(unknown.of_gauge, 0, 1), np.array([True, False]), np.array([ALWAYS, ALWAYS]))
    family = unknown.family if isinstance(unknown, UnnamedErrors) else np.full(len(unknown.prior), -1)
    parameters = unknown.model.parameters[: int((family < 0).sum())]
    names = [f"geometry, {p.unit}" if p.group == "geometry" else p.group for p in parameters]
    distinct = [GAUGE, *(n for n in dict.fromkeys(names) if n != GAUGE)]
    effects = {n for n, p in zip(names, parameters, strict=True) if p.is_effect}
    number = np.array([distinct.index(n) for n in names])
    number = np.append(number, len(distinct) + family[len(names) :])
    shapes = unknown.catalogued if isinstance(unknown, UnnamedErrors) else np.zeros(0, dtype=bool)
    acts = np.append([MOSTLY if n in effects else ALWAYS for n in distinct], np.where(shapes, AT_TIMES, HARDLY_EVER))
    return Families(number, np.arange(len(acts)) == 0, acts, IdentifiedErrors.doubt)


def mean_errors(unknown: ExpectedErrors) -> Array:
    """Return the expected value of each parameter of the model before the session, (P,) [m, rad, …]."""
    names = unknown.model.names
    mean = np.zeros(len(names))
    if isinstance(unknown, RemainingErrors):
        file = unknown.before.known.file
        known = {p.name: -value for p, value in zip(file.parameters, file.nominal, strict=True)}
        lone = tool_point_parameters("")  # of a single point that was measured
        tool = dict(zip(tool_names(unknown.model.setup), lone, strict=True))
        if unknown.stands is not None:
            known |= dict(zip(unknown.stands.parameters, unknown.stands.values, strict=True))
        mean = np.array([known.get(n, known.get(tool.get(n, n), 0.0)) for n in names])
    return mean
