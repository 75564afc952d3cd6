"""A gauge: what it reads, how it stands, where it can read, what a person does; and its section of the cell file.

Each kind is one file in ``planner.gauges``, registered by ``register_gauge``, and has
:class:`planner.effects.gauge_unknowns.GaugeUnknowns` beside this. Everything else asks the gauge, and never its kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel

from planner.cell.file import CellFile, GaugeFile
from planner.cell.gauge_frames import GaugeFrames
from planner.cell.gauge_numbers import GaugeNumbers
from planner.cell.gauge_reach import GaugeReach
from planner.cell.gauge_reading import GaugeReading
from planner.cell.gauge_session import GaugeSession
from planner.cell.gauge_way import GaugeWay, check_reading_way, check_robot_rests
from planner.cell.parts import Fixture
from planner.common.choices import SetUp
from planner.common.errors import InputError
from planner.common.schema import validate
from planner.common.units import MM, UM, from_deg
from planner.kinematics.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Gauge(GaugeReading, GaugeNumbers, GaugeFrames, GaugeReach, GaugeSession, GaugeWay):
    """What every kind of gauge has and does, and how it is read from a cell file.

    Attributes:
        mounting: name of its set-up, which runs share that find it as the one before has left it; empty: none else has.
    """

    mounting: str = field(default="", compare=False)

    reads_moving: ClassVar[bool] = False  # whether it can be read while the robot moves
    validates_with: ClassVar[int] = 0  # poses of a plan that only validates, where no number is given; 0: it calibrates
    needs_range: ClassVar[bool] = True  # whether planning needs ``gauge.length_mm``
    usual_keys: ClassVar[Mapping[str, Mapping[str, object]]] = {}  # by section: they stand where the cell gives none
    usual_measure: ClassVar[Literal["continuous", "static"]] = "static"  # where the cell does not say
    usual_set_up: ClassVar[SetUp] = "measured"  # of its fixtures, where the cell does not say
    OwnKeys: ClassVar[type[BaseModel] | None] = None  # keys of ``[gauge]`` that only this kind has

    @classmethod
    def read(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> Self:
        """Return the gauge of a cell file; for identification alone its range may be missing.

        Raises:
            InputError: a key is missing, or contradicts another.
        """
        g = file.gauge
        if g.length_mm is None and planning and cls.needs_range:
            raise InputError(f"{path}: the key 'gauge.length_mm' is missing (shortest and longest length)")
        cls._check_noise(path, g)
        cls._check_scale(path, g)
        way = check_reading_way(path, file, cls)
        if planning:
            check_robot_rests(path, file, way)
        shortest, longest = g.length_mm or (0.0, np.inf)
        return cls(
            noise=(g.noise_um or cls.default_noise_um) * UM,
            stated_scale=None if g.scale_ppm is None else g.scale_ppm * 1e-6,
            noise_angle=float(from_deg(g.noise_mdeg * 1e-3)),
            length_min=shortest * MM,
            length_max=longest * MM,
            cone_fixture=float(from_deg(g.cone_deg.fixture)),
            cone_map=float(from_deg(g.cone_deg.map)),
            trim=g.body.trim_mm * MM,
            read_by=way,
            reading_time=g.reading_s or 0.0,
            **cls.read_own(path, robot, file, planning),
        )

    @staticmethod
    def noise_of_angles(g: GaugeFile) -> float | None:
        """Return the noise of its angles [mdeg], if it is another than the one that plans hold for every gauge."""
        return None if g.noise_mdeg == GaugeFile.model_fields["noise_mdeg"].default else g.noise_mdeg

    @classmethod
    def _check_noise(cls, path: Path, g: GaugeFile) -> None:
        """Refuse the noise of what it does not read."""
        if g.noise_um is not None and cls.angles == cls.width:
            raise InputError(
                f"{path}: 'gauge.noise_um' = {g.noise_um:g}: the gauge '{cls.kind}' reads no length; the noise of its "
                "angles is 'gauge.noise_mdeg'"
            )
        reads_angles = cls.angles > 0 or cls.with_turns is not Gauge.with_turns
        if (given := cls.noise_of_angles(g)) is not None and not reads_angles:
            raise InputError(
                f"{path}: 'gauge.noise_mdeg' = {given:g}: the gauge '{cls.kind}' reads no angle; the noise of "
                "its lengths is 'gauge.noise_um'"
            )

    @classmethod
    def _check_scale(cls, path: Path, g: GaugeFile) -> None:
        """Refuse the scale of lengths of a gauge that reads none."""
        if g.scale_ppm is not None and cls.angles == cls.width:
            raise InputError(f"{path}: 'gauge.scale_ppm' = {g.scale_ppm:g}: the gauge '{cls.kind}' reads no length")

    @classmethod
    def read_own(cls, path: Path, robot: Robot, file: CellFile, planning: bool) -> dict[str, Any]:
        """Return the fields that only this kind has, from ``OwnKeys`` or from sections of the cell file."""
        own = cls.OwnKeys
        return {} if own is None else dict(validate(file.gauge.own, own, f"{path}: [gauge]"))

    @classmethod
    def read_places(cls, path: Path, robot: Robot, file: CellFile) -> tuple[Fixture, ...]:
        """Return the places at which it stands, for planning; an ideal gauge stands nowhere.

        Raises:
            InputError: a section is missing, or one is there that this gauge has no use for.
        """
        return ()

    def with_turns(self, turns: bool) -> "Gauge":
        """Return the gauge that reads orientations as well, where ``turns``: some can, and no cell file says so."""
        return self

    @property
    def travel_name(self) -> str:
        """What the path from home is called."""
        return f"path without the {self.noun}" if self.is_attached else "path to the start"

    @property
    def without_gauge_text(self) -> str:
        """What a program says behind the name of that path."""
        return f", without the {self.noun}" if self.is_attached else ""
