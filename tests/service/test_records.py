"""Records of robots in the service: what jobs have found is added, shown, exported, and read by the command line."""

import io
import json
import zipfile
from datetime import date, timedelta

import pytest

from planner.checks.record import RobotRecord
from planner.checks.results import verdict_content
from planner.common.files import data_folder, document_text
from planner.common.units import DEG
from planner.service.job_record import JobCommand, JobOutput
from tests.checks.fleet import NAME
from tests.checks.test_evaluation import judged
from tests.checks.test_record import calibration
from tests.command import edbb
from tests.service.conftest import client_of
from tests.service.test_crashes import CHEAP, Store

AGO = (30, 25, 15, 5, 4, -2)  # days
BEFORE, FIRST, SECOND, THIRD, LAST, TO_COME = ((date.today() - timedelta(d)).isoformat() for d in AGO)
CALIBRATED, SOUND, CHANGED, SIMULATED = "a" * 24, "b" * 24, "c" * 24, "f" * 24


IDENTIFY = JobCommand(("identify", "run.csv", "--cell", "kuka-kr6-r700/edbb"))
ROBOT = data_folder("robots") / "kuka-kr6-r700/robot.toml"


def finish(store, id, kind, request, name, content, command=CHEAP):
    store.jobs.submit(id, kind, "run.csv", json.dumps(request, separators=(",", ":")), command)
    written = ((name, document_text(content).encode()), ("robot.toml", ROBOT.read_bytes()))
    done = [JobOutput(n, store.files.add(data), len(data)) for n, data in written]
    assert store.jobs.finish(store.jobs.take(2), "done", done, 0, None)


def fill(folder):
    """Jobs as they end: a calibration, the plan of a check, a check of the sound robot, one after an axis slipped."""
    store, plan = Store(folder), "d" * 24
    finish(store, CALIBRATED, "identification", {"plan": "e" * 24}, "identification.json", calibration(0.01), IDENTIFY)
    finish(store, plan, "check-plan", {"model": CALIBRATED, "poses": 10}, "plan.json", {})
    for id, verdict in ((SOUND, judged()), (CHANGED, judged(theta3=0.03 * DEG))):
        finish(store, id, "check", {"plan": plan}, "check.json", verdict_content(verdict, NAME))
    drawn = calibration(0.02) | {"simulated": True}
    finish(store, SIMULATED, "identification", {"simulation": plan}, "identification.json", drawn, IDENTIFY)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    fill(folder)
    with client_of(folder) as made:
        made.folder = folder
        yield made


def add(client, job, day, serial="KR6-0815"):
    body = {"job": job, "circumstances": {"date": day, "operator": "<b>W</b>", "certificate": "D-K-15"}}
    return client.post(f"/api/records/{serial}/entries", json=body)


def refuse_days(client):
    for day in (BEFORE, TO_COME):
        refused = add(client, SOUND, day)
        assert refused.status_code == 422
        assert f"dated {day}; allowed are {FIRST} (its calibration) to " in refused.json()["detail"]


@pytest.mark.slow
def test_a_robots_record_grows_with_what_jobs_find(client):
    assert client.get("/api/records/KR6-0815").status_code == 404
    assert add(client, CALIBRATED, FIRST).json()["state"] == "good"
    refuse_days(client)
    assert add(client, SOUND, SECOND).json()["state"] == "good"
    last = add(client, CHANGED, THIRD).json()
    assert (last["state"], last["advice"]) == ("changed", "master axis 3 and check again")
    assert [e["job"] for e in last["history"]] == [CALIBRATED, SOUND, CHANGED]
    assert (last["check_days"], last["next_check"]) == ([SECOND, THIRD], THIRD), "due at once"
    assert last["due"] == "now: master axis 3 and check again"
    assert last["beyond_chance"][0] < 0 < last["beyond_chance"][1]
    again = add(client, CHANGED, THIRD)
    assert (again.status_code, len(again.json()["history"])) == (201, 3), "the same again changes nothing"
    assert "simulated" in add(client, SIMULATED, LAST).json()["detail"]
    assert add(client, SIMULATED, LAST, "SIM-1").json()["simulated"]
    refused = client.post("/api/simulations", json={"plan": "d" * 24})
    assert "only for a robot whose calibration was simulated" in refused.json()["detail"]
    run = client.post("/api/runs", params={"name": "run.csv"}, content=b"q1_deg").json()["id"]
    refused = client.post("/api/identifications", json={"plan": "d" * 24, "runs": [{"id": run, "name": "run.csv"}]})
    assert "is a check-plan; a plan is needed" in refused.json()["detail"]
    for path in ("/robots/SIM-1", f"/jobs/{SIMULATED}"):
        assert "Nobody has measured this robot" in client.get(path).text, path
    assert "Nobody has measured this robot" not in client.get(f"/jobs/{CALIBRATED}").text
    assert add(client, "d" * 24, LAST).status_code == 422
    assert add(client, SOUND, LAST, "../x").status_code in (404, 405, 422)
    page = client.get("/robots/KR6-0815").text
    assert "master axis 3" in page
    assert "<b>W" not in page
    assert "KR6-0815" in client.get("/").text
    for job, verdict in ((CHANGED, "Failed: changed"), (SOUND, "Passed: unchanged")):
        assert all(said in client.get(f"/jobs/{job}").text for said in (verdict, "<h1>Check of kuka-kr6-r700</h1>"))
    assert 'It is in the record of <a href="/robots/KR6-0815">' in client.get(f"/jobs/{SOUND}").text
    sheet = client.get(f"/jobs/{CALIBRATED}/certificate").text
    assert "No certificate is issued for it" in sheet, "a check has found a change"
    assert "&lt;b&gt;W" in page

    ua = client.get("/api/records/KR6-0815/opcua").json()["Prognosis"]
    assert (ua["Calibrated"], ua["DateOfCalibration"]) == (False, f"{FIRST}T00:00:00Z")
    assert (ua["PredictedTime"], ua["CalibrationInterval"]) == (f"{THIRD}T00:00:00Z", 30 * 86_400_000)
    assert ua["CalibrationCertificate"] == ["D-K-15"]

    with zipfile.ZipFile(io.BytesIO(client.get("/api/records/KR6-0815/export").content)) as packed:
        packed.extractall(client.folder / "taken")
    record = RobotRecord.read(client.folder / "taken" / "KR6-0815")
    assert [e.file.kind for e in record.entries] == ["calibration", "check", "check"]
    done = edbb("record", client.folder / "records" / "KR6-0815")
    assert "3 entries" in done.stdout + done.screen
