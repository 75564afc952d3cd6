"""Numbers and findings as sentences: a bound is never rounded to the side on which it would be wrong."""

from collections.abc import Sequence
from math import ceil, floor, isfinite, log10

import numpy as np

from planner.cell.cell import Cell
from planner.common.numbers import number_of
from planner.common.units import UM, to_mm
from planner.design.discrimination.power import Discrimination
from planner.design.foresight_text import describe_forecast
from planner.design.observability.information import INDEX_RULES
from planner.motion.path.verdict import Verdict
from planner.session.plan_types import Plan


def count_text(n: float) -> str:
    """Write a whole number with its thousands apart."""
    return f"{int(n):,}".replace(",", "\u202f")


def separation_text(separation: Discrimination) -> str:
    """Say what the table of findings and rivals shows, and how far it is proven."""
    proof = "proven" if separation.verified else "not proven"
    return (
        "Noncentrality: what is left of an effect's readings when its rival explains what it can. It is a sum of "
        f"squares in noise variances ({separation.noise * 1e6:.3g} µm), of the less sure of the two. "
        "Power: the chance that the run then speaks a hundred to one for the "
        f"truth. No {separation.poses} candidates weigh all of this more than "
        f"{percent_text(max(separation.gap, 0.0))} better ({proof})."
    )


def digits(x: float, count: int = 3) -> str:
    """Write a number with so many significant digits, without an exponent where it can be read without one."""
    if x == 0 or not isfinite(x):
        return f"{x:g}"
    if not 1e-5 <= abs(x) < 1e7:
        return f"{x:.{count - 1}e}"
    return f"{x:.{max(0, count - 1 - floor(log10(abs(x))))}f}"


def decimals_of(std: float, otherwise: int) -> int:
    """Return how many decimals a standard deviation has at two digits; ``otherwise`` where there is none."""
    return min(max(1 - floor(log10(std)), 0), 8) if std > 0 else otherwise


def chance_text(p: float) -> str:
    """Write a probability so that a person can read it."""
    return "below 1 in a million" if p < 1e-6 else digits(p, 2)


def in_mm(value: float, count: int = 3) -> str:
    """Write a length [m] in millimetres, without the unit, with so many significant digits."""
    return digits(float(to_mm(value)), count)


def in_um(value: float | None) -> str:
    """Write a length [m] in micrometres, without the unit, to a tenth."""
    return "–" if value is None else f"{float(value) / UM:.1f}"


def duration_text(t: float) -> str:
    """Write a time: seconds up to two minutes, then minutes and seconds."""
    if t < 120:
        return f"{t:.1f} s"
    minutes, rest = divmod(round(t), 60)
    return f"{minutes} min {rest:02d} s"


def bound_text(bound: float, maximise: bool) -> str:
    """Write a bound with four digits, rounded to the side on which it still holds."""
    if not isfinite(bound) or bound == 0:
        return f"{bound:g}"
    step = 10.0 ** (floor(log10(abs(bound))) - 3)
    return digits((ceil if maximise else floor)(bound / step) * step, 4)


def percent_text(gap: float) -> str:
    """Write a gap in per cent, rounded up to a tenth."""
    return f"{ceil(gap * 1000 - 1e-9) / 10:.1f} %"


def certificate_text(plan: Plan) -> tuple[str, ...]:
    """Say how far from the best possible the poses are, sentence by sentence."""
    choice, bound = plan.choice, plan.choice.certificate
    rule, n = INDEX_RULES[choice.index], len(choice.q)
    expected = "" if plan.forecast is None else describe_forecast(plan.forecast)
    said = (f"{expected[0].upper()}{expected[1:]}.",) if expected else ()
    if plan.expected_error is not None:
        moved = (
            ("The poses were then moved by a fraction of a step, for which no limit is proven.",)
            if plan.cell.plan.refine
            else ()
        )
        return (
            *said,
            *moved,
            f"{choice.index}, the {rule.of_raw}, is {digits(choice.value, 4)} here; it did not choose these poses.",
        )
    pool = f"the {count_text(bound.candidates)} candidate poses"
    who = f"No {n} of {pool}" if bound.poses else f"No set of {pool}, however many it takes,"
    verb = ("reach" if bound.poses else "reaches") if rule.maximise else ("have" if bound.poses else "has")
    limit = bound_text(bound.value, rule.maximise)
    gap = rule.gap(choice.on_grid_value, bound.value)
    side = "below" if rule.maximise else "above"
    own = (
        f"The {n} that were chosen among them have {digits(choice.on_grid_value, 4)}: at most"
        f" {percent_text(gap)} {side} what is possible."
        if plan.by_index
        else f"The {n} here were not chosen by it, and have {digits(choice.on_grid_value, 4)}."
    )
    out = [f"{who} {verb} a {rule.of_raw} {'above' if rule.maximise else 'below'} {limit}.", own]
    if choice.pruning is not None:
        other = rule.gap(choice.pruning.exchanged, bound.value)
        out.append(
            "They are what pruning left when it took one pose after the other away; exchange among the same candidates "
            f"reaches {digits(choice.pruning.exchanged, 4)}, at most {percent_text(other)} {side} what is possible."
        )
    if plan.by_index and choice.value != choice.on_grid_value:
        off = plan.certificate
        sought = count_text(off.candidates - bound.candidates - n)
        least = f"no {n} of the candidates, these and {sought} poses sought between them {verb} a {rule.of_raw}"
        limit = f"{'above' if rule.maximise else 'below'} {bound_text(off.value, rule.maximise)}"
        apart = f"a gap of at most {percent_text(max(rule.gap(choice.value, off.value), 0.0))}"
        out.append(
            f"After moving them off the grid of candidates: {digits(choice.value, 4)}; {least} {limit}, {apart}. "
            "Of poses between the candidates that is not proven otherwise."
        )
    driven = (
        "Read all along the trajectory, evenly in time" if plan.cell.motion.is_continuous else "At the poses as driven"
    )
    out.append(f"{driven}: {digits(plan.driven, 4)}.")
    out.append(
        "The bound is a proof: its dual solution was checked afresh against every candidate."
        if bound.verified
        else "The check of the bound's dual solution failed: take it as an estimate, not as a proof."
    )
    return (*said, *out)


def verdict_rows(what: str, verdicts: Sequence[Verdict], cell: Cell) -> list[tuple[str, str]]:
    """Say what each engine found of a path: (which path and engine, verdict)."""
    asked = f"{float(to_mm(cell.motion.clearance)):g} mm asked for"
    return [
        (
            f"{what}, judged by {v.engine}",
            f"{'free, proven between the checked states too' if v.clear else 'not proven free'}; "
            f"{nearest_pair_text(v)} ({asked})",
        )
        for v in verdicts
    ]


def nearest_pair_text(verdict: Verdict) -> str:
    """Say how near the nearest pair of bodies comes; that there is none, where the arm has no bodies."""
    if not np.isfinite(verdict.clearance):
        return "no pair of bodies to look at"
    return f"nearest pair {float(to_mm(verdict.clearance)):.1f} mm apart"


def clearance_fact(verdicts: Sequence[Verdict], cell: Cell) -> tuple[str, str, str]:
    """Say how near any pair of bodies comes: (what, value, remark)."""
    engines = number_of(len({v.engine for v in verdicts}), "engine")
    bare = "" if cell.robot.bodies else f" without the arm: {cell.robot.name} has no bodies"
    least = min(v.clearance for v in verdicts)
    size = f"{float(to_mm(least)):.1f} mm" if np.isfinite(least) else "no pair of bodies"
    return ("clearance", size, f"proven by {engines}{bare}")
