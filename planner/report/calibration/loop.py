"""What the page says of the loop: every finding with its evidence, what was looked for, what was turned down."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planner.identification import Finding, Limit
from planner.report.calibration.data import Told
from planner.report.calibration.named import by_name
from planner.report.calibration.sentences import mm
from planner.report.calibration.story import Step, steps
from planner.report.calibration.units import unit_of
from planner.report.words import count, sized

Row = tuple[str, ...]
NAMED = 4  # rivals that are listed by name
FAMILIAR = ("backlash", "gear ripple", "joint compliance", "encoder once a turn")  # what a mechanic asks for first
NOTHING = "Nothing beyond noise that the catalogue can name."
MOST_REJECTED, MOST_NAMED = 20, 6  # in the table, and findings on the first sheet
BLIND = {"rad": 0.02, "m": 0.01, "rad/rad": 0.02, "rad/Nm": 1e-3, "1": 1.0, "s": 1.0}
"""Sizes of an effect that no arm has: a run that shows only such ones does not see it."""


@dataclass(frozen=True)
class Found:
    """One finding on the page: a sentence, the name of its picture, and the evidence."""

    heading: str
    picture: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class LimitTable:
    """Detection limits: one row an effect, a column for each joint, and what is elsewhere in words."""

    joints: tuple[str, ...]
    rows: tuple[Row, ...]


def findings(told: Told) -> tuple[Found, ...]:
    """Say what was found, in the order in which it came."""
    return tuple(Found(_capital(s.finding.note), s.name, _evidence(told, s)) for s in steps(told))


def in_short(told: Told) -> Row:
    """Say what was fitted by name, what was found and what would have been, for the first sheet."""
    traced, named = told.calibration.traced, by_name(told.calibration)
    if traced is None:
        return named
    first = sorted(traced.findings, key=lambda f: -f.held_out_gain)[:MOST_NAMED]
    found = [_capital(f.note) + _or(f.rivals) + "." for f in traced.findings if f in first] or [NOTHING]
    if len(first) < len(traced.findings):
        found.append(f"And {len(traced.findings) - len(first)} more that bring less.")
    return (*named, *found, *silence(traced.limits))


def silence(limits: Iterable[Limit]) -> Row:
    """Say what familiar effects would have been seen from which size on, where they were not found."""
    out = []
    for kind in FAMILIAR:
        own = [x for x in limits if x.effect == kind and _seen(x)]
        if own:
            worst = max(own, key=lambda x: x.size)
            unit, factor = unit_of(worst.unit, worst.size)
            where = f"of {worst.on}" if len(own) == 1 else f"of {len(own)} joints"
            out.append(f"{kind} {where} above {sized(worst.size * factor, 2)} {unit}")
    return (f"Would have been seen 95 times in 100: {'; '.join(out)}.",) if out else ()


def _evidence(told: Told, step: Step) -> tuple[str, ...]:
    f, before, after = step.finding, step.before.held_out.rms, step.after.held_out.rms
    others = [e for e in step.after.effects if e not in step.before.effects and e != step.what]
    along = f" (with {', '.join(others)})" if others else ""
    lines = [
        f"Size {_size(f)}. Chance of so large an effect where there is none, corrected for the "
        f"{count(_tried(told))} alternatives that were tried: {_chance(f.log_p)}.",
        f"Held-out error {mm(before)} → {mm(after)} (rms) when it was added{along}; "
        f"fitted samples {mm(step.before.train.rms)} → {mm(step.after.train.rms)}.",
        _rivals(f),
    ]
    return tuple(lines)


def _size(f: Finding) -> str:
    unit, factor = unit_of(f.unit, f.value)
    out = f"{_pair(f.value * factor, f.std * factor)} {unit}"
    if f.inner is None:
        return out
    unit, factor = unit_of(f.inner_unit or "", f.inner)
    inner = sized(f.inner * factor, 4) if f.inner_std is None else _pair(f.inner * factor, f.inner_std * factor)
    return f"{out}, {f.inner_name} {inner} {unit}"


def _pair(value: float, std: float) -> str:
    """Write a value and its deviation with as many decimals as the deviation has at two digits."""
    places = int(np.clip(1 - np.floor(np.log10(std)), 0, 8)) if std > 0 else 3
    return f"{value:.{places}f} ± {std:.{places}f}"


def _rivals(f: Finding) -> str:
    if not f.rivals:
        return "Rivals: none. Nothing else that was tried explains the same, at a hundred to one."
    named = ", ".join(f.rivals[:NAMED]) + (f" and {len(f.rivals) - NAMED} more" if len(f.rivals) > NAMED else "")
    return f"Rivals that this run cannot tell from it: {named}."


def _or(rivals: Row) -> str:
    return "" if not rivals else f" — or {rivals[0]}" + (f" or {len(rivals) - 1} more" if len(rivals) > 1 else "")


def _chance(log_p: float) -> str:
    ten = log_p / np.log(10)
    if ten < -300:
        return "below 10^-300"
    return f"10^{ten:.0f}" if ten < -4 else sized(float(np.exp(log_p)), 2)


def _tried(told: Told) -> int:
    traced = told.calibration.traced
    return 0 if traced is None else traced.tried


def rejected(told: Told) -> tuple[Row, ...]:
    """List what was tried in full and not kept, and why; each only once."""
    traced = told.calibration.traced
    return () if traced is None else tuple(dict.fromkeys(traced.rejected))[:MOST_REJECTED]


def limit_table(told: Told) -> LimitTable:
    """Set the detection limits: effects by joints."""
    traced = told.calibration.traced
    n = told.calibration.run.samples.q.shape[1]
    rows: dict[str, list[tuple[str, Limit]]] = {}
    for limit in () if traced is None else traced.limits:
        place, _, by = limit.on.partition(" by ")
        rows.setdefault(f"{limit.effect} by {by}" if by else limit.effect, []).append((place, limit))
    joints = tuple(f"joint {j + 1}" for j in range(n))
    return LimitTable(joints, tuple(_limits(effect, joints, own) for effect, own in rows.items()))


def _limits(effect: str, joints: Row, own: list[tuple[str, Limit]]) -> Row:
    seen = sorted(limit.size for _, limit in own if _seen(limit)) or [0.0]
    middle = seen[len(seen) // 2]
    unit, factor = unit_of(own[0][1].unit, middle)
    at = {place: sized(limit.size * factor, 2) if _seen(limit) else "–" for place, limit in own}
    elsewhere = ", ".join(f"{place} {size}" for place, size in at.items() if place not in joints)
    return (effect, unit, *(at.get(j, "") for j in joints), elsewhere)


def _seen(limit: Limit) -> bool:
    """Tell whether the run would show a size of the effect that an arm may have."""
    return limit.size < BLIND.get(limit.unit, np.inf)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
