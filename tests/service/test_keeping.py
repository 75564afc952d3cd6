"""What is kept and what may go: nothing that something needs is ever deleted, and what is copied is whole."""

import hashlib
import json
import random
import time
from datetime import date

import pytest

from planner.checks.record import Circumstances
from planner.checks.record_changes import add_entry
from planner.common.errors import InputError
from planner.service import job_request
from planner.service.backup import back_up, restore
from planner.service.database import Database
from planner.service.file_store import FileStore, UnknownFileError
from planner.service.job_keeping import JobKeeper, KeptJobError
from planner.service.job_record import JobCommand, JobFilter, JobInput, JobOutput
from planner.service.job_store import JobStore
from planner.service.record_index import RecordIndex
from planner.service.settings import DAY_S, Retention
from tests.checks.test_record import calibration
from tests.command import edbb
from tests.service.conftest import client_of

CALIBRATION = json.dumps(calibration(0.01), default=str).encode()


class Plant:
    """A store with jobs that end as they are told."""

    def __init__(self, folder):
        self.folder = folder
        self.db = Database(folder / "jobs.sqlite3")
        self.jobs, self.files = JobStore(self.db), FileStore(folder)
        (folder / "records").mkdir(exist_ok=True)
        self.keeper = JobKeeper(self.db, self.jobs, self.files, RecordIndex(folder / "records", self.db))

    def run(self, id, kind="plan", request=None, inputs=(), outputs=(), task=False, state="done"):
        given = tuple(JobInput(f"in{k}", self.files.add(data)) for k, data in enumerate(inputs))
        self.jobs.submit(id * 24, kind, f"{kind} {id}", json.dumps(request or {}), JobCommand((kind,), given, task))
        if state == "queued":
            return
        done = [JobOutput(name, self.files.add(data), len(data)) for name, data in outputs]
        assert self.jobs.finish(self.jobs.take(99), state, done, 0, None)

    def ids(self):
        return {j.id[0] for j in self.jobs.list_jobs(JobFilter(tasks=True), 999)}

    def holds(self, data):
        return self.files.holds(hashlib.sha256(data).hexdigest())

    def record(self, serial="R1"):
        results = self.folder / "results"
        results.mkdir()
        (results / "identification.json").write_bytes(CALIBRATION)
        add_entry(self.folder / "records" / serial, results, Circumstances(date=date.today()), serial)


@pytest.fixture
def plant(tmp_path):
    return Plant(tmp_path)


def refusal(plant, id):
    with pytest.raises(KeptJobError) as told:
        plant.keeper.delete(id * 24)
    assert id in plant.ids()
    return str(told.value)


def test_what_something_needs_stays(plant):
    plant.run("a", outputs=[("plan.json", b"plan")])
    plant.run("b", "identification", {"plan": "a" * 24}, [b"plan"], [("identification.json", CALIBRATION)])
    plant.run("c", "plan-view", {"plan": "a" * 24}, task=True, outputs=[("view.json", b"view")])
    assert f"the identification {'b' * 24} starts from it" in refusal(plant, "a")
    plant.record()
    assert "the record of the robot R1 cites it" in refusal(plant, "b")
    plant.run("d", state="queued")
    assert "it is queued; cancel it first" in refusal(plant, "d")
    plant.jobs.cancel("d" * 24)
    plant.keeper.delete("d" * 24)
    assert plant.ids() == {"a", "b", "c"}


def test_views_and_files_go_with_the_last_that_needs_them(plant):
    plant.run("a", outputs=[("plan.json", b"plan"), ("log", b"the same log")])
    plant.run("b", outputs=[("plan.json", b"another plan"), ("log", b"the same log")])
    plant.run("c", "plan-view", {"plan": "a" * 24}, [b"plan"], [("view.json", b"view")], task=True)
    plant.keeper.delete("a" * 24)
    assert plant.ids() == {"b"}
    assert [plant.holds(d) for d in (b"plan", b"view", b"the same log")] == [False, False, True]
    plant.keeper.delete("b" * 24)
    assert not any(p.is_file() for p in plant.files.folder.rglob("*"))


def test_a_record_that_is_not_read_yet_lets_nothing_go(plant, monkeypatch):
    plant.run("b", "identification", outputs=[("identification.json", CALIBRATION)])
    monkeypatch.setattr(RecordIndex, "refresh", lambda self, now=False: False)
    assert "are being read" in refusal(plant, "b")


