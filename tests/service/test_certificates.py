"""Certificates: frozen when they are issued, honest about what they contain, and withdrawn by what happens later."""

import io
import json
from datetime import datetime, timedelta, timezone

import pytest
from pypdf import PdfReader

from planner.checks.results import verdict_content
from planner.common.files import document_text
from planner.common.units import DEG
from planner.service.job_record import JobCommand, JobInput, JobOutput
from tests.checks.fleet import NAME
from tests.checks.test_evaluation import judged
from tests.checks.test_record import calibration
from tests.service.conftest import AT_HOME, client_of
from tests.service.test_crashes import Store
from tests.service.test_records import (
    CALIBRATED,
    CHANGED,
    FIRST,
    IDENTIFY,
    LAST,
    ROBOT,
    SECOND,
    SIMULATED,
    SOUND,
    THIRD,
    add,
)

pytestmark = pytest.mark.slow
TWIN, PLAN, NEWER, LATER = "1" * 24, "d" * 24, "2" * 24, "3" * 24
CHECK = ("check", "run.csv", "--model", "calibrated")
WITHIN, WITHIN_ANOTHER = 0.82, 3.1  # mm
USE = {
    "repeatability_mm": 0.03,
    "tools": [
        {"tool": "measured", "within_mm": WITHIN, "within_before_mm": 2.1},
        {"tool": "another", "within_mm": WITHIN_ANOTHER, "within_before_mm": 4.0},
    ],
}


def stated(theta3, **more):
    return calibration(theta3) | {"use": USE, "noise_floor_mm": 0.02} | more


def put(store, id, kind, name, content, inputs=()):
    """A job that ended as one of its kind does, with its files and what it was given."""
    command = JobCommand(IDENTIFY.words if kind == "identification" else CHECK, tuple(inputs))
    store.jobs.submit(id, kind, "run.csv", json.dumps({"plan": "e" * 24}), command)
    written = ((name, document_text(content).encode()), ("robot.toml", ROBOT.read_bytes()))
    done = [JobOutput(n, store.files.add(data), len(data)) for n, data in written]
    assert store.jobs.finish(store.jobs.take(2), "done", done, 0, None)
    return done[0].sha256


def judge(store, id, theta3, document):
    """The check of a robot one axis of which has moved by an angle [rad]."""
    content = verdict_content(judged(theta3=theta3) if theta3 else judged(), NAME)
    given = [JobInput("calibrated/identification.json", document)]
    return put(store, id, "check", "check.json", content | {"made": id}, given)


@pytest.fixture
def plant(tmp_path):
    store = Store(tmp_path)
    known = put(store, CALIBRATED, "identification", "identification.json", stated(0.01))
    put(store, SIMULATED, "identification", "identification.json", stated(0.02, simulated=True))
    with client_of(tmp_path, workers=0) as client:
        client.store, client.known = store, known
        assert add(client, CALIBRATED, FIRST).status_code == 201
        yield client


def issue(client, job=CALIBRATED, **said):
    return client.post("/api/certificates", json={"job": job, **said})


def sheet_text(client, number):
    """The words of the sheet as another program reads them, which are on one page."""
    answer = client.get(f"/api/certificates/{number}/pdf")
    assert answer.headers["content-type"] == "application/pdf"
    pages = PdfReader(io.BytesIO(answer.content)).pages
    assert len(pages) == 1
    assert [round(float(v) / 72 * 25.4) for v in pages[0].mediabox[2:]] == [210, 297], "A4, in mm"
    return " ".join(pages[0].extract_text().split())


def test_a_certificate_claims_what_the_calibration_page_says_and_names_the_rest(plant):
    assert f"leads to <code>{AT_HOME}</code>" in plant.get(f"/jobs/{CALIBRATED}/certificate").text
    made = issue(plant, u_gauge_mm=0.1, place="Hall 7").json()
    c = made["certificate"]
    assert (c["number"], c["serial"], made["holds"]) == ("KR6-0815-C01", "KR6-0815", True)
    assert c["expanded_mm"] >= WITHIN, "no less than the 95 of 100 targets that the calibration states"
    rows = {r["what"]: r["u_mm"] for r in c["budget"]}
    assert rows["Calibrated model"] == pytest.approx(WITHIN / 2)
    assert c["expanded_mm"] == pytest.approx(2 * sum(u**2 for u in rows.values()) ** 0.5)
    assert "any other tool: 95 of 100 targets are within 3.1 mm by the model alone" in c["not_contained"]
    assert any("temperature, base alignment" in t for t in c["not_contained"])
    another = issue(plant, tool="another").json()["certificate"]
    assert (another["number"], another["expanded_mm"] >= WITHIN_ANOTHER) == ("KR6-0815-C02", True)
    for wrong in ({"u_base_mm": -0.1}, {"tool": "own"}, {"region": "run"}):
        assert issue(plant, **wrong).status_code == 422, wrong


