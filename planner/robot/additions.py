"""What a calibration adds to ``robot.toml``: effects beyond geometry, the loads they go with, what was nominal."""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, field_validator

from planner.bodies import Vector
from planner.chain import Transform
from planner.errors import InputError, nearest
from planner.robot.model import BASE, Loads, RobotEffect
from planner.schema import Strict
from planner.units import DEG, MM, UM, from_deg, from_mm, frozen

SIZES = {"mm": ("m", MM), "um": ("m", UM), "deg": ("rad", DEG), "urad": ("rad", 1e-6)}  # beside the SI units themselves
WORDS = ("m", "rad", "s", "kg", "N", "Nm", "degC", "K", "turn", "1")


class EffectFile(Strict):
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


class LoadsFile(Strict):
    """The ``[loads]`` table: tool and base as they were when the effects were found."""

    payload_kg: Annotated[float, Field(ge=0)] = 0.0
    com_mm: Vector = (0.0, 0.0, 0.0)
    base_rpy_deg: Vector = (0.0, 0.0, 0.0)


def si_unit(unit: str) -> tuple[str, float]:
    """Return the SI unit of a unit such as ``urad/Nm``, and the factor to it: ``rad/Nm``, 1e-6.

    Raises:
        ValueError: a part of it is no unit that is known here.
    """
    first, rest = _split(unit)
    known = [*WORDS, *SIZES]
    for word, allowed in [(first, known), *((w, list(WORDS)) for w in re.split("[/·]", rest)[1:])]:
        if word not in allowed:
            raise ValueError(f"'{word}' is no unit{nearest(word, allowed)} (allowed: {', '.join(allowed)})")
    word, factor = SIZES.get(first, (first, 1.0))
    return word + rest, factor


def file_unit(unit: str) -> str:
    """Return the unit in which files give a value of the SI ``unit``: mm and deg, but um and urad per something."""
    first, rest = _split(unit)
    shown = {"m": "um", "rad": "urad"} if rest else {"m": "mm", "rad": "deg"}
    return shown.get(first, first) + rest


def _split(unit: str) -> tuple[str, str]:
    first = re.split("[/·]", unit)[0]
    return first, unit[len(first) :]


def effects_of(path: Path, tables: tuple[EffectFile, ...], rows: tuple[Transform, ...]) -> tuple[RobotEffect, ...]:
    """Return the effects in SI units.

    Raises:
        InputError: an effect acts on no transform of this robot.
    """
    known = [*(t.name for t in rows), *BASE]
    out = []
    for k, e in enumerate(tables, 1):
        if e.on not in known:
            raise InputError(
                f"{path}: effect {k} '{e.name}' acts on '{e.on}', which is no transform of this robot"
                f"{nearest(e.on, known)} (there are: {', '.join(known)})"
            )
        unit, factor = si_unit(e.unit)
        out.append(RobotEffect(e.name, e.on, e.phi, e.value * factor, unit, e.static))
    return tuple(out)


def loads_of(file: LoadsFile | None) -> Loads | None:
    """Return the loads in SI units."""
    if file is None:
        return None
    return Loads(file.payload_kg, frozen(from_mm(file.com_mm)), frozen(from_deg(file.base_rpy_deg)))


def nominal_of(path: Path, table: Mapping[str, float], rows: tuple[Transform, ...]) -> tuple[Transform, ...]:
    """Return the transforms of the controller's own model: ``rows`` with the values of the ``[nominal]`` table.

    Raises:
        InputError: a key names no transform of this robot with its unit.
    """
    known = {nominal_key(t): t.name for t in rows}
    values = {}
    for key, value in table.items():
        if key not in known:
            raise InputError(
                f"{path}: nominal.{key} names no transform of this robot{nearest(key, list(known))} "
                f"(there are: {', '.join(known)})"
            )
        values[known[key]] = value * (MM if key.endswith("_mm") else DEG)
    return tuple(replace(t, nominal=values.get(t.name, t.nominal)) for t in rows)


def nominal_key(t: Transform) -> str:
    """Return the key of a transform in the ``[nominal]`` table: ``a2_mm``, ``theta2_deg``."""
    return f"{t.name}_{'mm' if t.kind == 'translation' else 'deg'}"
