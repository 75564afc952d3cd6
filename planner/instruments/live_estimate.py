"""What the poses that were read so far leave of the tool's error, pose by pose, and what further ones would bring.

The model is linear about what was expected of the robot; its information matrix grows by a reading at a time, and how
large the errors of each kind are is learnt from the same matrix. Nothing is identified anew: ``edbb identify`` says
what holds, from the whole run.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.common.units import Array, read_only
from planner.design.expected_errors import ExpectedErrors
from planner.design.free_parameters import UndeclaredErrors, undeclared_errors
from planner.design.learnt_posterior import LearntPosterior
from planner.design.learnt_sizes import Families
from planner.instruments.remaining_errors import CalibratedState, RemainingErrors, tool_names
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
        self.noise = model.noise(self.samples)
        self.expected = model.reading(self.samples, errors)[:, 0]
        white, weight = self.unknown.white(self.samples), self.unknown.weight_per_prior
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
            unknown = undeclared_errors(cell, samples)
        else:
            unknown = RemainingErrors.of(CalibratedState.read(after, cell), cell, samples)
        return cls(unknown, samples, until)

    def add(self, pose: int, length: float) -> Progress:
        """Take a reading [m] at the pose of this number among ``samples``; return where the session stands."""
        off = self._off(pose, length)
        expected = self.posterior.white[pose] @ self.posterior.learnt.mean
        surprise = abs(off - expected) / np.sqrt(self.posterior.spread_of(pose, self.read))
        self.read.append(pose)
        self.off.append(off)
        self.posterior.learn(self.read, np.array(self.off))
        self.history.append(self.stands(float(surprise)))
        return self.history[-1]

    def add_all(self, lengths: Mapping[int, float]) -> Progress:
        """Take readings [m] by the number of their pose, at once; return where the session stands then."""
        self.read += list(lengths)
        self.off += [self._off(pose, length) for pose, length in lengths.items()]
        self.posterior.learn(self.read, np.array(self.off))
        self.history.append(self.stands())
        return self.history[-1]

    def _off(self, pose: int, length: float) -> float:
        """Return a reading [m] less what was expected of it, in its standard deviations."""
        here = self.samples.take(np.array([pose]))
        target = self.unknown.model.setup.targets(here, Readings(length=read_only([length])))
        assert target.length is not None
        return float((target.length[0] - self.expected[pose]) / self.noise[pose])

    def unread_poses(self) -> list[int]:
        """Return the poses that are not read yet, in the order of the plan."""
        done = set(self.read)
        return [k for k in range(len(self.samples)) if k not in done]

    def adds_nothing(self, pose: int, beside: Sequence[int]) -> bool:
        """Tell whether a pose may be passed: once those ``beside`` it are read as well, the error is the same."""
        # 2e-3: of the mean square error, a tenth of a per cent of the error
        return self.posterior.square([*self.read, *beside]) <= (1.0 + 2e-3) * self.posterior.square(
            [*self.read, *beside, pose]
        )

    @property
    def reached(self) -> bool:
        """Whether the goal is reached by what was read."""
        return self.until is not None and bool(self.history) and self.history[-1].at_most <= self.until

    def stands(self, surprise: float = 0.0) -> Progress:
        """Return where the session stands; ``surprise``: of the last reading, see :class:`Progress`."""
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

    def _error(self, which: Sequence[int]) -> float:
        return self.unknown.state(self.posterior.square(which))

    def _limit(self, which: Sequence[int]) -> float:
        """Return what 95 of 100 such robots stay below after some readings [m]."""
        return self.unknown.state_limit(self.posterior.square_limit(which))


def families(unknown: ExpectedErrors) -> Families:
    """Return which errors share a size: where the gauge stands has a stated one.

    Errors of a robot that was calibrated have the sizes that its runs say, all together one factor on them.
    """
    if not isinstance(unknown, UndeclaredErrors):
        return Families(np.where(unknown.of_gauge, 0, 1), np.array([True, False]), np.array([False, False]))
    parameters = unknown.model.parameters
    names = [f"geometry, {p.unit}" if p.group == "geometry" else p.group for p in parameters]
    distinct = [GAUGE, *(n for n in dict.fromkeys(names) if n != GAUGE)]
    rare = {n for n, p in zip(names, parameters, strict=True) if p.is_effect}
    number = np.array([distinct.index(n) for n in names])
    # 0.3: of 60 arms drawn 19 of 20 are below the limit that this gives
    return Families(number, np.array([n == GAUGE for n in distinct]), np.array([n in rare for n in distinct]), 0.3)


def mean_errors(unknown: ExpectedErrors) -> Array:
    """Return what is expected of each parameter of the model before the session, (P,) [m, rad, …]."""
    names = unknown.model.names
    mean = np.zeros(len(names))
    if isinstance(unknown, RemainingErrors):
        file = unknown.before.known.file
        known = {p.name: -value for p, value in zip(file.parameters, file.nominal, strict=True)}
        tool = dict(zip(tool_names(unknown.model.setup), (f"map_{a}" for a in "xyz"), strict=True))
        if unknown.stands is not None:
            known |= dict(zip(unknown.stands.parameters, unknown.stands.values, strict=True))
        mean = np.array([known.get(tool.get(n, n), 0.0) for n in names])
    return mean
