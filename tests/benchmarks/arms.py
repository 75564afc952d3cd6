"""Planning time of any arm: ``python -m tests.benchmarks.arms [--limit 60] [--urdf FILE,TIP ...] [ROBOT ...]``.

Every shipped robot (or those that are named) and every URDF, meshes included, with a bar and with a draw wire that
stand where the arm reaches well; each plan runs in a process of its own under ``--time-limit``. Prints seconds by
stage, median and worst, and how each plan ended.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.motion.path.constraints import Constraints

STAGES = ("candidates", "roadmap", "selection", "refinement", "path", "programs", "report")
CELL = """schema = "edbb-cell/1"
robot = "{robot}"
home_deg = {home}
{tip}
[tool]
map_mm = [0, 0, {tool:.0f}]
[gauge]
kind = "{kind}"
length_mm = [{low:.0f}, {high:.0f}]
{body}
[[fixtures]]
position_mm = [{x:.0f}, 0, {z:.0f}]
[base]
floor_mm = {floor:.0f}
[motion]
clearance_mm = 5
"""
TRIED, DRAWN = 2000, 400  # states among which a home is looked for; states that tell the reach


def write_cell(reference: str, tip: str, kind: str, path: Path) -> Path:
    """Write a cell whose fixture stands in front of the arm, at half its reach, with a gauge of a fitting length."""
    robot = load_robot(reference, tip=tip or None)
    rng, limit = np.random.default_rng(0), np.deg2rad(179)
    q = rng.uniform(np.maximum(robot.q_lower, -limit), np.minimum(robot.q_upper, limit), (TRIED, robot.n_joints))
    reach = 1e3 * float(np.linalg.norm(robot.chain.carry(robot.theta(q[:DRAWN]), np.zeros(3)), axis=1).max())
    body = f"body = {{ housing_mm = {0.1 * reach:.0f}, trim_mm = 10, radius_mm = 12 }}" if kind == "edbb" else ""
    words = {"robot": reference, "tip": f'tip = "{tip}"' if tip else "", "kind": kind, "body": body}
    sizes = {"tool": 0.06 * reach, "low": 0.2 * reach, "high": 0.5 * reach, "x": 0.5 * reach, "z": 0.1 * reach}
    middle = np.rad2deg(np.clip(0.0, robot.q_lower + 0.1, robot.q_upper - 0.1)).round(1).tolist()
    text = CELL.format(home=middle, floor=-0.3 * reach, **words, **sizes)
    path.write_text(text)
    clear = Constraints(load_cell(str(path)), bar=False)
    fit = q[clear.valid(q)]
    if len(fit):
        home = np.rad2deg(fit[np.argmin(np.abs(fit).max(axis=1))]).round(1).tolist()
        path.write_text(CELL.format(home=home, floor=-0.3 * reach, **words, **sizes))
    return path


def time_plan(cell: Path, out: Path, limit: float) -> tuple[float, dict[str, float], str]:
    """Plan in a process of its own; returns wall seconds, those of each stage, and how it ended."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "planner.cli", "plan", str(cell), "-o", str(out), "--time-limit", str(limit)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, env=os.environ)
    seconds = time.perf_counter() - start
    timings = out / "timings.json"
    stages = json.loads(timings.read_text()) if timings.is_file() else {}
    words = {0: "whole", 5: "cut short"}.get(done.returncode, done.stderr.strip().splitlines()[-1][:160])
    return seconds, stages, words


def main() -> None:
    """Time all that the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", help="shipped robots (default: all)")
    parser.add_argument("--urdf", action="append", default=[], metavar="FILE,TIP", help="an arm by its URDF")
    parser.add_argument("--limit", type=float, default=60.0, help="of each plan [s]")
    asked = parser.parse_args()
    arms = [(name, "") for name in asked.robots or list_robots()]
    arms += [(str(Path(file).resolve()), tip) for file, _, tip in (u.partition(",") for u in asked.urdf)]
    spent = []
    print(f"{'arm':<24} {'gauge':<10} {'wall':>6}  " + " ".join(f"{s[:10]:>10}" for s in STAGES))
    with tempfile.TemporaryDirectory() as folder:
        for number, (reference, tip) in enumerate(arms):
            for kind in ("edbb", "draw-wire"):
                try:
                    cell = write_cell(reference, tip, kind, Path(folder) / f"{number}-{kind}.toml")
                    seconds, stages, words = time_plan(cell, Path(folder) / f"{number}-{kind}", asked.limit)
                except Exception as error:  # one arm that cannot be read keeps nobody from the next
                    print(f"{Path(reference).stem:<24} {kind:<10} {error}", flush=True)
                    continue
                spent.append(seconds)
                row = " ".join(f"{stages.get(s, 0.0):10.1f}" for s in STAGES)
                print(f"{Path(reference).stem:<24} {kind:<10} {seconds:6.1f}  {row}  {words}", flush=True)
    if spent:
        print(f"median {np.median(spent):.1f} s, worst {max(spent):.1f} s, of {len(spent)} plans")


if __name__ == "__main__":
    main()
