"""The view in space for the page: a plotly figure, and the little that its player needs to move it."""

import base64
import json

import numpy as np
import plotly.graph_objects as go

from planner.report.picture import ROLES
from planner.report.shapes import Mesh
from planner.report.stage import STAND, Stage
from planner.report.web import FONT, INK
from planner.units import Array

LIGHT = {"ambient": 0.72, "diffuse": 0.55, "specular": 0.04, "roughness": 0.9, "fresnel": 0.02}
LAMP = {"x": 3000, "y": 4000, "z": 9000}
BASE_AXIS, GRID = "rgba(0,0,0,0)", "#EEEEEE"
SYMBOLS = {"calibrate": "circle", "repeat": "diamond", "validate": "square", "mount": "cross"}


def view_json(stage: Stage) -> str:
    """Return the plotly figure of the view as JSON; the moving bodies are its first traces."""
    fig = go.Figure([*_moving(stage), *_standing(stage), *_marks(stage)])
    axis = {
        "backgroundcolor": BASE_AXIS,
        "gridcolor": GRID,
        "zeroline": False,
        "showspikes": False,
        "tickfont": {"size": 11},
    }
    fig.update_layout(
        template=None,
        height=640,
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        font={"family": FONT, "size": 13, "color": INK},
        paper_bgcolor="white",
        legend={"orientation": "h", "x": 0, "y": 0, "yanchor": "bottom", "itemsizing": "constant"},
        scene={
            "aspectmode": "data",
            "camera": {"eye": {"x": 1.35, "y": 1.2, "z": 0.6}, "center": {"x": 0, "y": 0, "z": -0.2}},
            **{
                f"{name}axis": {"title": {"text": f"{name} (mm)"}, "range": [stage.low[k], stage.high[k]], **axis}
                for k, name in enumerate("xyz")
            },
        },
    )
    return str(fig.to_json())


def player_json(stage: Stage) -> str:
    """Return what moves the view: vertices in their carriers' frames, the carriers' poses, a line of text a frame."""
    span = {"all": [stage.low, stage.high], "near": [stage.near_low, stage.near_high]}
    return json.dumps(
        {
            "carriers": stage.frames.poses.shape[1],
            "poses": _packed(stage.frames.poses),
            "groups": [{"vertices": _packed(m.mesh.vertices), "carrier": _packed(m.carrier)} for m in stage.moving],
            "labels": list(stage.frames.labels),
            "ranges": {
                k: [[float(round(a)), float(round(b))] for a, b in zip(*v, strict=True)] for k, v in span.items()
            },
        },
        ensure_ascii=False,
    )


def _packed(values: Array) -> str:
    """Numbers as 32-bit floats in base64: 0.1 µm in a cell of metres is enough to look at."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _mesh(mesh: Mesh, name: str, **look: object) -> go.Mesh3d:
    x, y, z = mesh.vertices.T.astype(np.float32)
    i, j, k = mesh.triangles.T.astype(np.int32)
    return go.Mesh3d(
        x=x, y=y, z=z, i=i, j=j, k=k, name=name, hoverinfo="skip", lighting=LIGHT, lightposition=LAMP, **look
    )


def _moving(stage: Stage) -> list[go.Mesh3d]:
    start = stage.frames.poses[0]
    return [
        _mesh(Mesh(m.at(start), m.mesh.triangles), m.name, facecolor=m.colours, flatshading=False) for m in stage.moving
    ]


def _standing(stage: Stage) -> list[go.Mesh3d]:
    out = [] if stage.standing is None else [_mesh(stage.standing, "obstacles", color=STAND)]
    for k, shell in enumerate(stage.shells):
        name = "outer limit of the bar" if k % 2 else "inner limit of the bar"
        out.append(_mesh(shell, name, color="#56B4E9", opacity=0.10, showlegend=False))
    if stage.floor is not None:
        (x0, y0, _), (x1, y1, _) = stage.low, stage.high
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        ground = Mesh(np.column_stack([corners, np.full(4, stage.floor)]), np.array([[0, 1, 2], [0, 2, 3]]))
        out.append(_mesh(ground, "floor", color="#F3F1EC", opacity=0.6))
    return out


def _marks(stage: Stage) -> list[go.Scatter3d]:
    """Candidates, path, way without the bar, and the poses by role."""
    out = []
    if len(stage.cloud):
        look = {"size": 1.4, "color": "#9A9A9A", "opacity": 0.45}
        out.append(_scatter(stage.cloud, f"candidates ({len(stage.cloud)} shown)", "markers", marker=look))
    for k, path in enumerate(stage.paths):
        out.append(_scatter(path, "measuring path", "lines", k == 0, line={"width": 3, "color": "#444444"}))
    for k, way in enumerate(stage.ways):
        look = {"width": 3, "color": "#999999", "dash": "dash"}
        name = "way without the bar" if stage.shells else "way to the start"
        out.append(_scatter(way, name, "lines", k == 0, line=look))
    for role, colour in ROLES.items():
        spots = [s for s in stage.spots if s.role == role]
        if spots:
            marker = {"size": 4.5, "color": colour, "symbol": SYMBOLS[role], "line": {"width": 0}}
            points = np.array([s.position for s in spots])
            text = [s.label for s in spots]
            out.append(
                _scatter(points, f"{role} ({len(spots)})", "markers", marker=marker, hovertext=text, hoverinfo="text")
            )
    return out


def _scatter(points: Array, name: str, mode: str, show: bool = True, **look: object) -> go.Scatter3d:
    x, y, z = points.T.astype(np.float32)
    look = {"hoverinfo": "skip"} | look
    return go.Scatter3d(x=x, y=y, z=z, name=name, legendgroup=name, mode=mode, showlegend=show, **look)
