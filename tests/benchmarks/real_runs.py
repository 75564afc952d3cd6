"""What the fit of a whole real run costs: ``python -m tests.benchmarks.real_runs [ur5] [ur10] [driven]``.

Each in a process of its own, traced and written as ``edbb identify`` does: processor seconds, peak memory, and seconds
over those of a hundred products of two matrices of 1000 x 1000 on the same machine at the same time, which repeat
where seconds do not. ``driven`` is a simulated run of 224 000 rows of a bar on a moving arm, traced.
"""

import argparse
import os
import resource
import sys
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import tests.simulation.generator.runs as runs
from planner.workflow.identification import identify
from tests.golden.case import ROOT
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.draw import random_run

DATA, CELLS = ROOT / "tests" / "data", ROOT / "tests" / "identification" / "cells"
GOALS = {"ur5": (60.0, 0.7), "ur10": (60.0, 1.2), "driven": (60.0, 0.7)}  # processor seconds, GB
ROWS = 224_000


def unit() -> float:
    """Processor seconds of a hundred products of two matrices."""
    a = np.random.default_rng(0).normal(size=(1000, 1000))
    began = time.process_time()
    for _ in range(100):
        a @ a
    return time.process_time() - began


def measure(name: str, folder: str) -> tuple[float, float, float]:
    """Processor seconds, peak memory [GB] and the unit; of one run, in a process that does nothing else."""
    one = unit()
    if name == "driven":
        made = random_run(runs.edbb_continuous, Arm.from_toml("comau-nj130"), 2, ["reducer-ripple"], 3.0, n_rows=ROWS)
        run, cell = made.write(Path(folder))[:2]
    else:
        run, cell = DATA / f"{name}-tracker" / "run.csv", CELLS / f"{name}-tracker.toml"
    other = DATA / f"{name}-tracker" / "validation.csv"
    began = time.process_time()
    found = identify(run, cell=cell, validate=other if other.exists() else None)
    found.write(Path(folder) / "found")
    spent = time.process_time() - began
    return spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, one


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", nargs="*", default=["ur5", "ur10", "driven"], help="which")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    print(f"Python {sys.version.split()[0]}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print("\n| run | processor s | peak GB | over a hundred products | goal s | goal GB |\n|---|---|---|---|---|---|")
    for name in parser.parse_args().run:
        with tempfile.TemporaryDirectory() as folder, get_context("spawn").Pool(1) as pool:
            spent, peak, one = pool.apply(measure, (name, folder))
        seconds, gigabytes = GOALS[name]
        print(f"| {name} | {spent:.1f} | {peak:.2f} | {spent / one:.0f} | {seconds:.0f} | {gigabytes} |", flush=True)


if __name__ == "__main__":
    main()
