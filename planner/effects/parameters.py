"""The parameters of a model: what they move, by which basis function, and those of the geometry."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.cell.setup import N_BASE_TRANSFORMS, MeasurementSetup
from planner.effects.basis import ONE, AtPoint, BasisFunction

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


def gauge_parameters(setup: MeasurementSetup, free: frozenset[str]) -> Iterator[Parameter]:
    """Parameters that place the gauge: fixture or frame, targets on the tool, zero."""
    yield from setup.gauge.parameters(setup, free)


def tool_parameters(setup: MeasurementSetup) -> Iterator[Parameter]:
    """Where the targets sit on the tool."""
    for t, name in enumerate(setup.point_names):
        label = f"map_{name}" if name else "map"
        phi = AtPoint(t) if len(setup.point_names) > 1 else ONE
        for axis in "xyz":
            what = f"tool point {name} along {axis} of the flange".replace("  ", " ")
            moves = transform_move(setup.chain.index(f"map_{axis}"), phi)
            yield Parameter(f"{label}_{axis}", "m", setup.tool_prior, what, moves, "gauge")


def robot_parameters(setup: MeasurementSetup) -> list[Parameter]:
    """Errors of the robot's own transforms; transforms that are ``fixed`` have none.

    The last joint's angle comes last: a point on the last axis cannot see it.
    """
    robot = setup.robot
    out: list[Parameter] = []
    last: list[Parameter] = []
    for k, t in enumerate(robot.transforms):
        if t.fixed:
            continue
        if t.joint is not None:
            what = f"zero of joint {t.joint + 1}"
        else:
            link = int(np.searchsorted(robot.link_end, k, side="right"))
            what = f"{'shift along' if t.kind == 'translation' else 'turn about'} {'xyz'[t.axis]}, link {link}"
        prior = robot.priors.length if t.kind == "translation" else robot.priors.angle
        parameter = Parameter(
            t.name, "m" if t.kind == "translation" else "rad", prior, what, transform_move(N_BASE_TRANSFORMS + k)
        )
        (last if t.joint == robot.n_joints - 1 else out).append(parameter)
    return out + last
