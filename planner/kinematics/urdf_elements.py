"""What single elements of a URDF say: shapes and their meshes, masses, origins, numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.files import INPUTS
from planner.common.units import Array, read_only
from planner.kinematics.angle_units import degrees_text
from planner.kinematics.bodies import Body, capsule_between, mesh_unit
from planner.kinematics.geometry import pose, rpy_of
from planner.kinematics.packages import Packages, how_to_name
from planner.kinematics.robot import LinkMass
from planner.kinematics.urdf_tree import UrdfError, find_child

MOST_NUMBER = 1e3  # m, rad, or a scale
SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")


@dataclass(frozen=True)
class MeshFinder:
    """Finds the meshes that the URDF at ``path`` names.

    Attributes:
        path: of the URDF.
        packages: where ``package://`` leads.
        folder: where meshes lie besides, relative to the URDF: ``meshdir`` of a file that is made for MuJoCo.
    """

    path: Path
    packages: Packages
    folder: str = ""

    @classmethod
    def of(cls, path: Path, root: ET.Element, packages: Packages) -> MeshFinder:
        """Return what finds the meshes of the URDF at ``path`` whose root element is ``root``."""
        compiler = root.find("mujoco/compiler")
        return cls(path, packages, "" if compiler is None else compiler.get("meshdir", ""))

    def find(self, filename: str) -> Path | None:
        """Return a mesh in a named package, else beside the URDF or below a folder above it; ``None``: there is none.

        A link out of a named package is not followed, and ``..`` leads out of no package.
        """
        relative = filename.removeprefix("file://")
        if not relative.startswith("package://"):
            above = [folder / relative for folder in self.path.resolve().parents]
            # MuJoCo looks for a URDF's meshes by their names alone (strippath)
            named = [self.path.resolve().parent / self.folder / n for n in (relative, Path(relative).name)]
            return _first_file([*above, *named] if self.folder else above)
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

    def describe_lack(self, filename: str, name: str) -> str:
        """Say that the mesh of the link ``name`` is not there, and what to add."""
        package = filename.removeprefix("package://").partition("/")[0]
        asked, known = filename.startswith("package://"), package in self.packages.folders
        where = f"in the package '{package}'" if asked and known else "in any folder above the file"
        cure = "" if asked and known else f"; {how_to_name(package) if asked else 'lay it beside the file'}"
        return f"{self.path}: the mesh '{filename}' of link '{name}' does not exist {where}{cure}"


def _first_file(candidates: Iterable[Path]) -> Path | None:
    try:
        return next((p for p in candidates if INPUTS.allows(p) and p.is_file()), None)
    except (OSError, ValueError, RuntimeError):  # a name that no file can have
        return None


def read_bodies(meshes: MeshFinder, link: ET.Element, T_link: Array, lacking: list[str]) -> list[Body]:
    """Return the collision shapes of a link whose frame is ``T_link`` (4, 4) [m] in the frame that carries it.

    A mesh that is not there is left out, and ``lacking`` gets a sentence on it: kinematics need none.

    Raises:
        UrdfError: a shape of no size, or no shape.
    """
    out = []
    for k, element in enumerate(link.findall("collision")):
        T = T_link @ pose_matrix(*read_origin(element))
        name = f"{link.get('name')}{f'_{k}' if k else ''}"
        shapes = [e for e in find_child(element, "geometry") if e.tag in SHAPES]
        if len(shapes) != 1:
            found = "has several shapes: give each a <collision> of its own" if shapes else "is empty"
            raise UrdfError(f"the collision geometry of link '{link.get('name')}' {found}", element)
        shape = shapes[0]
        if shape.tag == "sphere":
            out.append(Body(name, "sphere", (_size(shape, "radius"),), read_only(T)))
        elif shape.tag == "box":
            x, y, z = read_numbers(shape, "size", (0, 0, 0))
            out.append(
                Body(
                    name, "box", (_positive_of(shape, x), _positive_of(shape, y), _positive_of(shape, z)), read_only(T)
                )
            )
        elif shape.tag in ("cylinder", "capsule"):  # a capsule holds the cylinder of its radius and length
            half = T[:3, 2] * _size(shape, "length") / 2
            out.append(capsule_between(name, T[:3, 3] - half, T[:3, 3] + half, _size(shape, "radius")))
        else:
            x, y, z = read_numbers(shape, "scale", (1, 1, 1))
            if not min(abs(x), abs(y), abs(z)) > 0:
                raise UrdfError(f"the mesh of link '{link.get('name')}' has scale 0")
            file = meshes.find(str(shape.get("filename")))
            if file is None:
                lacking.append(meshes.describe_lack(str(shape.get("filename")), name))
                continue
            unit = mesh_unit(file)
            out.append(Body(name, "mesh", (), read_only(T), file, (x * unit, y * unit, z * unit), hull=True))
    return [replace(b, part=str(link.get("name"))) for b in out]


def read_mass(link: ET.Element) -> LinkMass | None:
    """Return mass [kg] and centre of mass [m] of a link, ``None`` where the file does not say them."""
    inertial = link.find("inertial")
    if inertial is None or inertial.find("mass") is None:
        return None
    xyz, _ = read_origin(inertial)
    mass = number(find_child(inertial, "mass"), "value", 1e6)
    if mass < 0:
        raise UrdfError(f"the mass of link '{link.get('name')}' is {mass:g} kg")
    return LinkMass(mass, read_only(xyz))


def read_origin(element: ET.Element) -> tuple[Array, Array]:
    """Return ``xyz`` (3,) [m] and ``rpy`` (3,) [rad] of an element's origin, whose turn may be a quaternion (URDF 1.1).

    Raises:
        UrdfError: the turn is said twice, is in degrees, or is no unit quaternion.
    """
    origin = element.find("origin")
    xyz, rpy = (np.array(read_numbers(origin, key, (0.0, 0.0, 0.0))) for key in ("xyz", "rpy"))
    if origin is None:
        return xyz, rpy
    if origin.get("quat_xyzw") is not None:
        if origin.get("rpy") is not None:
            raise UrdfError("<origin> has both rpy and quat_xyzw: keep one of them", origin)
        return xyz, _rpy_of_quaternion(origin)
    if why := degrees_text(rpy.tolist()):
        meant = " ".join(f"{v:.10g}" for v in np.deg2rad(rpy))
        raise UrdfError(f"<origin>: rpy = '{origin.get('rpy')}': {why}; if degrees are meant, write {meant}", origin)
    return xyz, rpy


def _rpy_of_quaternion(origin: ET.Element) -> Array:
    rounding = 1e-3  # of the length of a quaternion that is written with few digits
    quaternion = np.array(read_numbers(origin, "quat_xyzw", (0.0, 0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1.0) <= rounding:
        raise UrdfError(
            f"<origin>: quat_xyzw = '{origin.get('quat_xyzw')}' has the length {length:.4g}, and turns have the length "
            "1; its order is x y z w",
            origin,
        )
    return rpy_of(np.asarray(Rotation.from_quat(quaternion).as_matrix()))


def pose_matrix(xyz: Array, rpy: Array) -> Array:
    """Return the pose (4, 4) of an origin [m, rad]."""
    return pose(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)


def read_numbers(element: ET.Element | None, key: str, default: Sequence[float]) -> list[float]:
    """Return the numbers of an attribute, as many as ``default`` has, which stands where there is none.

    Raises:
        UrdfError: there are more or fewer, or they are no numbers.
    """
    if element is None or (text := element.get(key)) is None:
        return list(default)
    found = [_parse_number(element, key, word) for word in text.split()]
    if len(found) != len(default):
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' needs {len(default)} numbers", element)
    return found


def number(element: ET.Element, key: str, most: float = MOST_NUMBER) -> float:
    """Return the number of an attribute, 0 where there is none.

    Raises:
        UrdfError: it is no number up to ``most``.
    """
    return _parse_number(element, key, element.get(key, "0"), most)


def _parse_number(element: ET.Element, key: str, text: str, most: float = MOST_NUMBER) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= most:
        cure = ": blanks part numbers, no commas" if "," in text else ""
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' is no number up to {most:g}{cure}", element)
    return value


def _size(element: ET.Element, key: str) -> float:
    return _positive_of(element, number(element, key))


def _positive_of(element: ET.Element, value: float) -> float:
    if value <= 0:
        raise UrdfError(f"<{element.tag}>: a size of {value:g} m leaves nothing of the body", element)
    return value


def read_stroke(joint: ET.Element, most: float = MOST_NUMBER) -> tuple[float, float]:
    """Return the limits of a joint [rad, m], the soft ones of its ``<safety_controller>`` where these are narrower.

    Infinite where the file says none, or 0 and 0.

    Raises:
        UrdfError: a limit that is no number up to ``most``, or soft limits outside the others.
    """
    limit = None if joint.get("type") == "continuous" else joint.find("limit")
    lower, upper = (0.0, 0.0) if limit is None else (number(limit, k, most) for k in ("lower", "upper"))
    lower, upper = (lower, upper) if lower or upper else (-np.inf, np.inf)
    if (safety := joint.find("safety_controller")) is None:
        return lower, upper
    soft_lower, soft_upper = (number(safety, f"soft_{k}_limit", most) for k in ("lower", "upper"))
    if soft_lower == soft_upper == 0.0:  # as a file without these two numbers is read everywhere
        return lower, upper
    narrow = max(lower, soft_lower), min(upper, soft_upper)
    if not narrow[0] < narrow[1]:
        raise UrdfError(
            f"joint '{joint.get('name')}': soft limits of {soft_lower:g} to {soft_upper:g} leave nothing of its "
            f"limits, {lower:g} to {upper:g}",
            safety,
        )
    return narrow


def read_positive(element: ET.Element | None, *keys: str) -> float:
    """Return the smallest of some numbers of an element, 0 where it says none of them: 0 and infinity say none.

    Raises:
        UrdfError: one is negative, or no number.
    """
    most = 1e6  # [rad/s², m/s³ …] more is said by no drive
    found = [0.0]
    for key in keys if element is not None else ():
        assert element is not None
        if element.get(key, "").strip().lower() in ("inf", "+inf", "infinity"):
            continue
        found.append(number(element, key, most))
        if found[-1] < 0.0:
            raise UrdfError(f"<{element.tag}>: {key} = {found[-1]:g} is negative", element)
    return min((v for v in found if v), default=0.0)
