"""What the server puts into a page: robots, problems as text, steps at the cell, numbers of the certificate."""

import json
import re
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import maxwell

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import document_text
from planner.service.certificate_content import RMS_OF_REPEATABILITY, find_validation
from planner.service.job_record import JobCommand, JobInput, JobOutput
from planner.service.job_requests import CommandRequest
from planner.service.page_content import plan_facts
from planner.service.pages import render
from planner.service.runner import SHIPPED
from planner.service.serving import build_context
from planner.service.session_api import session_content
from planner.service.tasks import check_run, check_view
from planner.session.document import ForesightRecord, PlanDocument
from tests.checks.test_record import calibration
from tests.service.conftest import begin_session, client_of, ended, settings, upload
from tests.service.test_crashes import CHEAP, Store


def test_the_first_page_leads_to_every_cell(client):
    page = client.get("/").text
    assert 'href="/cells/ur10/edbb"' in page
    assert client.get("/cells/ur10/edbb").status_code == 200
    assert client.get("/cells/ur10/none").status_code == 404


def test_a_wrong_address_is_told_as_a_page(client):
    for path in ("/jobs/" + "9" * 24, "/jobs/9", "/robots/none", "/nowhere"):
        answer = client.get(path)
        assert (answer.status_code, answer.headers["content-type"]) == (404, "text/html; charset=utf-8"), path
    assert client.get("/api/nowhere").headers["content-type"] == "application/problem+json"


def test_pages_take_nothing_from_elsewhere(client):
    for path in ("/", "/jobs", "/calibrate", "/cells/ur10/edbb"):
        answer = client.get(path)
        for link in re.findall(r'(?:src|href)="([^"]+)"', answer.text):
            assert link.startswith(("/", "#")), link
            if link.startswith("/static/"):
                assert client.get(link).status_code == 200
        assert "script-src 'self'" in answer.headers["content-security-policy"]
        assert not re.search(r"<script(?![^>]*src=)|\son\w+=|\sstyle=", answer.text)


@pytest.mark.slow
def test_text_of_a_file_is_text_on_a_page(client):
    cell = upload(client, "cells", 'schema = "edbb-cell/1"\nrobot = "<script>alert(1)</script>"\n', "x.toml")
    job = ended(client, client.post("/api/cell-checks", json={"cell": cell["id"]}))
    page = client.get(f"/jobs/{job['id']}").text
    assert job["state"] == "failed"
    assert "<script>alert" not in page


@pytest.mark.parametrize("cell", ["kuka-kr6-r700/tracker", "kuka-kr6-r700/trical", "so101/sockets", "so101/wire"])
def test_cells_of_every_gauge_are_seen(cell):
    seen = check_view(load_cell(cell))
    assert "robot" in {p.name for p in seen.view.parts}
    assert np.all(np.array(seen.view.high_mm) > np.array(seen.view.low_mm))
    assert bool(seen.fixtures) == (cell == "so101/wire")


OWN_WORDS = {  # what the checklist of each gauge speaks of
    "ur10/edbb": ("bar", "cup"),
    "abb-irb6700/ldbb": ("bar", "load"),
    "kuka-kr6-r700/tracker": ("reflector", "nest_mm"),
    "kuka-kr6-r700/trical": ("indicators", "38.1 mm"),
    "ur5e/sockets": ("sockets", "25.4 mm"),
    "so101/wire": ("wire", "eyelet"),
}


@pytest.mark.parametrize("name", OWN_WORDS)
def test_the_steps_at_the_cell_speak_of_its_gauge_and_no_other(name):
    cell = load_cell(name)
    plan = PlanDocument.model_validate(
        {
            "schema": "edbb-plan/1",
            "plan_id": "0123456789ab",
            "drives": [{"fixture": "A", "travel": [], "waypoints": []}],
        }
    )
    session = SimpleNamespace(id="b", serial="S1", begun=datetime.now(UTC), ended=None)
    job = SimpleNamespace(id="a", title="", kind="plan")
    page = render("session", job=job, session=session, **session_content(plan, cell.file, []))
    text = bytes(page.body).decode().partition("<ol")[2].partition("</ol>")[0]
    assert "0123456789ab" in text
    placed: tuple[Any, ...] = (*cell.file.fixtures[:1], cell.file.tracker, cell.file.artifact)
    assert any(", ".join(f"{v:g}" for v in p.position_mm) in text for p in placed if p)
    others = {w for n, words in OWN_WORDS.items() if n != name for w in words} - set(OWN_WORDS[name])
    assert all(re.search(rf"\b{w}\b", text) for w in OWN_WORDS[name])
    assert not [w for w in others if re.search(rf"\b{w}\b", text) and (w, name) != ("cup", "abb-irb6700/ldbb")]


