"""One, two and three fixtures on every shipped cell of a bar: ``python -m tests.benchmarks.fixtures [CELL …]``.

Each is planned by the command (``--fixtures N``; one: as the cell is). Printed are what the number of fixtures was said
to be worth, the error that the plan expects and its minutes; then, where the robot measures at rest, the true error of
simulated arms with drawn errors (``true_arms``, nothing of the planner) before and after, with what was stated. Where
there is no plan, the sentence that says why.
"""

import argparse
import json
import os
import re
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.kinematics.robot_reader import load_robot
from tests.benchmarks.other_arms import released_tool
from tests.benchmarks.true_arms import TrueArm, aligned_distance, true_flange
from tests.command import edbb

CELLS = ("ur10/edbb", "kuka-kr6-r700/edbb", "ur5e/edbb", "comau-nj130/paper", "comau-nj130/edbb", "abb-irb6700/edbb")
STATES = 2000  # at which an arm's error is taken
HEAD = (
    "| cell | fixtures | said | expected [mm] | minutes | before [mm] | true after [mm] | stated [mm] |\n"
    "|---|---|---|---|---|---|---|---|"
)


def plan(cell, count, folder):
    """Plan with so many fixtures; returns the document, or the sentence that says why there is none, and the notes."""
    words = ["--fixtures", count] if count > 1 else []
    done = edbb("plan", cell, "-o", folder, "--force", "--dialect", "poses-csv", *words, threads="1")
    told = " ".join((done.stdout + done.stderr).split())
    share = re.search(r"100 poses ([^;]*);", told)
    said = ", ".join(re.findall(r"[\d.]+(?= by)", share[1])) if share else ""
    if done.returncode:
        return None, f"exit {done.returncode}: {done.stderr.strip()[-400:]}"
    return json.loads((folder / "plan.json").read_text()), said


def judge(folder, seed):
    """An arm with drawn errors, measured and identified: its error before and after, and the one stated [mm]."""
    cell = load_cell(str(folder / "cell.toml"))
    flange = true_flange(cell.robot, None, "", np.random.default_rng([seed, 11]))
    arm = TrueArm.draw(cell, flange, np.random.default_rng([seed, 12]))
    run, found = folder / f"run{seed}.csv", folder / f"found{seed}"
    arm.write_run(folder / "plan.json", run)
    words = ("--cell", folder / "cell.toml", "--plan", folder / "plan.json", "-o", found, "--force")
    done = edbb("identify", run, *words, threads="1")
    assert done.returncode == 0, done.stderr
    stated = json.loads((found / "identification.json").read_text())["known_anywhere_mm"]
    q = np.random.default_rng(3).uniform(*cell.joint_range, (STATES, cell.robot.n_joints))
    released, true = released_tool(load_robot(found / "robot.toml"), q), arm.tool(q)
    return 1e3 * aligned_distance(cell.map_position(q), true), 1e3 * aligned_distance(released, true), stated


def row(cell, count, folder, arms):
    """Return the line of the table."""
    document, said = plan(cell, count, folder)
    if document is None:
        return f"| {cell} | {count} | {said} | | | | | |"
    poses = sum(p["role"] == "calibrate" for p in document["poses"])
    expected = document.get("foresight", {}).get("error_mm", float("nan"))
    minutes = document["trajectory"]["duration_s"] / 60
    judged = [judge(folder, k) for k in range(arms if load_cell(cell).motion.measure == "static" else 0)]
    columns = [" ".join(f"{j[k]:.3f}" for j in judged) for k in range(3)]
    return (
        f"| {cell} | {count} | {said} | {expected:.3f} ({poses} poses) | {minutes:.0f} | " + " | ".join(columns) + " |"
    )


def main():
    """Plan and judge what the arguments ask for, some at a time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cells", nargs="*", default=CELLS)
    parser.add_argument("--counts", nargs="+", type=int, default=[1, 2, 3], help="numbers of fixtures")
    parser.add_argument("--arms", type=int, default=3, help="simulated arms a plan")
    parser.add_argument("-j", "--jobs", type=int, default=max(1, (os.cpu_count() or 1) // 2), help="rows at a time")
    asked = parser.parse_args()
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(asked.jobs) as pool:
        wanted = [(c, n) for n in sorted(asked.counts, reverse=True) for c in asked.cells]
        folders = [Path(name) / f"{c.replace('/', '-')}-{n}" for c, n in wanted]
        rows = [pool.submit(row, c, n, f, asked.arms) for (c, n), f in zip(wanted, folders, strict=True)]
        for each in rows:
            print(each.result(), flush=True)


if __name__ == "__main__":
    main()
