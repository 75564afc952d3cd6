"""Reads and writes URDF files: the chain from the root to a tip link, and the same file with corrected joint
origins."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import INPUTS, MOST_TOML, read_bytes
from planner.common.lazy_modules import pin
from planner.common.units import Array, read_only
from planner.common.xml_files import XmlError, parse_xml
from planner.kinematics.bodies import Body, Vector, capsule_between, rotation_from_z
from planner.kinematics.chain import Transform, fixed_turns, frame_with_errors
from planner.kinematics.geometry import pose
from planner.kinematics.packages import NO_PACKAGES, Packages, how_to_name
from planner.kinematics.robot import LinkMass, elementary_placement
from planner.kinematics.urdf_tree import UrdfError, find_bodily_links, find_child, read_tree
from planner.kinematics.xacro.expander import expand_template

TURN = 2 * np.pi
MOST_TURNS = 4  # to either side: wrists with an end turn up to twice, limits in degrees would be tens of turns
MOST_NUMBER = 1e3  # m, rad, or a scale


@dataclass(frozen=True)
class UrdfJoint:
    """Name, sense, limits [rad] and largest speed [rad/s] of a revolute joint, and the mass of the link it carries."""

    name: str
    sense: int
    lower: float
    upper: float
    speed: float
    mass: LinkMass | None


@dataclass(frozen=True)
class UrdfChain:
    """What a URDF says of the chain from its root link to the tip (joints in order, SI units).

    ``parts`` are the joints of the chain, fixed ones too: the name, and the number of transforms up to its end;
    ``links`` the URDF's links: the name, and the number of the link that it belongs to; ``shapeless`` those
    of them that can touch something and have no collision shape, ``beside`` those that can and are not in the chain.
    """

    transforms: tuple[Transform, ...]
    link_end: tuple[int, ...]
    joints: tuple[UrdfJoint, ...]
    bodies: tuple[tuple[int, Body], ...]
    tip: str
    parts: tuple[tuple[str, int], ...]
    links: tuple[tuple[str, int], ...]
    shapeless: tuple[tuple[str, int], ...]
    beside: tuple[str, ...]


@dataclass(frozen=True)
class MeshFinder:
    """Finds the meshes that the URDF at ``path`` names; ``packages``: where ``package://`` leads."""

    path: Path
    packages: Packages

    def find(self, filename: str) -> Path | None:
        """Return a mesh in a named package, else beside the URDF or below a folder above it; ``None``: there is none.

        A link out of a named package is not followed, and ``..`` leads out of no package.
        """
        relative = filename.removeprefix("file://")
        if not relative.startswith("package://"):
            return _first_file(folder / relative for folder in self.path.resolve().parents)
        relative = relative.removeprefix("package://")
        name, _, rest = relative.partition("/")
        if ".." in Path(relative).parts:
            return None
        if name in self.packages.folders:
            found = _first_file([self.packages.folders[name] / rest])
            inside = found is not None and found.resolve().is_relative_to(self.packages.folders[name])
            return found if inside else None
        tails = [relative] + ([rest] if rest else [])
        return _first_file(folder / tail for folder in self.path.resolve().parents for tail in tails)

    def find_for(self, filename: str, name: str) -> Path:
        """Return the mesh of the link ``name``.

        Raises:
            InputError: there is none; with what to add.
        """
        found = self.find(filename)
        if found is None:
            package = filename.removeprefix("package://").partition("/")[0]
            known = package in self.packages.folders or not filename.startswith("package://")
            raise InputError(
                f"{self.path}: the mesh '{filename}' of link '{name}' does not exist in "
                + ("any folder above the file" if not known or package == filename else f"the package '{package}'")
                + ("" if known else f"; {how_to_name(package)}")
            )
        return found


def _first_file(candidates: Iterable[Path]) -> Path | None:
    try:
        return next((p for p in candidates if INPUTS.allows(p) and p.is_file()), None)
    except (OSError, ValueError, RuntimeError):  # a name that no file can have
        return None


