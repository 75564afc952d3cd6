"""Results of a loaded-circle evaluation: averaged curves, joint compliances, centring offset, comparison with a
tracker."""

from dataclasses import dataclass

import numpy as np

from planner.circular.plan import CircleAtFixture
from planner.common.units import Array
from planner.design.observability.identifiability import format_direction
from planner.loaded.assumptions import TOLD

KNOWN, HARDLY_KNOWN, NOT_LEARNT = "known", "hardly known", "not learnt"
SENSES = {1: "counter-clockwise", -1: "clockwise"}  # of travel about the circle's normal


@dataclass(frozen=True)
class Combination:
    """One direction of the compliances, in prior sigmas: ``shares`` (N,) of unit length, ``std`` as a part of them."""

    names: tuple[str, ...]
    shares: Array
    std: float

    @property
    def verdict(self) -> str:
        """What the readings alone say of it: known, hardly known, or not learnt (more is open than was before)."""
        return KNOWN if self.std < TOLD.known_share else HARDLY_KNOWN if self.std <= TOLD.open_share else NOT_LEARNT

    @property
    def text(self) -> str:
        """The direction in words, largest share first; c2 is compliance2, alone where the others hardly count."""
        largest = float(abs(self.shares).max())
        pairs = [
            (n.replace("compliance", "c"), float(s))
            for n, s in zip(self.names, self.shares, strict=True)
            if abs(s) > TOLD.negligible_share * largest
        ]
        if len(pairs) == 1:
            return pairs[0][0]
        return format_direction(sorted(pairs, key=lambda pair: -round(abs(pair[1]), 9)))


@dataclass(frozen=True)
class JointCompliances:
    """Joint compliances as the deflections tell them.

    Attributes:
        names: ``compliance1`` …
        value, std: with the prior, (N,) [rad/Nm].
        prior: one-sigma sizes before the measurement, (N,) [rad/Nm].
        information: of the deflections alone, (N, N) [(Nm/rad)²]; ``pulled`` is ``information`` times their own
            estimate, (N,) [Nm/rad].
        combinations: from the best known to the least.
        noise: standard deviation of one averaged reading, by the repeats where there are some [m].
        misfit: how many times more the loads' curves differ than the repeats do; 1 where all is as modelled.
    """

    names: tuple[str, ...]
    value: Array
    std: Array
    prior: Array
    information: Array
    pulled: Array
    combinations: tuple[Combination, ...]
    noise: float
    misfit: float

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Verdict on each joint's compliance, (N,): known, hardly known, or not learnt (the prior says more)."""
        share = self.std / self.prior
        still_open = TOLD.open_share / np.sqrt(2.0)  # with the prior: the readings say no more than was known before
        return tuple(KNOWN if s < TOLD.known_share else HARDLY_KNOWN if s < still_open else NOT_LEARNT for s in share)

    @property
    def known_combinations(self) -> tuple[Combination, ...]:
        """Combinations known to a third of their prior sigma or better."""
        return tuple(c for c in self.combinations if c.std < TOLD.known_share)

    @property
    def unknown_combinations(self) -> tuple[Combination, ...]:
        """Combinations of which the deflections say less than was known before."""
        return tuple(c for c in self.combinations if c.std > TOLD.open_share)


@dataclass(frozen=True)
class DrivenCircle(CircleAtFixture):
    """The circle that the nominal robot's measured point runs on; ``name`` and ``place`` of its fixture in the run."""

    name: str
    place: int


@dataclass(frozen=True)
class AveragedCurves:
    """Repeats averaged over an even grid of angles: D directions, K loads, B angles.

    Attributes:
        circle: where it was driven.
        theta: middles of the grid, (B,) [rad], 0 … 2π.
        directions: 1 counter-clockwise about the circle's normal, −1 clockwise, (D,).
        loads: pull of the bar at each step, ascending in size, (K,) [N].
        q: controller angles, (D, K, B, N) [rad].
        length: reading, (D, K, B) [m]; ``force`` the pull, (D, K, B) [N].
        noise: variance of one turn's harmonics over the angle, by the scatter of the repeats, (B // 2 + 1,) [m²] in
            the orthonormal sense (white noise has the variance of a reading in all of them); NaN without repeats.
        repeats: whole turns that were averaged, (D, K).
    """

    circle: DrivenCircle
    theta: Array
    directions: tuple[int, ...]
    loads: Array
    q: Array
    length: Array
    force: Array
    noise: Array
    repeats: Array

    @property
    def deflection(self) -> Array:
        """Change of the reading from the base load, the smallest, (D, K − 1, B) [m] (EDBB paper, eq. 8)."""
        return np.asarray(self.length[:, 1:] - self.length[:, :1])

    @property
    def loads_beyond_base(self) -> Array:
        """Load beyond the base load that each deflection belongs to, (K − 1,) [N]."""
        return np.asarray(self.loads[1:] - self.loads[0])


@dataclass(frozen=True)
class CentringOffset:
    """A sine fitted to the averaged curve (EDBB paper, eq. 9 with b = 1): a sin(θ − φ).

    Attributes:
        amplitude: a [m].
        phase: φ [rad].
        rms: of what is left [m].
    """

    amplitude: float
    phase: float
    rms: float

    def sine(self, theta: Array) -> Array:
        """Value at the angles θ [rad], like ``theta`` [m]."""
        return np.asarray(self.amplitude * np.sin(theta - self.phase))


@dataclass(frozen=True)
class TrackerComparison:
    """Kinematic error by the bar beside a tracker's (mean and first harmonic taken off both).

    Attributes:
        tracker: change of the bar's length by the tracker, (B,) [m].
        mean, largest: size of the difference to what the bar read [m].
    """

    tracker: Array
    mean: float
    largest: float


@dataclass(frozen=True)
class EvaluatedCircle:
    """One circle, evaluated.

    Attributes:
        curves: as measured.
        predicted: deflection by the fitted compliances, (D, K − 1, B) [m].
        compensated: readings less the whole yielding under the bar's load, (D, K, B) [m].
        spread: largest distance of the loads' compensated curves at one angle [m]; ``spread_rms`` [m].
        bent: the same after a straight line over the load at each angle, what no linear compliance explains [m].
        averaged: mean over loads, per direction, its own mean taken off, (D, B) [m].
        offset: eq. 9 with b = 1.
        centre_offset: of the circle's centre from the fixture's axis along angle 0 and 90 degrees, (2,) [m].
        kinematic: what is left of ``averaged`` without the offset, (D, B) [m].
        tracker: the comparison, where a tracker's run was given.
    """

    curves: AveragedCurves
    predicted: Array
    compensated: Array
    spread: float
    spread_rms: float
    bent: float
    averaged: Array
    offset: CentringOffset
    centre_offset: Array
    kinematic: Array
    tracker: TrackerComparison | None = None


@dataclass(frozen=True)
class LoadedEvaluation:
    """A loaded run, evaluated: ``circles`` one a fixture, ``compliances`` of all together.

    ``problems`` are reasons not to use the compliances, ``warnings`` what a person should know.
    """

    name: str
    robot: str
    circles: tuple[EvaluatedCircle, ...]
    compliances: JointCompliances
    sentences: tuple[str, ...]
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
