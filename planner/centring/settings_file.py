"""Settings as given, completed by what the cell beside the plan says."""

from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
from pydantic import PositiveFloat

from planner.bodies import Vector
from planner.centring.settings import Settings
from planner.errors import InputError
from planner.plan.header import Loose
from planner.schema import Strict, read_toml

S = TypeVar("S", bound=Strict)


class _Head(Loose):
    indicators: tuple[Vector, Vector, Vector] | None = None
    usable_mm: PositiveFloat = 5.0


class _Gauge(Loose):
    head: _Head = _Head()


class _Artifact(Loose):
    rpy_deg: Vector = (0.0, 0.0, 0.0)


class _Controller(Loose):
    tool: int | None = None
    base: int | None = None


class CellPart(Loose):
    """What the cell says of the head, the plate and the controller."""

    gauge: _Gauge = _Gauge()
    artifact: _Artifact = _Artifact()
    controller: _Controller = _Controller()


def read_settings(path: Path | None, cell: Path) -> Settings:
    """Read the settings at ``path``, the defaults where there is none; what it leaves out the ``cell`` may say.

    Raises:
        InputError: a file is missing, is no TOML, or a key is wrong; or the cell should say how the head stands.
    """
    given = Settings() if path is None else read_toml(path, Settings)
    found = read_toml(cell, CellPart) if cell.is_file() else CellPart()
    head, numbers = found.gauge.head, found.controller
    robot: dict[str, object] = {"plate_rpy_deg": found.artifact.rpy_deg}
    robot |= {k: v for k, v in (("tool", numbers.tool), ("base", numbers.base)) if v is not None}
    said: dict[str, object] = {"usable_mm": head.usable_mm}
    if given.head.tool_frame == "flange" and given.head.matrix is None:
        if head.indicators is None:
            raise InputError(
                f"{cell}: 'gauge.head.indicators' is missing; it says how the indicators stand in the flange, which "
                "'tool_frame' = \"flange\" needs"
            )
        axes = np.array(head.indicators)
        said["matrix"] = tuple(map(tuple, (axes / np.linalg.norm(axes, axis=1)[:, None]).T.tolist()))
    return given.model_copy(
        update={"head": _filled(given.head, said), "robot": _filled(given.robot, robot)},
    )


def _filled(section: S, said: Mapping[str, object]) -> S:
    """Take over what the cell says, except where the settings say it themselves."""
    return section.model_copy(update={k: v for k, v in said.items() if k not in section.model_fields_set})
