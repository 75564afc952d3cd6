"""Reads ``robot.toml`` (and URDF) into a :class:`Robot`, with every check that a typing error deserves."""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder
from planner.common.schema import Coordinate, OneLine, PositiveFloat, StrictModel, read_toml, validate
from planner.common.units import DEG, MM, Array, from_deg, from_mm, read_only
from planner.kinematics.axes import AxisConvention, ControllerTable, JointRange, convention_from_table
from planner.kinematics.bodies import LinkBodyFile, Vector
from planner.kinematics.chain import Transform, dh_row, frame_transforms, is_near_parallel
from planner.kinematics.packages import COMMAND_PACKAGES, NO_PACKAGES, Packages, named_packages
from planner.kinematics.robot import LinkMass, Priors, Robot
from planner.kinematics.robot_numbers import (
    LinkMassKg,
    PayloadKg,
    ReachMm,
    RepeatabilityMm,
    check_joint_limits,
    check_reach,
)
from planner.kinematics.robot_tables import (
    LENGTHS,
    ROW_KEYS,
    LoadsTable,
    RobotEffectTable,
    ToolPointTable,
    effects_from_tables,
    loads_from_table,
    nominal_from_table,
    read_dh_table,
)
from planner.kinematics.srdf import NEXT_BUT_ONE, read_allowed_pairs
from planner.kinematics.urdf import UrdfChain, UrdfJoint, is_urdf, plain_name, read_urdf

FEWEST_JOINTS = 5
SPEED_TIME = 0.25  # [s] to full speed, and the ratio acceleration/jerk, where a file leaves them unsaid


class JointTable(StrictModel):
    """One ``[[joints]]`` table, from base to flange; ``name`` as the arm's own software calls the joint."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z][\w/.-]*$")] = ""
    alpha_deg: Coordinate | None = None
    a_mm: Coordinate | None = None
    d_mm: Coordinate | None = None
    theta_deg: Coordinate | None = None
    beta_deg: Coordinate | None = None
    sense: Literal[1, -1] = 1
    zero_deg: Coordinate = 0.0
    couple: dict[int, Coordinate] = {}
    limit_deg: tuple[Coordinate, Coordinate] | None = None  # these four may be left out where nothing is planned
    speed_deg_s: PositiveFloat | None = None
    acceleration_deg_s2: PositiveFloat | None = None
    jerk_deg_s3: Annotated[float, Field(gt=0, le=1e9)] | None = None
    gear_ratio: PositiveFloat | None = None
    mass_kg: LinkMassKg | None = None
    com_mm: Vector | None = None

    @field_validator("limit_deg")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        if value is None:
            return None
        if value[0] >= value[1]:
            raise ValueError("the lower limit must lie below the upper one")
        if max(abs(v) for v in value) <= 2 * np.pi + 1e-9:
            raise ValueError("these look like radians; limits are in degrees")
        return value

    @classmethod
    def from_urdf(cls, joint: UrdfJoint) -> "JointTable":
        """Return what a URDF says of a joint."""
        lower, upper, speed = (float(np.rad2deg(v)) for v in (joint.lower, joint.upper, joint.speed))
        return cls.model_construct(  # limits of a few degrees are right in a file that has radians
            sense=joint.sense,
            limit_deg=(lower, upper),
            speed_deg_s=speed,
            name=joint.name,
        )

    def with_estimates(self) -> "JointTable":
        """Return the joint with acceleration and jerk, each where it is unsaid estimated from the speed."""
        if self.speed_deg_s is None:
            return self
        acceleration = self.acceleration_deg_s2 or self.speed_deg_s / SPEED_TIME
        jerk = self.jerk_deg_s3 or acceleration / SPEED_TIME
        return self.model_copy(update={"acceleration_deg_s2": acceleration, "jerk_deg_s3": jerk})

    @property
    def row(self) -> dict[str, float]:
        """The joint's row of DH parameters, those that are given [m, rad]."""
        given = {key: getattr(self, name) for key, name in ROW_KEYS.items()}
        return {key: v * (MM if key in LENGTHS else DEG) for key, v in given.items() if v is not None}

    @property
    def mass(self) -> LinkMass | None:
        """Mass and centre of mass of the link, where they are given."""
        if self.mass_kg is None:
            return None
        return LinkMass(self.mass_kg, read_only(from_mm(self.com_mm or (0, 0, 0))))


