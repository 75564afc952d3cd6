"""A gauge that the project does not ship: an inclinometer on the flange, whose reading is one angle."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import BaseModel, Field

from planner.cell.gauge import Gauge
from planner.cell.gauge_registry import register_gauge
from planner.cell.gauge_types import FilterStage
from planner.cell.parts import Fixture
from planner.cell.placement import Targets
from planner.common.errors import InputError
from planner.common.schema import PositiveFloat, StrictModel
from planner.common.units import DEG, from_deg
from planner.effects.basis import ONE
from planner.effects.effect import Parameter, ParameterMove, reading_move, transform_move
from planner.effects.gauge_unknowns import GaugeUnknowns
from planner.runs.run import ScalarReadings, column_of, register_scalar


@register_scalar
@dataclass(frozen=True)
class InclineReadings(ScalarReadings):
    """Inclination of the flange's x axis against the horizontal."""

    key: ClassVar[str] = "incline"
    units: ClassVar[Mapping[str, float]] = {"deg": DEG, "rad": 1.0}
    plausible: ClassVar[tuple[float, float]] = (-np.pi, np.pi)


class InclinometerKeys(StrictModel):
    """The keys of ``[gauge]`` that only this gauge has."""

    range_deg: Annotated[PositiveFloat, Field(lt=90.0)] = 30.0  # to either side of level


@register_gauge
@dataclass(frozen=True)
class Inclinometer(Gauge, GaugeUnknowns):
    """Reads by which angle the flange's x axis stands above the horizontal, ``range`` [rad] to either side."""

    range: float

    kind: ClassVar[str] = "inclinometer"
    default_noise_um: ClassVar[float] = 1.0  # of no length: it has none
    columns: ClassVar[str] = column_of(InclineReadings)
    plural: ClassVar[str] = "inclinations"
    angles: ClassVar[int] = 1
    unit: ClassVar[str] = "mrad"
    has_zero: ClassVar[bool] = True
    needs_range: ClassVar[bool] = False  # of a length
    OwnKeys: ClassVar[type[BaseModel] | None] = InclinometerKeys

    @classmethod
    def read_own(cls, path, robot, file, planning):
        if file.tool is not None and file.tool.map_axis != (1.0, 0.0, 0.0):
            raise InputError(f"{path}: 'tool.map_axis' = {list(file.tool.map_axis)}: it reads along [1, 0, 0]")
        return {"range": float(from_deg(super().read_own(path, robot, file, planning)["range_deg"]))}

    @classmethod
    def read_places(cls, path, robot, file):
        return (Fixture("level", np.zeros(3), np.array([0.0, 0.0, 1.0]), 1e-3),)

    # ---- one reading: asin(x_F · up); a turn about u moves x_F by u × x_F

    def residual(self, setup, samples, motion, targets):
        return (targets.scalar - np.arcsin(motion.R[2, 0]))[:, None]

    def project(self, setup, samples, motion, which):
        x = motion.R[:, 0]
        turned = motion.u[which, 0] * x[1] - motion.u[which, 1] * x[0]
        slope = turned / np.sqrt(1.0 - x[2] ** 2) * motion.rotation[which, None]
        return slope[:, None]

    def targets(self, setup, samples, readings):
        return Targets(scalar=readings.scalar)

    def readings(self, values):
        return InclineReadings(scalar=values[:, 0])

    # ---- where it can read: candidates, moved poses and the path stay there

    @property
    def margin_columns(self) -> tuple[tuple[FilterStage, str], ...]:
        return (("cones", "range of the inclinometer"),)

    def margins(self, stage, place, p_BM, axis_B):
        if stage != "cones":
            return np.empty((len(p_BM), 0))
        return (self.range - np.abs(np.arcsin(np.clip(axis_B[:, 2], -1.0, 1.0))))[:, None]

    def margin_changes(self, travel):
        return [travel.turn]  # no angle to the vertical changes by more than the tool turns

    # ---- what is unknown of it

    def parameters(self, setup, free) -> Iterator[Parameter]:
        """Its zero, and how the base leans."""
        yield Parameter("level_zero", "rad", 5e-3, "zero of the inclinometer", reading_move(), "gauge")
        for a in range(2):
            yield Parameter(f"base_r{'xy'[a]}", "rad", 5e-3, "lean of the base", transform_move(3 + a, ONE), "gauge")

    def lag_moves(self):
        return (ParameterMove("reading", 0, ONE),)

    def coordinates(self, setup, samples, motion):
        yield "inclination", np.arcsin(motion.R[2, 0])

    # ---- frames to be found

    def number_places(self, setup, cell, run):
        return replace(setup, place_names=run.places)

    def place(self, setup, run, p_FM):
        return setup
