"""How long a large run takes to load and check: ``python -m tests.benchmarks.run_loading [--rows N]``.

Time, six joint angles and a length, as CSV, as Parquet, and as two logs with clocks of their own.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl

from planner.runs.joint_motion import joint_speeds
from planner.runs.loader import load_run, load_runs
from planner.runs.run import Run
from planner.runs.writer import save_run


def write_logs(folder: Path, n: int) -> None:
    """Write n rows of a smooth path every 2 ms, whole in both formats, and in two halves with sync marks."""
    t = 0.002 * np.arange(n)
    joints = {f"q{j}_deg": 60.0 * np.sin(0.05 * j * t + j) for j in range(1, 7)}
    length = {"length_mm": 400.0 + 80.0 * np.sin(0.3 * t)}
    sync = {"sync": (np.sin(t + 2e-4 * t**2) > 0.99).astype(int)}
    pl.DataFrame({"t_s": t} | joints | length).write_csv(folder / "run.csv", float_precision=6)
    pl.DataFrame({"t_s": t} | joints | length).write_parquet(folder / "run.parquet")
    pl.DataFrame({"t_s": t} | joints | sync).write_csv(folder / "axes.csv", float_precision=6)
    pl.DataFrame({"t_s": t - 71.0} | length | sync).write_csv(folder / "gauge.csv", float_precision=6)


def timed(name: str, what: Callable[[], object]) -> None:
    """Print wall and processor seconds of one call."""
    wall, cpu = time.perf_counter(), time.process_time()
    run = what()
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(
        f"{name:28} {wall:7.2f} s {cpu:7.2f} s cpu  {f'{len(run)} samples' if isinstance(run, Run) else ''}", flush=True
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    rows = parser.parse_args().rows
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_logs(folder, rows)
        timed("CSV", lambda: load_run(folder / "run.csv", 6))
        timed("Parquet", lambda: load_run(folder / "run.parquet", 6))
        timed("gauge and controller apart", lambda: load_runs([folder / "gauge.csv", folder / "axes.csv"], 6))
        run = load_run(folder / "run.parquet", 6)
        timed("joint speeds", lambda: joint_speeds(run.samples))
        timed("save as CSV", lambda: save_run(run, folder / "saved.csv"))
        timed("save as Parquet", lambda: save_run(run, folder / "saved.parquet"))


if __name__ == "__main__":
    main()