def test_the_sweep_by_age_leaves_what_is_new_archived_or_needed(plant):
    for id in "abcde":
        plant.run(id, outputs=[("plan.json", id.encode())])
    plant.run("f", "identification", {"plan": "b" * 24})
    plant.run("0", "cell-check", task=True)
    now = time.time() + 100 * DAY_S
    with plant.db.write() as db:
        db.execute("UPDATE jobs SET archived = 1 WHERE title = 'plan a'")
        db.execute("UPDATE jobs SET finished = ? WHERE title IN ('plan e', 'identification f')", (now - 5 * DAY_S,))
    assert plant.keeper.sweep(Retention(age_s=30 * DAY_S), now) == 3  # c, d and the check of a cell
    assert plant.ids() == {"a", "b", "e", "f"}


def test_the_sweep_by_size_takes_the_oldest_until_it_fits(plant):
    """Against a plain simulation with sizes at random."""
    rng = random.Random(2)
    sizes = {id: rng.randrange(1, 9000) for id in "0123456789abcdef"}
    for id, size in sizes.items():
        plant.run(id, outputs=[("plan.json", rng.randbytes(size))])
    for limit in (60_000, 30_000, 10_000, 0):
        plant.keeper.sweep(Retention(size_bytes=limit), time.time())
        kept = list(sizes)
        while sum(sizes[k] for k in kept) > limit:
            kept.pop(0)
        assert plant.ids() == set(kept)
        assert plant.keeper.size_bytes() == sum(sizes[k] for k in kept)


def send(plant, data, days_ago, person=""):
    sha256 = plant.files.add(data)
    with plant.db.write() as db:
        row = (sha256, "run.csv", len(data), "run", time.time() - days_ago * DAY_S, person)
        db.execute("INSERT INTO uploads VALUES (?, ?, ?, ?, ?, ?)", row)
    return sha256


def test_files_that_were_sent_go_before_jobs_do_and_not_while_a_job_starts_from_them(plant):
    send(plant, b"unused" * 1000, days_ago=30)
    send(plant, b"used" * 1000, days_ago=30)
    send(plant, b"new" * 1000, days_ago=1)
    plant.run("a", "identification", inputs=[b"used" * 1000], outputs=[("identification.json", b"x")])
    plant.keeper.sweep(Retention(size_bytes=8000), time.time())
    assert [plant.holds(word * 1000) for word in (b"unused", b"used", b"new")] == [False, True, True]
    assert plant.ids() == {"a"}, "a job does not go for what others have sent"
    plant.keeper.sweep(Retention(size_bytes=4000), time.time())
    assert plant.ids() == set()
    assert [plant.holds(word * 1000) for word in (b"used", b"new")] == [False, True], "it may be about to be used"
    plant.keeper.sweep(Retention(age_s=30 * DAY_S), time.time() + 31 * DAY_S)
    assert not plant.holds(b"new" * 1000)


def test_a_person_deletes_what_the_person_has_sent(plant):
    run, other = send(plant, b"run", 0, "wanda"), send(plant, b"other", 0, "luis")
    plant.run("a", "identification", inputs=[b"run"])
    with pytest.raises(KeptJobError, match=f"the job {'a' * 24} starts from"):
        plant.keeper.delete_upload(run, "wanda")
    plant.keeper.delete("a" * 24)
    for person in ("luis", ""):
        with pytest.raises(UnknownFileError):
            plant.keeper.delete_upload(run, person)
    plant.keeper.delete_upload(run, "wanda")
    plant.keeper.delete_upload(other, None)
    assert not plant.holds(b"run")
    assert not plant.holds(b"other")


def test_what_a_crash_has_left_goes_after_a_day_and_nothing_else(plant):
    plant.run("a", outputs=[("plan.json", b"plan")])
    send(plant, b"sent", 30)
    plant.files.add(b"left")
    assert plant.keeper.remove_old_uploads(time.time() - DAY_S) == 0
    assert plant.keeper.remove_old_uploads(time.time() + DAY_S) == 1
    assert [plant.holds(data) for data in (b"plan", b"sent", b"left")] == [True, True, False]


def test_nothing_goes_where_nobody_said_so(plant):
    plant.run("a")
    plant.run("0", "cell-check", task=True)
    assert not Retention().limited
    plant.keeper.sweep(Retention(), time.time() + DAY_S)
    assert plant.ids() == {"a", "0"}


