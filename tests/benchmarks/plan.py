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


def growth():
    """Cost against candidates and against poses, with the exponent of a power law."""
    cell = load_cell("comau-nj130/edbb")
    sizes, seconds = (1_000, 10_000, 100_000, 1_000_000), []
    print("\ncandidates     draw      rows+rank   bound (35)   memory")
    rows = None
    for n in sizes:
        marks = [time.perf_counter()]
        pool = draw_candidates(cell, n)
        marks.append(time.perf_counter())
        _, _, rows = identify_candidates(cell, pool)
        marks.append(time.perf_counter())
        certify_bound(rows, "O2", 35)
        marks.append(time.perf_counter())
        step = np.diff(marks)
        seconds.append(step)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{n:>10} {step[0]:8.2f} s {step[1]:10.2f} s {step[2]:10.2f} s {peak:8.0f} MB")
        if n == 20_000 or n == 10_000:
            few = rows
    slopes = np.polyfit(np.log(sizes), np.log(np.array(seconds)), 1)[0]
    print(f"  exponents: draw {slopes[0]:.2f}, rows and rank {slopes[1]:.2f}, bound {slopes[2]:.2f}")
    print("\nposes     exchange on 10 000 candidates, one start")
    counts, spent = (30, 60, 120, 250, 500), []
    for n in counts:
        start = time.perf_counter()
        certificate = certify_bound(few, "O2", n)
        found = exchange_poses(few, n, "O2", starts=1, certificate=certificate)
        spent.append(time.perf_counter() - start)
        print(f"{n:>5} {spent[-1]:9.2f} s   gap {100 * (found.value / certificate.value - 1):.2f} %")
    print(f"  exponent {np.polyfit(np.log(counts), np.log(spent), 1)[0]:.2f}")


def main():
    """Run what the arguments ask for, by default all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "part", nargs="*", choices=("whole", "cells", "growth", []), help="whole, cells, growth (default: all)"
    )
    parts = parser.parse_args().part or ["whole", "cells", "growth"]
    with tempfile.TemporaryDirectory() as name:
        if "whole" in parts:
            whole_plan(Path(name))
        if "cells" in parts:
            every_cell(Path(name))
    if "growth" in parts:
        growth()


if __name__ == "__main__":
    main()
