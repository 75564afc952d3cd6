"""The HTTP interface: jobs, files, events and problems, as a script uses them."""

import hashlib
import json
from pathlib import Path

import pytest

from planner.common.files import data_folder
from tests.service.conftest import ended, upload

PLAN = Path(__file__).parents[1] / "data" / "kr6-plan"
CELL = 'schema = "edbb-cell/1"\nrobot = "ur10"\nhome_deg = [0, -90, 90, -90, -90, 0]\n[tool]\nmap_mm = [50, 0, 120]\n'
CELL += '[gauge]\nkind = "edbb"\nlength_mm = [300, 520]\n[[fixtures]]\nposition_mm = [600, 500, 60]\n'


@pytest.fixture(scope="module")
def checked(client):
    cell = upload(client, "cells", CELL, "mine.toml")
    return ended(client, client.post("/api/cell-checks", json={"cell": cell["id"]}))


@pytest.mark.slow
def test_a_job_gives_its_document_and_files(client, checked):
    assert checked["state"] == "done", checked["problem"]
    view = client.get(f"{checked['url']}/result").json()
    assert view["view"]["carriers"] == 9  # base and six links, housing and rod
    file = checked["files"][0]
    assert hashlib.sha256(client.get(file["url"]).content).hexdigest() == file["sha256"]
    assert client.get(f"{checked['url']}/files/..%2f..%2fjobs.sqlite3").status_code == 404
    assert client.get(f"{checked['url']}/report").status_code == 404


@pytest.mark.slow
def test_the_same_content_is_the_same_job(client, checked):
    again = client.post("/api/cell-checks", json=checked["request"])
    assert (again.status_code, again.json()["id"]) == (202, checked["id"])
    assert again.json()["state"] == "done"


@pytest.mark.slow
def test_events_are_numbered_and_resumed(client, checked):
    stream = {"job": checked["id"], "wait": "false"}
    told = client.get("/api/events", params=stream).text
    kinds = [line[7:] for line in told.splitlines() if line.startswith("event: ")]
    assert kinds == ["queued", "running", "end"]
    second = next(line[4:] for line in told.splitlines() if line.startswith("id: "))
    rest = client.get("/api/events", params=stream, headers={"last-event-id": second}).text
    assert [line[7:] for line in rest.splitlines() if line.startswith("event: ")] == kinds[1:]
    contents = [json.loads(line[6:]) for line in told.splitlines() if line.startswith("data: ")]
    assert contents[-1] == {"job": checked["id"], "state": "done", "detail": ""}


