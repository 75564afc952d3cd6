"""Which parameters are fitted: those that may be off and that the run can identify."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup
from planner.common.determinism import even_positions
from planner.common.units import Array
from planner.design.free_parameters import (
    declared_parameters,
    hold_measured_tool,
    preference_order,
    unloaded_compliances,
)
from planner.design.observability.identifiability import DroppedParameter, Identifiability, find_identifiable
from planner.effects.compliance import compliance_parameters
from planner.effects.gauge_errors import clock_offset_parameter
from planner.effects.parameters import Parameter
from planner.identification.noise import Whitener
from planner.model.model import Model
from planner.runs.run import Run, Samples

DECIDING_SAMPLES = 4000  # samples that decide


def identifiable_subset(
    model: Model, samples: Samples, prefer: Sequence[int] | None = None
) -> tuple[Model, Identifiability]:
    """Return the model with the parameters that the samples can identify, and why the others are left out.

    ``prefer`` are their positions, best kept first; as they stand in the model where it is not given.
    """
    few = samples.take(even_positions(len(samples), DECIDING_SAMPLES))
    rows = Whitener.of(model, few).white(slice(None), model.rows(few))
    order = range(len(model.names)) if prefer is None else prefer
    seen = find_identifiable(rows, model.names, model.prior, order, noise=1.0, readings=len(samples) * model.width)
    return model.subset(list(seen.kept)), seen


def parameters_of_groups(model: Model, groups: Collection[str]) -> Model:
    """Return the model with only the parameters of some groups."""
    return model.subset([j for j, p in enumerate(model.parameters) if p.group in groups])


@dataclass(frozen=True)
class FittedParameters:
    """The parameters of a fit.

    Attributes:
        whole: all that may be off.
        model: what the run can see of it.
        dropped: what it cannot, with the reasons.
        held: what was measured better than the run could, so that it is not fitted; among ``dropped``.
    """

    whole: Model
    model: Model
    dropped: tuple[DroppedParameter, ...]
    held: tuple[Parameter, ...] = ()

    def upto(self, effects: Sequence[str]) -> Model:
        """Return the model with the identifiable parameters of gauge, geometry and these kinds of effect."""
        return parameters_of_groups(self.model, ("gauge", "geometry", *effects))


def choose_parameters(cell: Cell, setup: MeasurementSetup, run: Run, more: tuple[str, ...] = ()) -> FittedParameters:
    """Choose the parameters to fit, by the same sets, preferences and reasons as the plan.

    Kinds of effect in ``more`` are looked at beside those that the cell's ``[plan]`` declares.

    Raises:
        InputError: the cell declares an effect that this run cannot show.
    """
    whole = Model.of(setup, cell.plan.free | ({"tool"} if not cell.tool.known else frozenset()))
    if run.clocks == 2 and run.samples.speed is not None:
        whole = whole.before([clock_offset_parameter(setup)])
    whole = whole.plus(declared_parameters(cell, setup, run.samples, more))
    out = _held_parameters(cell, whole, run)
    names = {d.name for d in out}
    open_ = whole.subset([k for k, name in enumerate(whole.names) if name not in names])
    stated = cell.file.artifact is not None or cell.file.tracker is not None  # else nobody can have planned with it
    model, seen = identifiable_subset(open_, run.samples, preference_order(open_) if stated else None)
    still = unloaded_compliances((*cell.plan.effects, *more), whole)
    idle = [p for p in compliance_parameters(setup) if p.name in {d.name for d in still}]
    known = tuple(p for p in whole.parameters if p.name in names)
    return FittedParameters(whole.plus(idle), model, (*seen.dropped, *out, *still), known)


def _held_parameters(cell: Cell, model: Model, run: Run) -> tuple[DroppedParameter, ...]:
    """Return tool parameters whose declared uncertainty is smaller than this run could reach."""
    if not cell.tool.measured:
        return ()
    few = run.samples.take(even_positions(len(run), DECIDING_SAMPLES))
    covariance = Whitener.of(model, few).covariance(slice(None))
    each: Array = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max(axis=1))
    return hold_measured_tool(cell, model, model.rows(few), float(np.median(each)), len(run))