@pytest.mark.slow
def test_two_plans_stand_side_by_side(tmp_path):
    """One asked for at a page, the other by a command."""
    store, ids = Store(tmp_path), ["a" * 24, "b" * 24]
    asked = CommandRequest(words=["plan", "ur10/edbb", "-o", "out"])
    for id, minutes, kind in zip(ids, (7, 12), ("plan", asked.job_kind), strict=True):
        plan = {"schema": "edbb-plan/1", "plan_id": id[:12], "poses": [], "notes": [f"note {minutes}"]}
        data = json.dumps(plan).encode()
        store.jobs.submit(id, kind, f"cell {minutes}", "{}", CHEAP)
        done = [JobOutput("plan.json", store.files.add(data), len(data))]
        assert store.jobs.finish(store.jobs.take(2), "done", done, 0, None)
    with client_of(tmp_path) as client:
        page = client.get("/compare", params={"first": ids[0], "second": ids[1]}).text
        assert re.findall(r"note (\d+)", page) == ["7", "12"]
        assert "cell 7" in page
        for id, other in (ids, ids[::-1]):
            page = client.get(f"/jobs/{id}").text
            assert f'value="{other}"' in page
            assert f"/jobs/{id}/session" in page
            assert f'value="{id}"' in client.get("/calibrate").text
        assert client.get("/compare", params={"first": ids[0], "second": "c" * 24}).status_code == 404


@pytest.mark.slow
def test_the_page_of_a_planned_check_is_whole(tmp_path):
    """Asked for by a command: it finds its calibration by content, shows what the check shows, and leads on."""
    store, known, plan = Store(tmp_path), "a" * 24, "b" * 24
    calibration = store.files.add(b"{}")
    pose = {"id": 0, "q_deg": [0] * 6, "role": "calibrate"}
    programs = [{"dialect": "krl", "file": "CHECK.src"}]
    changes = [{"change": "zero of joint 1", "detectable_mm": 0.031}]
    documents = {
        "plan.json": {
            "schema": "edbb-plan/1",
            "plan_id": plan[:12],
            "robot": "ur10",
            "poses": [pose],
            "programs": programs,
        },
        "shows.json": {"false_alarm": 0.01, "power": 0.9, "changes": changes},
    }
    content = {name: json.dumps(d).encode() for name, d in documents.items()}
    content |= {"CHECK.src": b"DEF", "cell.toml": load_cell("ur10/edbb").path.read_bytes()}
    outputs = [JobOutput(n, store.files.add(data), len(data)) for n, data in content.items()]
    words = JobCommand(("plan-check", "x", "--model", "a1"), (JobInput("a1/identification.json", calibration),))
    for id, kind, command, made in (
        (known, "identification", CHEAP, [JobOutput("identification.json", calibration, 2)]),
        (plan, CommandRequest(words=list(words.words)).job_kind, words, outputs),
    ):
        store.jobs.submit(id, kind, kind, "{}", command)
        assert store.jobs.finish(store.jobs.take(2), "done", made, 0, None)
    with client_of(tmp_path) as client:
        page = client.get(f"/jobs/{plan}").text
        assert re.search(r"zero of joint 1</th><td[^>]*>0\.031 mm", page)
        assert page.count(">CHECK.src<") == 1
        for link in (f"/jobs/{known}", f"/jobs/{plan}/session", f"/calibrate?plan={plan}"):
            assert f'href="{link}"' in page
        assert "nobody" in client.get(begin_session(client, plan, robot="ur10")).text.lower()


