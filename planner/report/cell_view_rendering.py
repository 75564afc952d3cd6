"""The view of the cell for the page (plotly, with a player) and for print (matplotlib)."""

import base64
import json
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from planner.common.units import Array
from planner.report.cell_view import STAND, CellView, Mesh
from planner.report.chart import ROLES
from planner.report.matplotlib_backend import figure_png, print_style
from planner.report.plotly_backend import FONT, INK, Properties, figure_json

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
    layout = {
        "height": 640,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "white",
        "legend": {"orientation": "h", "x": 0, "y": 0, "yanchor": "bottom", "itemsizing": "constant"},
        "scene": {"aspectmode": "data", "camera": eye, **spans},
    }
    return figure_json([*_bodies(view), *_lines(view), *_poses(view)], layout)


def player_json(view: CellView) -> str:
    """Return what moves the view: vertices in their carriers' frames, the carriers' poses, a line of text a frame."""
    spans = {"all": (view.low, view.high), "near": (view.near_low, view.near_high)}
    data = {
        "carriers": view.frames.poses.shape[1],
        "poses": _encode(view.frames.poses),
        "groups": [{"vertices": _encode(m.mesh.vertices), "carrier": _encode(m.carrier)} for m in view.moving],
        "labels": list(view.frames.labels),
        "ranges": {k: (np.round(np.stack(v, axis=1)) + 0.0).tolist() for k, v in spans.items()},
    }
    return json.dumps(data, ensure_ascii=False)


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
    way = f"way without the {view.noun}" if view.shells else "way to the start"
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


PRINT_LIGHT = np.array([0.35, 0.45, 0.82])
PRINT_MARKERS = {"calibrate": "o", "repeat": "D", "validate": "s", "mount": "P"}


def view_png(view: CellView) -> bytes:
    """Return a PNG with the whole cell on the left and the gauge's surroundings on the right."""
    with print_style():
        figure = Figure(figsize=(10.0, 5.2))
        for k, (low, high) in enumerate(((view.low, view.high), (view.near_low, view.near_high))):
            ax = figure.add_axes((0.04 + 0.48 * k, 0.06, 0.46, 0.94), projection="3d", computed_zorder=False)
            _draw(ax, view, low, high, near=bool(k))
        handles, labels = figure.axes[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=6, fontsize=9)
        return figure_png(figure)


def _draw(ax: Axes3D, view: CellView, low: Array, high: Array, near: bool) -> None:
    for shell in view.shells[1::2]:
        ax.add_collection3d(
            Poly3DCollection(shell.vertices[shell.triangles], facecolor="#56B4E918", edgecolor="none", zorder=1)
        )
    if near and len(view.cloud):
        ax.plot(*view.cloud.T, ".", color="#9A9A9A", markersize=0.8, alpha=0.6, zorder=2, label="candidates")
    # what lies outside the box would be drawn over the rest, so the view from near shows the bar alone, or the balls
    bodies = [
        (m.at(view.frames.poses[0]), m.mesh.triangles, m.colours)
        for m in view.moving
        if not near or (view.shells and m.name == view.noun)
    ]
    if view.standing is not None and not (near and view.shells):
        bodies.append((view.standing.vertices, view.standing.triangles, (STAND,) * len(view.standing.triangles)))
    if bodies:
        corners = np.vstack([v[t] for v, t, _ in bodies])
        colours = np.vstack([_shade(Mesh(v, t), c) for v, t, c in bodies])
        ax.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=3))
    for path in view.paths:
        ax.plot(*path.T, "-", color="#444444", linewidth=0.9, zorder=4)
    for way in view.ways if not near else ():
        ax.plot(*way.T, "--", color="#777777", linewidth=0.9, zorder=4)
    there = [r for r in ROLES if any(s.role == r for s in view.spots)]
    for k, role in enumerate(there):  # those that come first lie on top, smaller: several poses may share a place
        points = np.array([s.position for s in view.spots if s.role == role])
        size = (4 if near else 2) + 1.2 * k * (not view.shells)
        ax.plot(*points.T, PRINT_MARKERS[role], color=ROLES[role], markersize=size, label=role, zorder=9 - k)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(ax, f"set_{name}lim")(a, b)
        getattr(ax, f"set_{name}label")(f"{name} (mm)", fontsize=8)
        getattr(ax, f"{name}axis").set_major_locator(MaxNLocator(5))
        ax.tick_params(axis=name, labelsize=7, pad=-1)
        getattr(ax, f"{name}axis").set_pane_color((1, 1, 1, 0))
    ax.set_box_aspect(high - low)
    ax.view_init(elev=22, azim=42)


def _shade(mesh: Mesh, colours: tuple[str, ...]) -> Array:
    """Colour of each triangle in the light of one far lamp, (t, 3)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    bright = 0.62 + 0.38 * np.abs(normal @ PRINT_LIGHT)
    palette = {name: to_rgb(name) for name in set(colours)}
    return np.asarray(np.array([palette[name] for name in colours]) * bright[:, None])
