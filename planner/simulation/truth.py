"""The true errors and effects of a simulated robot: read from ``TRUTH.toml``, or drawn from their priors."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal
from zlib import crc32

import numpy as np
from pydantic import Field, NonNegativeFloat

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.placement import FREEABLE
from planner.common.errors import InputError, did_you_mean
from planner.common.files import read_utf8
from planner.common.schema import StrictModel, read_toml, validate
from planner.common.units import MM, UM, Array, read_only, si_unit
from planner.design.free_parameters import expected_effects
from planner.effects.catalogue import catalogue
from planner.effects.compliance import compliance_parameters, is_joint_compliance
from planner.effects.effect import Effect, Parameter, parameter_keys, unit_spellings
from planner.effects.usual_errors import TYPICAL_FACTOR, is_usual, usual_factors
from planner.model.model import Model
from planner.runs.run import SIMULATED, Samples
from planner.simulation.set_up import (
    UncalibratedBound,
    bound_uncalibrated_errors,
    place_fixtures_by_robot,
    set_up_sizes,
)


class TruthEffectFile(StrictModel):
    """``[[effects]]``: a kind of the catalogue, on what it acts, its value (several where it has several parameters).

    ``inner`` is a number inside the basis function, for instance a frequency, in the unit that the catalogue gives it.
    """

    kind: str
    on: str | None = None
    value: float | tuple[float, ...]
    unit: str
    inner: float | None = None


@dataclass(frozen=True)
class TrueEffect:
    """Parameters of one effect with their values in SI units; ``said`` as the file says it."""

    parameters: tuple[Parameter, ...]
    values: tuple[float, ...]
    said: str


def effects_from_file(
    path: Path | str,
    files: tuple[TruthEffectFile, ...],
    setup: MeasurementSetup,
    samples: Samples,
    more: Sequence[Effect] = (),
) -> tuple[TrueEffect, ...]:
    """Return the effects that the file asks for: those of the catalogue that the samples can show, and ``more``.

    Raises:
        InputError: a kind that the catalogue does not have, or this run cannot show; a value or unit that does not fit.
    """
    if not files:
        return ()
    offered = (*catalogue(setup, samples), *more)
    return tuple(_read_effect(f"{path}: [[effects]] number {k}", f, offered) for k, f in enumerate(files, start=1))


def _read_effect(where: str, file: TruthEffectFile, offered: tuple[Effect, ...]) -> TrueEffect:
    effect = _find_effect(where, file, offered)
    if (file.inner is None) != (effect.nonlinear is None):
        wanted = "takes no 'inner'" if effect.nonlinear is None else f"needs 'inner', its {effect.nonlinear.name}"
        unit = "" if effect.nonlinear is None else f" [{effect.nonlinear.unit}]"
        raise InputError(f"{where}: {effect.name} {wanted}{unit}")
    parameters = effect.make(file.inner)
    values = file.value if isinstance(file.value, tuple) else (file.value,)
    if len(values) > len(parameters) or (len(values) < len(parameters) and isinstance(file.value, tuple)):
        names = ", ".join(p.name for p in parameters)
        raise InputError(f"{where}: {len(values)} values found, {effect.name} has {len(parameters)} ({names})")
    values += (0.0,) * (len(parameters) - len(values))
    factor = _unit_factor(where, file.unit, parameters[0].unit)
    return TrueEffect(parameters, tuple(v * factor for v in values), _describe_effect(effect, file))


def _describe_effect(effect: Effect, file: TruthEffectFile) -> str:
    inner = "" if file.inner is None else f", inner = {file.inner:g}"
    value = list(file.value) if isinstance(file.value, tuple) else file.value
    return f'{{kind = "{effect.kind}", on = "{effect.place}", value = {value}, unit = "{file.unit}"{inner}}}'


def _find_effect(where: str, file: TruthEffectFile, offered: tuple[Effect, ...]) -> Effect:
    of_kind = [e for e in offered if e.kind == file.kind]
    if not of_kind:
        known = list(dict.fromkeys(e.kind for e in offered))
        raise InputError(
            f"{where}: kind = '{file.kind}' is no effect that this run could show{did_you_mean(file.kind, known)} "
            f"(there are: {', '.join(known)})"
        )
    there = [str(e.place) for e in of_kind]
    if file.on is None and len(of_kind) > 1:
        raise InputError(f"{where}: the key 'on' is missing; {file.kind} may act on {', '.join(there)}")
    if file.on is not None and file.on not in there:
        raise InputError(
            f"{where}: on = '{file.on}'{did_you_mean(file.on, there)} ({file.kind} acts on {', '.join(there)})"
        )
    return of_kind[0 if file.on is None else there.index(file.on)]


def _unit_factor(where: str, unit: str, wanted: str) -> float:
    try:
        si, factor = si_unit(unit)
    except ValueError as err:
        raise InputError(f"{where}: unit = '{unit}': {err}") from err
    if si != wanted:
        raise InputError(f"{where}: unit = '{unit}' is {si}, but a value in {wanted} is needed")
    return factor


TRUTH_LINE = "# truth: "  # of a simulated run begins a line that says what is true
WRITTEN_DECIMALS = 9  # of a drawn error as it is written


class NoiseFile(StrictModel):
    """``[noise]``: in place of the cell's and the robot's own."""

    gauge_um: NonNegativeFloat | None = None
    repeatability_mm: NonNegativeFloat | None = None


class TruthFile(StrictModel):
    """The whole ``TRUTH.toml`` (schema ``edbb-truth/1``)."""

    schema_: Literal["edbb-truth/1"] = Field(alias="schema")
    errors: dict[str, float] = {}
    effects: tuple[TruthEffectFile, ...] = ()
    noise: NoiseFile = NoiseFile()


@dataclass(frozen=True)
class Truth:
    """The robot and gauge as they are.

    Attributes:
        model: every error that may be named; its setup has the noise.
        errors: their values, (P,) in the parameters' units.
        effects: of the catalogue.
        bound: by which errors that were drawn were made smaller, where the cell says how large they are at most.
    """

    model: Model
    errors: Array
    effects: tuple[TrueEffect, ...] = ()
    bound: UncalibratedBound | None = None

    def complete_model(self) -> tuple[Model, Array]:
        """Return the model with the effects among its parameters, and all values."""
        more = [(p, v) for e in self.effects for p, v in zip(e.parameters, e.values, strict=True)]
        return self.model.plus([p for p, _ in more]), np.append(self.errors, [v for _, v in more])

    def lines(self) -> tuple[str, ...]:
        """Say how it was drawn, then every error but zeros, every effect and the noise, as keys of ``TRUTH.toml``."""
        pairs = zip(self.model.parameters, self.errors, strict=True)
        said = [_format_error(p, float(v)) for p, v in pairs if v != 0.0]
        setup = self.model.setup
        return (
            *(() if self.bound is None else (f"# {self.bound.text}",)),
            *said,
            *([f"effects = [{', '.join(e.said for e in self.effects)}]"] if self.effects else []),
            f"gauge_um = {setup.gauge.noise / UM:.6g}",
            f"repeatability_mm = {setup.robot.repeatability / MM:.6g}",
        )


def read_truth(path: Path | Mapping[str, Any], cell: Cell, samples: Samples, change: str = "") -> Truth:
    """Read the errors of the robot in ``cell``; those not named are zero. Effects are those ``samples`` can show.

    Args:
        path: a ``TRUTH.toml``, or a simulated run as CSV, which says what is true of its robot; or the content of a
            truth, or of its errors alone, as a mapping: ``{"theta2_deg": 0.1, "a3_mm": -0.4}``.
        cell: of the robot.
        samples: to be measured.
        change: ``KEY=VALUE``, added to the error of this key.

    Raises:
        InputError: a key that names no error of this cell, or has no unit, or a value that is no number; a run that
            was not simulated.
    """
    where = "truth" if isinstance(path, Mapping) else str(path)
    if isinstance(path, Mapping):
        whole = path.keys() & {"errors", "effects", "noise", "schema"}
        content = dict(path) if whole else {"errors": dict(path)}
        file = validate({"schema": "edbb-truth/1", **content}, TruthFile, where)
    else:
        file = _truth_of_run(path) if path.suffix.lower() == ".csv" else read_toml(path, TruthFile)
    if change:
        file = _add_change(file, change)
    model = _truth_model(_with_noise(cell, file.noise))
    keys = {key: (k, factor) for k, p in enumerate(model.parameters) for key, factor in parameter_keys(p)}
    errors = np.zeros(len(model.parameters))
    for key, value in file.errors.items():
        if key not in keys:
            raise InputError(f"{where}: 'errors.{key}' names no error{_key_hint(key, model, list(keys))}")
        k, factor = keys[key]
        if errors[k]:
            raise InputError(f"{where}: 'errors.{key}' gives {model.names[k]} a second time, in another unit")
        errors[k] = value * factor
    # another run of the same robot may have shown what these samples do not: one pose leaves nothing out
    runs = (Samples.at(cell.home[None]), samples)
    more = {e.name: e for run in runs for e in expected_effects(cell, model.setup, run)} if file.effects else {}
    effects = effects_from_file(where, file.effects, model.setup, samples, tuple(more.values()))
    return Truth(model, read_only(errors), effects)


def _truth_of_run(path: Path) -> TruthFile:
    """Read what the comment lines of a simulated run say."""
    lines = [line.removeprefix(TRUTH_LINE) for line in read_utf8(path).splitlines() if line.startswith(TRUTH_LINE)]
    if SIMULATED not in lines:
        raise InputError(
            f"{path}: no line '{TRUTH_LINE}{SIMULATED}'; only a simulated run says what is true of its robot"
        )
    try:
        said = [tomllib.loads(line) for line in lines if line != SIMULATED]
    except tomllib.TOMLDecodeError as err:
        raise InputError(f"{path}: a line '{TRUTH_LINE}…' is not as it was written: {err}") from err
    errors = {key: value for line in said for key, value in line.items() if key != "effects"}
    noise = {key: errors.pop(key) for key in NoiseFile.model_fields if key in errors}
    lists = [line["effects"] for line in said if "effects" in line]
    effects = [e for each in lists for e in (each if isinstance(each, list) else [each])]  # one a line in older files
    content = {"schema": "edbb-truth/1", "errors": errors, "effects": effects, "noise": noise}
    return validate(content, TruthFile, str(path))


def _add_change(file: TruthFile, change: str) -> TruthFile:
    key, _, value = change.partition("=")
    try:
        changed = file.errors.get(key, 0.0) + float(value)
    except ValueError:
        raise InputError(f"--change {change}: is not KEY=VALUE with a number, as in theta3_deg=0.2") from None
    return file.model_copy(update={"errors": file.errors | {key: changed}})


def draw_expected_truth(cell: Cell, seed: int, samples: Samples) -> Truth:
    """Draw a robot as the plan that measures ``samples`` expects it: :func:`draw_truth` with all of its forecast.

    Of what every robot has in some size it has little, or rarely much, as the forecast counts.
    """
    return draw_truth(cell, seed, [_draw_size(e, seed) for e in expected_effects(cell, setup_of(cell), samples)])


def _draw_size(effect: Effect, seed: int) -> Effect:
    """Return an effect with the size that a robot has of it, where robots differ much in that."""
    own, (factors, probability) = effect.make(), usual_factors()
    family = own[0].group
    if not is_usual(family):
        return effect
    drawn = np.random.default_rng([seed, crc32(family.encode())]).choice(factors, p=probability) / TYPICAL_FACTOR
    return replace(effect, parameters=tuple(p.with_prior(p.prior * drawn) for p in own))


def draw_truth(cell: Cell, seed: int, more: Sequence[Effect] = ()) -> Truth:
    """Draw every error from its prior sigma, by its name: one robot in all cells of a seed.

    Where the cell says how far a robot errs at most before calibration, that robot's errors are made smaller by one
    factor (:mod:`planner.simulation.set_up`): the same arm, built with more care. Joints give way in the
    direction of their load only. Fixtures that are set up by the robot stand where it truly comes, see
    :mod:`planner.simulation.set_up`.
    """
    plain = _truth_model(cell)
    model = plain.plus([p for effect in more for p in effect.make()])
    drawn = [np.random.default_rng([seed, crc32(name.encode())]).standard_normal() for name in model.names]
    sizes = np.array(drawn) * set_up_sizes(cell, model)
    gives = np.array([is_joint_compliance(p) for p in model.parameters])
    errors = np.where(gives, np.abs(sizes), sizes)
    if bound := bound_uncalibrated_errors(cell, model, errors):
        errors = np.where([p.group == "gauge" for p in model.parameters], errors, bound.factor * errors)
    errors = place_fixtures_by_robot(cell, model, errors)
    own = len(plain.parameters)
    short = [_round_value(p, float(v)) for p, v in zip(plain.parameters, errors[:own], strict=True)]
    ends = own + np.cumsum(np.array([len(effect.make()) for effect in more], dtype=int))
    values = np.split(errors[own:], ends[:-1] - own)
    effects = tuple(_drawn_effect(e, v) for e, v in zip(more, values, strict=False))
    return Truth(plain, read_only(short), effects, bound)


def _drawn_effect(effect: Effect, values: Array) -> TrueEffect:
    """Return an effect with these values [rad], as a line of ``TRUTH.toml`` writes them."""
    short = tuple(round(float(v) / 1e-6, 4) for v in values)  # [µrad]
    file = TruthEffectFile(kind=effect.kind, on=str(effect.place), value=short, unit="urad")
    return TrueEffect(effect.make(), tuple(v * 1e-6 for v in short), _describe_effect(effect, file))


def _truth_model(cell: Cell) -> Model:
    setup = setup_of(cell)
    return Model.of(setup, FREEABLE).plus(compliance_parameters(setup))


def _with_noise(cell: Cell, noise: NoiseFile) -> Cell:
    gauge, robot = cell.gauge, cell.robot
    if noise.gauge_um is not None:
        gauge = replace(gauge, noise=noise.gauge_um * UM)
    if noise.repeatability_mm is not None:
        robot = replace(robot, repeatability=noise.repeatability_mm * MM)
    return replace(cell, gauge=gauge, robot=robot)


def _key_hint(key: str, model: Model, known: list[str]) -> str:
    """Return how the error is written where only its unit is wrong, else the nearest key."""
    for p in model.parameters:
        if key == p.name or key.startswith(f"{p.name}_"):
            return f" with its unit; the {p.what} is written {' or '.join(k for k, _ in parameter_keys(p))}"
    return did_you_mean(key, known) or f" (there are {', '.join(model.names)}, each with its unit: a2_mm, theta3_deg)"


def _round_value(p: Parameter, value: float) -> float:
    """Return the value as its line says it."""
    factor = next(iter(unit_spellings(p).values()))
    return round(value / factor, WRITTEN_DECIMALS) * factor


def _format_error(p: Parameter, value: float) -> str:
    spelling, factor = next(iter(unit_spellings(p).items()))
    return f"{p.name}_{spelling} = {round(value / factor, WRITTEN_DECIMALS)!r}"
