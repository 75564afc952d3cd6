"""What the page says of effects that were fitted by name, not found by tracing: the cell's own model."""

from planner.identification import Calibration, Estimate
from planner.report.calibration.units import unit_of_estimate
from planner.report.words import sized

MOST = 8  # parameters of one effect that are listed


def by_name(c: Calibration) -> tuple[str, ...]:
    """Say one sentence for each effect of the last stage that no tracing brought, with its values."""
    found = () if c.traced is None else c.traced.findings
    traced = {f"{f.effect}, {f.on}" for f in found}
    return tuple(_sentence(c, kind) for kind in c.stages[-1].effects if kind not in traced and ", " not in kind)


def _sentence(c: Calibration, kind: str) -> str:
    own = [e for e in c.estimates if e.group == kind and e.identifiable]
    listed = ", ".join(_value(e) for e in own[:MOST])
    more = f" and {len(own) - MOST} more" if len(own) > MOST else ""
    return f"Fitted beside the geometry: {kind} ({listed}{more})."


def _value(e: Estimate) -> str:
    unit, factor = unit_of_estimate(e)
    return f"{e.name} {sized(e.value * factor)} ± {sized((e.std or 0.0) * factor, 2)} {unit}"
