"""A draw-wire encoder: its wire reads the distance of the tool point as a bar does, a hundred times less finely."""

from dataclasses import dataclass
from typing import ClassVar

from planner.cell.gauge_registry import register_gauge
from planner.gauges.bar import LengthGauge


@register_gauge
@dataclass(frozen=True)
class DrawWire(LengthGauge):
    """A draw-wire encoder at a fixture, its wire's end on the tool."""

    kind: ClassVar[str] = "draw-wire"
    default_noise_um: ClassVar[float] = 100.0
