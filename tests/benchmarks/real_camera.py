"""Images of a real arm that others published: ``python -m tests.benchmarks.real_camera FOLDER``.

A Panda with a camera on its hand before a ChArUco board, 12 images with the joint angles that the arm read, from
``git clone https://github.com/kvasios/franka-handeye``, commit 0b9fe29 (later ones have no images); FOLDER is its
``data/captured-data``. Nothing of it is kept here. Corners are found by ``edbb import``, the arm is identified, and
images that no fit saw are compared with those of OpenCV's ``calibrateRobotWorldHandEye``, which takes the arm for
exact and is given all images but one.
"""

import argparse
import csv
import json
import shutil
import tempfile
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.reading import load_cell
from planner.documents.gauge_unit_errors import own_errors_text
from planner.gauges.vision.sight import BoardSight
from planner.identification.pipeline import FitSettings, identify
from planner.kinematics.inverse_kinematics import tool_pose
from planner.runs.loader import load_run
from tests.benchmarks.hand_eye import robot_world_hand_eye
from tests.command import edbb

CELL = """schema = "edbb-cell/1"
robot = "panda"
home_deg = [0, -45, 0, -135, 0, 120, 45]
[tool]
map_mm = [40, -30, 65] # of the lens in the flange, to a centimetre
map_axis = [0, 0, 1]
prior_mm = 20
[gauge]
kind = "camera"
camera = "flange"
length_mm = [250, 600]
noise_px = 0.3
tool_rpy_deg = [0, 0, 45]
[gauge.board]
kind = "charuco"
columns = 5
rows = 7
square_mm = 34
marker_mm = 28
dictionary = "DICT_6X6_250"
scale_ppm = 3000 # printed on paper
[gauge.lens] # as the data have it
fx_px = {0[0]}
fy_px = {0[1]}
cx_px = {0[2]}
cy_px = {0[3]}
distortion = {1}
width_px = 1280
height_px = 720
[gauge.place]
position_mm = [490, 20, -20] # of the board, to some centimetres
rpy_deg = [0, 0, 0]
prior_mm = 50
prior_deg = 5
"""


def write_session(source: Path, folder: Path) -> np.ndarray:
    """Write images, their angles and the cell into ``folder``; return the joint angles (n, 7) [rad]."""
    (folder / "images").mkdir()
    found = [(int(p.name[-2:]), p) for p in sorted(source.glob("pose_*")) if (p / "image.png").is_file()]
    if not found:
        raise SystemExit(f"{source}: no pose_NN/image.png; check out commit 0b9fe29")
    read = [json.loads((p / "data.json").read_text()) for _, p in found]
    q = np.array([d["joint_pose"] for d in read])
    with (folder / "angles.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["pose", *(f"q{j}_deg" for j in range(1, 8))])
        table.writerows([k, *row] for (k, _), row in zip(found, np.rad2deg(q).tolist(), strict=True))
    for k, p in found:
        shutil.copy(p / "image.png", folder / "images" / f"pose_{k:02d}.png")
    K = np.array(read[0]["camera_intrinsics"])
    (folder / "cell.toml").write_text(CELL.format([K[0, 0], K[1, 1], K[0, 2], K[1, 2]], read[0]["dist_coeffs"]))
    return q


def opencv_held_out(folder: Path, pixels: np.ndarray, q: np.ndarray) -> float:
    """Reprojection [px] of each image by OpenCV's result from all others, rms over the corners."""
    cell = load_cell(str(folder / "cell.toml"))
    gauge = cell.gauge
    assert isinstance(gauge, BoardSight)
    (fx, fy), (cx, cy) = gauge.lens.focal, gauge.lens.centre
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    bent, corner = np.array(gauge.lens.distortion), np.array(gauge.board.corners)
    x, R, _ = tool_pose(cell.robot.chain, cell.robot, q)
    arm = [
        np.block([[R[k].T, -R[k].T @ x[k][:, None]], [np.zeros((1, 3)), 1]]) for k in range(len(q))
    ]  # base in flange
    seen = [np.isfinite(uv[:, 0]) for uv in pixels]
    board = [cv2.solvePnP(corner[ok], uv[ok], K, bent)[1:] for ok, uv in zip(seen, pixels, strict=True)]
    turn = [Rotation.from_rotvec(r.ravel()).as_matrix() for r, _ in board]
    squares: list[float] = []
    calibrate = robot_world_hand_eye()
    for k in range(len(q)):
        rest = [j for j in range(len(q)) if j != k]
        R_wb, t_wb, R_cg, t_cg = calibrate(
            [turn[j] for j in rest], [board[j][1] for j in rest],
            [arm[j][:3, :3] for j in rest], [arm[j][:3, 3] for j in rest],
        )  # fmt: skip
        world, camera = np.eye(4), np.eye(4)
        world[:3, :3], world[:3, 3:], camera[:3, :3], camera[:3, 3:] = R_wb, t_wb, R_cg, t_cg
        T = camera @ arm[k] @ np.linalg.inv(world)
        there = cv2.projectPoints(corner, cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], K, bent)[0][:, 0]
        squares += ((there - pixels[k]) ** 2).sum(axis=1)[seen[k]].tolist()
    return float(np.sqrt(np.mean(squares)))


def main() -> None:
    """Print what is found of the images, and the errors of images that no fit saw."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        q = write_session(asked.parse_args().folder, folder)
        words = "import", folder / "angles.csv", "--images", folder / "images", "--board", folder / "cell.toml"
        done = edbb(*words, "-o", folder / "run.csv")
        assert done.returncode == 0, done.stderr
        run, cell = load_run(folder / "run.csv", 7), load_cell(str(folder / "cell.toml"))
        pixels = run.readings.pixels
        assert pixels is not None
        print(f"{len(pixels)} images, {int(np.isfinite(pixels[..., 0]).sum())} corners")
        print(f"OpenCV, the arm taken for exact, held out: {opencv_held_out(folder, pixels, q):.2f} px")
        print("edbb: " + own_errors_text(identify(run, cell, settings=FitSettings(release=False))))


if __name__ == "__main__":
    main()
