"""Reads URDF files: the chain from the root to a tip link, and what hangs on it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import MOST_TOML, read_bytes
from planner.common.units import TURN, Array
from planner.common.xml_files import XmlError, parse_xml
from planner.kinematics.bodies import Body, rotation_from_z
from planner.kinematics.calibration_files import YAML, urdf_of_origins
from planner.kinematics.chain import Transform, fixed_turns, frame_with_errors, xyz_transforms
from planner.kinematics.geometry import rpy_of
from planner.kinematics.packages import NO_PACKAGES, Packages
from planner.kinematics.robot import LinkMass, ParkedJoint
from planner.kinematics.urdf_elements import (
    MeshFinder,
    number,
    pose_matrix,
    read_bodies,
    read_mass,
    read_numbers,
    read_origin,
    read_positive,
    read_stroke,
)
from planner.kinematics.urdf_parked import UNITS, Branches, Parking, park_joints, read_branches
from planner.kinematics.urdf_tree import UrdfError, find_bodily_links, find_child, link_of, read_tree, rigid_groups
from planner.kinematics.urdf_vocabulary import check_vocabulary
from planner.kinematics.xacro_templates import expand_template

SHAPELESS = "no collision shape"
LONGEST = 50.0  # [m] to either side of a linear track: 47 m are on the market


@dataclass(frozen=True)
class UrdfJoint:
    """Name, sense, limits [rad, m] and largest speed [rad/s, m/s] of a driven joint, and the mass of its link.

    ``slides``: whether it is prismatic, so that its numbers are of lengths. ``acceleration`` (the smaller of it and the
    deceleration) and ``jerk`` [rad/s², rad/s³, or m] are 0 where the file does not say them.
    """

    name: str
    sense: int
    lower: float
    upper: float
    speed: float
    mass: LinkMass | None
    slides: bool = False
    acceleration: float = 0.0
    jerk: float = 0.0


@dataclass(frozen=True)
class UrdfChain:
    """What a URDF says of the chain from its root link to the tip (joints in order, SI units), and of what hangs on it.

    ``parts`` are the joints of the chain, fixed ones too: the name, the number of transforms up to its end, and its
    motion to where it stands, (4, 4); ``bodies`` all shapes with the number of the link that carries each; ``links``
    all links that have a place: the name, and that number. ``solid`` are those of the chain that can touch something,
    ``unchecked`` the links whose shapes or places are not known: the name, and why; ``neighbours`` the rigid parts that
    a driven joint joins; ``lacking`` a sentence on each mesh that is not there.
    """

    transforms: tuple[Transform, ...]
    link_end: tuple[int, ...]
    joints: tuple[UrdfJoint, ...]
    bodies: tuple[tuple[int, Body], ...]
    tip: str
    parts: tuple[tuple[str, int, Array], ...]
    links: tuple[tuple[str, int], ...]
    solid: tuple[tuple[str, int], ...]
    unchecked: tuple[tuple[str, str], ...]
    parked: tuple[ParkedJoint, ...]
    neighbours: frozenset[frozenset[str]] = frozenset()
    lacking: tuple[str, ...] = ()


def read_urdf(
    path: Path,
    tip: str | None,
    packages: Packages = NO_PACKAGES,
    parked: Mapping[str, float] | None = None,
    base: str | None = None,
) -> UrdfChain:
    """Read the chain from ``base`` (default: the root) to ``tip`` (default: the only leaf) of the URDF at ``path``.

    Args:
        path: of the URDF, or of a template of one.
        tip: the chain's last link.
        packages: where ``package://`` of meshes and ``$(find …)`` of templates lead.
        parked: where joints stand that the arm does not drive, by their names with their units (``finger_mm``).
        base: the chain's first link; what it hangs on stands still and counts as fixed to it.

    Raises:
        InputError: no XML, no such link, a joint that neither turns, slides nor is fixed, a missing mesh.
    """
    try:
        root = parse_urdf(path, packages)
        check_vocabulary(root)
        links, joints, start = read_tree(path, root, tip, base)
        every = root.findall("joint")
        parking = park_joints(every, joints, parked or {})
        meshes = MeshFinder.of(path, root, packages)
        chain, placed = _assemble(meshes, links, joints, start, parking)
        beside = read_branches(meshes, links, every, placed, parking)
        whole = _with_branches(chain, links, beside, find_bodily_links(root))
        return _with_rigid_parts(whole, joints, rigid_groups(links, every))
    except UrdfError as err:
        line = f", line {err.line}" if err.line and path.suffix == ".urdf" else ""  # a template's lines are others
        raise InputError(f"{path}{line}: {err}") from err


def is_urdf(path: Path) -> bool:
    """Tell whether a file is a URDF, a template of one, or a file of joint origins that is read as one."""
    return path.suffix in (".urdf", ".xacro", *YAML)


def plain_name(path: Path) -> Path:
    """Return the path of the URDF that ``xacro`` makes of a template: ``arm.urdf`` for ``arm.urdf.xacro``."""
    return path if path.suffix != ".xacro" else path.with_suffix("").with_suffix(".urdf")


def parse_urdf(path: Path, packages: Packages, comments: bool = False) -> ET.Element:
    """Return the root of a URDF, or of what a template or a file of origins makes.

    Its ``comments`` are in it where they are asked for.

    Raises:
        InputError: it is no XML, or a template that makes none.
    """
    try:
        if path.suffix in YAML:
            return parse_xml(urdf_of_origins(path))
        data = expand_template(path, packages) if path.suffix == ".xacro" else read_bytes(path, MOST_TOML)
        return parse_xml(data, comments)
    except (XmlError, ValueError, LookupError, RecursionError) as err:
        raise InputError(f"{path}: cannot be read as URDF ({err})") from err


def _assemble(
    meshes: MeshFinder, links: dict[str, ET.Element], joints: list[ET.Element], base: str, parking: Parking
) -> tuple[UrdfChain, dict[str, tuple[int, Array]]]:
    """Return the chain, and of each of its links the number of the link it belongs to and its pose (4, 4) in that."""
    still = {j.name for j in parking.joints}
    transforms: list[Transform] = []
    ends, driven = [0], list[UrdfJoint]()
    lacking = list[str]()
    bodies = [(0, b) for b in read_bodies(meshes, links[base], np.eye(4), lacking)]
    parts: list[tuple[str, int, Array]] = []
    placed = {base: (0, np.eye(4))}
    carried = np.eye(4)  # pose of the current URDF link in the last link frame
    for joint in joints:
        name, kind = str(joint.get("name")), joint.get("type")
        xyz, rpy = read_origin(joint)
        child = links[str(find_child(joint, "child").get("link"))]
        if kind == "fixed" or name in still:
            motion = parking.motion(joint)
            T = pose_matrix(xyz, rpy) @ motion
            if name in still:
                xyz, rpy = T[:3, 3], rpy_of(T[:3, :3])
            transforms += frame_with_errors(f"_{name}", xyz, rpy)
            parts.append((name, len(transforms), motion))
            carried = carried @ T
            placed[str(child.get("name"))] = (len(driven), carried)
            bodies += [(len(driven), b) for b in read_bodies(meshes, child, carried, lacking)]
            continue
        if kind not in UNITS:
            raise UrdfError(
                f"joint '{name}' is '{kind}'; revolute, continuous, prismatic and fixed are supported: begin the chain "
                f'behind it, base = "{find_child(joint, "child").get("link")}"'
            )
        i = len(driven) + 1
        rows, read = _driven_joint(i, joint, xyz, rpy, read_mass(child))
        transforms += rows
        ends.append(len(transforms))
        parts.append((name, len(transforms), np.eye(4)))
        carried = np.eye(4)
        placed[str(child.get("name"))] = (i, carried)
        driven.append(read)
        bodies += [(i, b) for b in read_bodies(meshes, child, np.eye(4), lacking)]
    named = tuple((link, k) for link, (k, _) in placed.items())
    chain = UrdfChain(
        transforms=tuple(transforms),
        link_end=tuple(ends),
        joints=tuple(driven),
        bodies=tuple(bodies),
        tip=named[-1][0],
        parts=tuple(parts),
        links=named,
        solid=(),
        unchecked=(),
        parked=parking.joints,
        lacking=tuple(lacking),
    )
    return chain, placed


def _driven_joint(
    i: int, joint: ET.Element, xyz: Array, rpy: Array, mass: LinkMass | None
) -> tuple[list[Transform], UrdfJoint]:
    """Return the transforms of joint i, whose origin is at ``xyz`` [m], ``rpy`` [rad], and what its element says."""
    name, slides = str(joint.get("name")), joint.get("type") == "prismatic"
    if (leader := joint.find("mimic")) is not None:
        raise UrdfError(
            f"joint '{name}' is moved by joint '{leader.get('joint')}' (<mimic>); only joints with a drive of "
            "their own are supported on the way to the tip"
        )
    axis = np.array(read_numbers(joint.find("axis"), "xyz", (1, 0, 0)))
    rows, sense = (_slide_transforms if slides else _joint_transforms)(i, xyz, rpy, axis)
    limit = joint.find("limit")
    acceleration = read_positive(limit, "acceleration", "deceleration", "drake:acceleration")
    jerk = read_positive(limit, "jerk")
    return rows, UrdfJoint(name, sense, *_read_limits(joint), mass, slides, acceleration, jerk)


def _read_limits(joint: ET.Element) -> tuple[float, float, float]:
    """Return the limits of a joint [rad, m] and its largest speed [rad/s, m/s].

    Limits that the file does not say are infinite, a speed is 0.
    """
    most_turns = 4  # to either side: wrists with an end turn up to twice, limits in degrees would be tens of turns
    name, limit = joint.get("name"), joint.find("limit")
    lower, upper = read_stroke(joint)
    speed = 0.0 if limit is None else number(limit, "velocity", 1e6)
    if np.isinf([lower, upper]).any() and (joint.get("type") == "continuous" or limit is None):
        end = np.inf if joint.get("type") == "prismatic" else TURN
        return max(lower, -end), min(upper, end), speed
    if np.isinf([lower, upper]).all():  # what a file without these two numbers says: robot.toml has to
        return lower, upper, speed
    if joint.get("type") == "prismatic":
        if not -LONGEST <= lower < upper <= LONGEST:
            raise UrdfError(
                f"joint '{name}': lower = {lower:g} and upper = {upper:g} m are no limits; the lower one lies below "
                f"the upper one, both within {LONGEST:g} m (are these millimetres?)",
                joint,
            )
    elif not -most_turns * TURN <= lower < upper <= most_turns * TURN:
        raise UrdfError(
            f"joint '{name}': lower = {lower:g} and upper = {upper:g} rad are no limits. The lower one lies below "
            f"the upper one, both within {most_turns} turns ({most_turns * TURN:.3g} rad; are these degrees?); a "
            "joint without an end is 'continuous'",
            joint,
        )
    return lower, upper, speed


def _with_branches(
    chain: UrdfChain, links: Mapping[str, ET.Element], beside: Branches, bodily: frozenset[str]
) -> UrdfChain:
    placed = (*chain.links, *beside.links)
    shapeless = [(name, SHAPELESS) for name, _ in placed if name in bodily and links[name].find("collision") is None]
    return replace(
        chain,
        bodies=(*chain.bodies, *beside.bodies),
        links=placed,
        solid=tuple((name, k) for name, k in chain.links if name in bodily),
        unchecked=(*shapeless, *((name, why) for name, why in beside.unchecked if name in bodily)),
        lacking=(*chain.lacking, *beside.lacking),
    )


def _with_rigid_parts(chain: UrdfChain, joints: list[ET.Element], rigid: Mapping[str, str]) -> UrdfChain:
    """Return the chain whose bodies know which links are one with theirs, with the neighbours among these."""
    driven = {j.name for j in chain.joints}
    ends = [[rigid[link_of(j, end)] for end in ("parent", "child")] for j in joints if j.get("name") in driven]
    of_chain = {rigid[link_of(j, end)] for j in joints for end in ("parent", "child")}
    bodies = tuple((k, replace(b, rigid=rigid[b.part], branch=rigid[b.part] not in of_chain)) for k, b in chain.bodies)
    return replace(chain, bodies=bodies, neighbours=frozenset(map(frozenset, ends)))


def _joint_transforms(i: int, xyz: Array, rpy: Array, axis: Array) -> tuple[list[Transform], int]:
    """Return the transforms of joint i: its origin, and a turn about x, y or z; other axes are turned to z and back.

    A small turn of the origin about the joint's own axis is the error of the joint's zero, and has no name beside it.
    """
    k, sense, there, back = _align(i, axis)
    rows = frame_with_errors(str(i), xyz, rpy)
    origin, errors = rows[:-3], rows[-3:]
    across = [e for e in errors if e.axis != k]
    return [*origin, *there, *across, Transform(f"theta{i}", "rotation", k, 0.0, i - 1), *back], sense


def _slide_transforms(i: int, xyz: Array, rpy: Array, axis: Array) -> tuple[list[Transform], int]:
    """Return the transforms of joint i that slides: its origin, turned to the axis and back where that is slanted.

    Its errors stand in the axes of the slide: two shifts across it, as one along it is its zero's, and the turns, of
    which those across are the direction in which it slides.
    """
    k, sense, there, back = _align(i, axis)
    moves = xyz_transforms("origin_", "translation", xyz, str(i), fixed=True)
    shifts = [t for t in xyz_transforms("", "translation", suffix=str(i)) if t.axis != k]
    turns = xyz_transforms("r", "rotation", suffix=str(i))
    slide = Transform(f"d{i}", "translation", k, 0.0, i - 1)
    return [*moves, *fixed_turns("origin_r", str(i), rpy), *there, *shifts, *turns, slide, *back], sense


def _align(i: int, axis: Array) -> tuple[int, int, list[Transform], list[Transform]]:
    """Return along which of x, y, z the axis of joint i lies and in which sense, and the turns to it and back."""
    if not np.linalg.norm(axis) > 1e-9:
        raise UrdfError(f"the axis of joint {i} has no length")
    axis = axis / np.linalg.norm(axis)
    k = int(np.argmax(np.abs(axis)))
    if abs(axis[k]) > 1 - 1e-9:
        return k, int(np.sign(axis[k])), [], []
    there = fixed_turns("aligned_", str(i), Rotation.from_matrix(rotation_from_z(axis)).as_euler("ZYX")[::-1])
    return 2, 1, there, [replace(t, name=f"{t.name}_back", nominal=-t.nominal) for t in reversed(there)]
