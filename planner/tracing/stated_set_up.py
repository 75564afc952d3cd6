"""What a cell holds for known of its set-up and the model has all the same, as uncertain as the cell says it is.

It needs no search: its size is fitted from the first stage on. Where it is off beyond chance, and much of the error is
its doing, it is a finding like those that were searched for.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from planner.common.units import Array
from planner.effects.effect import Effect, Parameter, Role
from planner.fit.covariance import consider_covariance
from planner.fit.least_squares import Fit
from planner.model.model import Model
from planner.tracing.state import FittedEffect, SearchState


def stated_set_up(offered: Sequence[Effect], model: Model) -> list[FittedEffect]:
    """Return the set-up causes of the catalogue of which a model has any parameter."""
    known = set(model.names)
    return [FittedEffect(e) for e in offered if e.has(Role.SET_UP) and known & {p.name for p in e.make()}]


def covariance_beside(state: SearchState, found: FittedEffect, unseen: Sequence[Parameter]) -> Array:
    """Return the covariance (k, k) that an effect's sizes have by what may be off and is not in the model.

    A base that stands lower is, to a bar, a fixture that stands higher: how far the fixture is off is known no better
    than the base is. Those ``unseen`` parameters are taken to be as large as the fit has those of their kind.
    """
    which = state.positions(found)
    return consider_covariance(state.fit, [replace(p, prior=_size_of(p, state.fit)) for p in unseen])[
        np.ix_(which, which)
    ]


def _size_of(unseen: Parameter, fit: Fit) -> float:
    sizes = [
        size for p, size in zip(fit.model.parameters, fit.problem.prior.tolist(), strict=True)
        if (p.group, p.unit) == (unseen.group, unseen.unit)
    ]  # fmt: skip
    return max([unseen.prior, float(np.median(sizes))]) if sizes and unseen.group != "gauge" else unseen.prior
