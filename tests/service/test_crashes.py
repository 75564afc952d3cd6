"""Server and job killed at random moments: what was accepted is done, once, and nothing is half there."""

import hashlib
import os
import random
import select
import signal
import sqlite3
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from planner.service import job_store
from planner.service.context import Supervisor
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_record import JobCommand, JobFilter
from planner.service.job_store import JobStore
from planner.service.settings import JobLimits
from tests.service.conftest import PATIENCE_S, wait_until

CHEAP = JobCommand(("--version",))  # the quickest command line there is

MANY = 200 if os.environ.get("EDBB_ALL_TRIALS") else 30


class Store:
    def __init__(self, folder):
        self.folder = folder
        self.files = FileStore(folder)
        self.jobs = JobStore(Database(folder / "jobs.sqlite3"))
        self.supervisor = Supervisor(self.jobs, self.files, folder, 2, JobLimits(1 << 30, 60.0))


def serve(folder, number, told):
    """One life of a server: takes an upload and a job, says so once both are safe, and works until it is killed.

    Every life is of another version: the program was upgraded between the kill and the restart.
    """
    job_store.__version__ = f"{number}.0.0"
    store = Store(folder)
    store.supervisor.start()
    data = random.Random(number).randbytes(300_000)
    sha256 = store.files.add(data)
    os.write(told, f"file {sha256}\n".encode())
    store.jobs.submit(f"{number:024x}", "plan", "cheap", "{}", CHEAP)
    os.write(told, f"job {number:024x}\n".encode())
    time.sleep(60)


def live_and_die(folder, number, told, told_to, rng):
    pid = os.fork()
    if pid == 0:
        os.setpgid(0, 0)
        try:
            serve(folder, number, told)
        finally:
            os._exit(0)
    if number == 0:
        select.select([told_to], [], [], PATIENCE_S)  # one life at least accepts something
    if number % 10 == 9:  # however slow the machine is, some lives are long enough to work off what others left
        wait_for_ends(folder / "jobs.sqlite3", count_done(folder / "jobs.sqlite3") + 1)
    time.sleep(rng.choice((rng.uniform(0, 0.1), rng.uniform(0, 0.8))))
    if rng.random() < 0.5:  # the job first, then its server a moment later
        for child in children_of(pid):
            os.kill(child, signal.SIGKILL)
        time.sleep(rng.uniform(0, 0.2))
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def count_done(path):
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=20.0)) as db:
        return db.execute("SELECT count(*) FROM jobs WHERE state = 'done'").fetchone()[0]


def wait_for_ends(path, count):
    until = time.monotonic() + PATIENCE_S
    while count_done(path) < count and time.monotonic() < until:
        time.sleep(0.05)


def children_of(pid):
    found = [Path(p) for p in Path("/proc").glob("[0-9]*/stat")]
    return [int(p.parent.name) for p in found if parent_of(p) == pid]


def parent_of(stat):
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except OSError:
        return None


def kill_often(folder, times):
    rng = random.Random(4)
    read, told = os.pipe()
    for number in range(times):
        live_and_die(folder, number, told, read, rng)
    os.close(told)
    with os.fdopen(read) as lines:
        words = [line.split() for line in lines]
    return [w[1] for w in words if w[0] == "job"], [w[1] for w in words if w[0] == "file"]


@pytest.mark.slow
@pytest.mark.parametrize("times", [4, pytest.param(MANY, marks=pytest.mark.long)])
def test_what_was_accepted_is_done_once_whatever_is_killed(tmp_path, times):
    accepted, kept = kill_often(tmp_path, times)
    assert len(accepted) >= times // 10
    store = Store(tmp_path)
    store.supervisor.start()
    wait_until(lambda: sum(store.jobs.count_open_states()) == 0, PATIENCE_S + times)
    store.supervisor.stop()
    jobs = store.jobs.list_jobs(JobFilter(), most=10_000)
    assert {j.id for j in jobs} >= set(accepted)
    ends = [e.job for e in store.jobs.events_after(0, [], 100_000) if e.kind == "end"]
    assert sorted(ends) == sorted(j.id for j in jobs), "each job ends once"
    for job in jobs:
        # a job whose process was killed three times on purpose may be given up; it then shows no files
        outputs = store.jobs.outputs(job.id)
        assert (job.state, len(outputs)) in (("done", 1), ("failed", 0)), job
        assert job.state == "done" or "killed" in job.problem.detail
    later = [j for j in jobs if j.version not in (f"{int(j.id, 16)}.0.0", job_store.__version__)]
    assert len(later) >= times // 20, "a life of another version ended what one before had taken"
    assert sum(j.state == "done" for j in jobs) >= 0.8 * len(jobs) - 1
    for sha256 in {*kept, *(o.sha256 for j in jobs for o in store.jobs.outputs(j.id))}:
        assert hashlib.sha256(store.files.path(sha256).read_bytes()).hexdigest() == sha256
    for path in store.files.folder.glob("??/*"):
        assert hashlib.sha256(path.read_bytes()).hexdigest() == path.name, "nothing half-written has a name"
    assert not list((tmp_path / "jobs").iterdir())
    assert not list((tmp_path / "drafts").iterdir())


def test_an_overtaken_server_ends_nothing(tmp_path):
    """Two servers hold the same job; only the one of the later fence can end it."""
    store = Store(tmp_path)
    store.jobs.submit("0" * 24, "plan", "cheap", "{}", CHEAP)
    first = store.jobs.take(2)
    with store.jobs._db.write() as db:
        db.execute("UPDATE jobs SET lease_until = 0")
    second = store.jobs.take(2)
    assert second.fence == first.fence + 1
    assert not store.jobs.finish(first, "done", [], 0, None)
    assert store.jobs.get(first.id).state == "running"
    assert store.jobs.finish(second, "done", [], 0, None)
    assert not store.jobs.finish(second, "failed", [], 0, None)


def test_a_job_that_is_tried_again_is_followed_from_its_new_beginning(tmp_path):
    store, id = Store(tmp_path), "0" * 24
    store.jobs.submit(id, "plan", "cheap", "{}", CHEAP)
    store.jobs.cancel(id)
    first = store.jobs.events_after(0, [id])
    store.jobs.submit(id, "plan", "cheap", "{}", CHEAP)
    again = store.jobs.events_after(0, [id])
    assert ([e.kind for e in first], [e.kind for e in again]) == (["queued", "end"], ["queued"])
    assert again[0].id > first[-1].id


def test_no_more_jobs_run_than_workers(tmp_path):
    store = Store(tmp_path)
    for k in range(4):
        store.jobs.submit(f"{k:024x}", "plan", "cheap", "{}", CHEAP)
    assert store.jobs.take(2)
    assert store.jobs.take(2)
    assert store.jobs.take(2) is None
    for k in range(4, 6):
        store.jobs.submit(f"{k:024x}", "fixture-view", "short", "{}", replace(CHEAP, task=True))
    assert store.jobs.take(2).kind == "fixture-view", "one short task beside them"
    assert store.jobs.take(2) is None
