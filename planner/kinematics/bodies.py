"""Shapes that may collide: capsules, spheres, boxes and meshes, as files give them and as the code uses them."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal
from xml.parsers import expat

import numpy as np
from pydantic import Field, model_validator
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.common.files import check_read_access
from planner.common.schema import Coordinate, OptionalKeys
from planner.common.units import MM, Array, from_deg, from_mm, read_only
from planner.kinematics.geometry import pose

Vector = tuple[Coordinate, Coordinate, Coordinate]
SizeMm = Annotated[float, Field(gt=0, le=1e6)]  # a kilometre: nothing in a cell is larger
Scale = Annotated[float, Field(gt=0, le=1e4)]


@dataclass(frozen=True)
class Body:
    """One shape in the frame that carries it.

    Attributes:
        name: how messages call it.
        kind: ``capsule`` (along its z, centred), ``sphere``, ``box`` (centred) or ``mesh``.
        size: capsule (radius, length of the straight part), sphere (radius,), box (x, y, z) [m]; mesh ().
        T: pose of the shape in the carrying frame, (4, 4) [m].
        mesh: file of the mesh, or ``None``.
        scale: scale of the mesh.
        hull: whether the convex hull stands for the mesh.
        part: of a robot from a URDF, the link that it is a shape of.
        rigid: of a robot from a URDF, the first of the links that fixed joints make one with that link.
        branch: whether these hang beside the chain from the base to the tip: a finger, a head, a second arm.
    """

    name: str
    kind: Literal["capsule", "sphere", "box", "mesh"]
    size: tuple[float, ...]
    T: Array
    mesh: Path | None = None
    scale: Vector = (1.0, 1.0, 1.0)
    hull: bool = False
    part: str = ""
    rigid: str = ""
    branch: bool = False


def capsule_between(name: str, a: Array, b: Array, radius: float) -> Body:
    """Return the capsule around the segment from ``a`` to ``b`` (3,) [m]."""
    axis = np.asarray(b) - np.asarray(a)
    length = float(np.linalg.norm(axis))
    R = rotation_from_z(axis / length) if length > 0 else np.eye(3)
    T = pose(R, (np.asarray(a) + np.asarray(b)) / 2)
    return Body(name, "capsule", (radius, length), read_only(T))


def rotation_from_z(direction: Array) -> Array:
    """Return the smallest rotation (3, 3) that takes z to the unit vector ``direction``."""
    z = np.array([0.0, 0.0, 1.0])
    axis, cosine = np.cross(z, direction), float(direction[2])
    norm = float(np.linalg.norm(axis))
    if norm < 1e-12:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    return np.asarray(Rotation.from_rotvec(axis / norm * np.arctan2(norm, cosine)).as_matrix())


def mesh_unit(path: Path) -> float:
    """Return the unit [m] of a mesh's numbers: what a COLLADA file says of it, as RViz and Gazebo read it, else 1.

    Its ``<up_axis>`` is passed over, as they do: files for robots have z up whatever it says.

    Raises:
        InputError: a unit that is no length.
    """
    if path.suffix.lower() != ".dae":
        return 1.0
    found: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        """Note the unit of the whole file; an asset of a part has none of its own."""
        open_tags.append(tag.rpartition(":")[2])
        if open_tags[1:] == ["asset", "unit"]:
            found.append(attributes.get("meter", "1"))

    def end(_: str) -> None:
        """Look no further than the end of the file's head."""
        if open_tags[1:] == ["asset"]:
            found.append("1")
        open_tags.pop()

    parser, open_tags = expat.ParserCreate(), list[str]()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    with path.open("rb") as file, suppress(expat.ExpatError):  # what reads the mesh refuses what is no XML
        while not found and (chunk := file.read(16384)):  # the unit stands in its first lines
            parser.Parse(chunk)
    text = found[0] if found else "1"
    try:
        unit = float(text)
    except ValueError:
        unit = 0.0
    if not 1e-9 <= unit <= 1e3:
        raise InputError(f'{path}: <unit meter="{text}">: a length in metres is needed, such as 0.001')
    return unit


class BodyFile(OptionalKeys):
    """A shape as a cell or robot file gives it.

    ``unit``: of a mesh's numbers, before ``scale`` (metres, unless a COLLADA file says another); ``hull``: whether its
    convex hull stands for it.
    """

    name: str | None = None
    kind: Literal["capsule", "sphere", "box", "mesh"]
    from_mm: Vector | None = None
    to_mm: Vector | None = None
    at_mm: Vector | None = None
    rpy_deg: Vector = (0.0, 0.0, 0.0)
    radius_mm: SizeMm | None = None
    size_mm: tuple[SizeMm, SizeMm, SizeMm] | None = None
    file: str | None = None
    unit: Literal["m", "mm"] | None = None
    scale: tuple[Scale, Scale, Scale] = (1.0, 1.0, 1.0)
    hull: bool = False
    LATER: ClassVar[tuple[str, ...]] = ("unit", "hull")

    @model_validator(mode="after")
    def _check_complete(self) -> "BodyFile":
        needed = {
            "capsule": ("from_mm", "to_mm", "radius_mm"),
            "sphere": ("at_mm", "radius_mm"),
            "box": ("at_mm", "size_mm"),
            "mesh": ("file",),
        }[self.kind]
        missing = [key for key in needed if getattr(self, key) is None]
        if missing:
            raise ValueError(f"a {self.kind} needs {', '.join(missing)}")
        return self

    def body(self, name: str, where: Path) -> Body:
        """Convert to SI; ``where`` is the folder that mesh files are relative to.

        Raises:
            InputError: the mesh file does not exist, or lies where nothing may be read.
        """
        name = self.name or name
        if self.kind == "capsule":
            assert self.from_mm
            assert self.to_mm
            assert self.radius_mm
            return capsule_between(name, from_mm(self.from_mm), from_mm(self.to_mm), float(from_mm(self.radius_mm)))
        R = Rotation.from_euler("xyz", from_deg(self.rpy_deg)).as_matrix()
        T = pose(R, from_mm(self.at_mm or (0.0, 0.0, 0.0)))
        if self.kind == "mesh":
            path = (where / str(self.file)).resolve()
            check_read_access(path)
            if not path.is_file():
                raise InputError(f"{where}: the mesh '{self.file}' of body '{name}' does not exist")
            unit = mesh_unit(path) if self.unit is None else {"m": 1.0, "mm": MM}[self.unit]
            x, y, z = (s * unit for s in self.scale)
            return Body(name, "mesh", (), read_only(T), path, (x, y, z), self.hull)
        size = (self.radius_mm,) if self.kind == "sphere" else self.size_mm
        return Body(name, self.kind, tuple(float(v) for v in from_mm(size)), read_only(T))  # type: ignore[arg-type]


class LinkBodyFile(BodyFile):
    """A shape on a robot link: link 0 is the base, link i the frame after row i."""

    link: int = Field(ge=0)
