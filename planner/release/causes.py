"""The causes that a calibration names: what tracing found and what the posterior holds besides, as that judges both."""

from collections.abc import Sequence
from dataclasses import dataclass

from planner.common.system import give_back_memory
from planner.common.units import display_unit, format_value
from planner.effects.steps import SLIP
from planner.inference.candidates import HUNDRED_TO_ONE, CauseComparison, Inclusion, TracingResult
from planner.inference.model_comparison import judge_findings
from planner.inference.posterior_fit import DrawRecord
from planner.model.finding import Finding, OtherValue, RejectedEffect, cause_text, inner_unit, percent
from planner.model.identification_document import Estimate
from planner.release.nameless_rivals import with_nameless_rivals
from planner.release.posterior_causes import posterior_families, posterior_findings
from planner.release.released_robot import ReleasedRobot


@dataclass(frozen=True)
class Causes:
    """What a document names as causes, one by one, and what was looked at and is none."""

    findings: tuple[Finding, ...]
    rejected: tuple[RejectedEffect, ...]


def name_causes(
    traced: TracingResult,
    released: ReleasedRobot | None,
    table: Sequence[Estimate],
    readings: float,
    most: int | None = None,
) -> Causes:
    """Return the causes with their probabilities and rivals by the posterior.

    Args:
        traced: what tracing found; it alone where no robot was released.
        released: with the posterior.
        table: of the last stage's parameters.
        readings: independent ones of the run.
        most: how many are named at most, wrong rows beside them; none: any number.
    """
    found = tuple(_with_estimate(f, table) for f in traced.findings)
    if released is None or traced.tried is None:
        return Causes(found, traced.rejected)
    posterior = released.posterior
    give_back_memory()
    worth = readings / len(posterior.record.effects.y)
    known = _judge(released, traced.comparisons, worth)
    found = tuple(
        _with_standing(_with_other_values(f, posterior.record), known[f.name]) if f.name in known else f for f in found
    )
    held = posterior_families(posterior, found)
    known |= _judge(released, [h.comparison for h in held], worth)
    beside = [f for h in held for f in posterior_findings(released, h, known[h.name])]
    again = {f.name for f in beside}
    kept = tuple(f for f in found if not _is_negligible(f) and not (f.is_doubtful and f.name in again))
    rejected = {f.name: _rejection(f) for f in found if f not in kept and f.name not in again}
    named = _likeliest((*kept, *beside), most)
    return Causes(named, (*rejected.values(), *traced.rejected))


def _likeliest(findings: tuple[Finding, ...], most: int | None) -> tuple[Finding, ...]:
    """Return at most so many causes, the likeliest, in their order; wrong rows do not count."""
    order = sorted(findings, key=lambda f: -(1.0 if f.probability is None else f.probability))
    names = list(dict.fromkeys(f.name for f in order if f.effect != SLIP))[:most]
    return tuple(f for f in findings if f.effect == SLIP or f.name in names)


def _judge(released: ReleasedRobot, comparisons: Sequence[CauseComparison], worth: float) -> dict[str, Inclusion]:
    """Return how the cause of each comparison stands, by name."""
    judged = with_nameless_rivals(
        released, [c.own for c in comparisons], judge_findings(released.posterior, comparisons, worth)
    )
    return {c.own.name: standing for c, standing in zip(comparisons, judged, strict=True)}


def _with_standing(f: Finding, standing: Inclusion) -> Finding:
    """Return a finding with its probability and its rivals."""
    update = {
        "probability": standing.probability,
        "rivals": tuple(r.name for r in standing.rivals),
        "rival_probabilities": tuple(r.probability for r in standing.rivals),
    }
    return f.model_copy(update=update)


def _with_other_values(f: Finding, record: DrawRecord) -> Finding:
    """Return a finding with the other values that its inner number may have."""
    others = {} if f.inner is None else record.other_values(f.name)
    likely = tuple((v, p) for v, p in others.items() if p >= HUNDRED_TO_ONE)
    if f.inner is None or not likely:
        return f
    name, factor = inner_unit(f.inner.unit, f.inner.value)
    words = ", ".join(f"{v * factor:.4g} {name}".strip() + f" ({percent(p)})" for v, p in likely)
    kept = tuple(OtherValue(value=v, unit=f.inner.unit, probability=p) for v, p in likely)
    inner = f.inner.model_copy(update={"others": kept})
    return f.model_copy(update={"inner": inner, "note": f"{f.note}; its {f.inner.name} may also be {words}"})


def _is_negligible(f: Finding) -> bool:
    nobody_acts = 0.05  # probability below which nobody would act on a finding
    return f.probability is not None and f.probability < nobody_acts


def _rejection(f: Finding) -> RejectedEffect:
    """Say what is likelier than a finding that the posterior speaks against."""
    own = f.probability or 0.0
    likelier = [r for r, p in zip(f.rivals, f.rival_probabilities or (), strict=False) if p > own]
    what = f"{cause_text(likelier[0])} is likelier" if likelier else "what else acts explains as much without it"
    because = f"{percent(own)}: it had a stage, but {what}"
    return RejectedEffect(name=f.name, because=because, probability=own)


def _with_estimate(f: Finding, table: Sequence[Estimate]) -> Finding:
    """Return a finding of one parameter with the value and deviation that the table of parameters has."""
    inner = "" if f.inner is None else f"{f.name}, {f.inner.name}"
    own = [e for e in table if e.group == f.name and e.identifiable and e.std is not None and e.name != inner]
    if len(own) != 1 or own[0].unit != f.unit or f.after_sample is not None or f.row is not None:
        return f
    value, std = own[0].value - own[0].nominal, own[0].std or 0.0
    before, now = (format_value(abs(v), d, *display_unit(f.unit, v)) for v, d in ((f.value, f.std), (value, std)))
    return f.model_copy(update={"value": value, "std": std, "note": f.note.replace(before, now)})