def read_urdf(path: Path, tip: str | None, packages: Packages = NO_PACKAGES) -> UrdfChain:
    """Read the revolute chain from the root to ``tip`` (default: the only leaf) of the URDF at ``path``.

    ``packages``: where ``package://`` of meshes and ``$(find …)`` of templates lead.

    Raises:
        InputError: no XML, no such link, a joint that is neither revolute, continuous nor fixed, a missing mesh.
    """
    try:
        root = parse_urdf(path, packages)
        links, joints, base = read_tree(path, root, tip)
        chain = _assemble(MeshFinder(path, packages), links, joints, base)
        return _with_unchecked_links(chain, links, find_bodily_links(root))
    except UrdfError as err:
        raise InputError(f"{path}: {err}") from err


def is_urdf(path: Path) -> bool:
    """Tell whether a file is a URDF, or a template of one."""
    return path.suffix in (".urdf", ".xacro")


def plain_name(path: Path) -> Path:
    """Return the path of the URDF that ``xacro`` makes of a template: ``arm.urdf`` for ``arm.urdf.xacro``."""
    return path if path.suffix != ".xacro" else path.with_suffix("").with_suffix(".urdf")


def parse_urdf(path: Path, packages: Packages, comments: bool = False) -> ET.Element:
    """Return the root of a URDF, or of what a template makes, with its ``comments`` where they are asked for.

    Raises:
        InputError: it is no XML, or a template that makes none.
    """
    try:
        data = expand_template(path, packages) if path.suffix == ".xacro" else read_bytes(path, MOST_TOML)
        return parse_xml(data, comments)
    except (XmlError, ValueError, LookupError, RecursionError) as err:
        raise InputError(f"{path}: cannot be read as URDF ({err})") from err


def _assemble(meshes: MeshFinder, links: dict[str, ET.Element], joints: list[ET.Element], base: str) -> UrdfChain:
    transforms: list[Transform] = []
    ends, revolute = [0], list[UrdfJoint]()
    bodies = [(0, b) for b in _read_bodies(meshes, links[base], np.eye(4))]
    parts: list[tuple[str, int]] = []
    named = [(base, 0)]
    carried = np.eye(4)  # pose of the current URDF link in the last link frame
    for joint in joints:
        name, kind = str(joint.get("name")), joint.get("type")
        xyz, rpy = _read_origin(joint)
        child = links[str(find_child(joint, "child").get("link"))]
        named.append((str(child.get("name")), len(revolute) + (kind != "fixed")))
        if kind == "fixed":
            transforms += frame_with_errors(f"_{name}", xyz, rpy)
            parts.append((name, len(transforms)))
            carried = carried @ _pose_matrix(xyz, rpy)
            bodies += [(len(revolute), b) for b in _read_bodies(meshes, child, carried)]
            continue
        if kind not in ("revolute", "continuous"):
            raise UrdfError(f"joint '{name}' is '{kind}'; only revolute, continuous and fixed are supported")
        if (leader := joint.find("mimic")) is not None:
            raise UrdfError(
                f"joint '{name}' is moved by joint '{leader.get('joint')}' (<mimic>); only joints with a drive of "
                "their own are supported on the way to the tip"
            )
        i = len(revolute) + 1
        rows, sign = _joint_transforms(i, xyz, rpy, np.array(_read_numbers(joint.find("axis"), "xyz", (1, 0, 0))))
        transforms += rows
        ends.append(len(transforms))
        parts.append((name, len(transforms)))
        carried = np.eye(4)
        limit = joint.find("limit")
        free = kind == "continuous"
        lower, upper = (-TURN, TURN) if free or limit is None else (_number(limit, k) for k in ("lower", "upper"))
        if not -MOST_TURNS * TURN <= lower < upper <= MOST_TURNS * TURN:
            raise UrdfError(
                f"joint '{name}': lower = {lower:g} and upper = {upper:g} rad are no limits; the lower one lies below "
                f"the upper one, both within {MOST_TURNS} turns ({MOST_TURNS * TURN:.3g} rad; are these degrees?); a "
                "joint without an end is 'continuous'"
            )
        speed = 0.0 if limit is None else _number(limit, "velocity", 1e6)
        revolute.append(UrdfJoint(name, sign, lower, upper, speed, _read_mass(child)))
        bodies += [(i, b) for b in _read_bodies(meshes, child, np.eye(4))]
    tip = named[-1][0]
    return UrdfChain(
        tuple(transforms), tuple(ends), tuple(revolute), tuple(bodies), tip, tuple(parts), tuple(named), (), ()
    )


