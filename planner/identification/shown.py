"""A calibration's numbers as files and pages give them: their units, and inner numbers with their whole value."""

from dataclasses import replace

from planner.identification.types import Calibration, Estimate
from planner.units import DEG, MM

PLAIN = {"m": ("mm", 1 / MM), "rad": ("deg", 1 / DEG), "rad/rad": ("urad/rad", 1e6)}


def in_file_units(unit: str) -> tuple[str, float]:
    """Return the unit in which files give a value of the SI ``unit``, and the factor to it: mm, deg, urad/Nm, um/N."""
    if unit in PLAIN:
        return PLAIN[unit]
    if unit.startswith(("m/", "rad/")):
        return f"u{unit}", 1e6
    return unit, 1.0


def shown_estimates(calibration: Calibration) -> tuple[Estimate, ...]:
    """Return all parameters, an effect's inner number (frequency, time constant) with its whole value.

    The fit moves it about the value that the search came to; that one stands as its nominal.
    """
    traced = calibration.traced
    found = () if traced is None else traced.findings
    about = {f"{f.effect}, {f.on}, {f.inner_name}": f.inner for f in found if f.inner is not None}
    return tuple(
        e if (start := about.get(e.name)) is None else replace(e, nominal=start, value=e.value + start)
        for e in calibration.estimates
    )
