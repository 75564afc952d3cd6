"""The cell in space as a still picture: what a page shows until its view is turned.

It is seen from where ``static/view`` begins. All surfaces, lines and balls are taken apart into points, one a pixel or
more, of which the nearest are seen.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from planner.common.units import Array
from planner.report.cell_view import STAND, CellView, Mesh, lit_colours
from planner.report.chart import ROLES, hex_colour
from planner.report.svg_backend import png_base64

AXES = (("x", "#D55E00"), ("y", "#009E73"), ("z", "#0072B2"))  # as there
PAPER, FLOOR, PATH, REACH = "#F6F8F9", "#D3DAE0", "#3C3C3C", "#56B4E9"


@dataclass(frozen=True)
class Camera:
    """Where the view is seen from: all between the corners ``low`` and ``high`` (3,) [mm]."""

    low: Array
    high: Array
    wide: ClassVar[int] = 604  # [px] of the picture on the page
    tall: ClassVar[int] = 370
    fine: ClassVar[int] = 2  # pixels of the picture to one of the page, along each side
    around: ClassVar[float] = 0.75  # [rad] as orbit.js and view3d.js begin, and what follows too
    above: ClassVar[float] = 0.42
    away: ClassVar[float] = 1.05  # distance from the middle, in diagonals of the box
    opening: ClassVar[float] = float(np.radians(38.0))

    @cached_property
    def directions(self) -> Array:
        """To the right, down and forward, (3, 3)."""
        level = np.cos(self.above)
        forward = -np.array([level * np.cos(self.around), level * np.sin(self.around), np.sin(self.above)])
        right = np.array([forward[1], -forward[0], 0.0]) / level
        return np.array([right, np.cross(forward, right), forward])

    @property
    def focal(self) -> float:
        """Pixels of the picture to a slope of one."""
        return float(self.fine * self.tall / 2 / np.tan(self.opening / 2))

    def project(self, points: Array) -> Array:
        """Return pixels to the right and down, and the distance forward [mm], of points (n, 3), (n, 3)."""
        seen = (points - (self.low + self.high) / 2) @ self.directions.T
        ahead = np.maximum(seen[:, 2] + self.away * float(np.linalg.norm(self.high - self.low)), 1.0)
        middle = self.fine * np.array([self.wide, self.tall]) / 2
        return np.column_stack([middle + self.focal * seen[:, :2] / ahead[:, None], ahead])


@dataclass
class _Canvas:
    """Pixels of the picture, row by row: colours (p, 3) 0 … 255, and the distance of what is seen there (p,) [mm]."""

    camera: Camera
    colours: Array = field(
        default_factory=lambda: np.tile(hex_colour(PAPER), (Camera.fine**2 * Camera.wide * Camera.tall, 1))
    )
    ahead: Array = field(default_factory=lambda: np.full(Camera.fine**2 * Camera.wide * Camera.tall, np.inf))
    ball: ClassVar[float] = 11.0  # [mm] radius of a ball that marks a pose

    def cover(self, points: Array, colours: Array) -> None:
        """Paint points (n, 3) [mm] where nothing is nearer; colours (n, 3)."""
        at, ahead, which = self._pixels(points)
        which, at, ahead = (v[ahead < self.ahead[at]] for v in (which, at, ahead))
        order = np.argsort(-ahead, kind="stable")  # of several on one pixel the last, which is the nearest, stays
        self.colours[at[order]], self.ahead[at[order]] = colours[which[order]], ahead[order]

    def tint(self, parts: Iterable[Array], colour: str, share: float) -> None:
        """Mix a share of a colour into every pixel at which one of the points, parts of (n, 3) [mm], is seen."""
        seen = np.zeros(len(self.ahead), dtype=bool)
        for points in parts:
            at, ahead, _ = self._pixels(points)
            seen[at[ahead < self.ahead[at] + self.ball]] = True
        self.colours[seen] += share * (hex_colour(colour) - self.colours[seen])

    def _pixels(self, points: Array) -> tuple[np.ndarray, Array, np.ndarray]:
        """Return the pixels of those points that are in the picture, their distances, and which they are."""
        x, y, ahead = self.camera.project(points).T
        inside = (x >= 0) & (x < Camera.fine * Camera.wide) & (y >= 0) & (y < Camera.fine * Camera.tall) & (ahead > 1.0)
        which = np.flatnonzero(inside)
        return y[which].astype(int) * Camera.fine * Camera.wide + x[which].astype(int), ahead[which], which

    @property
    def pixels(self) -> np.ndarray:
        """The picture, (rows, columns, 3)."""
        return self.colours.round().astype(np.uint8).reshape(Camera.fine * Camera.tall, Camera.fine * Camera.wide, 3)


def still_view(view: CellView) -> str:
    """Return the picture as SVG."""
    camera = Camera(view.low, view.high)
    canvas = _Canvas(camera)
    for m in view.moving:
        _cover_mesh(canvas, Mesh(m.at(view.frames.poses[0]), m.mesh.triangles), m.colours)
    if view.standing is not None:
        _cover_mesh(canvas, view.standing, (STAND,) * len(view.standing.triangles))
    for spot in view.spots:
        _cover_ball(canvas, spot.position, ROLES[spot.role])
    canvas.tint((_along(camera, line) for line in _floor_lines(view)), FLOOR, 1.0)
    for shell in view.shells:
        canvas.tint((points for points, _ in _surface_points(camera, shell)), REACH, 0.15)
    tangled = 30  # poses: the path through more of them would hide the robot, and is faint
    for lines in (view.paths, view.ways):
        canvas.tint((_along(camera, line) for line in lines), PATH, 0.2 if len(view.spots) > tangled else 1.0)
    size = f'width="{camera.wide}" height="{camera.tall}"'
    image = f'<image {size} href="data:image/png;base64,{png_base64(canvas.pixels)}"/>'
    box = f'class="still" viewBox="0 0 {camera.wide} {camera.tall}" aria-hidden="true"'
    return f"<svg {box}>{image}{_axes(view, camera)}</svg>"


def still_legend(view: CellView) -> tuple[tuple[str, str], ...]:
    """Return what the balls of the picture mean, and the surfaces about the fixture, with their colours."""
    roles = [spot.role for spot in view.spots]
    poses = [(f"{roles.count(role)} {role}", colour) for role, colour in ROLES.items() if role in roles]
    return (*poses, *([(f"reach of the {view.noun}", REACH)] if view.shells else []))


def _cover_mesh(canvas: _Canvas, mesh: Mesh, colours: tuple[str, ...]) -> None:
    lit = 255 * lit_colours(mesh, colours)
    for points, of in _surface_points(canvas.camera, mesh):
        canvas.cover(points, lit[of])


def _surface_points(camera: Camera, mesh: Mesh) -> Iterator[tuple[Array, np.ndarray]]:
    """Yield points (n, 3) [mm] all over the triangles, closer than pixels, and which triangle each is of."""
    corners = mesh.vertices[mesh.triangles]
    flat = camera.project(corners.reshape(-1, 3)).reshape(-1, 3, 3)[:, :, :2]
    sides = np.linalg.norm(np.roll(flat, 1, axis=1) - np.roll(flat, -1, axis=1), axis=2)  # [px] opposite each corner
    first = sides.argmin(axis=1)  # corners are counted from the one opposite the shortest side: many are long and thin
    corners = corners[np.arange(len(corners))[:, None], (first[:, None] + np.arange(3)) % 3]
    along, across = (2 ** np.ceil(np.log2(np.clip(1.1 * v, 1, 4096))).astype(int) for v in (sides.max(1), sides.min(1)))
    for n, m in np.unique(np.column_stack([along, across]), axis=0):
        u, v = (g.ravel() for g in np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m))
        which = np.flatnonzero((along == n) & (across == m) & (sides.min(axis=1) > 0))  # at a pole two corners are one
        shares = np.column_stack([1 - u, u * (1 - v), u * v])
        yield (shares @ corners[which]).reshape(-1, 3), np.repeat(which, len(u))


def _cover_ball(canvas: _Canvas, middle: Array, colour: str) -> None:
    across = np.linspace(-1.0, 1.0, 33)  # more than it has pixels
    x, y = (v.ravel() for v in np.meshgrid(across, across))
    x, y = (v[x**2 + y**2 <= 1] for v in (x, y))
    near = np.sqrt(np.maximum(1 - x**2 - y**2, 0.0))
    points = middle + canvas.ball * np.column_stack([x, y, -near]) @ canvas.camera.directions
    canvas.cover(points, (0.7 + 0.3 * near)[:, None] * hex_colour(colour))


def _along(camera: Camera, line: Array) -> Array:
    """Return points (n, 3) [mm] along a line of such, closer than pixels."""
    flat = camera.project(line)[:, :2]
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(flat, axis=0), axis=1))])  # [px]
    at = np.linspace(0.0, passed[-1], int(2 * passed[-1]) + 2)
    return np.column_stack([np.interp(at, passed, p) for p in line.T])


def _floor_lines(view: CellView) -> Iterator[Array]:
    """Yield the two ends of each line of a grid on the floor, 250 mm apart, (2, 3) [mm]."""
    if view.floor is None:
        return
    middle, apart = (view.low + view.high)[:2] / 2, 250.0
    half = (np.ceil((view.high - view.low)[:2].max() / 500) * 500 + 500) / 2
    for at in np.arange(-half, half + 1, apart):
        for start, end in (((at, -half), (at, half)), ((-half, at), (half, at))):
            yield np.array([[*(middle + start), view.floor], [*(middle + end), view.floor]])


def _axes(view: CellView, camera: Camera) -> str:
    """Return arrows x, y and z at the base of the robot, with their letters, as SVG."""
    length = max(100.0, float(np.round(0.22 * np.linalg.norm(view.high - view.low) / 100)) * 100)
    out = []
    for (name, colour), along in zip(AXES, np.eye(3), strict=True):
        base, tip, letter = camera.project(length * np.outer([0.0, 1.0, 1.15], along))[:, :2] / camera.fine
        forward = (tip - base) / max(float(np.linalg.norm(tip - base)), 1e-9)
        side = 4 * np.array([-forward[1], forward[0]])  # [px]
        back = tip - 11 * forward
        a, b, c, d, e = (f"{p[0]:.1f} {p[1]:.1f}" for p in (base, back, tip, back + side, back - side))
        out.append(
            f'<path d="M{a}L{b}" stroke="{colour}" stroke-width="1.5"/><path d="M{c}L{d}L{e}z" fill="{colour}"/>'
            f'<text x="{letter[0]:.1f}" y="{letter[1]:.1f}" fill="{colour}">{name}</text>'
        )
    return "".join(out)
