"""The still picture of a cell: seen from where the view that turns begins, the nearest in front, without holes."""

import json
import re
from base64 import b64decode
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from matplotlib.path import Path as Outline

import planner.report.still_view as still
from planner.report.cell_view import Mesh, build_cell_view
from planner.report.chart import hex_colour
from planner.report.page import VIEW_FOLDER, embed_still
from planner.session.plan_types import Plan

LOW, HIGH = np.array([-300.0, -500.0, 0.0]), np.array([900.0, 700.0, 1000.0])


def script(name):
    return (VIEW_FOLDER / name).read_text("utf-8")


def test_it_is_seen_from_where_the_view_begins():
    orbit, view = script("orbit.js"), script("view3d.js")
    assert [float(re.search(rf"this.{k} = ([\d.]+)", orbit)[1]) for k in ("around", "above")] == [
        still.Camera.around,
        still.Camera.above,
    ]
    assert float(re.search(r"this.distance = ([\d.]+) \*", orbit)[1]) == still.Camera.away
    assert float(re.search(r"PerspectiveCamera\(([\d.]+),", view)[1]) == pytest.approx(np.degrees(still.Camera.opening))
    assert json.loads(re.sub(r"(\w+):", r'"\1":', re.search(r"const ROLES = (.*);", view)[1])) == still.ROLES


def test_points_come_where_a_perspective_camera_sees_them():
    """By a matrix that looks at the middle, as in OpenGL, and one of the perspective."""
    middle, away = (LOW + HIGH) / 2, still.Camera.away * np.linalg.norm(HIGH - LOW)
    level = np.cos(still.Camera.above)
    eye = middle + away * np.array(
        [level * np.cos(still.Camera.around), level * np.sin(still.Camera.around), np.sin(still.Camera.above)]
    )
    back = (eye - middle) / away
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    look = np.array([right, np.cross(back, right), back])
    points = np.random.default_rng(3).uniform(LOW, HIGH, (50, 3))
    x, y, z = look @ (points - eye).T
    slope = np.tan(still.Camera.opening / 2)
    across, up = x / -z / slope * still.Camera.tall / still.Camera.wide, y / -z / slope  # −1 … 1 over the picture
    wide, high = still.Camera.fine * still.Camera.wide, still.Camera.fine * still.Camera.tall
    seen = still.Camera(LOW, HIGH).project(points)
    assert np.allclose(seen, np.column_stack([(across + 1) / 2 * wide, (1 - up) / 2 * high, -z]))


def painted(*triangles):
    canvas = still._Canvas(still.Camera(LOW, HIGH))
    for corners, colour in triangles:
        still._cover_mesh(canvas, Mesh(np.array(corners), np.array([[0, 1, 2]])), (colour,))
    return canvas


@pytest.mark.parametrize("corners", [
    [[0.0, 0.0, 0.0], [600.0, 0.0, 0.0], [0.0, 600.0, 400.0]],
    [[0.0, -400.0, 100.0], [30.0, -400.0, 100.0], [0.0, 600.0, 900.0]],  # long and thin
])  # fmt: skip
def test_a_surface_has_no_holes(corners):
    canvas = painted((corners, "#FF0000"))
    flat = canvas.camera.project(np.array(corners))[:, :2]
    columns, rows = (
        v.ravel()
        for v in np.meshgrid(
            np.arange(still.Camera.fine * still.Camera.wide), np.arange(still.Camera.fine * still.Camera.tall)
        )
    )
    inside = Outline(flat).contains_points(np.column_stack([columns, rows]) + 0.5, radius=0.0)
    seen = np.isfinite(canvas.ahead)
    assert inside.sum() > 100
    assert seen[inside].mean() > 0.99
    assert (seen & ~inside).sum() < 0.1 * inside.sum() + 4 * np.linalg.norm(np.diff(flat, axis=0), axis=1).sum()


def test_what_is_nearer_is_seen():
    eye = np.array([np.cos(still.Camera.around), np.sin(still.Camera.around), 0.0])
    far = np.array([[0.0, 0.0, 0.0], [600.0, -300.0, 0.0], [0.0, 0.0, 600.0]])
    near = far + 200 * eye
    for order in ((far, near), (near, far)):
        colours = ["#FF0000" if c is near else "#0000FF" for c in order]
        canvas = painted(*zip(order, colours, strict=True))
        x, y, _ = canvas.camera.project(near.mean(axis=0)[None])[0].astype(int)
        assert canvas.pixels[y, x, 0] > 100 > canvas.pixels[y, x, 2]


@pytest.mark.slow
def test_the_picture_of_a_plan_shows_robot_poses_and_axes(plan: Plan) -> None:
    view = build_cell_view(plan)
    drawn = still.still_view(view)
    assert drawn == still.still_view(view)
    assert re.findall(r"<text [^>]*>(\w)</text>", drawn) == ["x", "y", "z"]
    packed = re.search(r"base64,([^\"]+)", drawn)
    assert packed
    assert len(packed[1]) < 200_000
    pixels = 255 * imread(BytesIO(b64decode(packed[1])))[:, :, :3]
    assert pixels.shape == (still.Camera.fine * still.Camera.tall, still.Camera.fine * still.Camera.wide, 3)
    camera, blue = still.Camera(view.low, view.high), hex_colour(still.ROLES["calibrate"])
    at = camera.project(np.array([s.position for s in view.spots if s.role == "calibrate"])).astype(int)
    near = np.abs(pixels[at[:, 1], at[:, 0]] - blue).max(axis=1) < 60
    assert near.mean() > 0.3  # the others are behind the robot
    assert (np.abs(pixels - hex_colour(still.PAPER)).max(axis=2) > 20).mean() > 0.05


def test_another_page_shows_the_same_picture_with_its_key(folder: Path) -> None:
    html = (folder / "report.html").read_text(encoding="utf-8")
    shown = embed_still(html)
    (picture,) = re.findall(r'<svg class="still".*?</svg>', html, re.DOTALL)
    assert picture in shown
    assert shown.count("calibrate</span>") == 1
    assert "<script" not in shown
    assert shown.count("<div") == shown.count("</div>")
    assert embed_still("<body>no view</body>") == ""
