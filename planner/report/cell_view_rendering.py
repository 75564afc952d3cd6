"""The view of the cell for the page (plotly, with a player)."""

import base64
import json
from typing import Any

import numpy as np

from planner.common.units import Array
from planner.report.cell_view import STAND, CellView, Mesh
from planner.report.chart import ROLES
from planner.report.plotly_backend import FONT, INK, Properties, figure_json

# light from high up on the right: shapes show, and no side is black
SURFACE = {
    "hoverinfo": "skip",
    "lighting": {"ambient": 0.72, "diffuse": 0.55, "specular": 0.04, "roughness": 0.9, "fresnel": 0.02},
    "lightposition": {"x": 3000, "y": 4000, "z": 9000},
}
AXIS = {
    "backgroundcolor": "rgba(0,0,0,0)",
    "gridcolor": "#EEEEEE",
    "zeroline": False,
    "showspikes": False,
    "tickfont": {"size": 11},
}
SYMBOLS = {"calibrate": "circle", "repeat": "diamond", "validate": "square", "mount": "cross"}


def view_json(view: CellView) -> str:
    """Return the plotly figure of the view as JSON; the moving bodies are its first traces."""
    span = np.stack([view.low, view.high], axis=1).tolist()
    spans = {f"{x}axis": {"title": {"text": f"{x} (mm)"}, "range": span[k], **AXIS} for k, x in enumerate("xyz")}
    eye = {"eye": {"x": 1.35, "y": 1.2, "z": 0.6}, "center": {"x": 0, "y": 0, "z": -0.2}}
    # 0.06: of the height, below the scene: labels of ticks end above it
    layout = {
        "height": 640,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "white",
        "legend": {"orientation": "h", "x": 0, "y": 0, "yanchor": "bottom", "itemsizing": "constant"},
        "scene": {"aspectmode": "data", "camera": eye, "domain": {"y": [0.06, 1.0]}, **spans},
    }
    return figure_json([*_bodies(view), *_lines(view), *_poses(view)], layout)


def player_json(view: CellView) -> str:
    """Return the data that moves the view: vertices in their carriers' frames, their poses, one text a frame."""
    spans = {"all": (view.low, view.high), "near": (view.near_low, view.near_high)}
    data = {
        "carriers": view.frames.poses.shape[1],
        "poses": _encode(view.frames.poses),
        "groups": [{"vertices": _encode(m.mesh.vertices), "carrier": _encode(m.carrier)} for m in view.moving],
        "labels": list(view.frames.labels),
        "ranges": {k: (np.round(np.stack(v, axis=1)) + 0.0).tolist() for k, v in spans.items()},
    }
    return json.dumps(data, ensure_ascii=False, allow_nan=False)


def _encode(values: Array) -> str:
    """Numbers as 32-bit floats in base64: 0.1 µm in a cell of metres is enough to look at."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _mesh(mesh: Mesh, name: str, **look: object) -> Properties:
    x, y, z = mesh.vertices.T.astype(np.float32)
    i, j, k = mesh.triangles.T.astype(np.int32)
    return {"type": "mesh3d", "x": x, "y": y, "z": z, "i": i, "j": j, "k": k, "name": name, **SURFACE, **look}


def _bodies(view: CellView) -> list[Properties]:
    """Robot, tool and bar in the first frame, then obstacles, shells of the bar's reach and the floor."""
    out = []
    for m in view.moving:
        here = Mesh(m.at(view.frames.poses[0]), m.mesh.triangles)
        out.append(_mesh(here, m.name, facecolor=m.colours, flatshading=False))
    if view.standing is not None:
        out.append(_mesh(view.standing, "obstacles", color=STAND))
    for k, shell in enumerate(view.shells):
        name = f"{'outer' if k % 2 else 'inner'} limit of the {view.noun}"
        out.append(_mesh(shell, name, color="#56B4E9", opacity=0.10, showlegend=False))
    if view.floor is not None:
        (x0, y0, _), (x1, y1, _) = view.low, view.high
        corners = np.array([[x0, y0, view.floor], [x1, y0, view.floor], [x1, y1, view.floor], [x0, y1, view.floor]])
        out.append(_mesh(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), "floor", color="#F3F1EC", opacity=0.6))
    return out


def _lines(view: CellView) -> list[Properties]:
    """Candidates, measuring paths, and ways without the bar."""
    out = []
    if len(view.cloud):
        look = {"size": 1.4, "color": "#9A9A9A", "opacity": 0.45}
        out.append(_scatter(view.cloud, f"candidates ({len(view.cloud)} shown)", "markers", marker=look))
    way = f"path without the {view.noun}" if view.shells else "path to the start"
    for name, lines, look in (
        ("measuring path", view.paths, {"width": 3, "color": "#444444"}),
        (way, view.ways, {"width": 3, "color": "#999999", "dash": "dash"}),
    ):
        out += [_scatter(points, name, "lines", k == 0, line=look) for k, points in enumerate(lines)]
    return out


def _poses(view: CellView) -> list[Properties]:
    """The measuring poses by role."""
    out = []
    for role, colour in ROLES.items():
        spots = [s for s in view.spots if s.role == role]
        if spots:
            look = {"size": 4.5, "color": colour, "symbol": SYMBOLS[role], "line": {"width": 0}}
            hover: dict[str, Any] = {"hovertext": [s.label for s in spots], "hoverinfo": "text"}
            points = np.array([s.position for s in spots])
            out.append(_scatter(points, f"{role} ({len(spots)})", "markers", marker=look, **hover))
    return out


def _scatter(points: Array, name: str, mode: str, show: bool = True, **look: Any) -> Properties:
    x, y, z = points.T.astype(np.float32)
    look = {"hoverinfo": "skip"} | look
    look |= {"name": name, "legendgroup": name, "mode": mode, "showlegend": show}
    return {"type": "scatter3d", "x": x, "y": y, "z": z, **look}