def test_a_certificate_is_frozen_and_its_sheet_is_whole(plant):
    long = "Bar 0815 of the metrology laboratory, third drawer, with the long extension"
    body = {"date": SECOND, "operator": "Wanda Weber", "tool": "gripper 4 with adapter", "gauge": long}
    twin = put(
        plant.store, TWIN, "identification", "identification.json", stated(0.03, warnings=["A remark. " * 12] * 9)
    )
    assert plant.post("/api/records/KR6-0816/entries", json={"job": TWIN, "circumstances": body}).status_code == 201
    first = issue(plant, TWIN).json()
    text = sheet_text(plant, "KR6-0816-C01")
    for whole in (
        long,
        SECOND,
        "gripper 4 with adapter",
        "KR6-0816-C01",
        first["sha256"],
        twin,
        "5 more in the report",
    ):
        assert whole.replace(" ", "") in text.replace(" ", ""), whole
    assert "SIMULATED" not in text
    again = plant.get("/api/certificates/KR6-0816-C01").json()
    assert again == first, "another device shows the same"
    page = plant.get("/certificates/KR6-0816-C01").text
    assert first["sha256"] in page
    assert "It holds" in page
    path = next(plant.store.folder.glob("records/KR6-0816/certificates/*-C01.json"))
    path.write_text(path.read_text().replace("Wanda", "Wilma"))
    refused = plant.get("/api/certificates/KR6-0816-C01")
    assert refused.status_code == 422
    assert "is not what was issued" in refused.json()["detail"]


def test_a_simulated_calibration_says_so_across_the_sheet(plant):
    assert issue(plant, SIMULATED).status_code == 409, "of no robot yet"
    add(plant, SIMULATED, FIRST, "SIM-1")
    c = issue(plant, SIMULATED).json()["certificate"]
    text = sheet_text(plant, c["number"])
    assert "SIMULATED" in text
    assert "Simulated: no certificate" in text


def test_a_failed_check_binds_before_anybody_records_it(plant):
    number = issue(plant).json()["certificate"]["number"]
    judge(plant.store, SOUND, 0.0, plant.known)
    assert plant.get(f"/api/certificates/{number}").json()["holds"]
    judge(plant.store, CHANGED, 0.03 * DEG, plant.known)
    found = plant.get(f"/api/certificates/{number}").json()
    assert not found["holds"]
    assert "zero of joint 3; master axis 3 and check again" in found["fault"]
    assert "WITHDRAWN" in sheet_text(plant, number)
    assert "Withdrawn" in plant.get(f"/certificates/{number}").text
    assert issue(plant).status_code == 409
    record, (listed,) = plant.get("/api/records/KR6-0815").json(), plant.get("/api/records").json()
    assert (record["state"], listed["state"]) == ("changed", "changed")
    assert record["advice"] == listed["advice"] == "add its failed check to the record"
    assert record["line"] == "changed: zero of joint 3", "the day is that of the record's entry"
    assert 'edbb_robots{state="changed"} 1' in plant.get("/metrics").text
    job = plant.get(f"/api/jobs/{CALIBRATED}").json()
    assert "the robot KR6-0815 has changed: zero of joint 3" in job["fault"]
    for page in (
        f"/jobs/{CALIBRATED}",
        f"/jobs/{CALIBRATED}/correct",
        f"/jobs/{CALIBRATED}/certificate",
        "/robots/KR6-0815",
    ):
        assert "has changed: zero of joint 3" in plant.get(page).text, page
    listed = {j["id"]: (j["verdict"], j["sense"], j["serial"]) for j in plant.get("/api/jobs").json()}
    assert listed[CHANGED] == ("changed", "bad", "KR6-0815")
    assert listed[SOUND] == ("unchanged", "good", "KR6-0815")
    assert [j["id"] for j in plant.get("/api/jobs", params={"q": "kr6-0815"}).json()].count(CHANGED) == 1
    program = plant.post("/api/files", params={"name": "p.csv"}, content=b"q1_deg").json()["id"]
    asked = {"program": {"id": program, "name": "p.csv"}, "model": CALIBRATED}
    refused = plant.post("/api/compensations", json=asked)
    assert refused.status_code == 409
    assert "--despite-change (despite_change in a request) corrects it anyway" in refused.json()["detail"]
    words = ["compensate", "p.csv", "--model", "robot.toml", "-o", "out/"]
    robot = plant.post("/api/files", params={"name": "robot.toml"}, content=ROBOT.read_bytes()).json()["id"]
    sent = {"words": words, "files": [asked["program"], {"id": robot, "name": "robot.toml"}]}
    assert plant.post("/api/commands", json=sent).status_code == 409, "the command line on a server too"
    aware = {**sent, "words": [*words, "--despite-change"]}
    assert plant.post("/api/commands", json=aware).status_code == 202, "which knows the word"
    assert plant.post("/api/compensations", json=asked | {"despite_change": True}).status_code == 202
    assert plant.delete(f"/api/jobs/{CHANGED}").status_code == 409, "what binds is not deleted"
    # recorded, then withdrawn with a reason: it was no check of this robot
    number_of_entry = add(plant, CHANGED, THIRD).json()["history"][-1]["number"]
    assert "(check of" in plant.get(f"/api/certificates/{number}").json()["fault"]
    judge(plant.store, LATER, 0.0, plant.known)
    assert plant.get(f"/api/jobs/{CALIBRATED}").json()["fault"], "a check in no record clears none that is in one"
    path = f"/api/records/KR6-0815/entries/{number_of_entry}/withdrawal"
    assert plant.post(path, json={"reason": ""}).status_code == 422
    known = plant.post(path, json={"reason": "the ball was not seated"}).json()
    assert (known["state"], known["history"][-1]["withdrawn"]["reason"]) == ("good", "the ball was not seated")
    assert plant.get(f"/api/certificates/{number}").json()["holds"]
    assert not plant.get(f"/api/jobs/{CALIBRATED}").json()["fault"]


