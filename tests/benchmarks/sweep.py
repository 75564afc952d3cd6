"""Throughput of sweeps on a Dask cluster of processes here, and what that says of larger clusters.

``python -m tests.benchmarks.sweep`` (two minutes on two cores, three at most) measures points an hour with 1 and 2
workers, and what the one scheduler and the one process that submits and writes parts need for a point; from these the
rest follows.
"""

import signal
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster, as_completed

from planner.cell.reading import load_cell
from planner.studies.sweep import sweep, write_part
from planner.studies.sweep_point import SweepTask, cell_hash, run_task

SWEEP = 'schema = "edbb-sweep/1"\ncells = ["ur10/edbb"]\nposes = {poses}\ncandidates = 400\ntrials = 200\n'
POINTS, EMPTY, PARTS = 8, 2000, 200
BOUND_S = 180  # it ends there, whatever has come


def cluster(workers):
    return LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None)


def measure_points(workers, folder):
    """Seconds that a point takes, all workers together, and seconds of a core; libraries are loaded before."""
    file, content = folder / f"{workers}.toml", cell_hash(load_cell("ur10/edbb"))
    with cluster(workers) as here, Client(here) as client:
        warm = [client.submit(run_task, SweepTask("ur10/edbb", content, 10, 1, k, 100)) for k in range(4 * workers)]
        client.gather(warm)
        file.write_text(SWEEP.format(poses=list(range(30, 30 + POINTS))))
        begun, used = time.monotonic(), client.run(time.process_time)
        sweep(file, folder / str(workers), scheduler=here.scheduler_address)
        spent = sum(after - used[w] for w, after in client.run(time.process_time).items())
        return (time.monotonic() - begun) / POINTS, spent / POINTS


def measure_overhead():
    """Seconds that scheduler and client need for a task that does nothing."""
    with cluster(1) as here, Client(here) as client:
        begun = time.monotonic()
        for _ in as_completed([client.submit(abs, -k, pure=False) for k in range(EMPTY)]):
            pass
        return (time.monotonic() - begun) / EMPTY


def measure_writing(folder):
    """Seconds that a part takes to be written, and its bytes."""
    task = SweepTask("ur10/edbb", cell_hash(load_cell("ur10/edbb")), 30, 200, 0, 400)
    table = run_task(task).table()
    begun = time.monotonic()
    for _ in range(PARTS):
        write_part(task, table, folder)
    return (time.monotonic() - begun) / PARTS, (folder / f"{task.key}.parquet").stat().st_size


def main():
    signal.alarm(BOUND_S)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (one, core), (two, core_of_two) = (measure_points(n, folder) for n in (1, 2))
        overhead = measure_overhead()
        writing, size = measure_writing(folder)
    serial = overhead + writing
    print("| Workers | Points an hour | Workers busy |\n|---|---|---|")
    print(f"| 1 (measured) | {3600 / one:.0f} | {100 * core / one:.0f} % |")
    print(f"| 2 (measured) | {3600 / two:.0f}; {one / two:.1f} times one | {50 * core_of_two / two:.0f} % |")
    for workers in (100, 10_000):
        most = min(workers / one, 1 / serial)
        print(f"| {workers} (on paper) | {3600 * most:.0f} | {100 * min(1.0, most * one / workers):.0f} % |")
    print(f"\na point takes {core:.2f} s of a core, scheduler and client {1e3 * overhead:.2f} ms,")
    print(
        f"its part of {size} bytes {1e3 * writing:.2f} ms to write: one client feeds {1 / serial:.0f} points a second,"
    )
    print(f"what {one / serial:.0f} workers compute")


if __name__ == "__main__":
    main()