def _with_unchecked_links(chain: UrdfChain, links: Mapping[str, ET.Element], bodily: frozenset[str]) -> UrdfChain:
    inside = {name for name, _ in chain.links}
    shapeless = ((name, k) for name, k in chain.links if name in bodily and links[name].find("collision") is None)
    return replace(chain, shapeless=tuple(shapeless), beside=tuple(n for n in links if n in bodily - inside))


def _joint_transforms(i: int, xyz: Array, rpy: Array, axis: Array) -> tuple[list[Transform], int]:
    """Return the transforms of joint i: its origin, and a turn about x, y or z; other axes are turned to z and back.

    A small turn of the origin about the joint's own axis is the error of the joint's zero, and has no name beside it.
    """
    if not np.linalg.norm(axis) > 1e-9:
        raise UrdfError(f"the axis of joint {i} has no length")
    axis = axis / np.linalg.norm(axis)
    k = int(np.argmax(np.abs(axis)))
    rows = frame_with_errors(str(i), xyz, rpy)
    origin, errors = rows[:-3], rows[-3:]
    if abs(axis[k]) > 1 - 1e-9:
        across = [e for e in errors if e.axis != k]
        return [*origin, *across, Transform(f"theta{i}", "rotation", k, 0.0, i - 1)], int(np.sign(axis[k]))
    there = fixed_turns("aligned_", str(i), Rotation.from_matrix(rotation_from_z(axis)).as_euler("ZYX")[::-1])
    back = [replace(t, name=f"{t.name}_back", nominal=-t.nominal) for t in reversed(there)]
    return [*origin, *there, *errors[:2], Transform(f"theta{i}", "rotation", 2, 0.0, i - 1), *back], 1


def _read_bodies(meshes: MeshFinder, link: ET.Element, T_link: Array) -> list[Body]:
    out = []
    for k, element in enumerate(link.findall("collision")):
        T = T_link @ _pose_matrix(*_read_origin(element))
        name = f"{link.get('name')}{f'_{k}' if k else ''}"
        shape = next(iter(find_child(element, "geometry")), None)
        if shape is None:
            raise UrdfError(f"the collision geometry of link '{link.get('name')}' is empty")
        if shape.tag == "sphere":
            out.append(Body(name, "sphere", (_size(shape, "radius"),), read_only(T)))
        elif shape.tag == "box":
            x, y, z = _read_numbers(shape, "size", (0, 0, 0))
            out.append(Body(name, "box", (_positive(shape, x), _positive(shape, y), _positive(shape, z)), read_only(T)))
        elif shape.tag in ("cylinder", "capsule"):  # a capsule holds the cylinder of its radius and length
            half = T[:3, 2] * _size(shape, "length") / 2
            out.append(capsule_between(name, T[:3, 3] - half, T[:3, 3] + half, _size(shape, "radius")))
        else:
            x, y, z = _read_numbers(shape, "scale", (1, 1, 1))
            if not min(abs(x), abs(y), abs(z)) > 0:
                raise UrdfError(f"the mesh of link '{link.get('name')}' has scale 0")
            file = meshes.find_for(str(shape.get("filename")), name)
            out.append(Body(name, "mesh", (), read_only(T), file, (x, y, z), hull=True))
    return out


def _read_mass(link: ET.Element) -> LinkMass | None:
    inertial = link.find("inertial")
    if inertial is None or inertial.find("mass") is None:
        return None
    xyz, _ = _read_origin(inertial)
    mass = _number(find_child(inertial, "mass"), "value", 1e6)
    if mass < 0:
        raise UrdfError(f"the mass of link '{link.get('name')}' is {mass:g} kg")
    return LinkMass(mass, read_only(xyz))


