"""Writes a URDF again, with corrected joint origins."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from planner.common.units import Array
from planner.kinematics.chain import Transform
from planner.kinematics.geometry import rpy_of
from planner.kinematics.packages import NO_PACKAGES, Packages
from planner.kinematics.robot import elementary_placement
from planner.kinematics.urdf import parse_urdf, read_urdf
from planner.kinematics.urdf_elements import MeshFinder


def write_urdf(
    path: Path,
    tip: str | None,
    values: Mapping[str, float],
    meshes: Mapping[Path, str],
    remark: str,
    packages: Packages = NO_PACKAGES,
    parked: Mapping[str, float] | None = None,
    base: str | None = None,
) -> tuple[str, frozenset[str]]:
    """Return the text of the URDF at ``path`` with corrected joint origins, and the transforms of the joints concerned.

    With its own angle at zero a joint is a constant frame: the origin, then the error of its zero about its axis (and
    for a slanted axis the turns to it and back). Their product is the new origin, so any reader of URDF files has the
    corrected geometry. Joints without an error keep their origins as they are written.

    Args:
        path: nominal URDF; ``tip`` the chain's last link.
        values: corrected values of elementary transforms by name [m, rad].
        meshes: what to write for a mesh, of a body or to look at.
        remark: comment for the head of the file.
        packages, parked, base: as :func:`planner.kinematics.urdf.read_urdf` takes them.

    Raises:
        InputError: as :func:`planner.kinematics.urdf.read_urdf`.
    """
    chain = read_urdf(path, tip, packages, parked, base)
    root = parse_urdf(path, packages, comments=True)
    joints = {str(j.get("name")): j for j in root.findall("joint")}
    changed: set[str] = set()
    start = 0
    for name, end, motion in chain.parts:
        part = chain.transforms[start:end]
        start = end
        if any(values.get(t.name, t.nominal) != t.nominal for t in part):
            _set_origin(joints[name], part, values, motion)
            changed.update(t.name for t in part)
    _rename_meshes(MeshFinder.of(path, root, packages), root, meshes)
    _declare_prefixes(root)
    safe = remark.replace("--", "- -")
    return f'<?xml version="1.0"?>\n<!-- {safe} -->\n{ET.tostring(root, encoding="unicode")}\n', frozenset(changed)


def _set_origin(joint: ET.Element, part: tuple[Transform, ...], values: Mapping[str, float], motion: Array) -> None:
    """Write a joint's origin: the product of its transforms, without the ``motion`` (4, 4) to where it stands."""
    T = np.eye(4)
    for t in part:
        T = T @ elementary_placement(t, values.get(t.name, t.nominal))
    T = T @ np.linalg.inv(motion)
    origin = joint.find("origin")
    if origin is None:
        origin = ET.Element("origin")
        joint.insert(0, origin)
    origin.attrib.pop("quat_xyzw", None)
    origin.set("xyz", _format_vector(T[:3, 3]))
    origin.set("rpy", _format_vector(rpy_of(T[:3, :3])))


def _rename_meshes(finder: MeshFinder, root: ET.Element, meshes: Mapping[Path, str]) -> None:
    """Let links look for their meshes where these are laid beside the new file."""
    for mesh in root.iterfind("link/*/geometry/mesh"):
        found = finder.find(str(mesh.get("filename")))
        found = None if found is None else found.resolve()
        if found is not None and found in meshes:
            mesh.set("filename", meshes[found])
            for compiler in root.iterfind("mujoco/compiler"):
                compiler.set("meshdir", Path(meshes[found]).parent.as_posix())


def _declare_prefixes(root: ET.Element) -> None:
    """Declare the prefixes of foreign tags that the file does not, as readers of XML name spaces want it."""
    names = [n for e in root.iter() if isinstance(e.tag, str) for n in (e.tag, *e.attrib)]
    declared = {n.partition(":")[2] for n in names if n.startswith("xmlns:")}
    for prefix in sorted({n.partition(":")[0] for n in names if ":" in n} - declared - {"xmlns", "xml"}):
        root.set(f"xmlns:{prefix}", f"urn:{prefix}")


def find_meshes(path: Path, packages: Packages = NO_PACKAGES) -> tuple[Path, ...]:
    """Return the mesh files (collision and visual) that the URDF at ``path`` names for its links, if they exist."""
    root = parse_urdf(path, packages)
    finder = MeshFinder.of(path, root, packages)
    named = (str(mesh.get("filename")) for mesh in root.iterfind("link/*/geometry/mesh"))
    return tuple(dict.fromkeys(found.resolve() for found in map(finder.find, named) if found is not None))


def _format_vector(v: Array) -> str:
    return " ".join(repr(float(c) + 0.0) for c in np.round(v, 13))  # decimals of an origin, in m and rad
