"""The calibrated robot: its forward kinematics with the identified effects, and its files."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import PurePath

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import MeasurementSetup
from planner.cell.parts import STANDARD_GRAVITY
from planner.cell.placement import N_BASE_TRANSFORMS, RobotSetup
from planner.common.errors import InputError
from planner.common.schema import StrictModel
from planner.common.units import Array, read_only
from planner.documents.calibration import Calibration
from planner.effects.basis import BasisFunction
from planner.effects.context import Context
from planner.effects.effect import Parameter, ParameterMove
from planner.effects.phi_keys import belongs_to_gauge, functions_in, is_static, needs_loads, phi_from_key
from planner.effects.steps import SLIP, STEP
from planner.kinematics.robot import Loads, Robot, RobotEffect, ToolPoint
from planner.kinematics.robot_writer import RobotCorrections, mesh_files, write_robot
from planner.model.model import chunks
from planner.runs.run import Samples

OTHER_CAUSE = "what belongs to the gauge"


def uncorrected_text(effects: Iterable[RobotEffect]) -> str | None:
    """Return a sentence on effects that targets are not corrected for, with where each acts; ``None`` without any.

    Args:
        effects: those that hang on more than joint angles and loads.
    """
    where = dict[str, dict[str, list[int]]]()
    for e in effects:
        cause = next((f.uncorrected for f in functions_in(e.phi) if f.uncorrected), OTHER_CAUSE)
        part, number = _part(e.on)
        numbers = where.setdefault(cause, {}).setdefault(part, [])
        if number is not None and number not in numbers:
            numbers.append(number)
    if not where:
        return None
    causes = (f"{cause} ({'; '.join(_part_text(p, n) for p, n in parts.items())})" for cause, parts in where.items())
    return f"not corrected: {', '.join(causes)}: it depends on more than joint angles and loads"


def _part(transform: str) -> tuple[str, int | None]:
    """Return the part of the arm that a transform belongs to, and its number."""
    if transform.startswith("base"):
        return "base", None
    number = re.search(r"\d+", transform)
    if number is None:
        return "flange", None
    return "joint" if transform.startswith("theta") else "link", int(number[0])


def _part_text(part: str, numbers: list[int]) -> str:
    if not numbers:
        return part
    return f"{part}{'s' * (len(numbers) > 1)} {', '.join(str(n) for n in sorted(numbers))}"


CHUNK = 8192  # poses a pass
NO_LOADS = Loads(0.0, np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class CalibratedRobot:
    """A robot with those effects of its file that depend on joint angles and loads alone.

    Torques are those of the nominal geometry, as in the fit that found the compliances. On the corrected geometry the
    deflections would differ by about a thousandth of their size.

    Raises:
        InputError: an effect has a basis function that is unknown or does not fit, or loads are missing.
    """

    robot: Robot

    def __post_init__(self) -> None:
        """Check every effect, used or not."""
        _ = self._used_effects

    @property
    def uncorrected_effects(self) -> tuple[RobotEffect, ...]:
        """Effects that need more than joint angles and loads: speed, time, temperature, the place of the gauge."""
        return tuple(e for e in self.robot.effects if not e.static)

    @property
    def sentence(self) -> str | None:
        """The sentence that names the effects which the calibrated robot cannot hold; ``None`` where it holds all."""
        return uncorrected_text(self.uncorrected_effects)

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad]."""
        p, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for part in chunks(len(q), CHUNK):
            theta = self.robot.theta(q[part])
            motion = self._setup.chain.forward(theta, self._delta(q[part]))
            p[part], R[part] = motion.x.T, np.moveaxis(motion.R, 2, 0)
        return p, R

    def _delta(self, q: Array) -> list[float | Array]:
        """What the effects add to every transform of the setup's chain [m, rad]."""
        setup = self._nominal_setup
        context = Context(setup, Samples(q, np.zeros(len(q), dtype=int), payload=np.zeros(len(q))))
        known: dict[BasisFunction, Array] = {}
        out: list[float | Array] = [0.0] * len(self._setup.chain)
        for k, phi, value in self._used_effects:
            if phi not in known:
                known[phi] = phi(context)
            out[k] = out[k] + value * known[phi]
        return out

    @cached_property
    def _setup(self) -> RobotSetup:
        return loaded_robot(self.robot)

    @cached_property
    def _nominal_setup(self) -> RobotSetup:
        return replace(self._setup, robot=self.robot.nominal_robot)

    @cached_property
    def _used_effects(self) -> tuple[tuple[int, BasisFunction, float], ...]:
        """Transform, basis function and value of every effect that is used."""
        return tuple(self._check_effects())

    def _check_effects(self) -> Iterator[tuple[int, BasisFunction, float]]:
        names = [t.name for t in self._setup.chain.transforms[: N_BASE_TRANSFORMS + len(self.robot.transforms)]]
        for e in self.robot.effects:
            where = f"{self.robot.path}: effect '{e.name}'"
            try:
                phi = phi_from_key(e.phi, self.robot.n_joints)
            except InputError as err:
                raise InputError(f"{where}: {err}") from err
            if e.static:
                self._check_static(where, e)
                yield names.index(e.on), phi, e.value

    def _check_static(self, where: str, e: RobotEffect) -> None:
        if not is_static(e.phi):
            raise InputError(
                f"{where}: '{e.phi}' depends on more than joint angles and loads, so it needs static = false"
            )
        if needs_loads(e.phi) and self.robot.loads is None:
            raise InputError(
                f"{where}: '{e.phi}' depends on the loads, but the file has no [loads] "
                "(payload_kg, com_mm, base_rpy_deg)"
            )