def _read_origin(element: ET.Element) -> tuple[Array, Array]:
    origin = element.find("origin")
    return np.array(_read_numbers(origin, "xyz", (0, 0, 0))), np.array(_read_numbers(origin, "rpy", (0, 0, 0)))


def _pose_matrix(xyz: Array, rpy: Array) -> Array:
    return pose(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)


def _read_numbers(element: ET.Element | None, key: str, default: Vector) -> list[float]:
    if element is None or (text := element.get(key)) is None:
        return list(default)
    found = [_parse_number(element, key, word) for word in text.split()]
    if len(found) != len(default):
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' needs {len(default)} numbers")
    return found


def _number(element: ET.Element, key: str, most: float = MOST_NUMBER) -> float:
    return _parse_number(element, key, element.get(key, "0"), most)


def _parse_number(element: ET.Element, key: str, text: str, most: float = MOST_NUMBER) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= most:
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' is no number up to {most:g}")
    return value


def _size(element: ET.Element, key: str) -> float:
    return _positive(element, _number(element, key))


def _positive(element: ET.Element, value: float) -> float:
    if value <= 0:
        raise UrdfError(f"<{element.tag}>: a size of {value:g} m leaves nothing of the body")
    return value


ORIGIN_DIGITS = 13  # decimals of an origin, in m and rad


def write_urdf(
    path: Path,
    tip: str | None,
    values: Mapping[str, float],
    meshes: Mapping[Path, str],
    remark: str,
    packages: Packages = NO_PACKAGES,
) -> tuple[str, frozenset[str]]:
    """Return the text of the URDF at ``path`` with corrected joint origins, and the transforms of the joints concerned.

    With its own angle at zero a joint is a constant frame: the origin, then the error of its zero about its axis (and
    for a slanted axis the turns to it and back). Their product is the new origin, so any reader of URDF files has the
    corrected geometry. Joints without an error keep their origins as they are written.

    Args:
        path: nominal URDF; ``tip`` its last link.
        values: corrected values of elementary transforms by name [m, rad].
        meshes: what to write for a mesh of a collision body.
        remark: comment for the head of the file.
        packages: as :func:`read_urdf` takes them.

    Raises:
        InputError: as :func:`planner.kinematics.urdf.read_urdf`.
    """
    chain = read_urdf(path, tip, packages)
    root = parse_urdf(path, packages, comments=True)
    joints = {str(j.get("name")): j for j in root.findall("joint")}
    changed: set[str] = set()
    start = 0
    for name, end in chain.parts:
        part = chain.transforms[start:end]
        start = end
        if any(values.get(t.name, t.nominal) != t.nominal for t in part):
            _set_origin(joints[name], part, values)
            changed.update(t.name for t in part)
    _rename_meshes(MeshFinder(path, packages), root, meshes)
    safe = remark.replace("--", "- -")
    return f'<?xml version="1.0"?>\n<!-- {safe} -->\n{ET.tostring(root, encoding="unicode")}\n', frozenset(changed)


def _set_origin(joint: ET.Element, part: tuple[Transform, ...], values: Mapping[str, float]) -> None:
    T = pin.SE3.Identity()
    for t in part:
        T = T * elementary_placement(t, values.get(t.name, t.nominal))
    origin = joint.find("origin")
    if origin is None:
        origin = ET.Element("origin")
        joint.insert(0, origin)
    origin.set("xyz", _format_vector(T.translation))
    origin.set("rpy", _format_vector(pin.rpy.matrixToRpy(T.rotation)))


def _rename_meshes(finder: MeshFinder, root: ET.Element, meshes: Mapping[Path, str]) -> None:
    """Let collision bodies look for their meshes where these are laid beside the new file."""
    for mesh in root.iterfind("link/collision/geometry/mesh"):
        found = finder.find(str(mesh.get("filename")))
        if found is not None and found in meshes:
            mesh.set("filename", meshes[found])


def _format_vector(v: Array) -> str:
    return " ".join(repr(float(c) + 0.0) for c in np.round(v, ORIGIN_DIGITS))