@pytest.mark.slow
def test_a_cell_that_names_a_file_of_the_machine_fails_with_the_sentence_of_the_command_line(client, tmp_path):
    robot = Path(data_folder("robots"), "ur10", "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(robot)
    cell = upload(client, "cells", CELL.replace('"ur10"', f'"{tmp_path}/robot.toml"'), "wrong.toml")
    job = ended(client, client.post("/api/cell-checks", json={"cell": cell["id"]}))
    assert (job["state"], job["exit_code"]) == ("failed", 2)
    assert "robot.toml" in job["problem"]["detail"]
    assert "the folder of this job" in job["problem"]["detail"]


@pytest.mark.long
def test_a_run_that_does_not_fit_is_told(client):
    run = upload(client, "runs", "t_s,q1_deg\n0,1\n", "run.csv")
    assert run["id"] in [r["id"] for r in client.get("/api/runs").json()]
    job = ended(client, client.post("/api/run-checks", json={"runs": [run], "cell": "ur10/edbb"}))
    assert job["exit_code"] == 2
    assert "run.csv" in job["problem"]["detail"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("route", "body", "status", "sentence"),
    [
        ("plans", {"cell": "../../etc"}, 422, "cell: "),
        ("plans", {"poses": 20}, 422, "name a cell, or with after a calibration"),
        ("plans", {"cell": "ur10/edbb", "index": "O9"}, 422, "must be 'O1', 'O2', 'O3', 'O4' or 'O5'"),
        ("plans", {"cell": "ur10/edbb", "pose": 3}, 422, "pose: "),
        ("plans", {"cell": "0" * 64}, 404, "upload it first"),
        ("exports", {"plan": "0" * 24, "dialect": "krl"}, 404, "there is no job"),
        ("check-plans", {"model": "0" * 24}, 404, "there is no job"),
        ("checks", {"plan": "0" * 24, "run": {"id": "0" * 64, "name": "c.csv"}}, 404, "there is no job"),
        ("identifications", {"plan": "0" * 24}, 422, "name runs, or a simulation"),
        ("identifications", {"runs": [{"id": "0" * 64, "name": "../x"}], "plan": "0" * 24}, 422, "runs.0.name"),
    ],
)
def test_problems_say_what_is_wrong(client, route, body, status, sentence):
    answer = client.post(f"/api/{route}", json=body)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert sentence in answer.json()["detail"]
    assert answer.json()["status"] == status


@pytest.mark.slow
def test_a_disturbed_upload_leaves_nothing(client):
    answer = client.post("/api/runs", params={"name": "run.csv", "sha256": "0" * 64}, content=b"cut")
    assert answer.status_code == 409
    assert "send it again" in answer.json()["detail"]
    assert client.get("/api/files/" + hashlib.sha256(b"cut").hexdigest()).status_code == 404


@pytest.mark.slow
def test_lists(client):
    robots = {r["name"]: r for r in client.get("/api/robots").json()}
    assert "ur10/edbb" in robots["ur10"]["cells"]
    assert "krl" in [d["name"] for d in client.get("/api/dialects").json()]
    assert (
        client.get("/api/cells/ur10/edbb").text.startswith("#") or "schema" in client.get("/api/cells/ur10/edbb").text
    )
    assert client.get("/api/robots/none").status_code == 404


@pytest.mark.slow
def test_a_job_can_be_cancelled(client):
    answer = client.post("/api/plans", json={"cell": "comau-nj130/edbb", "seed": 3})
    stopped = client.post(f"/api/jobs/{answer.json()['id']}/cancel")
    assert stopped.status_code == 200
    job = ended(client, answer)
    assert (job["state"], job["files"], job["problem"]) == ("cancelled", [], None)


def sent_plan(client, **changed):
    """The files of a plan that was made elsewhere, as they are sent."""
    files = {name: (PLAN / name).read_bytes() for name in ("plan.json", "cell.toml")} | changed
    return [{"id": upload(client, "files", data, "x")["id"], "name": name} for name, data in files.items()]


@pytest.mark.slow
def test_a_plan_that_was_made_elsewhere_is_a_plan_here(client):
    """Its page leads to the cell, its run is simulated and read, and its program is written."""
    asked = {"files": sent_plan(client), "title": "cell 7"}
    plan = ended(client, client.post("/api/plan-uploads", json=asked))
    assert (plan["kind"], plan["state"], plan["title"], plan["robot"]) == ("plan", "done", "cell 7", "kuka-kr6-r700")
    assert {f["name"] for f in plan["files"]} == {"plan.json", "cell.toml"}
    page = client.get(f"/jobs/{plan['id']}").text
    assert f'href="/jobs/{plan["id"]}/session"' in page
    assert "/report" not in page, "it has none"
    assert (
        f'value="{plan["id"]}" data-plan="{json.loads((PLAN / "plan.json").read_text())["plan_id"]}"'
        in client.get("/calibrate").text
    )
    made = ended(client, client.post("/api/simulations", json={"plan": plan["id"], "seed": 1}))
    read = ended(client, client.post("/api/run-checks", json={"simulation": made["id"], "plan": plan["id"]}))
    assert read["state"] == "done", read["problem"]
    program = ended(client, client.post("/api/exports", json={"plan": plan["id"], "dialect": "krl"}))
    assert "program.src" in {f["name"] for f in program["files"]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (
            {"cell.toml": (data_folder("robots") / "ur10" / "cells" / "edbb.toml").read_bytes()},
            "is a plan for kuka-kr6",
        ),
        ({"plan.json": b'{"schema": "edbb-plan/1", "plan_id": "0123456789ab"}'}, "the key 'drives' is missing"),
    ],
)
def test_a_plan_that_is_not_of_its_cell_is_refused(client, changed, sentence):
    asked = {"files": sent_plan(client, **changed)}
    plan = ended(client, client.post("/api/plan-uploads", json=asked))
    assert plan["state"] == "failed"
    assert sentence in plan["problem"]["detail"]
    assert plan["exit_code"] == 2
