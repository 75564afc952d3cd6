"""The errors that a simulated robot has: read from ``TRUTH.toml``, or drawn from the prior sizes."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal
from zlib import crc32

import numpy as np
from pydantic import Field, NonNegativeFloat

from planner.cell import Cell
from planner.errors import InputError, nearest
from planner.model import Model, Parameter
from planner.model.parameters import compliance_parameters
from planner.rig import rig_of
from planner.run import Samples
from planner.schema import Strict, read_toml
from planner.simulation.effects import Effect, EffectFile, effects_of
from planner.units import DEG, MM, UM, Array, frozen

SPELLINGS = {
    "m": {"mm": MM, "um": UM, "m": 1.0},
    "rad": {"deg": DEG, "mrad": 1e-3, "urad": 1e-6, "rad": 1.0},
    "rad/Nm": {"urad_Nm": 1e-6, "deg_Nm": DEG, "rad_Nm": 1.0},
}  # of a parameter's unit in a key, the first is how it is written
DIGITS = 9  # of a drawn error as it is written
EVERYTHING = frozenset({"fixture", "tool", "zero"})


class NoiseFile(Strict):
    """``[noise]``: in place of the cell's and the robot's own."""

    gauge_um: NonNegativeFloat | None = None
    repeatability_mm: NonNegativeFloat | None = None


class TruthFile(Strict):
    """The whole ``TRUTH.toml`` (schema ``edbb-truth/1``)."""

    schema_: Literal["edbb-truth/1"] = Field(alias="schema")
    errors: dict[str, float] = {}
    effects: tuple[EffectFile, ...] = ()
    noise: NoiseFile = NoiseFile()


@dataclass(frozen=True)
class Truth:
    """The robot and gauge as they are.

    Attributes:
        model: every error that may be named; its rig has the noise.
        errors: their values, (P,) in the parameters' units.
        effects: of the catalogue.
    """

    model: Model
    errors: Array
    effects: tuple[Effect, ...] = ()

    def complete(self) -> tuple[Model, Array]:
        """Return the model with the effects among its parameters, and all values."""
        more = [(p, v) for e in self.effects for p, v in zip(e.parameters, e.values, strict=True)]
        return self.model.plus([p for p, _ in more]), np.append(self.errors, [v for _, v in more])

    def lines(self) -> tuple[str, ...]:
        """Say every error that is not zero, every effect and the noise, as keys of ``TRUTH.toml``."""
        pairs = zip(self.model.parameters, self.errors, strict=True)
        said = [_line(p, float(v)) for p, v in pairs if v != 0.0]
        rig = self.model.rig
        return (
            *said,
            *(f"effects = {e.said}" for e in self.effects),
            f"gauge_um = {rig.noise / UM:.6g}",
            f"repeatability_mm = {rig.robot.repeatability / MM:.6g}",
        )


def read_truth(path: Path, cell: Cell, samples: Samples) -> Truth:
    """Read the errors of the robot in ``cell``; those not named are zero. Effects are those ``samples`` can show.

    Raises:
        InputError: a key that names no error of this cell, or has no unit, or a value that is no number.
    """
    file = read_toml(path, TruthFile)
    model = _model(_noisy(cell, file.noise))
    keys = {key: (k, factor) for k, p in enumerate(model.parameters) for key, factor in _keys(p)}
    errors = np.zeros(len(model.parameters))
    for key, value in file.errors.items():
        if key not in keys:
            raise InputError(f"{path}: 'errors.{key}' names no error{_hint(key, model, list(keys))}")
        k, factor = keys[key]
        if errors[k]:
            raise InputError(f"{path}: 'errors.{key}' gives {model.names[k]} a second time, in another unit")
        errors[k] = value * factor
    return Truth(model, frozen(errors), effects_of(path, file.effects, model.rig, samples))


def drawn(cell: Cell, seed: int) -> Truth:
    """Draw every error from its prior size, by its name: one robot in all cells of a seed.

    Joints give way in the direction of their load only.
    """
    model = _model(cell)
    drawn = [np.random.default_rng([seed, crc32(name.encode())]).standard_normal() for name in model.names]
    sizes = np.array(drawn) * model.prior
    gives = np.array([p.group == "joint compliance" for p in model.parameters])
    errors = np.where(gives, np.abs(sizes), sizes)
    short = [_rounded(p, float(v)) for p, v in zip(model.parameters, errors, strict=True)]
    return Truth(model, frozen(short))


def _model(cell: Cell) -> Model:
    rig = rig_of(cell)
    return Model.of(rig, EVERYTHING).plus(compliance_parameters(rig))


def _noisy(cell: Cell, noise: NoiseFile) -> Cell:
    gauge, robot = cell.gauge, cell.robot
    if noise.gauge_um is not None:
        gauge = replace(gauge, noise=noise.gauge_um * UM)
    if noise.repeatability_mm is not None:
        robot = replace(robot, repeatability=noise.repeatability_mm * MM)
    return replace(cell, gauge=gauge, robot=robot)


def _keys(p: Parameter) -> list[tuple[str, float]]:
    return [(f"{p.name}_{spelling}", factor) for spelling, factor in SPELLINGS[p.unit].items()]


def _hint(key: str, model: Model, known: list[str]) -> str:
    """Return how the error is written where only its unit is wrong, else the nearest key."""
    for p in model.parameters:
        if key == p.name or key.startswith(f"{p.name}_"):
            return f" with its unit; the {p.what} is written {' or '.join(k for k, _ in _keys(p))}"
    return nearest(key, known) or f" (there are {', '.join(model.names)}, each with its unit: a2_mm, theta3_deg)"


def _rounded(p: Parameter, value: float) -> float:
    """Return the value as its line says it."""
    factor = next(iter(SPELLINGS[p.unit].values()))
    return round(value / factor, DIGITS) * factor


def _line(p: Parameter, value: float) -> str:
    spelling, factor = next(iter(SPELLINGS[p.unit].items()))
    return f"{p.name}_{spelling} = {round(value / factor, DIGITS)!r}"
