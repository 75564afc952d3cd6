"""What single elements of a URDF say: shapes and their meshes, masses, origins, numbers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import INPUTS
from planner.common.units import Array, read_only
from planner.kinematics.bodies import Body, Vector, capsule_between
from planner.kinematics.geometry import pose
from planner.kinematics.packages import Packages, how_to_name
from planner.kinematics.robot import LinkMass
from planner.kinematics.urdf_tree import UrdfError, find_child

MOST_NUMBER = 1e3  # m, rad, or a scale


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

    def find_for(self, filename: str, name: str) -> Path:
        """Return the mesh of the link ``name``.

        Raises:
            InputError: there is none; with what to add.
        """
        found = self.find(filename)
        if found is None:
            package = filename.removeprefix("package://").partition("/")[0]
            asked, known = filename.startswith("package://"), package in self.packages.folders
            where = f"in the package '{package}'" if asked and known else "in any folder above the file"
            cure = "" if asked and known else f"; {how_to_name(package) if asked else 'lay it beside the file'}"
            raise InputError(f"{self.path}: the mesh '{filename}' of link '{name}' does not exist {where}{cure}")
        return found


def _first_file(candidates: Iterable[Path]) -> Path | None:
    try:
        return next((p for p in candidates if INPUTS.allows(p) and p.is_file()), None)
    except (OSError, ValueError, RuntimeError):  # a name that no file can have
        return None


def read_bodies(meshes: MeshFinder, link: ET.Element, T_link: Array) -> list[Body]:
    """Return the collision shapes of a link whose frame is ``T_link`` (4, 4) [m] in the frame that carries it.

    Raises:
        UrdfError, InputError: a shape of no size, or a mesh that is not there.
    """
    out = []
    for k, element in enumerate(link.findall("collision")):
        T = T_link @ pose_matrix(*read_origin(element))
        name = f"{link.get('name')}{f'_{k}' if k else ''}"
        shape = next(iter(find_child(element, "geometry")), None)
        if shape is None:
            raise UrdfError(f"the collision geometry of link '{link.get('name')}' is empty")
        if shape.tag == "sphere":
            out.append(Body(name, "sphere", (_size(shape, "radius"),), read_only(T)))
        elif shape.tag == "box":
            x, y, z = read_numbers(shape, "size", (0, 0, 0))
            out.append(
                Body(
                    name,
                    "box",
                    (_positive_of(shape, x), _positive_of(shape, y), _positive_of(shape, z)),
                    read_only(T),
                )
            )
        elif shape.tag in ("cylinder", "capsule"):  # a capsule holds the cylinder of its radius and length
            half = T[:3, 2] * _size(shape, "length") / 2
            out.append(capsule_between(name, T[:3, 3] - half, T[:3, 3] + half, _size(shape, "radius")))
        else:
            x, y, z = read_numbers(shape, "scale", (1, 1, 1))
            if not min(abs(x), abs(y), abs(z)) > 0:
                raise UrdfError(f"the mesh of link '{link.get('name')}' has scale 0")
            file = meshes.find_for(str(shape.get("filename")), name)
            out.append(Body(name, "mesh", (), read_only(T), file, (x, y, z), hull=True))
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
    """Return ``xyz`` (3,) [m] and ``rpy`` (3,) [rad] of an element's origin."""
    origin = element.find("origin")
    return np.array(read_numbers(origin, "xyz", (0, 0, 0))), np.array(read_numbers(origin, "rpy", (0, 0, 0)))


def pose_matrix(xyz: Array, rpy: Array) -> Array:
    """Return the pose (4, 4) of an origin [m, rad]."""
    return pose(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)


def read_numbers(element: ET.Element | None, key: str, default: Vector) -> list[float]:
    """Return the three numbers of an attribute, or ``default`` where there is none.

    Raises:
        UrdfError: there are not three, or they are no numbers.
    """
    if element is None or (text := element.get(key)) is None:
        return list(default)
    found = [_parse_number(element, key, word) for word in text.split()]
    if len(found) != len(default):
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' needs {len(default)} numbers")
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
        raise UrdfError(f"<{element.tag}>: {key} = '{text}' is no number up to {most:g}{cure}")
    return value


def _size(element: ET.Element, key: str) -> float:
    return _positive_of(element, number(element, key))


def _positive_of(element: ET.Element, value: float) -> float:
    if value <= 0:
        raise UrdfError(f"<{element.tag}>: a size of {value:g} m leaves nothing of the body")
    return value
