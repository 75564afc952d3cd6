"""Two things at the same moment: each test lets the other one act between two steps, where it hurt or would hurt."""

import asyncio
import hashlib
import sqlite3
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace

import pytest
from argon2 import PasswordHasher

from planner.checks.record import Circumstances
from planner.checks.record_changes import latest_day
from planner.common.errors import InputError
from planner.service import backup, job_api, pages, record_store, robot_pages
from planner.service.backup import back_up, restore
from planner.service.callers import PATIENCE, GuessLimit
from planner.service.cluster import ClusterRunner
from planner.service.cluster_work import Work, WorkEnd
from planner.service.database import Database
from planner.service.file_api import StoredFileResponse
from planner.service.file_store import FileStore
from planner.service.job_keeping import JobChanges, JobKeeper, KeptJobError
from planner.service.job_process import RESULTS
from planner.service.job_request import JobRequest
from planner.service.job_store import JobStore, UnknownJobError
from planner.service.people import PeopleStore
from planner.service.record_index import RecordedEntry
from planner.service.record_store import RecordStore
from planner.service.runner import INPUT_FOLDER, JobRunner
from planner.service.session_store import SessionStore, Tick, UnknownSessionError
from planner.service.settings import DAY_S, JobLimits, Retention, Role
from tests.service.conftest import client_of
from tests.service.test_crashes import CHEAP
from tests.service.test_keeping import CALIBRATION, Plant

A, B = "a" * 24, "b" * 24
AWHILE_S = 0.3  # for the other one to go wrong; where it is held off it waits longer
PLAN = b'{"schema": "edbb-plan/1", "plan_id": "0123456789ab"}'


@pytest.fixture
def plant(tmp_path):
    return Plant(tmp_path)


class Meanwhile:
    """Somebody else, in a thread: begins when it is called, and is waited for at the end."""

    def __init__(self, act):
        self._act, self._pool, self.future = act, ThreadPoolExecutor(), None

    def __call__(self, seconds=AWHILE_S):
        if self.future is None:
            self.future = self._pool.submit(self._act)
            with suppress(TimeoutError):
                self.future.exception(seconds)

    def result(self):
        return self.future.result(30.0)


def before(monkeypatch, owner, name, act):
    """Let somebody act just before a step."""
    real = getattr(owner, name)

    def acted(*args, **named):
        act()
        return real(*args, **named)

    monkeypatch.setattr(owner, name, acted)


def after(monkeypatch, owner, name, act):
    """Let somebody act just after a step."""
    real = getattr(owner, name)

    def acted(*args, **named):
        found = real(*args, **named)
        act()
        return found

    monkeypatch.setattr(owner, name, acted)


def test_what_starts_from_a_job_that_is_deleted_meanwhile_is_refused(plant, monkeypatch):
    plant.run("a", outputs=[("plan.json", PLAN)])
    deleted = Meanwhile(lambda: plant.keeper.delete(A))
    before(monkeypatch, JobRequest, "job_id", deleted)
    with client_of(plant.folder, workers=0, beside=0) as client:
        answer = client.post("/api/plan-views", json={"plan": A})
    assert (answer.status_code, "deleted meanwhile" in answer.text) == (404, True)
    assert plant.ids() == set()


def test_a_taken_job_is_of_the_fence_under_which_it_was_taken(plant, monkeypatch):
    """Another server that takes it over a moment later has a later fence."""
    plant.run("a", state="queued")

    def take_over():
        with suppress(sqlite3.OperationalError), sqlite3.connect(plant.folder / "jobs.sqlite3", timeout=0.01) as db:
            db.execute("UPDATE jobs SET fence = fence + 1")

    before(monkeypatch, JobStore, "get", Meanwhile(take_over))
    assert plant.jobs.take(1).fence == 1


@pytest.mark.parametrize(
    "change",
    [
        lambda plant, check: plant.jobs.cancel(A, check),
        lambda plant, check: plant.keeper.change(A, JobChanges(note="x"), check),
        lambda plant, check: plant.keeper.delete(A, check),
    ],
)
def test_whose_a_job_is_does_not_change_after_the_look(plant, change):
    plant.run("a")

    def check(job):
        with sqlite3.connect(plant.folder / "jobs.sqlite3", timeout=0.01) as db:
            db.execute("UPDATE jobs SET person = 'another'")

    with pytest.raises(sqlite3.OperationalError, match="locked"):
        change(plant, check)
    assert plant.jobs.get(A).note == ""


def test_a_job_that_is_asked_for_again_before_it_is_stopped_is_done(plant):
    plant.run("a", state="queued")
    taken = plant.jobs.take(1)
    plant.jobs.cancel(A)
    assert plant.jobs.wants_stop(taken)
    assert plant.jobs.submit(A, "plan", "plan a", "{}", CHEAP).state == "running"
    assert not plant.jobs.wants_stop(taken)
    plant.jobs.finish(taken, "cancelled", [], None, None)  # its runner had seen the first wish already
    assert plant.jobs.get(A).state == "queued"
    again = plant.jobs.take(1)
    assert plant.jobs.finish(again, "done", [], 0, None)
    assert [e.kind for e in plant.jobs.events_after(0, [A])].count("end") == 1


