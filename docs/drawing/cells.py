"""Pictures and films of cells: the bodies that planning checks, in a measuring pose or along a planned way."""

import json
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from PIL import Image

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.units import Array, to_mm
from planner.design.candidates.balls import draw_ball_candidates
from planner.design.candidates.pool import draw_candidates
from planner.report.cell_view import STAND, CellView, Mesh, ViewFrames, carrier_poses, compose_cell_view, tool_points
from planner.report.chart import BLUE, ORANGE
from planner.report.matplotlib_backend import figure_png, print_style

LIGHT = np.array([0.35, 0.45, 0.82])  # direction of the lamp
CANDIDATES = 100  # measuring poses of which the one nearest to home is shown
FRAMES, FRAME_MS = 24, 200  # of a film
FILM_COLOURS = 48  # of a film's palette
SIZE, FILM_SIZE = (5.2, 4.2), (4.6, 3.8)  # [inch]
STILL_DPI, FILM_DPI = 130, 105
ZOOM = 1.12  # of the box in its picture
ELEVATION, AZIMUTH = 18, 42  # of the eye [deg]


def cell_picture(path: Path) -> bytes:
    """Return a PNG of a cell in the measuring pose that is nearest to its home."""
    cell = load_cell(path)
    draw = draw_ball_candidates if cell.gauge.at_balls else draw_candidates
    pool, mounting = draw(cell, CANDIDATES, 0), cell.mountings[0]
    here = pool.q[pool.samples.at_mounting(mounting)]
    q = here[np.linalg.norm(here - cell.home, axis=1).argmin()][None]
    view = compose_cell_view(cell, ViewFrames(carrier_poses(cell, mounting, q), ("",)))
    with print_style():
        figure, ax = _figure(SIZE, STILL_DPI)
        _draw(ax, cell, view, view.frames.poses[0], tool_points(cell, mounting, q))
        return figure_png(figure, small=True)


def session_film(plan: Path, cell_file: Path) -> bytes:
    """Return a GIF of the way that a plan's first drive takes with the gauge; a dot stays at each pose."""
    cell = load_cell(cell_file)
    drive = json.loads(plan.read_text())["drives"][0]
    corners = np.radians([w["q_deg"] for w in drive["waypoints"]])
    visits = np.array([w["visit"] for w in drive["waypoints"]])
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners, axis=0)).max(axis=1))])
    at = np.linspace(0.0, along[-1], FRAMES)
    q = np.stack([np.interp(at, along, c) for c in corners.T], axis=1)
    mounting = cell.mountings[0]
    measured, passed = tool_points(cell, mounting, corners[visits >= 0]), along[visits >= 0]
    view = compose_cell_view(
        cell, ViewFrames(carrier_poses(cell, mounting, q), ("",) * FRAMES), paths=(tool_points(cell, mounting, q),)
    )
    images = []
    with print_style():
        for k, poses in enumerate(view.frames.poses):
            figure, ax = _figure(FILM_SIZE, FILM_DPI)
            _draw(ax, cell, view, poses, tool_points(cell, mounting, q[k : k + 1]), measured[passed <= at[k] + 1e-9])
            images.append(_image(figure))
    palette = images[-1].quantize(FILM_COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few = [i.quantize(palette=palette, dither=Image.Dither.NONE) for i in images]
    out = BytesIO()
    few[0].save(out, "GIF", save_all=True, append_images=few[1:], duration=FRAME_MS, loop=0, optimize=True)
    return out.getvalue()


def _figure(size: tuple[float, float], dpi: int) -> tuple[Figure, Axes3D]:
    figure = Figure(figsize=size, dpi=dpi)
    FigureCanvasAgg(figure)
    return figure, figure.add_axes((-0.06, -0.08, 1.12, 1.16), projection="3d", computed_zorder=False)


def _image(figure: Figure) -> Image.Image:
    out = BytesIO()
    figure.savefig(out, format="png", dpi=FILM_DPI)
    return Image.open(out).convert("RGB")


def _draw(ax: Axes3D, cell: Cell, view: CellView, poses: Array, tool: Array, measured: Array | None = None) -> None:
    """Draw what stands, what moves at ``poses`` (C, 3, 4), and the line of sight of a tracker; points in mm."""
    for shell in view.shells[1::2]:
        ax.add_collection3d(
            Poly3DCollection(shell.vertices[shell.triangles], facecolor="#56B4E914", edgecolor="none", zorder=1)
        )
    solids = [(m.at(poses), m.mesh.triangles, m.colours) for m in view.moving]
    if view.standing is not None:
        solids.append((view.standing.vertices, view.standing.triangles, (STAND,) * len(view.standing.triangles)))
    corners = np.vstack([v[t] for v, t, _ in solids])
    colours = np.vstack([_shade(Mesh(v, t), c) for v, t, c in solids])
    ax.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2, zorder=3))
    low, high = view.low, view.high
    if view.standing is not None:
        low = np.minimum(low, view.standing.vertices.min(axis=0))
        high = np.maximum(high, view.standing.vertices.max(axis=0))
    if cell.file.tracker is not None:
        eye = np.asarray(cell.file.tracker.position_mm, dtype=float)
        ax.plot(*np.stack([eye, tool[0]]).T, "-", color=ORANGE, linewidth=1.2, zorder=5)
        ax.plot(*eye[:, None], "s", color="#222222", markersize=6, zorder=6)
        low, high = np.minimum(low, eye - 100), np.maximum(high, eye + 100)
    if measured is not None and len(measured):
        ax.plot(*measured.T, "o", color=BLUE, markersize=2.6, zorder=7)
    if cell.base.floor is not None:
        z = float(to_mm(cell.base.floor))
        x, y = (low[0], high[0]), (low[1], high[1])
        floor = np.array([[[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]]])
        ax.add_collection3d(Poly3DCollection(floor, facecolor="#F3F1EC", edgecolor="#E2DED5", zorder=0))
    for name, a, b in zip("xyz", low, high, strict=True):
        getattr(ax, f"set_{name}lim")(a, b)
    ax.set_axis_off()
    ax.set_box_aspect(high - low, zoom=ZOOM)
    ax.view_init(elev=ELEVATION, azim=AZIMUTH)


def _shade(mesh: Mesh, colours: tuple[str, ...]) -> Array:
    """Return the colour of each triangle in the light of one far lamp, (t, 3)."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]
    bright = 0.62 + 0.38 * np.abs(normal @ LIGHT)
    palette = {name: to_rgb(name) for name in set(colours)}
    return np.asarray(np.array([palette[name] for name in colours]) * bright[:, None])
