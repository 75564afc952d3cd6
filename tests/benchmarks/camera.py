"""``python -m tests.benchmarks.camera``: a camera against OpenCV's own hand–eye, and a bar and a wire on the same arms.

Arms are those of ``tests.gauges.camera.scene``: a UR5e whose rows are off by 0.4 mm and 0.5 mrad, its zeros by 1 mrad,
but for the last joint, which no gauge tells from where it sits on the flange. The camera sees a board of 24 corners to
0.15 px in each of 90 images; the bar reads to 1 µm and the wire to 0.1 mm at 90 poses of the same arm. Errors of the
tool are true ones, at 2000 states all over the workspace, after the best rigid motion.
"""

import argparse
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.documents.calibrated_robot import calibrated_files
from planner.documents.gauge_unit_errors import own_errors_text
from planner.fit.least_squares import fit
from planner.fit.problem import FitProblem
from planner.fit.run_setup import drop_unreadable, locate_gauge, number_samples, setup_for_run
from planner.identification.pipeline import FitSettings, identify
from planner.kinematics.geometry import registration
from planner.kinematics.robot_reader import load_robot
from planner.model.model import Model
from planner.runs.loader import load_run
from tests.benchmarks.hand_eye import METHODS, robot_world_hand_eye
from tests.gauges.camera.scene import BENT, LENS, SHEET, Scene, charuco, flange, pose, run_text

NOISE, POSES, HELD_OUT, STATES = 0.15, 90, 30, 2000
TOOL = np.array([0.0, 0.0, 0.1, 1.0])  # [m] of the flange
NEAR = np.deg2rad([120, 60, 100, 120, 120, 180])  # [rad] about home that states lie in


def scene_of(cell, seed, exact=False):
    standing = np.eye(4)
    standing[:3, :3], standing[:3, 3] = cell.fixtures[0].R_BX, cell.fixtures[0].p_BX
    scene = Scene.drawn(seed, True, standing, pose([0, 0, 0], cell.tool.p_FM))
    scene.rows[5], scene.zeros[5] = SHEET[5], 0.0
    if exact:
        scene.rows, scene.zeros = Scene(True).rows, np.zeros(6)
    return scene


def states(cell, seed):
    rng = np.random.default_rng([seed, 7])
    return np.clip(cell.home + rng.uniform(-1, 1, (STATES, 6)) * NEAR, cell.robot.q_lower, cell.robot.q_upper)


def true_points(scene, q):
    return np.array([(flange(s, scene.rows, scene.zeros) @ TOOL)[:3] for s in q])


def tool_error(points, true):
    """Rms distance [mm] after the best rigid motion."""
    R, t = registration(true, points, np.ones(len(true)))
    return 1e3 * float(np.sqrt(((true - points @ R.T - t) ** 2).sum(axis=1).mean()))


def robot_error(found, scene, q, folder):
    for name, text in calibrated_files(found):
        (folder / name).write_text(text)
    robot = load_robot("robot.toml", folder)
    return tool_error(robot.chain.carry(robot.theta(q), TOOL[:3]), true_points(scene, q))


def opencv_hand_eye(scene, q, pixels):
    """Reprojection [px] of images that it did not see by OpenCV's robot-world-hand-eye on the nominal robot."""
    corner = charuco().getChessboardCorners()
    train, test = slice(0, len(q) - HELD_OUT), slice(len(q) - HELD_OUT, len(q))
    poses = []
    for uv in pixels[train]:
        ok = np.isfinite(uv[:, 0])
        poses.append(cv2.solvePnP(corner[ok], uv[ok], LENS, BENT)[1:])
    arms = [np.linalg.inv(flange(s)) for s in q[train]]
    out = {}
    calibrate = robot_world_hand_eye()
    for name, method in METHODS.items():
        R_cw, t_cw = [cv2.Rodrigues(r)[0] for r, _ in poses], [t for _, t in poses]
        R_wb, t_wb, R_cg, t_cg = calibrate(
            R_cw, t_cw, [T[:3, :3] for T in arms], [T[:3, 3] for T in arms], method=getattr(cv2, method)
        )
        world, camera = np.eye(4), np.eye(4)
        world[:3, :3], world[:3, 3:], camera[:3, :3], camera[:3, 3:] = R_wb, t_wb, R_cg, t_cg
        errors = []
        for s, uv in zip(q[test], pixels[test], strict=True):
            T = camera @ np.linalg.inv(flange(s)) @ np.linalg.inv(world)
            there = cv2.projectPoints(corner, cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], LENS, BENT)[0][:, 0]
            errors.append(((there - uv) ** 2).sum(axis=1))
        off = np.linalg.inv(camera)[:3, 3] - scene.sitting[:3, 3]
        out[name] = float(np.sqrt(np.nanmean(errors))), 1e3 * float(np.linalg.norm(off))
    return out


