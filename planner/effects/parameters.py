"""The parameters of a model: pairs of what they move and a basis function, each with its size before measuring."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from planner.cell.setup import N_BASE_TRANSFORMS, MeasurementSetup
from planner.effects.basis import ONE, AtPoint, LoadTorque, Phi

PRIOR_LAG = 0.05  # [s], after the two logs were laid over each other
ParameterUnit = str  # m, rad, s, or a product such as rad/Nm


@dataclass(frozen=True)
class ParameterMove:
    """What a parameter moves, an elementary transform of the chain or a number of the reading, times ``phi``."""

    on: Literal["transform", "reading"]
    index: int
    phi: Phi = ONE


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


def transform_move(index: int, phi: Phi = ONE) -> tuple[ParameterMove, ...]:
    """Move one transform."""
    return (ParameterMove("transform", index, phi),)


def reading_move(phi: Phi = ONE, index: int = 0) -> tuple[ParameterMove, ...]:
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
            yield Parameter(
                f"{label}_{axis}",
                "m",
                setup.tool_prior,
                what,
                transform_move(setup.chain.index(f"map_{axis}"), phi),
                "gauge",
            )


def robot_parameters(setup: MeasurementSetup) -> list[Parameter]:
    """Errors of the robot's own transforms; fixed turns that only align an axis are no errors of their own.

    The last joint's angle comes last: a point on the last axis cannot see it.
    """
    robot = setup.robot
    out: list[Parameter] = []
    last: list[Parameter] = []
    for k, t in enumerate(robot.transforms):
        if t.name.startswith("aligned_") or t.name.endswith("_flange"):
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


def clock_offset_parameter(setup: MeasurementSetup) -> Parameter:
    """How late the gauge's clock runs against the controller's, where each was logged by its own [s]."""
    moves = setup.gauge.lag_moves()
    return Parameter("lag", "s", PRIOR_LAG, "lag of the gauge's clock behind the controller's", moves, "gauge")


def compliance_parameters(setup: MeasurementSetup) -> list[Parameter]:
    """Compliance of each joint under gravity, payload and the bar's pull [rad/Nm]."""
    joints = [(k, t.joint) for k, t in enumerate(setup.chain.transforms) if t.joint is not None]
    return [
        Parameter(
            f"compliance{i + 1}",
            "rad/Nm",
            setup.robot.priors.compliance,
            f"compliance of joint {i + 1}",
            transform_move(k, LoadTorque(i)),
            "joint compliance",
        )
        for k, i in sorted(joints, key=lambda pair: pair[1])
    ]
