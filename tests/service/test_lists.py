"""Lists of a plant: pages hold every entry once and in order, filters do what a plain loop does."""

import html
import json
import random
import re
import sqlite3
import time
from datetime import UTC, date, datetime, timedelta
from types import SimpleNamespace
from urllib.parse import urlencode

import pytest

from planner.checks.record import Circumstances
from planner.checks.record_changes import add_entry
from planner.checks.results import verdict_content
from planner.common.errors import InputError
from planner.service.database import FIRST, VERSION, Database
from planner.service.file_store import FileStore
from planner.service.job_record import JobCommand, JobFilter, JobOutput, JobPlace
from planner.service.job_store import JobStore
from planner.service.record_index import LOOK_S, RecordIndex, RobotFilter
from tests.checks.fleet import NAME
from tests.checks.test_evaluation import judged
from tests.checks.test_record import calibration
from tests.service.conftest import client_of, wait_until

KINDS, ROBOTS = ("plan", "identification", "check", "fixture-view"), ("comau-nj130", "ur10", "")
COUNT, PAGE = 137, 20


def fill(folder):
    """Jobs of all kinds and states, some submitted at the same moment; what was made is returned, the latest first."""
    rng, made = random.Random(3), []
    store = JobStore(Database(folder / "jobs.sqlite3"))
    for k in range(COUNT):
        kind, robot = rng.choice(KINDS), rng.choice(ROBOTS)
        id, title = f"{rng.getrandbits(96):024x}", f"{robot or 'own'}/Cell {k % 10}"
        command = JobCommand((kind,), (), kind == "fixture-view")
        store.submit(id, kind, title, "{}", command, robot)
        at, state = 1.76e9 + 60 * (k // 3) + 0.123456, rng.choice(("done", "failed", "cancelled"))
        with store._db.write() as db:
            db.execute("UPDATE jobs SET created = ?, state = ? WHERE id = ?", (at, state, id))
        made.append(SimpleNamespace(id=id, kind=kind, robot=robot, state=state, title=title, created=at))
    return sorted(made, key=lambda j: (j.created, j.id), reverse=True)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant")
    made = fill(folder)
    with client_of(folder) as client:
        yield client, made


def walk(client, path, **asked):
    """All entries of a list, page by page, as the Link header leads; and the number of pages."""
    path, found, pages = f"{path}?{urlencode(asked)}", [], 0
    while path:
        answer = client.get(path)
        assert answer.status_code == 200, answer.text
        found, pages = found + answer.json(), pages + 1
        link = answer.headers.get("link", "")
        assert not link or link.endswith('; rel="next"')
        path = link.partition(">")[0].removeprefix("<")
    return found, pages


def moment(k):
    return datetime.fromtimestamp(1.76e9 + 60 * k, UTC).isoformat()


@pytest.mark.parametrize(
    ("asked", "wanted"),
    [
        ({}, lambda j: j.kind != "fixture-view"),
        ({"tasks": "true"}, lambda j: True),
        ({"kind": "fixture-view"}, lambda j: j.kind == "fixture-view"),
        ({"state": "failed", "robot": "ur10"}, lambda j: (j.state, j.robot) == ("failed", "ur10")),
        ({"q": "cELL 7", "tasks": "true"}, lambda j: j.title.endswith("Cell 7")),
        ({"q": "100%_"}, lambda j: False),
        (
            {"since": moment(10), "until": moment(30), "kind": "plan"},
            lambda j: j.kind == "plan" and 10 <= (j.created - 1.76e9) / 60 < 30,
        ),
    ],
)
def test_pages_hold_every_wanted_job_once_and_in_order(plant, asked, wanted):
    client, made = plant
    expected = [j for j in made if (wanted(j) and j.kind != "fixture-view") or (asked and wanted(j))]
    if "tasks" not in asked and "kind" not in asked:
        expected = [j for j in expected if j.kind != "fixture-view"]
    found, pages = walk(client, "/api/jobs", most=PAGE, **asked)
    assert [j["id"] for j in found] == [j.id for j in expected]
    assert pages == max(1, -(-len(expected) // PAGE))


def test_a_job_that_comes_meanwhile_moves_no_page(tmp_path):
    """A page is where the one before ended, not a number of entries behind the first."""
    made = fill(tmp_path)
    store = JobStore(Database(tmp_path / "jobs.sqlite3"))
    first = store.list_jobs(JobFilter(tasks=True), PAGE)
    store.submit("f" * 24, "plan", "new", "{}", JobCommand(("plan",)))
    second = store.list_jobs(
        JobFilter(tasks=True), PAGE, JobPlace.parse(str(JobPlace(first[-1].created, first[-1].id)))
    )
    assert [j.id for j in [*first, *second]] == [j.id for j in made[: 2 * PAGE]]


@pytest.mark.parametrize("place", ["x", "1-", "1.5-zz", "1.5-" + "a" * 23, "'; DROP TABLE jobs; --"])
def test_a_place_that_is_none_is_refused(plant, place):
    refused = plant[0].get("/api/jobs", params={"after": place})
    assert refused.status_code == 422
    assert "Link header" in refused.json()["detail"] or "after" in refused.text


@pytest.mark.parametrize("asked", [{"state": "asleep"}, {"since": "yesterday"}, {"most": 0}, {"colour": "red"}])
def test_a_filter_that_is_none_is_refused(plant, asked):
    assert plant[0].get("/api/jobs", params=asked).status_code == 422


def test_a_store_of_the_version_before_has_its_lists(tmp_path):
    """Which jobs are helpers, and of which robot plans are, is found in what was kept before lists could ask for it."""
    path = tmp_path / "jobs.sqlite3"
    with sqlite3.connect(path) as old:
        old.executescript(FIRST)
        old.execute("ALTER TABLE jobs ADD COLUMN deaths INTEGER NOT NULL DEFAULT 0")
        for id, kind, title, task in (("a", "plan", "ur10/edbb", False), ("b", "fixture-view", "ur10/edbb", True)):
            command = json.dumps({"words": [kind], "inputs": [], "task": task})
            old.execute(
                "INSERT INTO jobs (id, kind, title, request, command, state, created)"
                " VALUES (?, ?, ?, '{}', ?, 'done', 1)",
                (id * 24, kind, title, command),
            )
        old.execute("PRAGMA user_version = 2")
    store = JobStore(Database(path))
    assert [(j.id[0], j.robot) for j in store.list_jobs(JobFilter(robot="ur10"))] == [("a", "ur10")]
    assert {j.id[0] for j in store.list_jobs(JobFilter(tasks=True))} == {"a", "b"}
    assert Database(path).read("PRAGMA user_version")[0][0] == VERSION


def test_each_list_reads_an_index_and_not_all_jobs(tmp_path):
    fill(tmp_path)
    db = Database(tmp_path / "jobs.sqlite3")
    for wanted in (JobFilter(), JobFilter(kind="plan"), JobFilter(kind="plan", state="done")):
        where, values = wanted.condition()
        query = f"EXPLAIN QUERY PLAN SELECT * FROM jobs WHERE {where} ORDER BY created DESC, id DESC LIMIT 50"
        steps = [row["detail"] for row in db.read(query, *values)]
        assert all("USING INDEX" in step for step in steps), steps


def folder_of(tmp_path, name, content):
    made = tmp_path / "results" / name
    made.mkdir(parents=True, exist_ok=True)
    document = "check.json" if "outcome" in content else "identification.json"
    (made / document).write_text(json.dumps(content, default=str))
    return made


def add(tmp_path, serial, name, content, day):
    record = tmp_path / "records" / serial
    add_entry(record, folder_of(tmp_path, name, content), Circumstances(date=day), serial)
    return record


TODAY = date.today()


@pytest.fixture
def robots(tmp_path):
    """One that is good, one whose check is due, one that has changed, one whose record is damaged."""
    add(tmp_path, "B-good", "good", calibration(0.01), TODAY - timedelta(3))
    add(tmp_path, "C-due", "due", calibration(0.01), TODAY - timedelta(90))
    add(tmp_path, "D-changed", "first", calibration(0.01), TODAY - timedelta(60))
    add(tmp_path, "D-changed", "slipped", verdict_content(judged(theta3=0.0005), NAME), TODAY - timedelta(2))
    add(tmp_path, "A-damaged", "damaged", calibration(0.01), TODAY - timedelta(3))
    document = next((tmp_path / "records/A-damaged").rglob("identification.json"))
    document.write_text(document.read_text() + " ")
    return RecordIndex(tmp_path / "records", Database(tmp_path / "jobs.sqlite3"))


def later(index):
    """Forget that the index has just looked."""
    index._looked = time.monotonic() - 2 * LOOK_S


def test_robots_in_need_come_first_and_a_damaged_record_hides_no_other(robots):
    found = robots.list_robots(RobotFilter(), 10)
    assert [(r.serial, r.state) for r in found] == [
        ("A-damaged", "damaged"), ("D-changed", "changed"), ("C-due", "check due"), ("B-good", "good"),
    ]  # fmt: skip
    assert "hash differs" in found[0].advice
    assert found[2].next_check == TODAY - timedelta(60)
    assert [r.serial for r in robots.list_robots(RobotFilter(text="-DUE"), 10)] == ["C-due"]
    assert [r.serial for r in robots.list_robots(RobotFilter(state="check due"), 10)] == ["C-due"]
    assert [r.serial for r in robots.list_robots(RobotFilter(), 2, found[0].place)] == ["D-changed", "C-due"]
    with pytest.raises(InputError, match="no place in a list"):
        robots.list_robots(RobotFilter(), 2, "1'; DROP TABLE robots; --")


def test_what_a_command_adds_beside_the_service_is_seen_and_what_is_gone_is_not(robots, tmp_path):
    robots.list_robots(RobotFilter(), 10)
    add(tmp_path, "C-due", "again", calibration(0.02), TODAY)
    (tmp_path / "records/B-good").rename(tmp_path / "moved")
    later(robots)
    found = {r.serial: (r.state, r.entries) for r in robots.list_robots(RobotFilter(), 10)}
    assert found["C-due"] == ("good", 2)
    assert set(found) == {"A-damaged", "C-due", "D-changed"}


def test_the_entry_of_a_document_is_found_by_its_hash(robots, tmp_path):
    entry = json.loads(next((tmp_path / "records/C-due").rglob("entry.json")).read_text())
    found = robots.find_entry({"0" * 64, entry["document_sha256"]})
    # the three calibrations are alike: the last serial number of those that hold it
    assert found.serial == "D-changed"
    assert found.circumstances.date == TODAY - timedelta(60)
    assert robots.find_entry({"0" * 64}).serial == ""
    assert robots.find_entry(set()).serial == ""


@pytest.mark.slow
def test_the_first_page_searches_the_robots(tmp_path):
    for k in range(60):
        add(tmp_path, f"KR-{k:03d}", "good", calibration(0.01), TODAY - timedelta(k % 5))
    with client_of(tmp_path) as client:
        wait_until(lambda: len(client.get("/api/records", params={"most": 1000}).json()) == 60)
        found, pages = walk(client, "/api/records", most=25)
        assert (len({r["serial"] for r in found}), pages) == (60, 3)
        first = client.get("/").text
        assert first.count('href="/robots/') == 50
        assert "More robots" in first
        more = re.search(r'href="(/\?q=&amp;after=[^"]+)"', first)[1]
        second = client.get(html.unescape(more)).text
        assert second.count('href="/robots/') == 10
        assert 'href="/robots/KR-017"' in client.get("/", params={"q": "kr-017"}).text
        assert "No robot has" in client.get("/", params={"q": "<b>"}).text
        assert "<b>" not in client.get("/", params={"q": "<b>"}).text


def test_a_job_says_of_which_robot_it_is(tmp_path):
    cell = b'schema = "edbb-cell/1"\nrobot = "kuka-kr6-r700"\n'
    with client_of(tmp_path, workers=0) as client:
        sent = client.post("/api/cells", params={"name": "mine.toml"}, content=cell)
        own = client.post("/api/plans", json={"cell": sent.json()["id"]}).json()
        shipped = client.post("/api/plans", json={"cell": "ur10/edbb"}).json()
        words = client.post("/api/commands", json={"words": ["plan", "so101/wire", "-o", "out"]}).json()
    assert [j["robot"] for j in (own, shipped, words)] == ["kuka-kr6-r700", "ur10", "so101"]


def test_outputs_of_a_page_are_those_of_each_job(tmp_path):
    store, files = JobStore(Database(tmp_path / "jobs.sqlite3")), FileStore(tmp_path)
    for id in ("a" * 24, "b" * 24, "c" * 24):
        store.submit(id, "plan", "ur10/edbb", "{}", JobCommand(("plan",)))
        outputs = [JobOutput(f"{id[0]}{k}.csv", files.add(f"{id}{k}".encode()), 25) for k in range(3)]
        assert store.finish(store.take(9), "done", outputs, 0, None)
    ids = ["a" * 24, "c" * 24]
    assert store.outputs_of(ids) == {id: store.outputs(id) for id in ids}
    assert store.outputs_of([]) == {}