def test_a_copy_made_while_jobs_come_is_whole_and_can_be_brought_back(plant, tmp_path):
    plant.run("a", inputs=[b"cell"], outputs=[("plan.json", b"plan")])
    plant.run("b", "identification", {"plan": "a" * 24}, outputs=[("identification.json", CALIBRATION)])
    plant.record()
    copy, again = tmp_path / "copy", tmp_path / "again"
    first = back_up(plant.folder, copy)
    plant.run("c", outputs=[("plan.json", b"a later plan")])
    second = back_up(plant.folder, copy)
    assert (first.jobs, second.jobs, second.files - first.files, second.robots) == (2, 3, 1, 1)
    found = restore(copy, again)
    assert found == second
    back = Plant(again)
    assert back.ids() == {"a", "b", "c"}
    assert all(back.holds(d) for d in (b"cell", b"plan", b"a later plan", CALIBRATION))
    assert "R1 cites it" in refusal(back, "b")


def test_a_damaged_file_ends_a_copy_and_the_earlier_one_stands(plant, tmp_path):
    plant.run("a", outputs=[("plan.json", b"plan")])
    copy = tmp_path / "copy"
    back_up(plant.folder, copy)
    plant.run("b", outputs=[("plan.json", b"another")])
    plant.files.path(hashlib.sha256(b"another").hexdigest()).write_bytes(b"anothex")
    with pytest.raises(InputError, match="has changed"):
        back_up(plant.folder, copy)
    assert restore(copy, tmp_path / "again").jobs == 1


def test_folders_that_are_something_else_are_refused(plant, tmp_path):
    plant.run("a")
    other = tmp_path / "other"
    other.mkdir()
    (other / "letter.txt").write_text("dear")
    for wrong, words in (
        (lambda: back_up(plant.folder, other), "holds other files"),
        (lambda: back_up(other, tmp_path / "x"), "no store of a service"),
        (lambda: restore(other, tmp_path / "x"), "no backup of a service"),
        (lambda: restore(plant.folder, other), "is not empty"),
    ):
        with pytest.raises(InputError, match=words):
            wrong()


def test_the_commands_copy_and_bring_back(plant, tmp_path):
    plant.run("a", outputs=[("plan.json", b"plan")])
    copy, again = tmp_path / "copy", tmp_path / "again"
    done = edbb("serve", "backup", copy, "--data", plant.folder)
    assert (done.returncode, "1 jobs, 1 files" in done.screen) == (0, True), done.screen
    assert edbb("serve", "restore", copy, "--data", again).returncode == 0
    assert Plant(again).ids() == {"a"}
    refused = edbb("serve", "restore", copy, "--data", again)
    assert (refused.returncode, "is not empty" in refused.screen) == (2, True)
    assert edbb("serve", "backup", "--data", plant.folder).returncode == 2
    assert edbb("serve", "copy", copy, "--data", plant.folder).returncode == 2


def test_by_the_interface(tmp_path):
    plant = Plant(tmp_path)
    plant.run("a", outputs=[("plan.json", b"plan")])
    plant.run("b", "identification", {"plan": "a" * 24})
    with client_of(tmp_path, workers=0) as client:
        at = f"/api/jobs/{'a' * 24}"
        changed = client.patch(at, json={"title": "Cell 7", "note": "before the <b>move", "archived": True})
        assert [changed.json()[k] for k in ("title", "note", "archived")] == ["Cell 7", "before the <b>move", True]
        assert client.patch(at, json={"note": ""}).json()["title"] == "Cell 7"
        assert [j["id"][0] for j in client.get("/api/jobs").json()] == ["b"]
        assert [j["id"][0] for j in client.get("/api/jobs", params={"archived": True}).json()] == ["a"]
        for wrong in ({"title": ""}, {"title": "x" * 121}, {"colour": "red"}, {"note": "x" * 2001}):
            assert client.patch(at, json=wrong).status_code == 422
        assert client.patch(f"/api/jobs/{'9' * 24}", json={"note": "x"}).status_code == 404
        refused = client.delete(at)
        assert (refused.status_code, "starts from it" in refused.json()["detail"]) == (409, True)
        assert client.delete(f"/api/jobs/{'b' * 24}").status_code == 204
        assert client.delete(at).status_code == 204
        assert client.get(at).status_code == 404


def test_the_same_request_of_another_version_is_another_job(tmp_path, monkeypatch):
    with client_of(tmp_path, workers=0) as client:
        asked = {"cell": "ur10/edbb", "poses": 30}
        first, second = (client.post("/api/plans", json=asked).json()["id"] for _ in range(2))
        monkeypatch.setattr(job_request, "__version__", "99.0.0")
        third = client.post("/api/plans", json=asked).json()["id"]
    assert first == second != third
