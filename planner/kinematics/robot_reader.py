"""Reads ``robot.toml`` (and URDF) into a :class:`Robot`, with every check that a typing error deserves."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder
from planner.common.schema import read_toml, read_toml_again, validate
from planner.common.units import DEG, MM, Array, from_deg, from_mm, read_only
from planner.kinematics.axes import AxisConvention, JointRange, convention_from_table
from planner.kinematics.calibration_files import (
    LENGTHS,
    ROW_KEYS,
    effects_from_tables,
    loads_from_table,
    nominal_from_table,
    read_dh_table,
    robot_of_differences,
    row_differences,
)
from planner.kinematics.chain import Transform, dh_row, frame_transforms, is_near_parallel
from planner.kinematics.packages import COMMAND_PACKAGES, NO_PACKAGES, Packages, named_packages
from planner.kinematics.parallel_axes import shorten_offsets
from planner.kinematics.robot import SLIDE, Robot
from planner.kinematics.robot_file import SPEED_TIME, JointTable, RobotDescription
from planner.kinematics.robot_hash import with_hand_edits
from planner.kinematics.robot_numbers import check_joint_limits, check_reach
from planner.kinematics.srdf import numbered_pairs, read_allowed_pairs
from planner.kinematics.urdf import SHAPELESS, UrdfChain, is_urdf, plain_name, read_urdf

OTHER_CONVENTION = {"dh": "mdh", "mdh": "dh"}


def list_robots() -> tuple[str, ...]:
    """Names of the robots that come with the planner."""
    return tuple(sorted(p.parent.name for p in data_folder("robots").glob("*/robot.toml")))


def load_robot(
    reference: str | Path,
    beside: Path = Path(),
    tip: str | None = None,
    beta: str = "auto",
    packages: Packages = NO_PACKAGES,
    parked: Mapping[str, float] | None = None,
    base: str | None = None,
    force: bool = False,
) -> Robot:
    """Load a robot by shipped name, or by path to a ``robot.toml``, ``.urdf``, ``.xacro``, or ``.csv`` of DH rows.

    Args:
        reference: name or path; also of a maker's calibration: ``calibration.conf`` of UR, YAML of joint origins.
        beside: folder that a relative path starts from.
        tip, base: last and first link of a URDF's chain, all in the frame of the first; as ``parked``.
        beta: ``auto`` adds Hayati's parameter where neighbouring axes are near-parallel; ``none`` leaves it out.
        packages: folders of ROS packages that the cell names; they go before those that the robot's file names.
        parked: where the cell says that joints of the URDF stand, by name with unit; it goes before the robot's file.
        force: load a calibrated robot, too, of which its identification says not to use it.

    Raises:
        InputError: no such robot, or its file is wrong, or says that nothing may be made of it.

    Example:
        >>> load_robot("arm.urdf", tip="flange")  # doctest: +SKIP
    """
    reference = str(reference)
    if shipped := _shipped_file(reference):
        return _from_file(shipped, beta, tip, parked=parked, base=base)
    path = beside / reference
    if os.path.isdir(path):
        path = path / "robot.toml"
    if os.path.isfile(path):  # false for a name that no file can have
        robot = _from_file(path, beta, tip, packages, parked, base)
        if robot.not_for_use and not force:
            why = f"this robot is not to be used, its identification says: {robot.not_for_use}; measure again"
            raise InputError(f"{path}: {why} ('edbb compensate --force' would correct programs by it)")
        return with_hand_edits(robot)
    known = list(list_robots())
    raise InputError(
        f"robot '{reference}': neither a shipped robot nor a file{did_you_mean(reference, known)} "
        f"(shipped: {', '.join(known)})"
    )


def _shipped_file(name: str) -> Path | None:
    """Return the file of a shipped robot; ``None`` where there is none of that name."""
    path = data_folder("robots") / name / "robot.toml"
    return path if "/" not in name and os.path.isfile(path) else None


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
    if path.suffix == ".conf":
        return _with_short_offsets(_with_differences(path))
    if path.suffix == ".csv":
        content = {"schema": "edbb-robot/1", "name": path.stem} | read_dh_table(path)
        return _with_short_offsets(validate(content, RobotDescription, str(path)))
    return _with_short_offsets(read_toml_again(path, RobotDescription))


def _with_differences(path: Path) -> RobotDescription:
    """Return the robot that a ``calibration.conf`` names, with the differences that it holds added to its rows."""
    name = robot_of_differences(path)
    if not (found := _shipped_file(name) or path.parent / name).is_file():
        near = did_you_mean(name, list(list_robots()))
        raise InputError(f"{path}: '# robot: {name}' is no shipped robot and no file{near}")
    file = read_toml(found, RobotDescription)
    if file.convention != "dh":
        raise InputError(f"{path}: its differences are of DH rows, and {name} has convention = '{file.convention}'")
    joints = tuple(
        j.model_copy(update={key: (getattr(j, key) or 0.0) + v for key, v in more.items()})
        for j, more in zip(file.joints, row_differences(path, len(file.joints)), strict=True)
    )
    sources = dict(file.sources) | {"kinematics": f"rows of {name} with the differences of {path.name}"}
    return file.model_copy(update={"joints": joints, "sources": sources, "reach_mm": None})


def _with_short_offsets(file: RobotDescription) -> RobotDescription:
    """Return the description without offsets along near-parallel axes that run far out and back, the same chain."""
    if file.convention == "urdf":
        return file
    rows = [j.row for j in file.joints]
    short = shorten_offsets(file.convention, rows)
    if short == rows:
        return file
    joints = tuple(
        j.model_copy(update={ROW_KEYS[key]: v / (MM if key in LENGTHS else DEG) for key, v in new.items()})
        for j, new in zip(file.joints, short, strict=True)
    )
    far = max((row["d"] for row in rows), key=abs)
    said = f"rows of near-parallel axes with d of up to {far:.6g} m, written by Hayati's beta instead"
    return file.model_copy(update={"joints": joints, "sources": dict(file.sources) | {"rows": said}})


def _from_file(
    path: Path,
    beta: str,
    tip: str | None = None,
    packages: Packages = NO_PACKAGES,
    parked: Mapping[str, float] | None = None,
    base: str | None = None,
) -> Robot:
    file = describe_robot(path, tip)
    links = {key: link for key, link in (("base", base), ("tip", tip)) if link is not None}
    if links and file.convention != "urdf":
        raise InputError(f"{path}: {next(iter(links))} names a link of a URDF; this robot is none")
    file = file.model_copy(update=links)
    if parked and file.convention != "urdf":
        raise InputError(f"{path}: joints can be parked of a URDF only (the cell's table [parked]); this robot is none")
    if file.convention == "urdf":
        file = file.model_copy(update={"parked": {**file.parked, **(parked or {})}})
        named = named_packages(str(path), file.packages, path.parent)
        return _from_urdf(file, path, named | packages | COMMAND_PACKAGES.packages)
    return _from_rows(file, path, beta)


def load_in_other_convention(robot: Robot) -> Robot | None:
    """Return the robot that a file of rows would be if they were DH where it says MDH, or the other way round.

    ``None`` of a URDF, and of a file that a calibration wrote: its convention has been tried.

    Raises:
        InputError: the file can no longer be read.
    """
    if robot.convention not in OTHER_CONVENTION or robot.nominal_robot is not robot:
        return None
    file = describe_robot(robot.path)
    return _from_rows(file.model_copy(update={"convention": OTHER_CONVENTION[robot.convention]}), robot.path, "none")


def _from_rows(file: RobotDescription, path: Path, beta: str) -> Robot:
    n = len(file.joints)
    _check_count(path, n)
    transforms: list[Transform] = []
    ends = [0]
    for i, j in enumerate(file.joints, 1):
        row = j.row
        if beta == "auto" and is_near_parallel(file.convention, i, n, row["alpha"]):
            row = {"beta": 0.0} | row
        transforms += dh_row(file.convention, i, row, j.variable)
        ends.append(len(transforms))
    return _build_robot(file, path, tuple(transforms), tuple(ends))


def _from_urdf(file: RobotDescription, path: Path, packages: Packages) -> Robot:
    chain = read_urdf(path.parent / str(file.urdf), file.tip, packages, file.parked, file.base)
    n = len(chain.joints)
    _check_count(path, n)
    file = file.model_copy(update={"joints": _joints_of_urdf(file, path, chain)})
    parts = _never_meet_parts(file, path, chain)
    if file.bodies and file.srdf is not None:  # which have numbers, no names
        pairs = (*file.never_meet, *numbered_pairs(parts, chain.solid))
        why = file.never_meet_reason or f"{file.srdf} allows them to touch"
        file = file.model_copy(update={"never_meet": pairs, "never_meet_reason": why})
    robot = _build_robot(file, path, chain.transforms, chain.link_end, chain)
    unchecked = _unchecked_links(file, chain)
    return replace(
        robot,
        packages=packages,
        unchecked_links=unchecked,
        parked=chain.parked,
        neighbours=chain.neighbours,
        never_meet_parts=parts,
        lacking_meshes=chain.lacking,
    )


def _joints_of_urdf(file: RobotDescription, path: Path, chain: UrdfChain) -> tuple[JointTable, ...]:
    """Return the joints of a URDF's chain; what a ``[[joints]]`` table says of one goes before what the URDF says.

    Tables that all have names of joints of the chain are of these; others are of all joints, from base to tip.
    """
    names = [j.name for j in chain.joints]
    said = [t.name for t in file.joints]
    if not set(said) <= set(names):
        if len(said) != len(names):
            raise InputError(
                f"{path}: {len(said)} [[joints]] tables, but the chain of the URDF has {len(names)} joints: give one "
                f"for each, or name those that you mean ({', '.join(names)})"
            )
        said = names
    if twice := [name for name in said if said.count(name) > 1]:
        raise InputError(f"{path}: two [[joints]] tables have the name '{twice[0]}'")
    tables = dict(zip(said, file.joints, strict=True))
    joints = tuple(JointTable.from_urdf(j, tables.get(j.name)) for j in chain.joints)
    for name, joint in zip(names, joints, strict=True):
        if key := joint.foreign_key:
            raise InputError(f"{path}: [[joints]] '{name}' {'slides' if joint.slides else 'turns'}, and has {key}")
    return joints


def _unchecked_links(file: RobotDescription, chain: UrdfChain) -> tuple[tuple[str, str], ...]:
    """Return the URDF's links that no collision check knows; bodies of ``robot.toml`` stand for all of the chain's."""
    if not file.bodies:
        return chain.unchecked
    embodied = {body.link for body in file.bodies}
    of_chain = {name for name, _ in chain.solid}
    bare = [(name, SHAPELESS) for name, k in chain.solid if k not in embodied]
    return (*bare, *((name, why) for name, why in chain.unchecked if name not in of_chain))


def _never_meet_parts(file: RobotDescription, path: Path, chain: UrdfChain) -> tuple[tuple[str, str, str], ...]:
    """Return the pairs of links, by name, that ``robot.toml`` or its SRDF leaves out of every check, and why."""
    known = [name for name, _ in chain.links]
    for name in (name for pair in file.named_pairs for name in pair):
        if name not in known:
            raise InputError(f"{path}: never_meet: no link of the URDF is called '{name}'{did_you_mean(name, known)}")
    own = tuple((min(p), max(p), file.never_meet_reason) for p in file.named_pairs)
    of_srdf = () if file.srdf is None else read_allowed_pairs(path.parent / file.srdf)
    said = {(a, b) for a, b, _ in own}
    return (*own, *(p for p in of_srdf if {p[0], p[1]} <= set(known) and (p[0], p[1]) not in said))


def _check_count(path: Path, n: int) -> None:
    fewest = 5  # joints of the arms that are supported
    if n < fewest:
        raise InputError(f"{path}: {n} joints found; arms of {fewest} joints and more are supported")


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
    slides = np.array([j.slides for j in joints])
    check_joint_limits(path, _limits(joints, 0), _limits(joints, 1), slides)
    couple = np.array([[j.couple.get(k, 0.0) for k in range(1, len(joints) + 1)] for j in joints])
    sense = np.array([float(j.sense) for j in joints]) * np.where(slides, SLIDE, 1.0)
    A = sense[:, None] * (np.eye(len(joints)) + couple)
    zero = from_deg([j.drive("zero") for j in joints])
    masses = tuple(j.mass for j in joints)
    shapes = tuple((b.link, b.body(f"link{b.link}_{k}", path.parent)) for k, b in enumerate(file.bodies))
    joints = tuple(j.with_estimates() for j in joints)
    limits = JointRange(_limits(joints, 0), _limits(joints, 1), _limit_or_infinity(joints, "speed"), slides)
    if urdf is not None:
        masses = masses if any(masses) else tuple(j.mass for j in urdf.joints)
        shapes = (*shapes, *(b for b in urdf.bodies if b[1].branch or not shapes))
    return Robot(
        name=file.name,
        title=file.title or file.name,
        convention=file.convention,
        transforms=_with_travel(whole, limits, A, -sense * zero),
        link_end=ends,
        coupling_matrix=read_only(A),
        theta_zero=read_only(-sense * zero),
        q_lower=limits.lower,
        q_upper=limits.upper,
        speed=limits.speed,
        acceleration=_limit_or_infinity(joints, "acceleration"),
        jerk=_limit_or_infinity(joints, "jerk"),
        repeatability=file.repeatability_mm * MM,
        repeatability_assumed="repeatability_mm" not in file.model_fields_set,
        priors=file.priors.priors(),
        payload=file.payload_kg,
        masses=masses,
        bodies=shapes,
        gear_ratio=tuple(j.gear_ratio for j in joints),
        never_meet=frozenset((min(p), max(p)) for p in file.numbered_pairs),
        never_meet_reason=file.never_meet_reason,
        sources=_sources(file, path, urdf),
        path=path,
        tip=None if urdf is None else urdf.tip,
        base=file.base,
        srdf=None if file.srdf is None else path.parent / file.srdf,
        joint_names=tuple(j.name for j in joints) if all(j.name for j in joints) else (),
        dialect=file.dialect,
        effects=effects_from_tables(path, file.effects, whole),
        loads=loads_from_table(file.loads),
        nominal_transforms=nominal_from_table(path, file.nominal, whole) if file.nominal else (),
        tool_points=tuple(t.point() for t in file.tool_points),
        simulated=file.simulated,
        not_for_use=file.not_for_use,
        conventions=tuple(_conventions(file, path, limits, None if urdf is None else (urdf, A, -sense * zero))),
    )


def _sources(file: RobotDescription, path: Path, urdf: UrdfChain | None) -> tuple[tuple[str, str], ...]:
    """Return where the numbers come from: what the file says, and what was estimated."""
    sources = dict(file.sources) or ({} if urdf is None else {"all": f"URDF {path.name}"})
    if unsaid := ", ".join(_unsaid_drives(file)):
        sources[unsaid] = f"estimated: {SPEED_TIME} s to full speed"
    return tuple(sorted(sources.items()))


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
    unit = np.array([SLIDE if j.slides else 1.0 for j in chain.joints])
    matrix, offset = sense[:, None] * (A / unit[:, None]), sense * zero / unit
    seen, said = limits.controller_limits(matrix, offset), f"the joints of {file.urdf}"
    yield AxisConvention(URDF_JOINTS, read_only(matrix), read_only(offset), seen.lower, seen.upper, seen.speed, said)


def _unsaid_drives(file: RobotDescription) -> list[str]:
    """Return what is estimated of a joint that has a speed, where the file's own sources do not speak of it."""
    keys = {"accelerations": "acceleration", "jerks": "jerk"}
    moving = [j for j in file.joints if j.drive("speed") is not None]
    unsaid = [topic for topic, key in keys.items() if any(j.drive(key) is None for j in moving)]
    return [topic for topic in unsaid if not any(topic in said for said in file.sources)]


def _flange_transforms(file: RobotDescription) -> tuple[Transform, ...]:
    every = frame_transforms("_flange", from_mm(file.flange.position_mm), from_deg(file.flange.rpy_deg))
    return tuple(t for t in every if t.nominal)


def _limits(joints: tuple[JointTable, ...], side: int) -> Array:
    ends = [j.drive("limit") or (-np.inf, np.inf) for j in joints]
    return read_only(from_deg([end[side] for end in ends]))


def _limit_or_infinity(joints: tuple[JointTable, ...], key: str) -> Array:
    values = [j.drive(key) for j in joints]
    return read_only(from_deg([np.inf if v is None else v for v in values]))


def _with_travel(rows: tuple[Transform, ...], limits: JointRange, A: Array, zero: Array) -> tuple[Transform, ...]:
    """Return the rows, those of joints that slide with how far they travel."""
    ends = np.array([A @ np.where(np.isfinite(end), end, 0.0) + zero for end in (limits.lower, limits.upper)])
    travel = np.abs(ends).max(axis=0)
    slides = (t.kind == "translation" and t.joint is not None for t in rows)
    return tuple(
        replace(t, travel=float(travel[t.joint])) if s and t.joint is not None else t
        for t, s in zip(rows, slides, strict=True)
    )
