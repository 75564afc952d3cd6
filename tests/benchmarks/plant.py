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

from planner.checks.record import Circumstances
from planner.checks.record_changes import add_entry
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_store import JobStore
from planner.service.people import PeopleStore
from planner.service.settings import Role
from tests.checks.test_record import calibration

PAGES = (
    ("first page", "/"), ("robots, API", "/api/records"), ("a robot", "/robots/R-00000"),
    ("search of robots", "/?q=r-01"), ("jobs", "/jobs"), ("jobs, API", "/api/jobs?most=50"),
    ("jobs, deep", "/api/jobs?most=50&until=2020-09-15T00:00:00Z"), ("failed jobs", "/api/jobs?state=failed&most=50"),
    ("jobs by text", "/api/jobs?q=edbb&most=50"), ("jobs of a person", "/api/jobs?person=p7&most=50"),
    ("log of a run", "/calibrate"), ("a plan", "/jobs/{plan}"), ("its checklist", "/jobs/{plan}/session"),
    ("ticks", "/api/jobs/{plan}/ticks"), ("who did what", "/deeds"), ("cells", "/api/cells"),
    ("metrics", "/metrics"), ("health", "/api/health"),
)  # fmt: skip
BEFORE = {"first page": 42.7, "a robot": 51.5}  # s
ROUNDS = 5  # of each page; the middle one counts
PLANS, PEOPLE, DEEDS = 300, 30, 20_000  # finished plans with their files; people; what they did
PLAN = Path(__file__).parents[1] / "data" / "kr6-plan"
MADE = f"{7:024x}"  # a plan whose page is made


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
    add_plans(folder, store)
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


def add_plans(folder, store):
    """Finished plans with files of their own, cells, ticks, and who did what."""
    people, files = PeopleStore(store._db), FileStore(folder)
    people.add("p0", Role.ADMINISTER, "a good password")
    for k in range(1, PEOPLE):
        people.add(f"p{k}", Role.WORK, None)
    text, cell = (PLAN / "plan.json").read_text(), (PLAN / "cell.toml").read_bytes()
    (known,) = set(re.findall(r'"plan_id": "([0-9a-f]{12})"', text))
    contents = [(text.replace(known, f"{k:012x}").encode(), cell + f"# {k}\n".encode()) for k in range(PLANS)]
    kept = [(files.add(plan), files.add(own)) for plan, own in contents]
    with store._db.write() as db:
        db.execute("UPDATE jobs SET person = 'p' || (rowid % ?)", (PEOPLE,))
        for k, (plan, own) in enumerate(kept):
            for kind, id, done in (("plan", f"{k:024x}", 1.7e9 + k), ("cell-check", f"{k + 1000:024x}", 1.6e9 + k)):
                command = json.dumps({"words": [kind], "inputs": [], "task": kind == "cell-check"})
                db.execute(
                    "INSERT INTO jobs (id, kind, title, request, command, task, robot, state, created, started,"
                    " finished, person) VALUES (?, ?, 'kr6/edbb', ?, ?, ?, 'kr6', 'done', ?, ?, ?, 'p7')",
                    (id, kind, json.dumps({"cell": own, "files": []}), command, kind == "cell-check", done, done, done),
                )  # fmt: skip
            names = (("plan.json", plan), ("cell.toml", own))
            db.executemany("INSERT INTO outputs VALUES (?, ?, ?, 40000)", [(f"{k:024x}", *named) for named in names])
            db.execute("INSERT INTO uploads VALUES (?, 'cell.toml', 2000, 'cell', ?, 'p7')", (own, 1.6e9 + k))
            db.execute("INSERT INTO cell_notes VALUES (?, ?, 'a note')", (own, f"cell {k}"))
            db.execute("INSERT INTO ticks VALUES (?, 'step-1', 1, 1.7e9, 'p7')", (f"{k:024x}",))
        deeds = [
            (1.6e9 + k, f"p{k % PEOPLE}", "10.0.0.1", "asked for: plan", f"/api/jobs/{k:024x}") for k in range(DEEDS)
        ]
        db.executemany(
            "INSERT INTO deeds (at, person, address, deed, subject, status) VALUES (?, ?, ?, ?, ?, 202)", deeds
        )


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


def count_robots(client):
    """How many robots the service knows by now."""
    return sum(
        int(float(n)) for n in re.findall(r"^edbb_robots\{.*\} (\S+)$", client.get("/metrics").text, re.MULTILINE)
    )


def time_pages(address, token, robots):
    found = {}
    with httpx.Client(base_url=address, timeout=300, headers={"authorization": f"Bearer {token}"}) as client:
        begun = time.monotonic()
        client.get("/")
        found["first page, nothing known yet"] = time.monotonic() - begun
        while count_robots(client) < robots:
            time.sleep(0.5)
        found["until all records are read"] = time.monotonic() - begun
        for name, path in PAGES:
            times = []
            for _ in range(ROUNDS):
                begun = time.monotonic()
                answer = client.get(path.format(plan=MADE))
                times.append(time.monotonic() - begun)
                assert answer.status_code == 200, (path, answer.text[:300])
            found[name] = sorted(times)[ROUNDS // 2]
            if times[0] > 2 * found[name]:
                found[f"{name}, the first time"] = times[0]
    return found


def main():
    jobs, robots = (int(v) for v in sys.argv[1:3]) if len(sys.argv) > 2 else (10_000, 2_000)
    with tempfile.TemporaryDirectory() as folder:
        make_plant(Path(folder), jobs, robots)
        token = PeopleStore(Database(Path(folder) / "jobs.sqlite3")).make_token("p0", "benchmark")
        for life in ("first life", "second life"):
            print(life)
            with running(folder) as (address, pid):
                for name, seconds in time_pages(address, token, robots).items():
                    old = f"  ({BEFORE[name]:g} s before)" if name in BEFORE else ""
                    print(f"  {name:32s} {seconds:7.3f} s{old}")
                print(f"  memory {memory_mb(pid):.0f} MB (540 MB before)")


if __name__ == "__main__":
    main()
