"""Parameters that accompany effects: nonlinear parameters (frequencies, time constants) linearised about their
value, and masses of links other than stated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.units import Array
from planner.effects.basis import Times
from planner.effects.effect import Effect
from planner.effects.load_functions import WeightTorque
from planner.effects.parameters import Parameter, ParameterMove
from planner.model.model import Model

DIFFERENCE_STEP = 1e-3  # of the grid's spacing, for the derivative


def grid_spacing(entry: Effect, value: float) -> float:
    """Distance of the grid's neighbours at ``value``."""
    assert entry.inner is not None
    values = np.sort(entry.inner.values)
    if len(values) < 2:
        return abs(value) * 0.1
    k = int(np.clip(np.searchsorted(values, value), 1, len(values) - 1))
    return float(values[k] - values[k - 1])


def clip_to_grid(entry: Effect, value: float) -> float:
    """Keep an inner number inside its grid: beyond it other entries begin."""
    assert entry.inner is not None
    return float(np.clip(value, entry.inner.values.min(), entry.inner.values.max()))


def sensitivity_parameter(entry: Effect, value: float, sizes: Array) -> Parameter:
    """Return the parameter that moves the inner number about ``value``, the effect's parameters being ``sizes``."""
    assert entry.inner is not None
    h = DIFFERENCE_STEP * grid_spacing(entry, value)
    moves: list[ParameterMove] = []
    for sign in (1.0, -1.0):
        for parameter, size in zip(entry.make(value + sign * h), sizes, strict=True):
            factor = float(sign * size / (2 * h))
            moves += [ParameterMove(m.on, m.index, Times(m.phi, factor)) for m in parameter.moves]
    first = entry.make(value)[0]
    return replace(
        first,
        name=f"{entry.name}, {entry.inner.name}",
        unit=entry.inner.unit,
        prior=2 * grid_spacing(entry, value),
        what=f"{entry.inner.name} of {entry.name}",
        moves=tuple(moves),
    )


COMPLIANCE = "joint compliance"
MASS_PRIOR = 0.15  # one sigma of a link's mass over its stated one
# one sigma of the weights as a run has them, above which it is not the weights that the run shows
LARGEST_MASS_PRIOR = 0.3
LINK_MASSES = "link weights"


def link_mass_parameters(base: Model, compliance: Sequence[tuple[int, float]]) -> list[Parameter]:
    """Return the parts by which links and tool weigh more than stated; ``compliance``: joints (from 0) and [rad/Nm]."""
    setup = base.setup
    if not compliance:
        return []
    joints = [t for t in range(len(setup.chain.transforms)) if setup.chain.transforms[t].joint is not None]
    where = {setup.chain.transforms[k].joint: k for k in joints}
    masses = [None if m is None else m.mass for m in setup.robot.masses]
    n = len(masses)
    out = []
    for link, mass in enumerate([*masses, setup.tool_mass]):
        bearing = [(i, c) for i, c in compliance if i <= link]
        if not mass or not bearing:
            continue
        moves = tuple(
            ParameterMove("transform", where[i], Times(WeightTorque(i, link), float(c * mass))) for i, c in bearing
        )
        what = "tool" if link == n else f"link {link + 1}"
        name = "weight_tool" if link == n else f"weight{link + 1}"
        out.append(
            Parameter(name, "1", MASS_PRIOR, f"part by which {what} weighs more than stated", moves, LINK_MASSES)
        )
    return out


def link_mass_uncertainty(model: Model) -> float:
    """How far the weights of a fitted model are believed to be off, one sigma; 0 where there are none."""
    return max((p.prior for p in model.parameters if p.group == LINK_MASSES), default=0.0)
