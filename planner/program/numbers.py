"""Numbers as controllers take them: fixed point, never an exponent, never a minus zero."""

import math


def fixed(value: float, decimals: int) -> str:
    """Return ``value`` rounded to the nearest with ``decimals`` digits behind the point."""
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def floored(value: float, decimals: int) -> float:
    """Return ``value`` rounded down, for what must not exceed a limit; 2.9999999999 counts as 3."""
    scale = 10.0**decimals
    return math.floor(value * scale * (1.0 + 1e-12) + 1e-9) / scale
