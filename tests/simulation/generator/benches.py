"""Where each arm is measured: fixture, bar, tool and plate as the cell file states them (mm, deg, kg)."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bench:
    """Nominal cell of one arm; ``plate_mm``: about where the ball artifact's own frame stands in the base frame."""

    home_deg: tuple[float, ...]
    fixture_mm: tuple[float, float, float]
    length_mm: tuple[float, float]
    map_mm: tuple[float, float, float]
    tool_kg: float
    com_mm: tuple[float, float, float]
    plate_mm: tuple[float, float, float]

    @property
    def fixture(self):
        return np.array(self.fixture_mm) / 1e3

    @property
    def tool(self):
        return np.array(self.map_mm) / 1e3


BENCHES = {
    "comau-nj130": Bench(
        (0, 0, 0, 0, -90, 0), (258, 1468, 708), (300, 520), (50, 0, 150), 5.0, (15, 0, 60), (1300, 0, 500)
    ),
    "kuka-kr6-r700": Bench(
        (0, -90, 90, 0, 45, 0), (430, 330, 60), (300, 520), (30, 0, 110), 1.3, (10, 0, 45), (480, 0, 150)
    ),
    "ur10": Bench((0, -90, 90, -90, -90, 0), (600, 500, 60), (300, 520), (50, 0, 120), 1.5, (15, 0, 45), (750, 0, 100)),
    "abb-irb120": Bench((0, 0, 0, 0, 90, 0), (300, 250, 60), (200, 420), (30, 0, 80), 0.5, (8, 0, 35), (380, 0, 120)),
}

# gear ratios that the robot file states where strain-wave gears are planted: nobody published any for these arms
RATIOS = (121.0, 160.0, 101.0, 100.0, 80.0, 50.0)

# the four 1-inch balls of the TriCal paper's artifact (its Table 1)
BALLS_MM = (
    (-79.539, -330.141, 17.531),
    (-79.193, 287.805, 18.740),
    (-79.650, -21.958, 276.388),
    (26.379, -21.676, 170.489),
)
