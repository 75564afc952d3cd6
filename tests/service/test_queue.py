"""Who is next: people take turns, short jobs pass long ones, nothing waits for ever; and the time that is left."""

import itertools
import random
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from planner.service import job_queue
from planner.service.database import Database
from planner.service.job_queue import Turns, WaitingJob, order_jobs
from planner.service.job_record import JobCommand
from planner.service.job_store import JobStore
from tests.service.conftest import client_of

NOBODY = Turns({}, {})


def simulate(arrivals, until):
    """One worker that takes the first of the order each time; when each job began."""
    now, last, begun, waiting, coming = 0.0, {}, {}, [], sorted(arrivals, key=lambda j: j.created)
    while now < until and (waiting or coming):
        while coming and (not waiting or coming[0].created <= now):
            now = max(now, coming[0].created)
            waiting.append(coming.pop(0))
        first = order_jobs(waiting, Turns({}, last), now)[0]
        waiting.remove(first)
        begun[first.id], last[first.person] = now, now
        now += first.length_s
    return begun


def test_people_take_turns_however_many_jobs_one_has():
    many = [WaitingJob(f"a{k:03}", "ada", float(k), 60.0) for k in range(100)]
    few = [WaitingJob("b", "ben", 100.0, 60.0), WaitingJob("c", "cleo", 101.0, 60.0)]
    order = order_jobs(many + few, NOBODY, 200.0)
    assert [j.person for j in order[:6]] == ["ada", "ben", "cleo", "ada", "ada", "ada"]
    assert [j.id for j in order if j.person == "ada"] == sorted(j.id for j in many)
    busy = order_jobs(many + few, Turns({"ada": 1}, {"ada": 150.0}), 200.0)
    assert [j.person for j in busy[:3]] == ["ben", "cleo", "ada"]


def test_short_jobs_pass_long_ones_that_wait_no_longer():
    long, short = WaitingJob("long", "ada", 0.0, 3600.0), WaitingJob("short", "ada", 60.0, 10.0)
    assert order_jobs([long, short], NOBODY, 70.0)[0].id == "short"


@pytest.mark.slow
def test_a_long_job_is_not_starved_by_short_ones_that_come_for_ever():
    shorts = [WaitingJob(f"s{k}", "ada", 10.0 * k, 10.0) for k in range(2000)]
    begun = simulate([WaitingJob("long", "ada", 5.0, 1000.0), *shorts], 20_000.0)
    assert "long" in begun
    assert begun["long"] < 5000.0


@pytest.mark.parametrize("seed", range(5))
def test_the_order_is_that_of_choosing_one_after_the_other(seed):
    """Against a plain loop that chooses the first each time; nothing is lost or doubled."""
    rng = random.Random(seed)
    jobs = [WaitingJob(f"{k:02}", rng.choice("abc"), rng.uniform(0, 50), rng.choice((5.0, 600.0))) for k in range(40)]
    running, last, left, plain = {"a": 2}, {"b": 30.0}, list(jobs), []
    for turn in itertools.count():
        if not left:
            break

        def place(j, turn=turn):
            own = sorted(
                (x for x in left if x.person == j.person), key=lambda x: (-x.response_ratio(60.0), x.created, x.id)
            )
            return running.get(j.person, 0), last.get(j.person, 0.0), own[0].created, j.person, own.index(j)

        first = min(left, key=place)
        plain.append(first.id)
        left.remove(first)
        running[first.person] = running.get(first.person, 0) + 1
        last[first.person] = 61.0 + turn
    assert [j.id for j in order_jobs(jobs, Turns({"a": 2}, {"b": 30.0}), 60.0)] == plain


def add(store, number, person, kind="plan", task=False):
    store.submit(f"{number:024x}", kind, f"{kind} {number}", "{}", JobCommand((kind,), task=task), person=person)


def test_the_store_gives_each_person_a_turn(tmp_path):
    store = JobStore(Database(tmp_path / "jobs.sqlite3"))
    for k in range(5):
        add(store, k, "ada")
    add(store, 5, "ben")
    add(store, 6, "ada", "cell-check", task=True)
    taken = []
    while (job := store.take(1)) is not None:
        taken.append((job.person, job.kind))
        store.finish(job, "done", [], 0, None)
    plans = [person for person, kind in taken if kind == "plan"]
    assert taken[0] == ("ada", "cell-check")
    assert plans[:3] == ["ada", "ben", "ada"]
    assert len(taken) == 7


def test_position_and_time_left_are_told(tmp_path):
    with client_of(tmp_path, workers=1, beside=0) as client:
        context = client.app._context
        context.supervisor.stop()
        store = context.jobs
        for number in (1, 2):
            add(store, number, "", "study")
            store.finish(store.take(9), "done", [], 0, None)
        with store._db.write() as db:
            db.execute("UPDATE jobs SET started = finished - 100")
        for number in (3, 4, 5):
            add(store, number, "", "study")
        first = store.take(1)
        with store._db.write() as db:
            db.execute("UPDATE jobs SET started = ? WHERE id = ?", (time.time() - 30, first.id))
        told = [client.get(f"/api/jobs/{n:024x}").json() for n in (3, 4, 5, 1)]
        assert [t["position"] for t in told] == [None, 1, 2, None]
        assert [t["left_s"] and round(t["left_s"], -1) for t in told] == [70, 170, 270, None]
        add(store, 6, "", "plan")
        assert client.get(f"/api/jobs/{6:024x}").json()["left_s"] is None, "no like job was ever done"


def test_the_queue_of_a_plant_is_quick(tmp_path):
    store = JobStore(Database(tmp_path / "jobs.sqlite3"))
    with store._db.write() as db:
        db.executemany(
            "INSERT INTO jobs (id, kind, title, request, command, person, state, created, started, finished)"
            " VALUES (?, ?, 'x', '{}', '{\"words\": []}', ?, ?, ?, 1, 2)",
            (
                (f"{k:024x}", ("plan", "study")[k % 2], f"p{k % 30}", "queued" if k < 2000 else "done", float(k))
                for k in range(10_000)
            ),
        )
    begun = time.process_time()
    store.take(1)
    assert time.process_time() - begun < 2.0
    begun = time.process_time()
    for k in range(1, 1000):  # many pages ask for their jobs
        assert store.outlook(f"{k:024x}", 1) is not None
    assert time.process_time() - begun < 10.0


def test_a_job_that_begins_while_its_end_is_foreseen_is_no_trouble(tmp_path, monkeypatch):
    """Between the questions of one answer a worker takes the job; each is answered of the same moment."""
    path = tmp_path / "jobs.sqlite3"
    store, worker = JobStore(Database(path)), JobStore(Database(path))
    add(store, 1, "ada")
    add(store, 2, "ada")

    taken, read_order = [], job_queue.read_order

    def read_late(db, now, firsts_only):
        monkeypatch.setattr(job_queue, "read_order", read_order)
        with ThreadPoolExecutor() as other:
            taken.append(other.submit(worker.take, 9).result().id)
        return read_order(db, now, firsts_only)

    monkeypatch.setattr(job_queue, "read_order", read_late)
    outlook = store.outlook(f"{1:024x}", workers=1)
    assert taken == [f"{1:024x}"]
    assert outlook.position == 1
    assert store.get(f"{1:024x}").state == "running"
    assert store.outlook(f"{1:024x}", workers=1).position == 0