class MovedBy(StrictModel):
    """A transform by its name, or a number of the reading, that a parameter in a file moves, and its basis function."""

    on: str
    phi: str


def describe_moves(p: Parameter, setup: MeasurementSetup) -> list[dict[str, str]]:
    """Return all that a parameter moves, as :class:`MovedBy` reads it."""
    named = ((f"reading {m.index}" if m.on == "reading" else setup.chain.transforms[m.index].name, m) for m in p.moves)
    return [{"on": on, "phi": m.phi.key} for on, m in named]


def effect_parameter(name: str, moves: Sequence[MovedBy], setup: MeasurementSetup) -> Parameter:
    """Return the parameter that a file describes.

    Raises:
        InputError: a basis function is unknown or does not fit.
        ValueError: the set-up has no such transform.
    """

    def move(m: MovedBy) -> ParameterMove:
        """Return the move that an entry of the file describes."""
        phi, (word, _, number) = phi_from_key(m.phi, setup.robot.n_joints), m.on.partition(" ")
        if word == "reading":
            return ParameterMove("reading", int(number), phi)
        return ParameterMove("transform", setup.chain.index(m.on), phi)

    return Parameter(name, "1", 1.0, name, tuple(move(m) for m in moves), "effect")


def loaded_robot(robot: Robot) -> RobotSetup:
    """Return the robot with the loads of its file."""
    loads = robot.loads or NO_LOADS
    R_WB = Rotation.from_euler("xyz", loads.base_rpy).as_matrix()
    return RobotSetup(robot, R_WB.T @ np.array([0.0, 0.0, -STANDARD_GRAVITY]), loads.payload, loads.com_F)


def calibrated_files(calibration: Calibration) -> tuple[tuple[str, str], ...]:
    """Return name and text of ``robot.toml`` and, for a robot given as URDF, of the corrected ``robot.urdf``.

    The geometry goes into the kinematic rows (or the URDF's origins), effects of the robot into ``[[effects]]`` and
    the loads that they were found under into ``[loads]``, the measured points of the tool, as they sit in the flange of
    this robot, into ``[[tool_points]]``. What else belongs to the gauge stays out. All else is as it was.

    Raises:
        InputError: the robot's own file can no longer be read.
    """
    robot = calibration.setup.robot
    effects = tuple(_effects(calibration))
    loads = _loads(calibration.setup) if effects else None
    geometry, points, simulated = (
        tuple(_geometry(calibration)),
        tuple(_tool_points(calibration)),
        bool(calibration.simulated),
    )
    why_not = calibration.reason_not_to_use
    found = RobotCorrections(geometry, effects, loads, _source(calibration), points, simulated, why_not)
    return write_robot(robot, found)


def calibrated_meshes(calibration: Calibration) -> tuple[tuple[str, bytes], ...]:
    """Return name (``meshes/…``) and content of the collision meshes that :func:`calibrated_files` refers to."""
    return mesh_files(calibration.setup.robot)


def _tool_points(c: Calibration) -> Iterator[ToolPoint]:
    for t in c.frames.tool:
        own, beside = (None if v is None else read_only(v) for v in (t.position_std, t.std_beside_robot))
        yield ToolPoint(t.name, read_only(t.p_FM), own, beside)


def _geometry(c: Calibration) -> Iterator[tuple[str, float]]:
    if c.released is None:
        yield from ((e.name, e.value) for e in c.estimates if e.group == "geometry" and e.value != e.nominal)
        return
    model = c.released.fit.model
    for p, error in zip(model.parameters, c.released.fit.errors, strict=True):
        if p.group == "geometry" and error != 0.0:
            yield p.name, model.setup.chain.transforms[p.main_move.index].nominal + float(error)


def _effects(c: Calibration) -> Iterator[RobotEffect]:
    """Effects on the base and the robot; a parameter that moves several transforms gives one entry for each."""
    fit = c.fit if c.released is None else c.released.fit
    chain, model = fit.setup.chain, fit.model
    end = N_BASE_TRANSFORMS + len(model.setup.robot.transforms)
    values = fit.values if c.released is None else c.released.effects
    for p in model.parameters:
        value = values.get(p.name, 0.0)
        for move in p.moves if p.name in values and p.is_effect else ():
            key = move.phi.key
            if move.on == "transform" and move.index < end and not belongs_to_gauge(key):
                on = chain.transforms[move.index].name
                yield RobotEffect(p.name, on, key, value, p.unit, is_static(key))


def _loads(setup: MeasurementSetup) -> Loads:
    """Return tool and base of a set-up; the rotation about the vertical leaves gravity as it is and stays zero."""
    return Loads(setup.tool_mass, read_only(setup.com_F), read_only(_tilt(setup.gravity_B)))


def _tilt(gravity_B: Array) -> Array:
    up = -gravity_B / np.linalg.norm(gravity_B)
    return np.array([np.arctan2(up[1], up[2]), np.arctan2(-up[0], np.hypot(up[1], up[2])), 0.0])


def _source(c: Calibration) -> str:
    found = c.stages[-1].effects if c.release is None else c.release.findings
    effects = [g for g in found if not g.startswith((f"{STEP}, ", f"{SLIP}, "))]
    what = "; ".join(["geometry", *effects])  # their names have commas inside
    if c.release is not None and c.release.basis == "posterior":
        what += "; and the posterior mean of the catalogue's other effects"
    return f"Identified from {PurePath(c.run.name).name}, {len(c.run)} samples: {what}."
