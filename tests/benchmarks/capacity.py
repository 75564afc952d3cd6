"""What the service itself costs a job, with one and two workers, beside it and on a Dask cluster over loopback.

``python -m tests.benchmarks.capacity [JOBS]`` runs jobs that compute next to nothing (``edbb robots``): what is left is
the service's own processor time a job, which says how many jobs an hour one service can give out, and the time from one
job to the next, in which Python starts.
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from tests.service.conftest import upload
from tests.service.test_cluster import Plant

SECONDS = 3600.0  # of an hour


def processor_s(pid):
    """Processor time of a process alone, without its children [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def measure(folder, count, workers, on_cluster):
    """Wall time and processor time of the service a job [s], for jobs that are all there at the beginning."""
    plant = Plant(folder, workers, on_cluster)
    for name in (["scheduler", *("one", "two")[:workers]] if on_cluster else []) + ["service"]:
        plant.begin(name)
        time.sleep(3.0 * (name != "service"))
    try:
        plant.wait_for_service()
        plant.wait(plant.ask(["robots"]))
        server = plant.processes["service"].pid
        begun, spent = time.monotonic(), processor_s(server)
        ids = [plant.ask(["robots"], [upload(plant.client, "files", b"%d" % k, "a.txt")]) for k in range(count)]
        for id in ids:
            plant.wait(id, seconds=600)
        return (time.monotonic() - begun) / count, (processor_s(server) - spent) / count
    finally:
        for name in list(plant.processes):
            plant.kill(name)


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    for on_cluster in (False, True):
        for workers in (1, 2):
            with tempfile.TemporaryDirectory() as folder:
                wall, own = measure(Path(folder), count, workers, on_cluster)
            where = "cluster" if on_cluster else "beside the service"
            print(
                f"{workers} workers, {where}: {wall:.2f} s from job to job ({SECONDS / wall:.0f} an hour), "
                f"{1e3 * own:.0f} ms of the service's processor each (at most {SECONDS / own:.0f} an hour); "
                f"load {os.getloadavg()[0]:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
