"""Sessions at the cell: each robot has its own checklist, which several people tick, and which nobody clears."""

import sqlite3

import pytest

from planner.service.database import MIGRATIONS, RECORDS, Database
from planner.service.job_record import JobFilter
from planner.service.job_store import JobStore
from planner.service.session_store import SessionStore
from tests.service.conftest import begin_session, client_of
from tests.service.test_cell_side import JOB, add_plan


@pytest.fixture
def client(tmp_path):
    add_plan(tmp_path)
    with client_of(tmp_path, workers=0, beside=0) as made:
        yield made


def tick(client, url, step, person):
    ticks = [{"step": step, "done": True, "at": "2026-01-01T10:00:00Z"}]
    return client.post(f"/api{url}/ticks", json={"ticks": ticks, "person": person}).json()


@pytest.mark.slow
def test_a_second_robot_of_the_kind_has_its_own_checklist(client):
    first, second = (begin_session(client, JOB, serial) for serial in ("KR6-0815", "KR6-0816"))
    tick(client, first, "step-1", "Ada")
    known = tick(client, first, "step-2", "Wanda")
    assert [(t["step"], t["person"]) for t in known["ticks"]] == [("step-1", "Ada"), ("step-2", "Wanda")]
    assert known["people"] == ["Ada", "Wanda"]
    assert client.get(f"/api{second}").json()["ticks"] == []
    assert begin_session(client, JOB) == first, "another phone goes on with the open one"
    page = client.get("/robots/KR6-0815").text
    assert "by Ada, Wanda, 2 steps ticked" in page
    assert "Never measured" in page
    assert [j["id"] for j in client.get("/api/jobs", params={"q": "kr6-0816"}).json()] == [JOB]
    unknown = client.post("/api/sessions", json={"plan": JOB, "serial": "KR6-O815"})
    assert (unknown.status_code, unknown.json()["detail"]) == (404, "there is no record of a robot KR6-O815")


@pytest.mark.slow
def test_a_session_that_is_begun_again_keeps_what_was_ticked(client):
    first = begin_session(client, JOB)
    tick(client, first, "step-1", "Ada")
    anew = client.post("/api/sessions", json={"plan": JOB, "serial": "KR6-0815", "anew": True}).json()
    assert (anew["ticks"], anew["url"] != first) == ([], True)
    kept = client.get(f"/api{first}").json()
    assert ([t["step"] for t in kept["ticks"]], kept["ended"] is None) == (["step-1"], False)
    assert "This session was begun again" in client.get(first).text
    listed = client.get("/api/sessions", params={"serial": "KR6-0815"}).json()
    assert [s["id"] for s in listed] == [anew["id"], kept["id"]]


def test_a_store_of_before_keeps_jobs_and_ticks(tmp_path):
    path = tmp_path / "jobs.sqlite3"
    with sqlite3.connect(path) as db:
        before = MIGRATIONS.index(RECORDS)
        for step in MIGRATIONS[:before]:
            db.executescript(step)
        db.execute(f"PRAGMA user_version = {before}")
        row = (JOB, "plan", "a plan", "{}", '{"words": ["plan"]}', "done", 1.0, "ada")
        names = "id, kind, title, request, command, state, created, person"
        db.execute(f"INSERT INTO jobs ({names}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)", row)
        db.execute(f"INSERT INTO jobs ({names}) VALUES ('m', 'error-map', 'a map', '{{}}', '{{}}', 'done', 1.0, 'ada')")
        db.execute("INSERT INTO outputs VALUES ('m', 'view.json', 'x', 1)")
        db.execute("INSERT INTO ticks VALUES (?, 'step-1', 1, 2.0, 'wanda')", (JOB,))
        db.execute("INSERT INTO robots VALUES ('S1', 'ur10', 'good', '', NULL, '', 1, 0, 'stamp')")
        db.execute("INSERT INTO recorded VALUES ('S1', 0, 'x', '{}')")
    db.close()
    database = Database(path)
    jobs, sessions = JobStore(database), SessionStore(database)
    assert jobs.askers(JOB) == {"ada"}
    assert database.read("SELECT * FROM outputs") == [], "views that no page shows any more"
    assert [j.id for j in jobs.list_jobs(JobFilter(person="ada"))] == [JOB]
    (session,) = sessions.list_sessions(plan=JOB)
    assert (session.serial, sessions.people(session)) == ("", ["wanda"])
    assert [t.step for t in sessions.list_ticks(session.id)] == ["step-1"]
    assert database.read("SELECT * FROM robots") == [], "the records of robots are read anew"


@pytest.mark.slow
def test_a_session_that_was_begun_again_takes_what_was_ticked_before_and_no_more(client):
    first = begin_session(client, JOB)
    client.post("/api/sessions", json={"plan": JOB, "serial": "KR6-0815", "anew": True})
    assert [t["step"] for t in tick(client, first, "step-1", "Ada")["ticks"]] == ["step-1"], "sent late"
    ticks = [{"step": f"step-{k}", "done": True, "at": f"20{at}-01-01T10:00:00Z"} for k, at in ((2, 26), (3, 60))]
    refused = client.post(f"/api{first}/ticks", json={"ticks": ticks, "person": "Ada"})
    assert (refused.status_code, "begun again" in refused.json()["detail"]) == (409, True)
    assert [t["step"] for t in client.get(f"/api{first}").json()["ticks"]] == ["step-1", "step-2"]


@pytest.mark.slow
def test_a_session_is_of_a_robot_of_the_model_of_its_plan(client):
    client.put("/api/records/UR-1", json={"robot": "ur10"})
    refused = client.post("/api/sessions", json={"plan": JOB, "serial": "UR-1"})
    assert (refused.status_code, "is the serial number of a ur10 here" in refused.json()["detail"]) == (409, True)
    begin_session(client, JOB, "KR6-O815")
    client.post("/api/records/KR6-O815/withdrawal", json={"reason": "mistyped"})
    refused = client.post("/api/sessions", json={"plan": JOB, "serial": "KR6-O815"})
    assert (refused.status_code, "was withdrawn (mistyped)" in refused.json()["detail"]) == (409, True)
