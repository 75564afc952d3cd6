"""A draw-wire encoder: its wire reads the distance of the tool point as a bar does, a hundred times less finely."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import GaugeBody
from planner.cell.site import Site
from planner.gauges.bar import LengthGauge
from planner.gauges.bar_checklist import BarChecklist
from planner.kinematics.bodies import capsule_between

EYELET_MM = 12.0  # [mm] radius of what stands at the fixture, where the wire leaves the drum


@register_gauge
@dataclass(frozen=True)
class DrawWire(LengthGauge):
    """A draw-wire encoder at a fixture, its wire's end on the tool.

    Its body is a wire: nothing is stiff, so ``[gauge.body]`` needs no housing; the drum is an obstacle of the cell.
    """

    kind: ClassVar[str] = "draw-wire"
    noun: ClassVar[str] = "wire"
    usual_measure: ClassVar[Literal["continuous", "static"]] = "static"  # read at each pose, by a person or over a line
    default_noise_um: ClassVar[float] = 100.0
    largest_scale: ClassVar[float] = (
        5e-3  # of the plainest encoders' drums: classes of linearity go up to half a percent
    )
    pose_columns: ClassVar[tuple[str, str]] = ("fixture", "wire (mm)")
    removal: ClassVar[str] = "unhook the wire and let it run in slowly"
    checklist: ClassVar[BarChecklist] = BarChecklist(
        fixture="The encoder's eyelet of place {name} stands",
        tool="The eye for the wire's end lies",
        ends="from the eyelet to the eye",
        adjust="drive the tool there and set the eyelet to its eye",
        clean="The wire runs out and in freely, and touches nothing on its way.",
        attach="lead the wire slowly to the tool and hook it in; never let it snap back.",
    )
    # the wire has a radius of 1 mm; the hook at the tool lets 10 mm free
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {
        "body": {"radius_mm": EYELET_MM, "rod_radius_mm": 1.0, "housing_mm": 2 * EYELET_MM, "trim_mm": 10.0}
    }

    def bodies(self, cell: Site) -> list[GaugeBody]:
        """Return the eyelet, and a piece of the wire at each end; together they are as long as the shortest wire.

        No body stands for the middle of a longer wire; ``unchecked_length`` is how long it may be.
        """
        reach, z = self.length_min - self.trim, np.array([0.0, 0.0, 1.0])
        thin = self.rod_radius
        eyelet = capsule_between("wire's eyelet", z * self.radius, z * max(self.housing, self.radius), self.radius)
        out = capsule_between("wire at the fixture", z * self.housing, z * max(reach - thin, self.housing), thin)
        end = capsule_between("wire at the tool", -z * (self.trim + thin), -z * max(reach, self.trim + thin), thin)
        return [GaugeBody(eyelet, "housing"), GaugeBody(out, "housing"), GaugeBody(end, "rod")]

    @property
    def unchecked_length(self) -> float:
        """Length in the middle of the longest wire that no body stands for [m]."""
        return max(self.length_max - 2.0 * (self.length_min - self.trim), 0.0)
