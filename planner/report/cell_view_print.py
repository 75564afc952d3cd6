"""The view of the cell for print (matplotlib)."""

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
    light = np.array([0.35, 0.45, 0.82])  # where it comes from: steeply from above, over the left shoulder
    bright = 0.62 + 0.38 * np.abs(normal @ light)  # 0.62: what lies in the shade
    palette = {name: to_rgb(name) for name in set(colours)}
    return np.asarray(np.array([palette[name] for name in colours]) * bright[:, None])