def camera_run(cell, scene, q, seed, folder):
    path = folder / "run.csv"
    path.write_text(run_text(scene, q, NOISE, seed, repeatability=2e-5))
    return drop_unreadable(cell, load_run(path))


def length_run(cell, scene, q, sigma, seed, folder):
    """A bar or a wire about the cell's fixture, on the same arm."""
    rng = np.random.default_rng([seed, 3])
    tool = np.append(cell.tool.p_FM + rng.normal(0, 5e-4, 3), 1.0)
    place = cell.fixtures[0].p_BX + rng.normal(0, 2e-3, 3)
    shaken = q + 2e-5 * rng.standard_normal(q.shape)
    points = np.array([(flange(s, scene.rows, scene.zeros) @ tool)[:3] for s in shaken])
    length = np.linalg.norm(points - place, axis=1) + rng.normal(0, sigma, len(q)) + 2e-4
    lines = ["# robot: ur5e", "# measure: static", "pose," + ",".join(f"q{j}_deg" for j in range(1, 7)) + ",length_mm"]
    for k, (s, value) in enumerate(zip(np.rad2deg(q), length * 1e3, strict=True), start=1):
        lines.append(f"{k}," + ",".join(f"{v:.9f}" for v in s) + f",{value:.6f}")
    path = folder / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    return load_run(path)


def main():
    """Print a line for each arm and the medians."""
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("--arms", type=int, default=5)
    arms = given.parse_args().arms
    robot_world_hand_eye()  # where OpenCV has none, that is said before minutes of work
    camera, bar = load_cell("ur5e/camera"), load_cell("ur5e/edbb")
    seen = draw_candidates(camera, POSES + HELD_OUT, seed=1).q[: POSES + HELD_OUT]
    held = draw_candidates(bar, POSES, seed=1).q[:POSES]
    quick, rows = FitSettings(release=False), []
    for seed in range(arms):
        with tempfile.TemporaryDirectory() as name:
            folder, scene, q = Path(name), scene_of(camera, seed), states(camera, seed)
            nominal = tool_error(np.array([(flange(s) @ TOOL)[:3] for s in q]), true_points(scene, q))
            whole = camera_run(camera, scene, seen, seed, folder)
            theirs = opencv_hand_eye(scene, seen, whole.readings.pixels)
            began = time.perf_counter()
            found = identify(whole.take(slice(0, POSES)), camera, settings=quick)
            seconds = time.perf_counter() - began
            said = own_errors_text(found).split(" px")
            ours = [float(said[0].split()[-1]), float(said[1].split()[-1])]
            errors = [robot_error(found, scene, q, folder)]
            for sigma in (1e-6, 1e-4):
                run = length_run(bar, scene, held, sigma, seed, folder)
                errors.append(robot_error(identify(run, bar, settings=quick), scene, q, folder))
            rows.append([nominal, *errors, theirs["Shah"][0], theirs["Li"][0], *ours, seconds])
            print(seed, " ".join(f"{v:.3f}" for v in rows[-1]), flush=True)
    titles = "nominal camera bar wire [mm]; Shah Li [px], ours before, after [px]; geometry [s]"
    print(titles, " ".join(f"{v:.3f}" for v in np.median(rows, axis=0)), sep="\n")
    exact = scene_of(camera, 0, exact=True)
    with tempfile.TemporaryDirectory() as name:
        run = camera_run(camera, exact, seen, 0, Path(name))
    theirs = opencv_hand_eye(exact, seen, run.readings.pixels)
    off = 1e3 * float(np.linalg.norm(camera_place(camera, run) - exact.sitting[:3, 3]))
    shah, li = (theirs[name][1] for name in ("Shah", "Li"))
    print(f"exact arm, camera's place off by [mm]: Shah {shah:.3f}, Li {li:.3f}, ours {off:.3f}")


def camera_place(cell, run):
    """Where the camera sits on the flange [m] by the frames alone, the robot taken for exact."""
    run = number_samples(run)
    setup = locate_gauge(setup_for_run(cell, run), run)
    model = Model.of(setup, frozenset())
    frames = model.subset([k for k, p in enumerate(model.parameters) if p.group == "gauge"])
    found = fit(FitProblem.of(frames, run))
    return setup.p_FM[0] + found.at(f"map_{axis}" for axis in "xyz")


if __name__ == "__main__":
    main()
