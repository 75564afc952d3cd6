"""Units as a page shows them: small numbers in millionths, times and rates in what a person counts in."""

from planner.identification import Estimate
from planner.identification.shown import in_file_units

MILLIONTHS = {"rad": "µrad", "m": "µm"}
PARTS = {"1": "ppm", "rad/rad": "ppm", "1/K": "ppm/K", "1/m": "ppm/m"}
LONG = 1.0  # [s] from here on a time is written in seconds
SHARE = 0.005  # from here on a part of one is written in per cent
HOUR = 3600.0


def unit_of(unit: str, size: float) -> tuple[str, float]:
    """Return how an effect's value of the SI ``unit`` and of about this ``size`` is written, and the factor to it."""
    top, _, per = unit.partition("/")
    if unit == "s":
        return ("s", 1.0) if abs(size) >= LONG else ("ms", 1e3)
    if unit == "1" and abs(size) >= SHARE:
        return "%", 100.0
    if unit in PARTS:
        return PARTS[unit], 1e6
    if top in MILLIONTHS and per == "s":
        return f"{MILLIONTHS[top]}/h", 1e6 * HOUR
    if top in MILLIONTHS:
        return MILLIONTHS[top] + (f"/{per}" if per else ""), 1e6
    return ("a turn", 1.0) if unit == "1/turn" else (unit, 1.0)


def unit_of_estimate(e: Estimate) -> tuple[str, float]:
    """Return how a parameter is written: mm and degrees for the geometry, small units for effects."""
    if e.group in ("gauge", "geometry"):
        return unit_of(e.unit, e.std or 0.0) if e.unit == "s" else in_file_units(e.unit)
    return unit_of(e.unit, max(abs(e.value), e.std or 0.0))
