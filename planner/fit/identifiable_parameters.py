"""Which parameters are fitted, those that may be off and that the run can identify, and what is said of each."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.cell.placement import FREEABLE
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
from planner.effects.effect import Parameter
from planner.effects.gauge_errors import clock_offset_parameter
from planner.fit.assumptions import ABSORBED_SHARE
from planner.fit.least_squares import Fit
from planner.fit.noise import Whitener
from planner.model.identification_document import Estimate
from planner.model.model import Model
from planner.runs.run import Run, Samples

DECIDING_SAMPLES = 4000  # of a run, evenly spread, decide which parameters are seen


def identifiable_subset(
    model: Model, samples: Samples, prefer: Sequence[int] | None = None
) -> tuple[Model, Identifiability]:
    """Return the model with the parameters that the samples can identify, and why the others are left out.

    ``prefer`` are their positions, best kept first; as they stand in the model where it is not given.
    """
    few = samples.take(even_positions(len(samples), DECIDING_SAMPLES))
    rows = Whitener.of(model, few).white(model.rows(few))
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

    @property
    def unseen_parameters(self) -> tuple[Parameter, ...]:
        """What may be off and the run cannot tell from what is fitted."""
        names = {d.name for d in self.dropped} - {p.name for p in self.held}
        return tuple(p for p in self.whole.parameters if p.name in names)

    def model_up_to(self, effects: Sequence[str]) -> Model:
        """Return the model with the identifiable parameters of gauge, geometry and these kinds of effect."""
        return parameters_of_groups(self.model, ("gauge", "geometry", *effects))


def choose_parameters(cell: Cell, setup: MeasurementSetup, run: Run, more: tuple[str, ...] = ()) -> FittedParameters:
    """Choose the parameters to fit, by the same sets, preferences and reasons as the plan.

    Kinds of effect in ``more`` are looked at beside those that the cell's ``[plan]`` declares.

    Raises:
        InputError: the cell declares an effect that this run cannot show.
    """
    whole = _stated_model(cell, setup, run)
    if run.clocks == 2 and run.samples.speed is not None:
        whole = whole.with_first([clock_offset_parameter(setup)])
    whole = whole.plus(declared_parameters(cell, setup, run.samples, more))
    out = _well_known_parameters(cell, whole, run)
    names = {d.name for d in out}
    open_ = whole.subset([k for k, name in enumerate(whole.names) if name not in names])
    stated = cell.file.artifact is not None or cell.file.tracker is not None
    model, seen = identifiable_subset(open_, run.samples, preference_order(open_, stated))
    still = unloaded_compliances((*cell.plan.effects, *more), whole)
    idle = [p for p in compliance_parameters(setup) if p.name in {d.name for d in still}]
    known = tuple(p for p in whole.parameters if p.name in names)
    return FittedParameters(whole.plus(idle), model, (*seen.dropped, *out, *still), known)


def _stated_model(cell: Cell, setup: MeasurementSetup, run: Run) -> Model:
    """Return the model of gauge and robot with all of the set-up that may be off, whether or not the cell frees it.

    What a cell holds for known is known no better than it says (``prior_mm``): it is in the model with that size, so
    that it takes the shape of no error of robot or gauge, and what cannot be told from it is as uncertain as it is.
    Only what is known better than one reading could show stands as stated, such as a zero that is set as well as the
    bar reads.
    """
    free = cell.plan.free | ({"tool"} if not cell.tool.known else frozenset())
    freed, whole = Model.of(setup, free), Model.of(setup, FREEABLE)
    held = [k for k, p in enumerate(whole.parameters) if p.name not in freed.names and not p.name.startswith("zero")]
    if not held:
        return freed
    few, noise = _few_samples(whole, run)
    moves = np.sqrt((whole.subset(held).rows(few) ** 2).sum(axis=1).mean(axis=0))
    shown = {whole.names[k] for k, size in zip(held, moves, strict=True) if whole.prior[k] * size > noise}
    return whole.subset([k for k, name in enumerate(whole.names) if name in shown.union(freed.names)])


def _few_samples(model: Model, run: Run) -> tuple[Samples, float]:
    """Return some samples of a run, and the noise of one reading [m]."""
    few = run.samples.take(even_positions(len(run), DECIDING_SAMPLES))
    covariance = Whitener.of(model, few).covariance()
    each: Array = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).max(axis=1))
    return few, float(np.median(each))


def _well_known_parameters(cell: Cell, model: Model, run: Run) -> tuple[DroppedParameter, ...]:
    """Return tool parameters whose declared uncertainty is smaller than this run could reach."""
    if not cell.tool.measured:
        return ()
    few, noise = _few_samples(model, run)
    return hold_measured_tool(cell, model, model.rows(few), noise, len(run))


def estimate_parameters(
    whole: Model,
    fit: Fit,
    dropped: tuple[DroppedParameter, ...],
    covariance: Array,
    inner: Mapping[str, float] | None = None,
) -> tuple[Estimate, ...]:
    """Return every parameter of ``whole``, fitted or not.

    ``inner``: by its name, the value of an effect's inner number (frequency, time constant) that the search came to,
    about which the fit moves it. It stands as the parameter's nominal.
    """
    std = dict(zip(fit.model.names, np.sqrt(np.diag(covariance)), strict=True))
    error = fit.values
    reasons = {d.name: d.because for d in dropped}
    size = dict(zip(whole.names, whole.prior, strict=True))
    out = []
    for p in whole.parameters:
        start = _nominal_value(whole.setup, p) + (inner or {}).get(p.name, 0.0)
        out.append(
            Estimate(
                name=p.name,
                unit=p.unit,
                what=p.what,
                value=start + error.get(p.name, 0.0),
                nominal=start,
                std=float(std[p.name]) if p.name in std else None,
                identifiable=p.name in std,
                absorbs=tuple(d.name for d in dropped if _takes_part(d, p.name, size)) if p.name in std else (),
                because=reasons.get(p.name),
                group=p.group,
            )
        )
    return tuple(out)


def _takes_part(dropped: DroppedParameter, name: str, size: dict[str, float]) -> bool:
    """Tell whether the parameter ``name`` absorbs a relevant share of a left-out parameter's error."""
    share = {n: abs(c) / size[n] for n, c in dropped.direction}
    return name != dropped.name and share.get(name, 0.0) > ABSORBED_SHARE * max(share.values())


def _nominal_value(setup: MeasurementSetup, p: Parameter) -> float:
    """Value before the fit: of the elementary transform, the fixture, the tool point, the zero."""
    if p.main_move.on == "reading":
        return setup.zero if p.name == "zero" else 0.0
    if p.name.startswith("fixture"):
        place = [n for n in range(len(setup.place_names)) if p.name.startswith(f"fixture_{setup.place_names[n]}_")]
        return float(setup.p_BX[place[0] if place else 0, p.main_move.index])
    if p.name.startswith("map_"):
        point = [n for n in range(len(setup.point_names)) if p.name.startswith(f"map_{setup.point_names[n]}_")]
        return float(setup.p_FM[point[0] if point else 0, "xyz".index(p.name[-1])])
    return setup.chain.transforms[p.main_move.index].nominal if p.group == "geometry" else 0.0
