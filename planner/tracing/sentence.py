"""Sizes as a mechanic reads them."""

import numpy as np

from planner.catalogue import Entry
from planner.tracing.curve import KIND as CURVE
from planner.tracing.curve import periods
from planner.units import Array

UNITS = {
    "rad": ("µrad", 1e6),
    "m": ("µm", 1e6),
    "rad/Nm": ("µrad/Nm", 1e6),
    "m/N": ("µm/N", 1e6),
    "s": ("ms", 1e3),
    "1": ("µm/m", 1e6),
    "1/K": ("µm/m/K", 1e6),
    "m/K": ("µm/K", 1e6),
    "rad/K": ("µrad/K", 1e6),
    "m/s": ("µm/h", 3.6e9),
    "rad/s": ("µrad/h", 3.6e9),
    "rad/rad": ("µrad/rad", 1e6),
}
INNER = {"1/turn": ("", 1.0), "s": ("s", 1.0), "m": ("mm", 1e3), "rad": ("µrad", 1e6)}


def sized(
    entry: Entry, value: float, std: float, unit: str, inner: float | None, inner_std: float | None, sizes: Array
) -> str:
    """Fill the entry's sentence with its size, its inner number, and the periods of a curve."""
    size = rounded(abs(value), std, *UNITS.get(unit, (unit, 1.0)))
    number = ""
    if inner is not None and entry.inner is not None:
        number = rounded(inner, inner_std, *INNER.get(entry.inner.unit, (entry.inner.unit, 1.0)))
    sentence = entry.sentence.format(size=size, inner=number)
    if value < 0:  # otherwise the sign is one of axes and senses, which a mechanic does not look for
        sentence = sentence.replace(" grow ", " shrink ")
    if entry.kind == CURVE:
        *others, last = [f"{f:.0f}" for f in periods(entry.make(None), sizes)]
        sentence += f", mostly in waves of about {', '.join(others)}{' and ' if others else ''}{last} a turn"
    return sentence


def rounded(value: float, std: float | None, unit: str, factor: float) -> str:
    """``182 ± 6 µrad``: the uncertainty to two digits at most, the value no finer than that."""
    value *= factor
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.3g} {unit}".strip()
    std *= factor
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    if std >= 3:
        digits = 0
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}".strip()
