"""What a cause may depend on, and what it does."""

from dataclasses import dataclass, field

import numpy as np

from tests.independent_arms.chain import Arm, Loads


@dataclass(frozen=True)
class States:
    """Samples of a run, or places in the workspace."""

    arm: Arm
    q: np.ndarray  # (n, 6)
    load: Loads
    frame: np.ndarray  # nominal frames (7, n, 4, 4)
    tool: np.ndarray  # nominal tool point in the flange
    time: np.ndarray  # (n,) seconds since the start of the run
    warm: np.ndarray  # (n,) kelvin of the logged temperature above 20 degC


@dataclass
class Errors:
    """What the causes add up to at each sample."""

    twist: np.ndarray  # (7, n, 6) in frames 0 to 6
    joint: np.ndarray  # (n, 6) rotation of each axis

    @staticmethod
    def none(n):
        return Errors(np.zeros((7, n, 6)), np.zeros((n, 6)))


@dataclass(frozen=True)
class Reading:
    """How a bar or a tracker stands at each sample: from its fixed ball, or its head, to the tool's point."""

    along: np.ndarray  # (n, 3) unit vectors in the base
    length: np.ndarray  # (n,)
    turn: np.ndarray  # (n, 3, 3) orientation of the flange
    time: np.ndarray


@dataclass(frozen=True)
class Cause:
    """One thing that is wrong with an arm or a gauge.

    ``acts(states, errors)`` adds to the errors; ``reads(reading)`` returns metres that are added to a length.
    ``names`` are the kinds by which a report may rightly call it, ``numbers`` the joints or links.
    """

    kind: str
    where: str
    acts: object = None
    reads: object = None
    names: tuple = ()
    numbers: tuple = ()
    size: str = field(default="")
