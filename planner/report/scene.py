"""The cell in space as one document with packed numbers: what ``static/view/view3d.js`` draws."""

from base64 import b64encode

import numpy as np

from planner.common.schema import StrictModel
from planner.common.units import Array
from planner.report.cell_view import STAND, CellView, Mesh


class ViewPart(StrictModel):
    """Triangles of one look, carried by one link (−1: nothing moves them): packed float32 and uint32."""

    name: str
    carrier: int
    colour: str
    opacity: float = 1.0
    vertices: str
    triangles: str


class ViewLine(StrictModel):
    """A path in space, packed float32 (x, y, z) in mm."""

    name: str
    points: str


class ViewSpot(StrictModel):
    """A measuring pose: where its point is (mm), and what is said of it."""

    position_mm: tuple[float, float, float]
    role: str
    label: str


class SceneView(StrictModel):
    """A cell in space, in mm; ``poses`` holds of every frame and carrier twelve float32, rows of (R | p)."""

    parts: list[ViewPart]
    lines: list[ViewLine]
    spots: list[ViewSpot]
    carriers: int
    frames: int
    poses: str
    labels: list[str]
    low_mm: tuple[float, float, float]
    high_mm: tuple[float, float, float]
    floor_mm: float | None = None


def pack_scene(view: CellView) -> SceneView:
    """Return a view as its document: bodies by the link that carries them, numbers packed."""
    parts = []
    for m in view.moving:
        colours = np.array(m.colours)
        owner = m.carrier[m.mesh.triangles[:, 0]]
        for carrier, colour in sorted({(int(c), str(k)) for c, k in zip(owner, colours, strict=True)}):
            chosen = m.mesh.triangles[(owner == carrier) & (colours == colour)]
            parts.append(_part(m.name, carrier, colour, Mesh(m.mesh.vertices, chosen)))
    if view.standing is not None:
        parts.append(_part("obstacles", -1, STAND, view.standing))
    parts += [_part("reach of the gauge", -1, "#56B4E9", s, 0.12) for s in view.shells]
    lines = [ViewLine(name="measuring path", points=pack_numbers(p)) for p in view.paths]
    lines += [ViewLine(name="path to the start", points=pack_numbers(p)) for p in view.ways]
    poses = view.frames.poses
    return SceneView(
        parts=parts,
        lines=lines,
        spots=[ViewSpot(position_mm=rounded_point(s.position), role=s.role, label=s.label) for s in view.spots],
        carriers=poses.shape[1],
        frames=len(poses),
        poses=pack_numbers(poses),
        labels=list(view.frames.labels),
        low_mm=rounded_point(view.low),
        high_mm=rounded_point(view.high),
        floor_mm=view.floor,
    )


def _part(name: str, carrier: int, colour: str, mesh: Mesh, opacity: float = 1.0) -> ViewPart:
    used, triangles = np.unique(mesh.triangles, return_inverse=True)
    packed = b64encode(np.ascontiguousarray(triangles.ravel(), dtype="<u4").tobytes()).decode("ascii")
    return ViewPart(
        name=name,
        carrier=carrier,
        colour=colour,
        opacity=opacity,
        vertices=pack_numbers(mesh.vertices[used]),
        triangles=packed,
    )


def pack_numbers(values: Array) -> str:
    """Return numbers as 32-bit floats in base64: in a cell of metres that is 0.1 µm."""
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def rounded_point(values: Array) -> tuple[float, float, float]:
    """Return a point (3,) [mm] to a micrometre."""
    x, y, z = (round(float(v), 3) for v in values)
    return (x, y, z)
