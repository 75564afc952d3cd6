"""``python -m tests.benchmarks.trace [ROWS]``: time to trace 300 lengths, 1000 x 3 coordinates, and so many rows."""

import os
import sys
import tempfile
import time
from pathlib import Path

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.identification.pipeline import identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.draw import as_in_a_real_arm, random_run

os.environ.setdefault("OMP_NUM_THREADS", "1")


def timed(name, made):
    """Identify with tracing, and print how long it took by the wall and by the processors."""
    with tempfile.TemporaryDirectory() as folder:
        files = made.write(Path(folder))
        cell = load_cell(str(files[1]), planning=False)
        run = load_runs([files[0]], cell.robot.n_joints)
        wall, spent = time.perf_counter(), time.process_time()
        found = identify(run, cell, tracer=trace)
        wall, spent = time.perf_counter() - wall, time.process_time() - spent
    names = [f"{f.effect}, {f.on}" for c in found.findings for f in c.each]
    print(f"{name}: {len(run)} samples, {wall:.1f} s by the wall, {spent:.1f} s of processors; {names}", flush=True)


def main():
    """Time all."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 500_000
    kuka, comau = Arm.from_toml("kuka-kr6-r700"), Arm.from_toml("comau-nj130")
    timed("bar, seven effects", as_in_a_real_arm(runs.edbb_static, kuka, 2, 3.0, n_poses=300))
    timed("tracker, seven effects", as_in_a_real_arm(runs.tracker, kuka, 2, 3.0, n_poses=1000))
    moving = random_run(runs.edbb_continuous, comau, 2, ["reducer-ripple"], 3.0, n_rows=rows)
    timed("continuous bar, one effect", moving)


if __name__ == "__main__":
    main()
