"""Parameters that accompany effects: the values of their nonlinear parameters, and masses other than stated.

The derivative of the prediction by a frequency or a time constant joins the model as one further parameter, so that the
number is fitted like all others and its uncertainty carries over to the rest.

A joint of compliance c turns by c Σ m w, with the torques w of the links' unit masses. A link that is heavier by a part
δ adds c m w δ at every joint below it: one number a link, shared by all joints whose compliance is in the model. These
numbers enter with the first compliance and are no effect of their own, for they show through it only.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.units import Array
from planner.effects.basis import Times
from planner.effects.compliance import WeightTorque
from planner.effects.effect import Effect
from planner.effects.parameters import Parameter, ParameterMove
from planner.model.model import Model

DIFFERENCE_STEP = 1e-3  # of the grid's spacing, for the derivative
LINK_MASSES = "link weights"  # group of the masses of links
MASS_PRIOR = 0.15  # one sigma of a link's mass over its stated one
LARGEST_MASS_PRIOR = 0.3  # one sigma of the masses as fitted, above which it is not the masses that the run shows


def grid_spacing(effect: Effect, value: float) -> float:
    """Distance of the neighbours at ``value`` on the grid of an effect's nonlinear parameter."""
    return float(grid_spacings(effect, np.array([value]))[0])


def grid_spacings(effect: Effect, values: Array) -> Array:
    """Return the same for several values (k,)."""
    assert effect.nonlinear is not None
    grid = np.sort(effect.nonlinear.values)
    if len(grid) < 2:
        return np.abs(values) * 0.1
    k = np.clip(np.searchsorted(grid, values), 1, len(grid) - 1)
    return np.asarray(grid[k] - grid[k - 1])


def clip_to_grid(effect: Effect, value: float) -> float:
    """Keep a nonlinear value inside its grid: beyond it other effects begin."""
    assert effect.nonlinear is not None
    return float(np.clip(value, effect.nonlinear.values.min(), effect.nonlinear.values.max()))


def sensitivity_parameter(effect: Effect, value: float, sizes: Array) -> Parameter:
    """Return the parameter that moves the nonlinear value, the effect's parameters being ``sizes``."""
    assert effect.nonlinear is not None
    h = DIFFERENCE_STEP * grid_spacing(effect, value)
    moves: list[ParameterMove] = []
    for sign in (1.0, -1.0):
        for parameter, size in zip(effect.make(value + sign * h), sizes, strict=True):
            factor = float(sign * size / (2 * h))
            moves += [replace(m, phi=Times(factor, m.phi)) for m in parameter.moves]
    return replace(
        effect.make(value)[0],
        name=f"{effect.name}, {effect.nonlinear.name}",
        unit=effect.nonlinear.unit,
        prior=2 * grid_spacing(effect, value),
        what=f"{effect.nonlinear.name} of {effect.name}",
        moves=tuple(moves),
    )


def link_mass_parameters(base: Model, compliance: Sequence[tuple[int, float]]) -> list[Parameter]:
    """Return the parts by which links and tool weigh more than stated; ``compliance``: joints (from 0) and [rad/Nm]."""
    setup, robot = base.setup, base.setup.robot
    rotation = {t.joint: k for k, t in enumerate(setup.chain.transforms) if t.joint is not None}
    out = []
    for link, mass in enumerate([*(None if m is None else m.mass for m in robot.masses), setup.tool_mass]):
        bearing = [(i, c) for i, c in compliance if i <= link]
        if not mass or not bearing:
            continue
        moves = tuple(
            ParameterMove("transform", rotation[i], Times(float(c * mass), WeightTorque(i, link))) for i, c in bearing
        )
        of_tool = link == len(robot.masses)
        what = f"part by which {'tool' if of_tool else f'link {link + 1}'} weighs more than stated"
        name = "weight_tool" if of_tool else f"weight{link + 1}"
        out.append(Parameter(name, "1", MASS_PRIOR, what, moves, LINK_MASSES))
    return out


def link_mass_uncertainty(model: Model) -> float:
    """How far the masses of a fitted model are believed to be off, one sigma; 0 where there are none."""
    return max((p.prior for p in model.parameters if p.group == LINK_MASSES), default=0.0)
