"""Units as titles of columns of somebody else say them, and which of a run's they are."""

import re
from collections.abc import Sequence

UNITS = {  # as titles say them, and the run's own unit
    "deg": "deg", "degree": "deg", "degrees": "deg", "°": "deg", "grad": "deg", "rad": "rad", "mm": "mm", "m": "m",
    "µm": "um", "μm": "um", "um": "um", "s": "s", "sec": "s", "°c": "degC", "degc": "degC", "c": "degC", "n": "N",
    "nm": "Nm", "kg": "kg", "px": "px",
}  # fmt: skip
OTHER_UNITS = {  # a unit that a run does not have: the one that is taken, the factor to it, and what is added
    "ms": ("s", "0.001", ""), "us": ("s", "1e-6", ""), "µs": ("s", "1e-6", ""), "ns": ("s", "1e-9", ""),
    "min": ("s", "60", ""), "h": ("s", "3600", ""), "cm": ("mm", "10", ""), "dm": ("mm", "100", ""),
    "in": ("mm", "25.4", ""), "inch": ("mm", "25.4", ""), "mil": ("um", "25.4", ""), "nm": ("um", "0.001", ""),
    "gon": ("deg", "0.9", ""), "mrad": ("rad", "0.001", ""), "mdeg": ("deg", "0.001", ""), "rev": ("deg", "360", ""),
    "°f": ("degC", "0.5555555556", "-17.7777777778"), "degf": ("degC", "0.5555555556", "-17.7777777778"),
    "k": ("degC", "1", "-273.15"), "kn": ("N", "1000", ""), "g": ("kg", "0.001", ""),
}  # fmt: skip
UNIT = re.compile(
    rf"[\[(\s_]\s*({'|'.join(sorted(map(re.escape, {*UNITS, *OTHER_UNITS}), key=len, reverse=True))})\s*[\])]?$",
    re.IGNORECASE,
)
BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]$")


def is_row_of_units(cells: Sequence[str]) -> bool:
    """Tell whether the cells of a row are units, or nothing, or strokes, and some of them units."""
    said = [unit for cell in cells if (unit := bare_unit(cell)) not in ("", "-", "–", "/")]
    return bool(said) and all(unit.lower() in UNITS or unit.lower() in OTHER_UNITS for unit in said)


def bare_unit(cell: str) -> str:
    """Return the unit that a cell says, without brackets round it."""
    return cell.strip().strip("[]()").strip()