class FlangeTable(StrictModel):
    """The fixed transform after the last row."""

    position_mm: Vector = (0.0, 0.0, 0.0)
    rpy_deg: Vector = (0.0, 0.0, 0.0)


class PriorsTable(StrictModel):
    """``[priors]``: one-sigma sizes of a robot's errors before it is calibrated."""

    length_mm: PositiveFloat = 1.0
    angle_deg: PositiveFloat = 0.0573
    compliance_urad_Nm: PositiveFloat = 2.0

    def priors(self) -> Priors:
        """Return them in SI units."""
        return Priors(self.length_mm * MM, float(from_deg(self.angle_deg)), self.compliance_urad_Nm * 1e-6)


class RobotDescription(StrictModel):
    """The whole ``robot.toml`` (schema ``edbb-robot/1``)."""

    schema_: Literal["edbb-robot/1"] = Field(alias="schema")
    name: OneLine
    title: OneLine = ""
    convention: Literal["dh", "mdh", "urdf"]
    urdf: str | None = None
    srdf: str | None = None
    tip: str | None = None
    packages: dict[str, str] = {}  # folders of ROS packages that the URDF names
    repeatability_mm: RepeatabilityMm = 0.05
    dialect: str | None = None
    payload_kg: PayloadKg | None = None
    reach_mm: ReachMm | None = None
    sources: dict[str, str] = {}
    flange: FlangeTable = FlangeTable()
    priors: PriorsTable = PriorsTable()
    joints: tuple[JointTable, ...] = ()
    bodies: tuple[LinkBodyFile, ...] = ()
    never_meet: tuple[tuple[int, int], ...] = ()
    never_meet_reason: str = ""
    effects: tuple[RobotEffectTable, ...] = ()
    loads: LoadsTable | None = None
    nominal: dict[str, float] = {}
    tool_points: tuple[ToolPointTable, ...] = ()
    simulated: bool | None = None
    controllers: dict[Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")], ControllerTable] = {}

    @model_validator(mode="after")
    def _complete(self) -> "RobotDescription":
        apart = [pair for pair in self.never_meet if abs(pair[0] - pair[1]) != NEXT_BUT_ONE]
        if apart:
            raise ValueError(
                f"never_meet = {[list(p) for p in apart]}: only links next but one may be left out (neighbours always "
                "are); others that touch are a collision"
            )
        if self.never_meet and not self.never_meet_reason.strip():
            raise ValueError("never_meet needs never_meet_reason: what keeps those links apart")
        if self.srdf is not None and (self.convention != "urdf" or self.never_meet):
            raise ValueError("srdf stands for never_meet of a URDF: give one of the two")
        if self.convention == "urdf":
            if self.urdf is None:
                raise ValueError('convention "urdf" needs urdf = "file.urdf"')
            return self
        for i, joint in enumerate(self.joints, 1):
            gone = [k for k in ("alpha_deg", "a_mm", "d_mm", "theta_deg") if getattr(joint, k) is None]
            if gone:
                raise ValueError(f"joint {i} has no {', '.join(gone)}, which convention '{self.convention}' needs")
            wrong = [j for j in joint.couple if not 1 <= j <= len(self.joints)]
            if wrong:
                raise ValueError(f"joint {i} is coupled to joint {wrong[0]}, but there are {len(self.joints)} joints")
        far = [b.link for b in self.bodies if b.link > len(self.joints)]
        if far:
            raise ValueError(f"a body sits on link {far[0]}, but the last link is {len(self.joints)}")
        return self


def list_robots() -> tuple[str, ...]:
    """Names of the robots that come with the planner."""
    return tuple(sorted(p.parent.name for p in data_folder("robots").glob("*/robot.toml")))


def load_robot(
    reference: str | Path,
    beside: Path = Path(),
    tip: str | None = None,
    beta: str = "auto",
    packages: Packages = NO_PACKAGES,
) -> Robot:
    """Load a robot by shipped name, or by path to a ``robot.toml``, ``.urdf``, ``.xacro``, or ``.csv`` of DH rows.

    Args:
        reference: name or path.
        beside: folder that a relative path starts from.
        tip: last link of a URDF.
        beta: ``auto`` adds Hayati's parameter where neighbouring axes are near-parallel; ``none`` leaves it out.
        packages: folders of ROS packages that the cell names; they go before those that the robot's file names.

    Raises:
        InputError: no such robot, or its file is wrong.
    """
    reference = str(reference)
    shipped = data_folder("robots") / reference / "robot.toml"
    if "/" not in reference and os.path.isfile(shipped):
        return _from_file(shipped, beta)
    path = beside / reference
    if os.path.isdir(path):
        path = path / "robot.toml"
    if os.path.isfile(path):  # false for a name that no file can have
        return _from_file(path, beta, tip, packages)
    known = list(list_robots())
    raise InputError(
        f"robot '{reference}': neither a shipped robot nor a file{did_you_mean(reference, known)} "
        f"(shipped: {', '.join(known)})"
    )


def describe_robot(path: Path, tip: str | None = None) -> RobotDescription:
    """Return what a ``robot.toml``, a bare URDF (or ``.xacro``) with the link ``tip``, or a table of DH rows says.

    Raises:
        InputError: the file is wrong.
    """
    if is_urdf(path):
        srdf = plain_name(path).with_suffix(".srdf")
        return RobotDescription(
            schema="edbb-robot/1",
            name=plain_name(path).stem,
            convention="urdf",
            urdf=path.name,
            tip=tip,
            srdf=srdf.name if srdf.is_file() else None,
        )
    if path.suffix == ".csv":
        return validate(
            {"schema": "edbb-robot/1", "name": path.stem} | read_dh_table(path), RobotDescription, str(path)
        )
    return read_toml(path, RobotDescription)


def _from_file(path: Path, beta: str, tip: str | None = None, packages: Packages = NO_PACKAGES) -> Robot:
    file = describe_robot(path, tip)
    if file.convention == "urdf":
        named = named_packages(str(path), file.packages, path.parent)
        return _from_urdf(file, path, named | packages | COMMAND_PACKAGES.packages)
    n = len(file.joints)
    _check_count(path, n)
    transforms: list[Transform] = []
    ends = [0]
    for i, j in enumerate(file.joints, 1):
        row = j.row
        if beta == "auto" and is_near_parallel(file.convention, i, n, row["alpha"]):
            row = {"beta": 0.0} | row
        transforms += dh_row(file.convention, i, row)
        ends.append(len(transforms))
    return _build_robot(file, path, tuple(transforms), tuple(ends))


def _from_urdf(file: RobotDescription, path: Path, packages: Packages) -> Robot:
    chain = read_urdf(path.parent / str(file.urdf), file.tip, packages)
    n = len(chain.joints)
    _check_count(path, n)
    if file.joints and len(file.joints) != n:
        raise InputError(f"{path}: {len(file.joints)} [[joints]] tables, but the chain of the URDF has {n} joints")
    if not file.joints:
        still = [i for i, j in enumerate(chain.joints, 1) if j.speed <= 0]
        if still:
            raise InputError(f"{path}: joint {still[0]} has no positive velocity limit")
        file = file.model_copy(update={"joints": tuple(JointTable.from_urdf(j) for j in chain.joints)})
    if file.srdf is not None:
        pairs = read_allowed_pairs(path.parent / file.srdf, chain)
        why = f"{file.srdf} allows them to touch"
        file = file.model_copy(update={"never_meet": pairs, "never_meet_reason": why})
    robot = _build_robot(file, path, chain.transforms, chain.link_end, chain)
    return replace(robot, packages=packages, unchecked_links=_unchecked_links(file, chain))


def _unchecked_links(file: RobotDescription, chain: UrdfChain) -> tuple[tuple[str, str], ...]:
    """Return the URDF's links that no collision check knows, where ``robot.toml`` gives them no bodies either."""
    beside = [(name, f"not between the base and '{chain.tip}'") for name in chain.beside]
    embodied = {body.link for body in file.bodies}
    shapeless = [name for name, k in chain.shapeless if k not in embodied]
    return (*((name, "no collision shape") for name in shapeless), *beside)


def _check_count(path: Path, n: int) -> None:
    if n < FEWEST_JOINTS:
        raise InputError(f"{path}: {n} joints found; revolute chains of {FEWEST_JOINTS} joints and more are supported")


def _build_robot(
    file: RobotDescription,
    path: Path,
    rows: tuple[Transform, ...],
    ends: tuple[int, ...],
    urdf: UrdfChain | None = None,
) -> Robot:
    joints = file.joints
    whole = (*rows, *_flange_transforms(file))
    check_reach(path, whole, file.reach_mm)
    check_joint_limits(path, _limits(joints, 0), _limits(joints, 1))
    couple = np.array([[j.couple.get(k, 0.0) for k in range(1, len(joints) + 1)] for j in joints])
    sense = np.array([float(j.sense) for j in joints])
    A = sense[:, None] * (np.eye(len(joints)) + couple)
    zero = from_deg([j.zero_deg for j in joints])
    masses = tuple(j.mass for j in joints)
    shapes = tuple((b.link, b.body(f"link{b.link}_{k}", path.parent)) for k, b in enumerate(file.bodies))
    sources = dict(file.sources) or ({} if urdf is None else {"all": f"URDF {path.name}"})
    if unsaid := ", ".join(_unsaid_drives(file)):
        sources[unsaid] = f"estimated: {SPEED_TIME} s to full speed"
    joints = tuple(j.with_estimates() for j in joints)
    limits = JointRange(_limits(joints, 0), _limits(joints, 1), _limit_or_infinity(j.speed_deg_s for j in joints))
    if urdf is not None:
        masses = masses if any(masses) else tuple(j.mass for j in urdf.joints)
        shapes = shapes or urdf.bodies
    return Robot(
        name=file.name,
        title=file.title or file.name,
        convention=file.convention,
        transforms=whole,
        link_end=ends,
        sense_matrix=read_only(A),
        theta_zero=read_only(-sense * zero),
        q_lower=limits.lower,
        q_upper=limits.upper,
        speed=limits.speed,
        acceleration=_limit_or_infinity(j.acceleration_deg_s2 for j in joints),
        jerk=_limit_or_infinity(j.jerk_deg_s3 for j in joints),
        repeatability=file.repeatability_mm * MM,
        priors=file.priors.priors(),
        payload=file.payload_kg,
        masses=masses,
        bodies=shapes,
        gear_ratio=tuple(j.gear_ratio for j in joints),
        never_meet=frozenset((min(p), max(p)) for p in file.never_meet),
        never_meet_reason=file.never_meet_reason,
        sources=tuple(sorted(sources.items())),
        path=path,
        tip=None if urdf is None else urdf.tip,
        srdf=None if file.srdf is None else path.parent / file.srdf,
        joint_names=tuple(j.name for j in joints) if all(j.name for j in joints) else (),
        dialect=file.dialect,
        effects=effects_from_tables(path, file.effects, whole),
        loads=loads_from_table(file.loads),
        nominal_transforms=nominal_from_table(path, file.nominal, whole) if file.nominal else (),
        tool_points=tuple(t.point() for t in file.tool_points),
        simulated=file.simulated,
        conventions=tuple(_conventions(file, path, limits, None if urdf is None else (urdf, A, -sense * zero))),
    )


URDF_JOINTS = "ros2-trajectory"  # the language whose axes are the joints of the URDF


def _conventions(
    file: RobotDescription, path: Path, limits: JointRange, urdf: tuple[UrdfChain, Array, Array] | None
) -> Iterable[AxisConvention]:
    """Yield how each controller counts; the joints of a URDF follow from the file's own (``theta = A q + zero``)."""
    yield from (convention_from_table(str(path), name, table, limits) for name, table in file.controllers.items())
    if urdf is None or URDF_JOINTS in file.controllers:
        return
    chain, A, zero = urdf
    sense = np.array([float(j.sense) for j in chain.joints])
    matrix, offset = sense[:, None] * A, sense * zero
    seen, said = limits.seen_by(matrix, offset), f"the joints of {file.urdf}"
    yield AxisConvention(URDF_JOINTS, read_only(matrix), read_only(offset), seen.lower, seen.upper, seen.speed, said)


def _unsaid_drives(file: RobotDescription) -> list[str]:
    """Return what is estimated of a joint that has a speed, where the file's own sources do not speak of it."""
    keys = {"accelerations": "acceleration_deg_s2", "jerks": "jerk_deg_s3"}
    moving = [j for j in file.joints if j.speed_deg_s is not None]
    unsaid = [topic for topic, key in keys.items() if any(getattr(j, key) is None for j in moving)]
    return [topic for topic in unsaid if not any(topic in said for said in file.sources)]


def _flange_transforms(file: RobotDescription) -> tuple[Transform, ...]:
    every = frame_transforms("_flange", from_mm(file.flange.position_mm), from_deg(file.flange.rpy_deg))
    return tuple(t for t in every if t.nominal)


def _limits(joints: tuple[JointTable, ...], side: int) -> Array:
    return read_only(from_deg([(-np.inf, np.inf)[side] if j.limit_deg is None else j.limit_deg[side] for j in joints]))


def _limit_or_infinity(values: Iterable[float | None]) -> Array:
    return read_only(from_deg([np.inf if v is None else v for v in values]))
