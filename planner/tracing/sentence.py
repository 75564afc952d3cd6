"""Sizes as a mechanic reads them."""

from planner.catalogue import Entry

UNITS = {"rad": ("µrad", 1e6), "m": ("µm", 1e6), "rad/Nm": ("µrad/Nm", 1e6), "m/N": ("µm/N", 1e6), "s": ("ms", 1e3)}


def sized(entry: Entry, value: float, std: float, unit: str, inner: float | None, inner_std: float | None) -> str:
    """Fill the entry's sentence with its size and inner number."""
    name, factor = UNITS.get(unit, (unit, 1.0))
    size = f"{value * factor:.3g} ± {std * factor:.2g} {name}".strip()
    number = "" if inner is None else f"{inner:.5g}" if inner_std is None else f"{inner:.5g} ± {inner_std:.1g}"
    return entry.sentence.format(size=size, inner=number)
