"""The parameters of a model: pairs of what they move and a basis function, each with its size before measuring."""

from dataclasses import dataclass
from typing import Literal

from planner.effects.basis import ONE, BasisFunction

ParameterUnit = str  # m, rad, s, or a quotient such as rad/Nm


@dataclass(frozen=True)
class ParameterMove:
    """What a parameter moves, an elementary transform of the chain or a number of the reading, times ``phi``."""

    on: Literal["transform", "reading"]
    index: int
    phi: BasisFunction = ONE


@dataclass(frozen=True)
class Parameter:
    """One error parameter.

    Attributes:
        name: for instance ``alpha2``, ``fixture_A_x``, ``map_z``, ``zero``, ``compliance2``.
        unit: of its value.
        prior: one-sigma size expected before any measurement, in that unit.
        what: what it is, in a mechanic's words.
        moves: all that it moves; most parameters move one thing.
        group: ``gauge`` (it places the gauge), ``geometry``, or the effect it belongs to.
    """

    name: str
    unit: ParameterUnit
    prior: float
    what: str
    moves: tuple[ParameterMove, ...]
    group: str = "geometry"

    @property
    def main(self) -> ParameterMove:
        """The first thing it moves."""
        return self.moves[0]


def transform_move(index: int, phi: BasisFunction = ONE) -> tuple[ParameterMove, ...]:
    """Move one transform."""
    return (ParameterMove("transform", index, phi),)


def reading_move(phi: BasisFunction = ONE, index: int = 0) -> tuple[ParameterMove, ...]:
    """Move one number of the reading."""
    return (ParameterMove("reading", index, phi),)