def test_a_job_that_is_gone_takes_no_progress_and_no_ticks(plant):
    plant.run("a")
    job = plant.jobs.get(A)
    plant.keeper.delete(A)
    plant.jobs.progress(job, "poses", 1, 2)
    with pytest.raises(UnknownSessionError):
        SessionStore(plant.db).merge(A, [Tick(step="step-1", done=True, at="2026-01-01T00:00:00Z")], "")


def test_a_file_that_is_deleted_while_it_goes_out_goes_out_whole(plant, monkeypatch):
    data = b"x" * 1_000_000
    plant.run("a", outputs=[("plan.json", data)])
    deleted = Meanwhile(lambda: plant.keeper.delete(A))
    before(monkeypatch, StoredFileResponse, "__call__", lambda: deleted(30.0))
    with client_of(plant.folder, workers=0, beside=0) as client:
        assert client.get(f"/api/jobs/{A}/files/plan.json").content == data
        assert not plant.holds(data)
        assert client.get(f"/api/jobs/{A}/files/plan.json").status_code == 404


def test_a_file_that_is_gone_is_not_found(plant, monkeypatch):
    plant.run("a", outputs=[("plan.json", PLAN)])
    before(monkeypatch, job_api, "file_answer", Meanwhile(lambda: plant.keeper.delete(A)))
    with client_of(plant.folder, workers=0, beside=0) as client:
        assert client.get(f"/api/jobs/{A}/files/plan.json").status_code == 404


def test_a_file_that_is_sent_while_the_last_job_that_has_it_goes_stays(plant, monkeypatch):
    plant.run("a", outputs=[("log", b"of a job")])
    deleted = Meanwhile(lambda: plant.keeper.delete(A))
    after(monkeypatch, FileStore, "place", deleted)
    with client_of(plant.folder, workers=0, beside=0) as client:
        sent = client.post("/api/files", params={"name": "a.txt"}, content=b"of a job")
        deleted.result()
        assert client.get(f"/api/files/{sent.json()['id']}").content == b"of a job"


def test_a_result_like_that_of_a_job_that_goes_stays(plant, monkeypatch):
    plant.run("a", outputs=[("plan.json", PLAN)])
    plant.run("b", state="queued")
    deleted = Meanwhile(lambda: plant.keeper.delete(A))
    runner = JobRunner(plant.jobs.take(1), plant.jobs, plant.files, plant.folder / "jobs", JobLimits())
    results = runner._folder / INPUT_FOLDER / RESULTS
    results.mkdir(parents=True)
    (results / "plan.json").write_bytes(PLAN)
    for name in ("printed", "log"):
        (runner._folder / name).touch()
    after(monkeypatch, JobRunner, "_take_outputs", deleted)
    runner._end_with(0)
    deleted.result()
    assert plant.jobs.get(B).state == "done"
    assert plant.holds(PLAN)


def test_what_is_being_added_to_a_record_is_not_deleted(plant, monkeypatch):
    plant.run("a", "identification", outputs=[("identification.json", CALIBRATION)])
    records = RecordStore(plant.folder, plant.jobs, plant.files, plant.db)
    keeper = JobKeeper(plant.db, plant.jobs, plant.files, records.index)
    deleted = Meanwhile(lambda: keeper.delete(A))
    before(monkeypatch, record_store, "add_entry", deleted)
    records.add("R1", plant.jobs.get(A), Circumstances(date=latest_day()), RecordedEntry())
    with pytest.raises(KeptJobError, match="R1 cites it"):
        deleted.result()
    assert plant.ids() == {"a"}


def test_what_was_deleted_is_not_added_to_a_record(plant):
    plant.run("a", "identification", outputs=[("identification.json", CALIBRATION)])
    records, job = RecordStore(plant.folder, plant.jobs, plant.files, plant.db), plant.jobs.get(A)
    plant.keeper.delete(A)
    with pytest.raises(UnknownJobError):
        records.add("R1", job, Circumstances(date=latest_day()), RecordedEntry())
    assert records.index.count() == 0


