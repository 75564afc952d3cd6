"""A service with 10 000 jobs and 2 000 robots: how long it takes to start and to make each page, and its memory.

``python -m tests.benchmarks.plant [JOBS ROBOTS]`` makes the plant (2 min), and prints each time beside that of version
0.1.0's first lists, which read every record (measured on two quiet cores: 42.7 s for the first page, 51.5 s for a
robot's, 540 MB).
"""

import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from datetime import date, timedelta
from pathlib import Path

import httpx

from planner.instruments.record import Circumstances, add_entry
from planner.service.database import Database
from planner.service.job_store import JobStore
from tests.instruments.check.test_record import calibration

PAGES = (
    ("first page", "/"), ("robots, API", "/api/records"), ("a robot", "/robots/R-00000"),
    ("search of robots", "/?q=r-01"), ("jobs", "/jobs"), ("jobs, API", "/api/jobs?most=50"),
    ("jobs, deep", "/api/jobs?most=50&until=2020-09-15T00:00:00Z"), ("failed jobs", "/api/jobs?state=failed&most=50"),
    ("jobs by text", "/api/jobs?q=edbb&most=50"), ("log of a run", "/calibrate"),
)  # fmt: skip
BEFORE = {"first page": 42.7, "a robot": 51.5}  # s
ROUNDS = 5  # of each page; the middle one counts


def make_plant(folder, jobs, robots):
    rng = random.Random(1)
    store = JobStore(Database(folder / "jobs.sqlite3"))
    with store._db.write() as db:
        for k in range(jobs):
            kind = rng.choice(("plan", "identification", "check", "fixture-view", "study"))
            command = json.dumps({"words": [kind], "inputs": [], "task": kind == "fixture-view"})
            db.execute(
                "INSERT INTO jobs (id, kind, title, request, command, task, robot, state, created)"
                " VALUES (?, ?, 'ur10/edbb', '{}', ?, ?, 'ur10', ?, ?)",
                (f"{rng.getrandbits(96):024x}", kind, command, kind == "fixture-view",
                 rng.choice(("failed", "cancelled")), 1.6e9 + 60.0 * k),
            )  # fmt: skip
    records, results = folder / "records", folder / "results"
    records.mkdir()
    results.mkdir()
    (results / "identification.json").write_text(json.dumps(calibration(0.01), default=str))
    add_entry(records / "R-00000", results, Circumstances(date=date.today() - timedelta(20)), "R-00000")
    text = (records / "R-00000/record.toml").read_text()
    for k in range(1, robots):
        own = records / f"R-{k:05d}"
        shutil.copytree(records / "R-00000", own)
        (own / "record.toml").write_text(text.replace("R-00000", own.name))


@contextmanager
def running(folder):
    """Address and process of a service; how long its start took is printed."""
    begun = time.monotonic()
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", folder]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        try:
            address = re.search(r"http://\S+?(?=,)", server.stderr.readline())[0]
            print(f"started in {time.monotonic() - begun:.2f} s, imports of Python included")
            yield address, server.pid
        finally:
            server.terminate()


def memory_mb(pid):
    """Largest memory of a process so far."""
    (line,) = (w for w in Path(f"/proc/{pid}/status").read_text().splitlines() if w.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def time_pages(address):
    found = {}
    with httpx.Client(base_url=address, timeout=300) as client:
        begun = time.monotonic()
        client.get("/")
        found["first page, nothing known yet"] = time.monotonic() - begun
        for _ in range(600):
            if len(client.get("/api/records", params={"q": "R-", "most": 1000, "after": 1000}).json()) >= 1000:
                break
            time.sleep(1.0)
        found["until all records are read"] = time.monotonic() - begun
        for name, path in PAGES:
            times = []
            for _ in range(ROUNDS):
                begun = time.monotonic()
                answer = client.get(path)
                times.append(time.monotonic() - begun)
                assert answer.status_code == 200, (path, answer.text[:300])
            found[name] = sorted(times)[ROUNDS // 2]
    return found


def main():
    jobs, robots = (int(v) for v in sys.argv[1:3]) if len(sys.argv) > 2 else (10_000, 2_000)
    with tempfile.TemporaryDirectory() as folder:
        make_plant(Path(folder), jobs, robots)
        for life in ("first life", "second life"):
            print(life)
            with running(folder) as (address, pid):
                for name, seconds in time_pages(address).items():
                    old = f"  ({BEFORE[name]:g} s before)" if name in BEFORE else ""
                    print(f"  {name:32s} {seconds:7.3f} s{old}")
                print(f"  memory {memory_mb(pid):.0f} MB (540 MB before)")


if __name__ == "__main__":
    main()
