"""What a calibrated robot is good enough for, in words: on the screen and at the top of its page."""

from math import ceil, floor, log10
from typing import Literal

from planner.common.units import to_mm
from planner.model.use_statement import ToolUse, Use

TOOLS = {"measured": "the measured tool point", "own": "its own tool", "another": "any other tool"}
TARGET = "Targets are positions that an offline program names; taught poses do not change."
Row = tuple[str, ...]


def targets_text(within: float, uncalibrated: float, of: Literal["this robot", "such robots"]) -> str:
    """Say what 95 of 100 targets are within [m], and within what they are before calibration, and of which robots."""
    return f"95 of 100 targets within {bound_text(within)}, {of} uncalibrated {bound_text(uncalibrated)}"


def usual_uses_text(within: float, tool: str) -> str:
    """Say for which usual uses it is enough that targets are within so much [m] with a tool.

    docs/commands/identify.md has why.
    """
    needs = {"handling": 1.0, "arc welding": 0.5, "drilling": 0.2}  # [mm] that such uses mostly allow
    mm = float(to_mm(within))
    named = {use: f"{use} ({allowed:g} mm)" for use, allowed in needs.items()}
    enough = [named[use] for use, allowed in needs.items() if mm <= allowed]
    others = [use for use, allowed in needs.items() if mm > allowed]
    # 1.2: times what is allowed: needs of a use are known no better
    nearly = "nearly" if others and mm <= 1.2 * needs[others[0]] else "not"
    if not enough:
        return f"With {tool} {nearly} enough for usual {named[others[0]]}."
    listed = " and ".join(filter(None, (", ".join(enough[:-1]), enough[-1])))
    rest = f", {nearly} for {named[others[0]]}" if others else ""
    return f"With {tool} enough for usual {listed}{rest}."


def ask_for_tolerance(where: str) -> str:
    """Say what a yes or no needs, and ``where`` it is given."""
    return f"State your tolerance ({where}) for a yes or no."


def use_sentence(use: Use) -> str:
    """Say in one sentence for which programs the robot is good enough."""
    said = ", ".join(f"within {bound_text(t.targets_within)} with {TOOLS[t.tool]}" for t in use.tools)
    return f"offline programs {said}"


def taught_sentence(use: Use) -> str:
    """Say what calibration does to poses that are led to by hand: nothing."""
    assumed = " (assumed: the robot's file has no repeatability_mm)" if use.repeatability_assumed else ""
    return f"poses that are taught by hand come back within {bound_text(use.repeatability)}{assumed}, calibrated or not"


def tolerance_sentence(use: Use) -> str:
    """Say whether the robot is good enough for the tolerance that was asked for."""
    assert use.tolerance is not None
    said = "; ".join(f"{t.answer} with {TOOLS[t.tool]} ({_shares(t)})" for t in use.tools)
    return f"{float(to_mm(use.tolerance)):g} mm: {said}"


def _shares(tool: ToolUse) -> str:
    return f"likely {share_text(tool.share)} of targets, uncalibrated {share_text(tool.share_before)}"


def use_rows(use: Use) -> list[Row]:
    """Return a row for each use: what, before, after and, where a tolerance was asked for, whether it is enough."""
    repeats = bound_text(use.repeatability)
    asked = use.tolerance is not None
    taught = "yes" if use.tolerance is not None and use.tolerance >= use.repeatability else "no"
    what = f"poses taught by hand{', assumed' if use.repeatability_assumed else ''}"
    rows = [(what, repeats, repeats, *([taught] if asked else []))]
    for t in use.tools:
        verdict = [f"{t.answer}: {_shares(t)}"] if asked else []
        bounds = (bound_text(t.targets_within_before), bound_text(t.targets_within))
        rows.append((f"offline programs, {TOOLS[t.tool]}", *bounds, *verdict))
    return rows


def use_head(use: Use) -> Row:
    """Return the titles of the columns of :func:`use_rows`."""
    asked = [] if use.tolerance is None else [f"within {to_mm(use.tolerance):g} mm?"]
    return ("use", "uncalibrated", "calibrated", *asked)


def verdict_text(use: Use) -> str:
    """Say in two sentences for which programs the robot is good enough, and what stays as it was."""
    return f"Good for {use_sentence(use)} (95 of 100 targets); {taught_sentence(use)}."


def bound_text(value: float) -> str:
    """Write a length [m] in mm to two digits, rounded up: a bound is never made smaller."""
    mm = float(to_mm(value))
    if mm <= 0:
        return "0 mm"
    decimals = max(1 - floor(log10(mm)), 0)
    up = ceil(mm * 10**decimals - 1e-9) / 10**decimals
    return f"{up:.{max(1 - floor(log10(up)), 0)}f} mm"  # 0.996 is 1.0, not 1.00


def share_text(share: float | None) -> str:
    """Write a share in percent, rounded down; it is one of drawn robots, and so never of all that there are."""
    percent = floor(100 * (share or 0.0))
    return f"{percent:d} %" if percent < 100 else "over 99 %"
