"""The view of the cell for the page (plotly, with a player) and for print (matplotlib)."""

import base64
import json

import numpy as np
import plotly.graph_objects as go
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from planner.common.units import Array
from planner.report.cell_view import STAND, CellView, Mesh
from planner.report.chart import ROLES
from planner.report.matplotlib_backend import figure_png, print_style
from planner.report.plotly_backend import FONT, INK

PLOTLY_LIGHT = {"ambient": 0.72, "diffuse": 0.55, "specular": 0.04, "roughness": 0.9, "fresnel": 0.02}
PLOTLY_LAMP = {"x": 3000, "y": 4000, "z": 9000}
BASE_AXIS, GRID = "rgba(0,0,0,0)", "#EEEEEE"
SYMBOLS = {"calibrate": "circle", "repeat": "diamond", "validate": "square", "mount": "cross"}


def view_json(stage: CellView) -> str:
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


def player_json(stage: CellView) -> str:
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
        x=x,
        y=y,
        z=z,
        i=i,
        j=j,
        k=k,
        name=name,
        hoverinfo="skip",
        lighting=PLOTLY_LIGHT,
        lightposition=PLOTLY_LAMP,
        **look,
    )


def _moving(stage: CellView) -> list[go.Mesh3d]:
    start = stage.frames.poses[0]
    return [
        _mesh(Mesh(m.at(start), m.mesh.triangles), m.name, facecolor=m.colours, flatshading=False) for m in stage.moving
    ]


def _standing(stage: CellView) -> list[go.Mesh3d]:
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


def _marks(stage: CellView) -> list[go.Scatter3d]:
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


PRINT_LIGHT = np.array([0.35, 0.45, 0.82])
PRINT_MARKERS = {"calibrate": "o", "repeat": "D", "validate": "s", "mount": "P"}


def view_png(stage: CellView) -> bytes:
    """Return a PNG with the whole cell on the left and the gauge's surroundings on the right."""
    with print_style():
        figure = Figure(figsize=(10.0, 5.2))
        for k, (low, high) in enumerate(((stage.low, stage.high), (stage.near_low, stage.near_high))):
            ax = figure.add_axes((0.04 + 0.48 * k, 0.06, 0.46, 0.94), projection="3d", computed_zorder=False)
            _draw(ax, stage, low, high, near=bool(k))
        handles, labels = figure.axes[1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=6, fontsize=9)
        return figure_png(figure)


def _draw(ax: Axes3D, stage: CellView, low: Array, high: Array, near: bool) -> None:
    for shell in stage.shells[1::2]:
        ax.add_collection3d(
            Poly3DCollection(shell.vertices[shell.triangles], facecolor="#56B4E918", edgecolor="none", zorder=1)
        )
    if near and len(stage.cloud):
        ax.plot(*stage.cloud.T, ".", color="#9A9A9A", markersize=0.8, alpha=0.6, zorder=2, label="candidates")
    # what lies outside the box would be drawn over the rest, so the view from near shows the bar alone, or the balls
    bodies = [
        (m.at(stage.frames.poses[0]), m.mesh.triangles, m.colours)
        for m in stage.moving
        if not near or (stage.shells and m.name == "bar")
    ]
    if stage.standing is not None and not (near and stage.shells):
        bodies.append((stage.standing.vertices, stage.standing.triangles, (STAND,) * len(stage.standing.triangles)))
    if bodies:
        corners = np.vstack([v[t] for v, t, _ in bodies])
        colours = np.vstack([_shaded(Mesh(v, t), c) for v, t, c in bodies])
        ax.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=3))
    for path in stage.paths:
        ax.plot(*path.T, "-", color="#444444", linewidth=0.9, zorder=4)
    for way in stage.ways if not near else ():
        ax.plot(*way.T, "--", color="#777777", linewidth=0.9, zorder=4)
    there = [r for r in ROLES if any(s.role == r for s in stage.spots)]
    for k, role in enumerate(there):  # those that come first lie on top, smaller: several poses may share a place
        points = np.array([s.position for s in stage.spots if s.role == role])
        size = (4 if near else 2) + 1.2 * k * (not stage.shells)
        ax.plot(*points.T, PRINT_MARKERS[role], color=ROLES[role], markersize=size, label=role, zorder=9 - k)
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(ax, f"set_{name}lim")(a, b)
        getattr(ax, f"set_{name}label")(f"{name} (mm)", fontsize=8)
        getattr(ax, f"{name}axis").set_major_locator(MaxNLocator(5))
        ax.tick_params(axis=name, labelsize=7, pad=-1)
        getattr(ax, f"{name}axis").set_pane_color((1, 1, 1, 0))
    ax.set_box_aspect(high - low)
    ax.view_init(elev=22, azim=42)


def _shaded(mesh: Mesh, colours: tuple[str, ...]) -> Array:
    """Colour of each triangle in the light of one far lamp, (t, 3)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    bright = 0.62 + 0.38 * np.abs(normal @ PRINT_LIGHT)
    palette = {name: to_rgb(name) for name in set(colours)}
    return np.asarray(np.array([palette[name] for name in colours]) * bright[:, None])
