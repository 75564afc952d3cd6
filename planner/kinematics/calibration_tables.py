"""What a calibration adds to ``robot.toml``: effects beyond geometry, the loads they go with, what was nominal."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator

from planner.common.errors import InputError, did_you_mean
from planner.common.schema import StrictModel
from planner.common.units import DEG, MM, from_deg, from_mm, read_only, si_unit
from planner.kinematics.bodies import Vector
from planner.kinematics.chain import Transform
from planner.kinematics.robot import BASE_TRANSFORMS, Loads, RobotEffect


class RobotEffectTable(StrictModel):
    """One ``[[effects]]`` table: what is added to the elementary transform ``on`` is ``value`` times ``phi``."""

    name: str
    on: str
    phi: str
    value: float
    unit: str
    static: bool = True

    @field_validator("unit")
    @classmethod
    def _known(cls, value: str) -> str:
        si_unit(value)
        return value


class LoadsTable(StrictModel):
    """The ``[loads]`` table: tool and base as they were when the effects were found."""

    payload_kg: Annotated[float, Field(ge=0)] = 0.0
    com_mm: Vector = (0.0, 0.0, 0.0)
    base_rpy_deg: Vector = (0.0, 0.0, 0.0)


def effects_from_tables(
    path: Path, tables: tuple[RobotEffectTable, ...], rows: tuple[Transform, ...]
) -> tuple[RobotEffect, ...]:
    """Return the effects in SI units.

    Raises:
        InputError: an effect acts on no transform of this robot.
    """
    known = [*(t.name for t in rows), *BASE_TRANSFORMS]
    out = []
    for k, e in enumerate(tables, 1):
        if e.on not in known:
            raise InputError(
                f"{path}: effect {k} '{e.name}' acts on '{e.on}', which is no transform of this robot"
                f"{did_you_mean(e.on, known)} (there are: {', '.join(known)})"
            )
        unit, factor = si_unit(e.unit)
        out.append(RobotEffect(e.name, e.on, e.phi, e.value * factor, unit, e.static))
    return tuple(out)


def loads_from_table(file: LoadsTable | None) -> Loads | None:
    """Return the loads in SI units."""
    if file is None:
        return None
    return Loads(file.payload_kg, read_only(from_mm(file.com_mm)), read_only(from_deg(file.base_rpy_deg)))


def nominal_from_table(path: Path, table: Mapping[str, float], rows: tuple[Transform, ...]) -> tuple[Transform, ...]:
    """Return the transforms of the controller's own model: ``rows`` with the values of the ``[nominal]`` table.

    Raises:
        InputError: a key names no transform of this robot with its unit.
    """
    known = {nominal_key(t): t.name for t in rows}
    values = {}
    for key, value in table.items():
        if key not in known:
            raise InputError(
                f"{path}: nominal.{key} names no transform of this robot{did_you_mean(key, list(known))} "
                f"(there are: {', '.join(known)})"
            )
        values[known[key]] = value * (MM if key.endswith("_mm") else DEG)
    return tuple(replace(t, nominal=values.get(t.name, t.nominal)) for t in rows)


def nominal_key(t: Transform) -> str:
    """Return the key of a transform in the ``[nominal]`` table: ``a2_mm``, ``theta2_deg``."""
    return f"{t.name}_{'mm' if t.kind == 'translation' else 'deg'}"
