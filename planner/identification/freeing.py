"""What the fit of a run frees: place, tool, geometry and the effects that the cell declares, as far as seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell import Cell
from planner.freed import declared, held, preference, unloaded
from planner.identification.noise import Whitener
from planner.identification.seeing import LOOK, only, seen_by
from planner.model import Model, Parameter
from planner.model.parameters import clock_offset, compliance_parameters
from planner.observability import Dropped
from planner.repeatable import evenly
from planner.rig import Rig
from planner.run import Run
from planner.units import Array


@dataclass(frozen=True)
class Freed:
    """The parameters of a fit.

    Attributes:
        whole: all that may be off.
        model: what the run can see of it.
        dropped: what it cannot, with the reasons.
        held: what was measured better than the run could, so that it is not fitted; among ``dropped``.
    """

    whole: Model
    model: Model
    dropped: tuple[Dropped, ...]
    held: tuple[Parameter, ...] = ()

    def upto(self, effects: Sequence[str]) -> Model:
        """Return the model of what is seen with gauge, geometry and these kinds of effect."""
        return only(self.model, ("gauge", "geometry", *effects))


def freed(cell: Cell, rig: Rig, run: Run, more: tuple[str, ...] = ()) -> Freed:
    """Decide what is fitted, as the plan decides what it measures: the same sets, preferences and reasons.

    Kinds of effect in ``more`` are looked at beside those that the cell's ``[plan]`` declares.

    Raises:
        InputError: the cell declares an effect that this run cannot show.
    """
    whole = Model.of(rig, cell.plan.free | ({"tool"} if not cell.tool.known else frozenset()))
    if run.clocks == 2 and run.samples.speed is not None:
        whole = whole.before([clock_offset(rig)])
    whole = whole.plus(declared(cell, rig, run.samples, more))
    out = _held(cell, whole, run)
    names = {d.name for d in out}
    open_ = whole.subset([k for k, name in enumerate(whole.names) if name not in names])
    stated = cell.file.artifact is not None or cell.file.tracker is not None  # else nobody can have planned with it
    model, seen = seen_by(open_, run.samples, preference(open_) if stated else None)
    still = unloaded((*cell.plan.effects, *more), whole)
    idle = [p for p in compliance_parameters(rig) if p.name in {d.name for d in still}]
    known = tuple(p for p in whole.parameters if p.name in names)
    return Freed(whole.plus(idle), model, (*seen.dropped, *out, *still), known)


def _held(cell: Cell, model: Model, run: Run) -> tuple[Dropped, ...]:
    """Tool parameters that were measured better than this run could."""
    if not cell.tool.measured:
        return ()
    few = run.samples.take(evenly(len(run), LOOK))
    covariance = Whitener.of(model, few).covariance(slice(None))
    each: Array = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max(axis=1))
    return held(cell, model, model.rows(few), float(np.median(each)), len(run))