def test_a_newer_calibration_and_a_person_withdraw_a_certificate(plant):
    first, second = (issue(plant).json()["certificate"]["number"] for _ in range(2))
    said = plant.post(f"/api/certificates/{first}/withdrawal", json={"reason": "wrong place"}).json()
    assert (said["holds"], said["fault"].startswith("wrong place (")) == (False, True)
    put(plant.store, NEWER, "identification", "identification.json", stated(0.02))
    assert plant.get(f"/api/certificates/{second}").json()["holds"]
    add(plant, NEWER, LAST)
    assert f"was calibrated anew on {LAST}" in plant.get(f"/api/certificates/{second}").json()["fault"]
    assert issue(plant).status_code == 409
    assert issue(plant, NEWER).json()["certificate"]["number"] == "KR6-0815-C03"
    page = plant.get("/robots/KR6-0815").text
    assert page.index("KR6-0815-C03") < page.index("KR6-0815-C01")


def test_a_calibration_is_of_one_robot_and_a_mistyped_serial_number_is_withdrawn(plant):
    refused = add(plant, CALIBRATED, FIRST, "KR6-O815")
    assert refused.status_code == 422
    assert "is entry 1 of the robot KR6-0815, and belongs to that robot alone" in refused.json()["detail"]
    run, names = JobInput("run.csv", "e" * 64), ("identification", "identification.json")
    for id, theta in ((TWIN, 0.03), (LATER, 0.04)):  # the same run, identified with other options
        put(plant.store, id, *names, stated(theta), [run])
    assert add(plant, TWIN, LAST).status_code == 201
    assert "or one of the same run, is entry 2 of the robot KR6-0815" in add(plant, LATER, LAST, "KR6-O815").text
    assert plant.post("/api/records/KR6-0815/entries/2/withdrawal", json={"reason": "no robot's"}).status_code == 200
    judge(plant.store, SOUND, 0.0, plant.known)
    refused = add(plant, SOUND, SECOND, "KR6-O815")
    assert "it is judged against a calibration of the robot KR6-0815" in refused.json()["detail"]
    path = "/api/records/KR6-0815/entries/1/withdrawal"
    known = plant.post(path, json={"reason": "serial number mistyped"}).json()
    assert known["state"] == "withdrawn"
    assert "KR6-0815" not in plant.get("/").text.replace("robots/KR6-0815", "")
    assert "KR6-0815" in plant.get("/", params={"q": "0815"}).text
    assert "withdrawn" in plant.get(f"/api/jobs/{CALIBRATED}").json()["fault"]
    assert "serial number mistyped" in plant.get("/robots/KR6-0815").text
    assert add(plant, CALIBRATED, FIRST, "KR6-0851").json()["state"] == "good"
    assert not plant.get(f"/api/jobs/{CALIBRATED}").json()["fault"]
    # a robot that was never measured
    assert plant.put("/api/records/KR6-O816", json={"robot": NAME}).json()["line"] == "never measured"
    assert f'href="/cells/{NAME}/' in plant.get("/robots/KR6-O816").text, "a session is planned from there"
    assert plant.put("/api/records/KR6-O816", json={"robot": "another"}).status_code == 409
    assert plant.post("/api/records/KR6-O816/withdrawal", json={"reason": "mistyped"}).json()["state"] == "withdrawn"
    assert plant.post("/api/records/KR6-0851/withdrawal", json={"reason": "mistyped"}).status_code == 409
    path = "/api/records/KR6-0815/entries/{}/withdrawal"
    codes = [plant.post(path.format(n), json={"reason": "mistyped"}).status_code for n in (1, 405)]
    assert codes == [409, 404], "withdrawn already, and not there"


