"""Which parameters a run can see: decided once, on the nominal robot, before the fit, and then frozen."""

from collections.abc import Collection, Sequence

from planner.identification.noise import Whitener
from planner.model import Model
from planner.observability import Identifiability, identifiable
from planner.repeatable import evenly
from planner.run import Samples

LOOK = 4000  # samples that decide


def seen_by(model: Model, samples: Samples, prefer: Sequence[int] | None = None) -> tuple[Model, Identifiability]:
    """Return the model with the parameters that the samples can tell apart, and why the others are left out.

    ``prefer`` are their positions, best kept first; as they stand in the model where it is not given.
    """
    few = samples.take(evenly(len(samples), LOOK))
    rows = Whitener.of(model, few).white(slice(None), model.rows(few))
    order = range(len(model.names)) if prefer is None else prefer
    seen = identifiable(rows, model.names, model.prior, order, noise=1.0, readings=len(samples) * model.width)
    return model.subset(list(seen.kept)), seen


def only(model: Model, groups: Collection[str]) -> Model:
    """Return the model with only the parameters of some groups."""
    return model.subset([j for j, p in enumerate(model.parameters) if p.group in groups])
