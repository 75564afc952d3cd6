"""Numbers that the two papers print: ``published.toml``."""

from functools import cache
from pathlib import Path

from planner.common.schema import StrictModel, read_toml


class DhTable(StrictModel):
    """Table 1 of the EDBB paper; ``used_alpha_deg`` makes joints 2 and 3 parallel."""

    printed_alpha_deg: tuple[float, ...]
    used_alpha_deg: tuple[float, ...]
    a_m: tuple[float, ...]
    d_m: tuple[float, ...]
    theta_deg: tuple[float, ...]


class Sine(StrictModel):
    """Parameters of eq. 9 of the EDBB paper."""

    a_mm: float
    b: float
    phase_deg: float


class RangesFile(StrictModel):
    """Ranges of length and deviation of one trajectory."""

    length_mm: float
    deviation_mm: float


class MdhTable(StrictModel):
    """Table 4 of the TriCal paper."""

    alpha_deg: tuple[float, ...]
    a_mm: tuple[float, ...]
    d_mm: tuple[float, ...]
    theta_deg: tuple[float, ...]


class Table8(StrictModel):
    """Identified less nominal parameters, by name, in three units."""

    deg: dict[str, float]
    mm: dict[str, float]
    deg_Nm: dict[str, float]


class Table9(StrictModel):
    """Mean, maximum and standard deviation of position errors after each calibration."""

    head_mm: tuple[float, float, float]
    tracker_mm: tuple[float, float, float]


class Published(StrictModel):
    """All of them."""

    table_1: DhTable
    sine: Sine
    first_guess: Sine
    circle: RangesFile
    path: RangesFile
    table_4: MdhTable
    table_8: Table8
    table_9: Table9


@cache
def paper_numbers() -> Published:
    """Return what the papers print."""
    return read_toml(Path(__file__).with_suffix(".toml"), Published)