@pytest.mark.parametrize("said", ["a\nb", "\0", "\u202eabc", "x" * 201, "\x1b[31m"])
def test_what_a_person_states_is_one_line(plant, said):
    assert issue(plant, place=said).status_code == 422
    circumstances = {"date": FIRST, "operator": said}
    body = {"job": SIMULATED, "circumstances": circumstances}
    assert plant.post("/api/records/SIM-1/entries", json=body).status_code == 422
    number = issue(plant).json()["certificate"]["number"]
    for reason in (f"{said} {'x ' * 150}", "   \n"):
        answer = plant.post(f"/api/certificates/{number}/withdrawal", json={"reason": reason})
        assert answer.status_code == 422, reason


def test_a_statement_has_no_blanks_around_it_and_a_number_is_a_number(plant):
    c = issue(plant, place="  ", approved_by=" Ada ", u_gauge_mm=-0.0).json()["certificate"]
    facts = {f["what"]: f["value"] for g in c["groups"] for f in g["facts"]}
    assert (facts["Place"], facts["Approved by"]) == ("not stated", "Ada")
    assert {r["what"]: str(r["u_mm"]) for r in c["budget"]}["Gauge's own calibration"] == "0.0"
    for wrong in (True, "0.1"):
        assert issue(plant, u_gauge_mm=wrong).status_code == 422, wrong


def test_signs_that_the_letters_of_the_sheet_lack_are_spelt_out(plant):
    number = issue(plant, place="上海 Łódź").json()["certificate"]["number"]
    assert r"\u4e0a\u6d77 Łódź" in sheet_text(plant, number)
    assert "上海 Łódź" in plant.get(f"/certificates/{number}").text


def test_a_day_counts_where_people_are(plant):
    """The service may stand in another zone than whoever measures."""
    east = datetime.now(timezone(timedelta(hours=14))).date()
    assert add(plant, SIMULATED, east.isoformat(), "SIM-1").status_code == 201
    assert add(plant, SIMULATED, (east + timedelta(1)).isoformat(), "SIM-2").status_code == 422


def test_what_was_withdrawn_is_not_withdrawn_again(plant):
    number = issue(plant).json()["certificate"]["number"]
    plant.put("/api/records/KR6-O816", json={"robot": NAME})
    for path in (f"/api/certificates/{number}/withdrawal", "/api/records/KR6-O816/withdrawal"):
        codes = [plant.post(path, json={"reason": why}).status_code for why in ("the first", "the second")]
        assert codes == [200, 409], path
    assert plant.get(f"/api/certificates/{number}").json()["fault"].startswith("the first")


def test_a_serial_number_is_of_one_robot_whatever_its_case(plant):
    for answer in (plant.put("/api/records/kr6-0815", json={"robot": NAME}), add(plant, SIMULATED, FIRST, "kr6-0815")):
        assert answer.status_code == 409
        assert "there is a robot KR6-0815: write its serial number as there" in answer.json()["detail"]


def test_a_withdrawn_serial_number_is_brought_back_with_the_right_model(plant):
    path = "/api/records/SIM-1"
    assert plant.put(path, json={"robot": "kuka\n"}).status_code == 422
    assert plant.put(path, json={"robot": "kuka"}).status_code == 200, "a model that nobody has"
    assert plant.put(path, json={"robot": NAME}).status_code == 409
    assert plant.post(f"{path}/withdrawal", json={"reason": "wrong model"}).status_code == 200
    known = plant.put(path, json={"robot": NAME}).json()
    assert (known["robot"], known["line"]) == (NAME, "never measured")
    plant.post(f"{path}/withdrawal", json={"reason": "once more"})
    assert add(plant, SIMULATED, FIRST, "SIM-1").json()["state"] == "good", "an entry brings it back, too"


def test_a_check_by_a_calibration_that_was_replaced_says_nothing_of_the_newer(plant):
    put(plant.store, NEWER, "identification", "identification.json", stated(0.02))
    add(plant, NEWER, THIRD)
    number = issue(plant, NEWER).json()["certificate"]["number"]
    judge(plant.store, CHANGED, 0.03 * DEG, plant.known)
    assert plant.get("/api/records/KR6-0815").json()["state"] == "good", "before it is recorded"
    refused = add(plant, CHANGED, LAST)
    assert refused.status_code == 422
    assert f"calibrated anew on {THIRD} (entry 2): judge its run by that calibration" in refused.json()["detail"]
    assert add(plant, CHANGED, SECOND).json()["state"] == "good", "measured before: history"
    assert plant.get(f"/api/certificates/{number}").json()["holds"]
