"""One, two and three fixtures on every shipped cell of a bar: ``python -m tests.benchmarks.fixtures [CELL …]``.

Each is planned by the command (``--fixtures N``; one: as the cell is). Printed are what the number of fixtures was said
to be worth at 100 poses, the error that the plan expects and its minutes; then the true error of simulated arms
(``true_arms``, nothing of the planner: lengths, angles, gears, joints that give way) at targets before and after they
are corrected, with what was stated. An arm that is measured while it moves is logged once in four seconds. Where there
is no plan, the sentence that says why.
"""

import argparse
import json
import os
import re
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import calibrated_files
from planner.identification.pipeline import identify
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_runs
from tests.benchmarks.true_arms import TrueArm, aligned_distance, true_flange, with_hidden_errors
from tests.command import edbb
from tests.identification.few_draws import few_draws
from tests.independent_arms.judge import correct

CELLS = ("ur10/edbb", "kuka-kr6-r700/edbb", "ur5e/edbb", "comau-nj130/paper", "comau-nj130/edbb", "abb-irb6700/edbb")
STATES = 500  # targets at which an arm's error is taken, as it is driven there by what ``edbb compensate`` writes
INSIDE = 0.05  # [rad] of every limit that they keep: the correction must have room
HEAD = (
    "| cell | fixtures | said | expected [mm] | minutes | before [mm] | true after [mm] | stated [mm] |\n"
    "|---|---|---|---|---|---|---|---|"
)


def plan(cell, count, folder, poses):
    """Plan with so many fixtures; returns the document, or the sentence that says why there is none, and the notes."""
    words = ["--fixtures", count] if count > 1 else []
    words += ["--aim", "tracing", "--poses", poses] if poses else []
    if not (folder / "plan.json").exists():
        done = edbb("plan", cell, "-o", folder, "--force", "--dialect", "poses-csv", *words, threads="1")
        if done.returncode:
            return None, f"exit {done.returncode}: {done.screen.strip()[-400:]}"
    document = json.loads((folder / "plan.json").read_text())
    share = re.search(r"100 poses ([^;]*);", " ".join(document["notes"]))
    return document, ", ".join(re.findall(r"[\d.]+(?= by)", share[1])) if share else ""


def measure(arm, folder, run, at_rest):
    """Write the run of a plan on an arm: at rest, or along the drive whose times and angles ``edbb simulate`` tells."""
    if at_rest or not arm.cell.motion.is_continuous:
        arm.write_run(folder / "plan.json", run)
        return
    told = folder / "told.csv"  # the same times and angles for every arm
    if not told.exists():
        done = edbb("simulate", folder / "plan.json", "-o", told, "--force", threads="1")
        assert done.returncode == 0, done.stderr
    arm.write_driven_run(told, run)


def calibrate(run, folder, found):
    """Identify a run by the command, into ``found``."""
    words = ("--cell", folder / "cell.toml", "--plan", folder / "plan.json", "-o", found, "--force")
    done = edbb("identify", run, *words, threads="1")
    assert done.returncode == 0, done.stderr


def calibrate_quickly(run, folder, found):
    """The same without the search for causes and without a report, by a sixth of the draws."""
    cell = load_cell(str(folder / "cell.toml"))
    with few_draws():
        done = identify(load_runs([run], cell.robot.n_joints), cell)
        files = calibrated_files(done)
    found.mkdir(exist_ok=True)
    for name, text in (*files, ("identification.json", json.dumps({"known_anywhere_mm": 1e3 * done.workspace_error}))):
        (found / name).write_text(text)


def judge(folder, seed, asked):
    """An arm with drawn and hidden errors, measured and identified: its error before, after, and as stated [mm]."""
    cell = load_cell(str(folder / "cell.toml"))
    flange = true_flange(cell.robot, None, "", np.random.default_rng([seed, 11]))
    flange = with_hidden_errors(flange, cell.robot.n_joints, cell.tool.p_FM, np.random.default_rng([seed, 13]))
    arm = TrueArm.draw(cell, flange, np.random.default_rng([seed, 12]))
    run, found = folder / f"run{seed}.csv", folder / f"found{seed}"
    if not (found / "identification.json").exists():
        measure(arm, folder, run, asked.at_rest)
        (calibrate_quickly if asked.quick else calibrate)(run, folder, found)
    stated = json.loads((found / "identification.json").read_text())["known_anywhere_mm"]
    low, high = cell.joint_range
    q = np.random.default_rng(3).uniform(low + INSIDE, high - INSIDE, (STATES, cell.robot.n_joints))
    corrected, done = correct(q, found / "robot.toml", folder)
    ideal = true_flange(cell.robot, None, "", np.random.default_rng(0), errors=False)
    wanted = replace(arm, flange=ideal, p_FM=load_robot(found / "robot.toml").tool_points[0].p_FM).tool(q)
    before, after = (1e3 * aligned_distance(arm.tool(driven[done]), wanted[done]) for driven in (q, corrected))
    return before, after, stated


def row(cell, count, folder, asked):
    """Return the line of the table."""
    document, said = plan(cell, count, folder, asked.poses)
    if document is None:
        return f"| {cell} | {count} | {said} | | | | | |"
    poses = sum(p["role"] == "calibrate" for p in document["poses"])
    expected = document.get("foresight", {}).get("error_mm", float("nan"))
    minutes = document["trajectory"]["duration_s"] / 60
    judged = [judge(folder, k, asked) for k in range(asked.arms)]
    columns = [" ".join(f"{j[k]:.3f}" for j in judged) for k in range(3)]
    return (
        f"| {cell} | {count} | {said} | {expected:.3f} ({poses} poses) | {minutes:.0f} | " + " | ".join(columns) + " |"
    )


def main():
    """Plan and judge what the arguments ask for, some at a time."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cells", nargs="*", default=CELLS)
    parser.add_argument("--counts", nargs="+", type=int, default=[1, 2, 3], help="numbers of fixtures")
    parser.add_argument("--poses", type=int, help="of each plan; as many as pay without it")
    parser.add_argument("--arms", type=int, default=3, help="simulated arms a plan")
    parser.add_argument("--at-rest", action="store_true", help="a driven plan, too, is read at its poses alone")
    parser.add_argument("--quick", action="store_true", help="no search for causes; a tenth of the time")
    parser.add_argument("--keep", type=Path, help="folder for plans and runs; what stands there is not made again")
    parser.add_argument("-j", "--jobs", type=int, default=max(1, (os.cpu_count() or 1) // 2), help="rows at a time")
    asked = parser.parse_args()
    print(HEAD, flush=True)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(asked.jobs) as pool:
        name = asked.keep or name
        wanted = [(c, n) for n in sorted(asked.counts, reverse=True) for c in asked.cells]
        folders = [Path(name) / f"{c.replace('/', '-')}-{n}" for c, n in wanted]
        rows = [pool.submit(row, c, n, f, asked) for (c, n), f in zip(wanted, folders, strict=True)]
        for each in rows:
            print(each.result(), flush=True)


if __name__ == "__main__":
    main()
