"""A gauge that the project does not ship: a dial on the tool that touches a flat plane and reads its distance."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydantic import BaseModel

from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import register_gauge
from planner.cell.parts import Fixture
from planner.cell.placement import Targets
from planner.common.units import MM, from_mm
from planner.effects.basis import ONE
from planner.effects.effect import Parameter, ParameterMove, reading_move, tool_parameters, transform_move
from planner.effects.gauge_errors import PointLag
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.runs.run import Readings


class PlaneKeys(BaseModel):
    """The keys of ``[gauge]`` that only this gauge has."""

    plane_point_mm: tuple[float, float, float]
    plane_normal: tuple[float, float, float] = (0.0, 0.0, 1.0)


@register_gauge
@dataclass(frozen=True)
class PlaneDial(Gauge, GaugeUnknowns):
    """Reads the distance of the tool point from a plane, along the plane's normal."""

    point: np.ndarray = None
    normal: np.ndarray = None

    kind: ClassVar[str] = "plane-dial"
    default_noise_um: ClassVar[float] = 2.0
    columns: ClassVar[str] = "length_mm"
    plural: ClassVar[str] = "distances from a plane"
    has_zero: ClassVar[bool] = True
    OwnKeys: ClassVar[type[BaseModel] | None] = PlaneKeys

    @classmethod
    def read_own(cls, path, robot, file, planning):
        keys = super().read_own(path, robot, file, planning)
        normal = np.array(keys["plane_normal"])
        return {"point": from_mm(keys["plane_point_mm"]), "normal": normal / np.linalg.norm(normal)}

    @classmethod
    def read_places(cls, path, robot, file):
        own = cls.read_own(path, robot, file, True)
        return (Fixture("plane", own["point"], own["normal"], 5 * MM),)

    # ---- one reading

    def distance(self, p_BM):
        return (p_BM - self.point) @ self.normal

    def residual(self, setup, samples, motion, targets):
        return (targets.length - self.distance(motion.x.T))[:, None]

    def project(self, setup, samples, motion, which):
        return np.einsum("kin,i->kn", motion.point_screws(which), self.normal)[:, None]

    def targets(self, setup, samples, readings):
        return Targets(length=readings.length)

    def readings(self, values):
        return Readings(length=values[:, 0])

    # ---- what is unknown of it

    def parameters(self, setup, free) -> Iterator[Parameter]:
        """The plane's place along its normal, its two tilts, and the tool point."""
        if "fixture" in free:
            yield Parameter("plane", "m", 5 * MM, "place of the plane", reading_move(), "gauge")
            for a in range(2):
                yield Parameter(
                    f"plane_r{'xy'[a]}", "rad", 5e-3, "tilt of the plane", transform_move(3 + a, ONE), "gauge"
                )
        if "tool" in free:
            yield from tool_parameters(setup)

    def lag_moves(self):
        return tuple(ParameterMove("reading", 0, PointLag(a)) for a in range(3))

    def coordinates(self, setup, samples, motion):
        yield "position", motion.x.T

    # ---- frames to be found

    def number_places(self, setup, cell, run):
        return replace(setup, place_names=run.places)

    def place(self, setup, run, p_FM):
        return setup

    # ---- where it reads

    @property
    def margin_columns(self):
        return (("workspace", "nearest to the plane"), ("workspace", "farthest from the plane"), ("cones", "tilt"))

    def margins(self, stage, place, p_BM, axis_B):
        if stage == "workspace":
            d = self.distance(p_BM)
            return np.column_stack([d - self.length_min, self.length_max - d])
        upright = np.arccos(np.clip(-axis_B @ self.normal, -1.0, 1.0))
        return (self.cone_map - upright)[:, None]

    def margin_changes(self, travel):
        return [travel.move, travel.move, travel.turn]