def test_an_old_password_opens_no_session_after_it_was_changed(tmp_path, monkeypatch):
    people = PeopleStore(Database(tmp_path / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, "the old password")
    changed = Meanwhile(lambda: people.set_password("ada", "the new password"))
    after(monkeypatch, PasswordHasher, "verify", lambda: changed(30.0))
    assert people.log_in("ada", "the old password") is None
    assert people._db.read("SELECT * FROM sessions") == []
    assert people.log_in("ada", "the new password") is not None


def test_guesses_at_the_same_moment_are_not_more_than_one_after_the_other():
    limit, waits = GuessLimit(), []
    begun = threading.Barrier(40)

    def guess():
        begun.wait()
        waits.append(limit.begin_try(("name", "ada")))

    threads = [threading.Thread(target=guess) for _ in range(40)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert sum(w == 0 for w in waits) == PATIENCE.free_tries


@pytest.mark.slow
@pytest.mark.parametrize("page", ["/calibrate", f"/jobs/{A}", "/"])
def test_a_page_is_of_one_moment(plant, monkeypatch, page):
    """The plan is deleted while the page is made; files are gone then, what the database knew is shown."""
    plant.run("a", outputs=[("plan.json", PLAN)])
    deleted = Meanwhile(lambda: plant.keeper.delete(A))
    for module, name in ((pages, "_plans"), (pages, "_show_plan"), (robot_pages, "robot_entries")):
        before(monkeypatch, module, name, deleted)
    with client_of(plant.folder, workers=0, beside=0) as client:
        assert client.get(page).status_code == 200


@pytest.mark.slow
def test_a_plan_of_another_version_holds_up_no_page(plant):
    plant.run("a", outputs=[("plan.json", b'{"schema": "edbb-plan/0"}')])
    with client_of(plant.folder, workers=0, beside=0) as client:
        assert A not in client.get("/calibrate").text
        shown = client.get(f"/jobs/{A}")
    assert (shown.status_code, "plan.json" in shown.text) == (200, True)


def test_a_copy_goes_on_where_a_job_is_deleted_meanwhile(plant, tmp_path, monkeypatch):
    plant.run("a", outputs=[("plan.json", b"plan")])
    plant.run("b", outputs=[("plan.json", b"another")])
    after(monkeypatch, backup, "_copy_database", Meanwhile(lambda: plant.keeper.delete(A)))
    done = back_up(plant.folder, tmp_path / "copy")
    assert (done.jobs, done.files) == (1, 1)
    assert restore(tmp_path / "copy", tmp_path / "again") == done
    plant.files.path(hashlib.sha256(b"another").hexdigest()).unlink()
    with pytest.raises(InputError, match="not in the store any more"):
        back_up(plant.folder, tmp_path / "copy 2")


def test_what_is_archived_while_a_sweep_goes_on_stays(plant, monkeypatch):
    plant.run("a")
    archive = Meanwhile(lambda: plant.keeper.change(A, JobChanges(archived=True)))
    before(monkeypatch, JobKeeper, "_try_delete", lambda: archive(30.0))
    now = plant.jobs.get(A).finished + 100 * DAY_S
    assert plant.keeper.sweep(Retention(age_s=DAY_S), now) == 0
    assert plant.ids() == {"a"}


def test_a_late_result_of_a_worker_that_was_taken_for_dead_is_not_looked_at(plant):
    """The cluster gave the job's lease up; another server runs it when the first worker comes back with a result."""
    plant.run("a", state="queued")
    first = plant.jobs.take(1)
    with plant.db.write() as db:
        db.execute("UPDATE jobs SET lease_until = 0")
    second = plant.jobs.take(1)
    late = SimpleNamespace(status="finished", result=lambda: WorkEnd("done", 0, files={"plan.json": b"late"}))
    work = Work(first, JobLimits(), "", "")
    ClusterRunner(None, work, plant.jobs, plant.files)._end(late)
    assert (plant.jobs.get(A).state, plant.jobs.outputs(A)) == ("running", [])
    right = SimpleNamespace(status="finished", result=lambda: WorkEnd("done", 0, files={"plan.json": b"right"}))
    ClusterRunner(None, replace(work, job=second), plant.jobs, plant.files)._end(right)
    assert [o.sha256 for o in plant.jobs.outputs(A)] == [hashlib.sha256(b"right").hexdigest()]
    assert [e.kind for e in plant.jobs.events_after(0, [A])].count("end") == 1


def test_a_stream_ends_with_the_session_of_who_follows_it(tmp_path):
    people = PeopleStore(Database(tmp_path / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, "a good password")
    with client_of(tmp_path, workers=0, beside=0) as client:
        context = client.app._context
        cookie = people.log_in("ada", "a good password")[1]
        headers = [(b"cookie", f"edbb_session={cookie}".encode())]
        request = SimpleNamespace(scope={"type": "http", "headers": headers, "client": ("127.0.0.1", 1)})

        async def follow():
            news = job_api._stream(context, request, [], 0, wait=True, known_s=0.0)
            first = await anext(news)
            people.close_session(cookie)
            return first, [text async for text in news]

        assert asyncio.run(asyncio.wait_for(follow(), 30.0)) == ("retry: 2000\n\n", [])


@pytest.mark.slow
def test_the_plan_that_led_to_the_page_is_offered_however_old_it_is(plant):
    plant.run("a", outputs=[("plan.json", PLAN)])
    with plant.db.write() as db:
        db.executemany(
            "INSERT INTO jobs (id, kind, title, request, command, state, created)"
            " VALUES (?, 'plan', 'x', '{}', '{\"words\": []}', 'done', ?)",
            ((f"{k:024x}", 4e9 + k) for k in range(300)),
        )
    with client_of(plant.folder, workers=0, beside=0) as client:
        assert f'value="{A}"' not in client.get("/calibrate").text
        assert f'value="{A}"' in client.get(f"/calibrate?plan={A}").text
