"""Sizes of effects in the units that a mechanic reads."""

import numpy as np

from planner.effects.effect import Effect

DISPLAY_UNITS = {
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


def implausible_text(effect: Effect, size: float) -> str:
    """Say that an effect of this size is refused because no arm or gauge has it."""
    unit = DISPLAY_UNITS.get(effect.unit, (effect.unit, 1.0))
    size_text, most = (format_value(v, None, *unit) for v in (size, effect.largest))
    return f"{size_text} is not plausible: at most {most} ({effect.literature})"


def format_value(value: float, std: float | None, unit: str, factor: float) -> str:
    """``182 ± 6 µrad``: the uncertainty to two digits at most, the value no finer than that."""
    value *= factor
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.3g} {unit}".strip()
    std *= factor
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    if std >= 3:
        digits = 0
    return f"{value:.{digits}f} ± {std:.{digits}f} {unit}".strip()