def test_a_certificate_takes_the_validation_of_its_own_calibration(tmp_path):
    context, store = build_context(settings(tmp_path)), Store(tmp_path)
    for id, model, ap in (("a" * 24, "c" * 64, 0.2), ("b" * 24, "d" * 64, 0.3)):
        figures = {"mean_mm": 0.1, "max_mm": 0.4}
        after = figures | {"iso9283": {"poses": 5, "visits": [30, 30], "AP_mm": ap, "RP_mm": 0.05}}
        data = json.dumps({"robot": "ur10", "run": "v.csv", "before": figures, "after": after}).encode()
        judges = JobCommand(("accuracy", "v.csv", "--model", "a1/robot.toml"), (JobInput("a1/robot.toml", model),))
        store.jobs.submit(id, "validation", "v.csv", "{}", judges)
        done = [JobOutput("accuracy.json", store.files.add(data), len(data))]
        assert store.jobs.finish(store.jobs.take(2), "done", done, 0, None)
    assert find_validation(context, "c" * 64).after.iso9283.AP_mm == 0.2
    assert find_validation(context, "e" * 64) is None


def test_repeatability_becomes_the_rms_of_such_a_scatter():
    """RP of ISO 9283 is the mean distance plus three standard deviations; distances in space follow Maxwell."""
    rms = (maxwell.mean() ** 2 + maxwell.var()) ** 0.5
    assert pytest.approx(rms / (maxwell.mean() + 3 * maxwell.std()), rel=1e-4) == RMS_OF_REPEATABILITY


def test_a_log_is_offered_the_cells_of_its_gauge_and_refused_in_others(client, tmp_path):
    assert '<option data-columns="x_mm, y_mm, z_mm">kuka-kr6-r700/tracker</option>' in client.get("/calibrate").text
    log = tmp_path / "run.csv"
    rows = "".join(f"{','.join(str(5 * k + 10 * j) for j in range(6))},{400 + k},0,300\n" for k in range(4))
    log.write_text(f"{','.join(f'q{j}_deg' for j in range(1, 7))},x_mm,y_mm,z_mm\n{rows}")
    assert check_run([log], load_cell("kuka-kr6-r700/tracker", planning=False)).samples == 4
    bar = load_cell("kuka-kr6-r700/edbb", planning=False)
    with pytest.raises(InputError, match=r"readings 'x_mm, y_mm, z_mm', but the gauge 'edbb' of .* gives") as e:
        check_run([log], bar)
    assert SHIPPED.sub(r"\1/\2", str(e.value)).endswith("of kuka-kr6-r700/edbb gives 'length_mm'")


def test_the_error_to_be_expected_of_a_plan_is_told():
    plan = PlanDocument.model_construct(foresight=ForesightRecord(error_mm=0.3512), plan_id="0" * 12)
    assert ("error to be expected", "0.351 mm") in plan_facts(plan)
    foreseen = ForesightRecord(error_mm=0.3512, within_mm=0.8123, within_before_mm=6.4)
    told = plan_facts(PlanDocument.model_construct(foresight=foreseen, plan_id="0" * 12))
    assert ("expected", "95 of 100 targets within 0.82 mm, such robots uncalibrated 6.4 mm, 95 % sure") in told


REPORT = """<!doctype html><html><head><style>h1 { color: red; }</style></head><body class="page">
<h1>Good for 0.5 mm</h1><p style="--c: red">&lt;b&gt;</p><script>alert("not here")</script></body></html>"""


@pytest.mark.parametrize("has_report", [True, False])
def test_the_page_of_a_calibration_is_its_report_and_what_the_service_knows(tmp_path, has_report):
    store, id = Store(tmp_path), "a" * 24
    files = {"identification.json": document_text(calibration(0.01))} | ({"report.html": REPORT} if has_report else {})
    store.jobs.submit(id, "identification", "run.csv", "{}", CHEAP)
    done = [JobOutput(n, store.files.add(text.encode()), len(text)) for n, text in files.items()]
    assert store.jobs.finish(store.jobs.take(2), "done", done, 0, None)
    with client_of(tmp_path, workers=0) as client:
        answer = client.get(f"/jobs/{id}")
        inside = re.search('<template shadowrootmode="open">(.*)</template>', answer.text, re.DOTALL)
        assert (inside is not None) == has_report
        assert ("<h1>Calibration from run.csv</h1>" in answer.text) != has_report
        assert "h1 { color: red; }" in (inside[1] if inside else "h1 { color: red; }")
        assert "alert" not in answer.text
        assert ("&lt;b&gt;" in answer.text) == has_report
        policy = answer.headers["content-security-policy"]
        assert "script-src 'self';" in policy, "what is in a report does not run"
        assert "style-src 'self' 'unsafe-inline'" in policy
        for own in (f"/jobs/{id}/certificate", f"/jobs/{id}/correct", "Into the record", f"/api/jobs/{id}/report"):
            assert own in answer.text
