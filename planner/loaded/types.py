"""What the evaluation of a loaded circle hands on: curves over the angle, compliances, offset, comparison."""

from dataclasses import dataclass

import numpy as np

from planner.loaded.told import Compliances
from planner.units import Array


@dataclass(frozen=True)
class Circle:
    """The circle that the nominal robot's measured point runs on, and the fixture that the bar stands on.

    Attributes:
        name, place: of the fixture, and its number in the run.
        centre: of the circle, in the base frame (3,) [m].
        axes: rows are the directions of angle 0 and 90 degrees and the normal, (3, 3).
        radius: [m].
        p_BX: the fixture's ball (3,) [m].
    """

    name: str
    place: int
    centre: Array
    axes: Array
    radius: float
    p_BX: Array


@dataclass(frozen=True)
class Curves:
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

    circle: Circle
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
    def apparent(self) -> Array:
        """Load beyond the base load that each deflection belongs to, (K − 1,) [N]."""
        return np.asarray(self.loads[1:] - self.loads[0])


@dataclass(frozen=True)
class Offset:
    """A sine fitted to the averaged curve (EDBB paper, eq. 9): a sin(b θ − φ).

    Attributes:
        amplitude: a [m].
        frequency: b; 1 where it was fixed.
        phase: φ [rad].
        rms: of what is left [m].
    """

    amplitude: float
    frequency: float
    phase: float
    rms: float


@dataclass(frozen=True)
class Comparison:
    """Kinematic error by the bar beside a tracker's (mean and first harmonic taken off both).

    Attributes:
        theta: (B,) [rad].
        bar, tracker: change of the bar's length, (B,) [m].
        mean, largest: size of their difference [m].
    """

    theta: Array
    bar: Array
    tracker: Array
    mean: float
    largest: float


@dataclass(frozen=True)
class Evaluated:
    """One circle, evaluated.

    Attributes:
        curves: as measured.
        predicted: deflection by the fitted compliances, (D, K − 1, B) [m].
        compensated: readings less the whole yielding under the bar's load, (D, K, B) [m].
        spread: largest distance of the loads' compensated curves at one angle [m]; ``spread_rms`` [m].
        bent: the same after a straight line over the load at each angle, what no linear compliance explains [m].
        averaged: mean over loads, per direction, its own mean taken off, (D, B) [m].
        offset: eq. 9 with b = 1; ``paper_offset`` with b free, where the paper is reproduced.
        centre_offset: of the circle's centre from the fixture's axis along angle 0 and 90 degrees, (2,) [m].
        kinematic: what is left of ``averaged`` without the offset, (D, B) [m].
        tracker: the comparison, where a tracker's run was given.
    """

    curves: Curves
    predicted: Array
    compensated: Array
    spread: float
    spread_rms: float
    bent: float
    averaged: Array
    offset: Offset
    paper_offset: Offset | None
    centre_offset: Array
    kinematic: Array
    tracker: Comparison | None = None


@dataclass(frozen=True)
class Loaded:
    """A loaded run, evaluated: ``circles`` one a fixture, ``compliances`` of all together.

    ``problems`` are reasons not to use the compliances, ``warnings`` what a person should know.
    """

    name: str
    robot: str
    circles: tuple[Evaluated, ...]
    compliances: Compliances
    sentences: tuple[str, ...]
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
