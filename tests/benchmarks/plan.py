"""Time and memory of planning: ``python -m tests.benchmarks.plan`` (about ten minutes on two cores).

Prints the whole plan of the NJ-130 cell stage by stage with its peak memory, the plan of every shipped cell with both
engines' verdicts and the same bytes on one thread and two, and how time and memory grow with candidates and poses.
"""

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell, shipped_cells
from planner.design.candidates.pool import draw_candidates
from planner.design.pose_selection import identify_candidates
from planner.design.selection.index_bound import certify_bound
from planner.design.selection.index_search import exchange_poses
from planner.motion.path.constraints import Constraints
from planner.motion.tour.solve import solve_tour
from planner.runs.run import FIRST_MOUNTING
from planner.session.tour_cost import tour_costs


def run_plan(cell, folder, *words, threads="1"):
    """Plan in a process of its own; returns wall seconds, peak memory [MB] and the plan."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "planner.cli", "plan", cell, "-o", str(folder), *words]
    subprocess.run(command, check=True, env={**os.environ, "OMP_NUM_THREADS": threads}, stderr=subprocess.DEVNULL)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return seconds, peak, json.loads((folder / "plan.json").read_text())


def whole_plan(folder):
    """The main number: 35 poses from 100 000 candidates."""
    seconds, peak, plan = run_plan("comau-nj130/edbb", folder / "main", "--poses", "35")
    stages = json.loads((folder / "main" / "timings.json").read_text())
    print(f"edbb plan comau-nj130/edbb --poses 35: {seconds:.1f} s, peak {peak:.0f} MB (goal 60 s, 2048 MB)")
    print("  " + ", ".join(f"{name} {s:.1f} s" for name, s in stages.items()))
    seen = plan["observability"]
    grid = seen["on_grid"]
    gap = 100 * grid["gap"]
    print(f"  O2 {seen['O2']:.2f}, bound {seen['bound']:.2f}, on the grid {grid['value']:.2f} (gap {gap:.2f} %)")


def digest(folder):
    """One hash over every file but the timings."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != "timings.json")
    return hashlib.sha256(b"".join(p.name.encode() + p.read_bytes() for p in files)).hexdigest()[:12]


def every_cell(folder):
    """Every shipped cell, on one BLAS thread and on two."""
    print("\ncell                    wall    clearance  coal   fcl    same bytes on 1 and 2 threads")
    for name in shipped_cells():
        runs = [run_plan(name, folder / f"{name.replace('/', '-')}-{k}", threads=k) for k in "12"]
        same = len({digest(folder / f"{name.replace('/', '-')}-{k}") for k in "12"}) == 1
        plan = runs[0][2]["path"]
        proven = {e: all(v["proven"] for v in plan["verdicts"] if v["engine"] == e) for e in ("coal", "python-fcl")}
        both = f"{proven['coal']!s:<5}  {proven['python-fcl']!s:<5}"
        print(f"{name:<20} {runs[0][0]:7.1f} s {plan['clearance_mm']:8.1f} mm  {both}  {same}")


def cpu_seconds():
    """Processor seconds of this process and of its copies that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def print_growth(what, sizes, task):
    """Time ``task`` for each size and print its processor seconds, peak memory and the exponent of a power law."""
    spent = []
    for n in sizes:
        begun = cpu_seconds()
        task(n)
        spent.append(max(cpu_seconds() - begun, 1e-3))
    power = np.polyfit(np.log(sizes), np.log(spent), 1)[0]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    cells = "  ".join(f"{n:>9,}: {s:7.2f} s" for n, s in zip(sizes, spent, strict=True))
    print(f"{what:<22} {cells}   exponent {power:5.2f}, peak so far {peak:5.0f} MB", flush=True)


def growth(largest):
    """How cost grows with candidates, poses, nodes of a tour and motions to be proven."""
    cell = load_cell("comau-nj130/edbb")
    sizes = [n for n in (1_000, 10_000, 100_000, 1_000_000) if n <= largest]
    pools = {}
    print_growth("candidates drawn", sizes, lambda n: pools.update({n: draw_candidates(cell, n)}))
    print_growth("rows and rank", sizes, lambda n: pools.update({n: identify_candidates(cell, pools[n])[2]}))
    print_growth("bound, 35 poses", sizes, lambda n: certify_bound(pools[n], "O2", 35))
    few, q = pools[10_000], draw_candidates(cell, 4_000).q
    print_growth("exchange, poses", (30, 60, 120, 240), lambda n: exchange_poses(few, n, "O2", starts=1))
    print_growth("tour, nodes", (25, 50, 100, 200), lambda n: solve_tour(tour_costs(cell, FIRST_MOUNTING, q[:n])))
    constraints = Constraints(cell)
    print_growth("motions proven", (125, 500, 2_000), lambda n: constraints.prove(q[:n], q[n : 2 * n]))


def main():
    """Run what the arguments ask for, by default all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "part", nargs="*", choices=("whole", "cells", "growth", []), help="whole, cells, growth (default: all)"
    )
    parser.add_argument("--largest", type=int, default=1_000_000, help="number of candidates in the growth")
    asked = parser.parse_args()
    parts = asked.part or ["whole", "cells", "growth"]
    with tempfile.TemporaryDirectory() as name:
        if "whole" in parts:
            whole_plan(Path(name))
        if "cells" in parts:
            every_cell(Path(name))
    if "growth" in parts:
        growth(asked.largest)


if __name__ == "__main__":
    main()
