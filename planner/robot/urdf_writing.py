"""Writes a corrected URDF: errors of frames and joint zeros are folded into the joints' origins, exactly."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from planner.chain import Transform
from planner.robot.model import elementary
from planner.robot.urdf import find_mesh, read_urdf
from planner.units import Array

DIGITS = 13  # decimals of an origin, in m and rad


def corrected_urdf(
    path: Path, tip: str | None, values: Mapping[str, float], meshes: Mapping[Path, str], remark: str
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

    Raises:
        InputError: as :func:`planner.robot.urdf.read_urdf`.
    """
    chain = read_urdf(path, tip)
    root = ET.parse(path, ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))).getroot()
    joints = {str(j.get("name")): j for j in root.findall("joint")}
    changed: set[str] = set()
    start = 0
    for name, end in chain.parts:
        part = chain.transforms[start:end]
        start = end
        if any(values.get(t.name, t.nominal) != t.nominal for t in part):
            _set_origin(joints[name], part, values)
            changed.update(t.name for t in part)
    _carry_meshes(path, root, meshes)
    safe = remark.replace("--", "- -")
    return f'<?xml version="1.0"?>\n<!-- {safe} -->\n{ET.tostring(root, encoding="unicode")}\n', frozenset(changed)


def _set_origin(joint: ET.Element, part: tuple[Transform, ...], values: Mapping[str, float]) -> None:
    T = pin.SE3.Identity()
    for t in part:
        T = T * elementary(t, values.get(t.name, t.nominal))
    origin = joint.find("origin")
    if origin is None:
        origin = ET.Element("origin")
        joint.insert(0, origin)
    origin.set("xyz", _text(T.translation))
    origin.set("rpy", _text(pin.rpy.matrixToRpy(T.rotation)))


def _carry_meshes(path: Path, root: ET.Element, meshes: Mapping[Path, str]) -> None:
    """Let collision bodies look for their meshes where these are laid beside the new file."""
    for mesh in root.iterfind("link/collision/geometry/mesh"):
        found = find_mesh(path, str(mesh.get("filename")))
        if found is not None and found in meshes:
            mesh.set("filename", meshes[found])


def _text(v: Array) -> str:
    return " ".join(repr(float(c) + 0.0) for c in np.round(v, DIGITS))
