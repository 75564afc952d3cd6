"""Pages at the cell in a browser: a checklist without a network, a service that comes back, a view that scrolls."""

import html
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from types import MappingProxyType

import httpx
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect, sync_playwright

from planner.design.pose_selection import warn_too_few_readings
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_record import JobCommand, JobOutput
from planner.service.job_store import JobStore
from planner.service.people import PeopleStore
from planner.service.settings import Role
from tests.service.conftest import begin_session, client_of, wait_until
from tests.service.test_browser import CHROMIUM, RULES, SOFTWARE_3D
from tests.service.test_cluster import free_port
from tests.service.test_records import FIRST, SOUND, fill

PLAN = Path(__file__).parents[1] / "data" / "kr6-plan"
PASSWORD, JOB = "correct horse battery", "a" * 24
KEPT_PAGES = """async () => {
    const kept = await Promise.all((await caches.keys()).map(async (name) => (await caches.open(name)).keys()));
    return kept.flat().map((request) => request.url);
}"""
SHOTS = os.environ.get("EDBB_PICTURES")  # folder for screenshots to be looked at
expect.set_options(timeout=60_000)  # the machine may be busy
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")


def add_plan(folder, person="", changed=MappingProxyType({})):
    """A finished plan in the store of a service, as if it had just been made."""
    jobs, files = JobStore(Database(folder / "jobs.sqlite3")), FileStore(folder)
    jobs.submit(JOB, "plan", "kuka-kr6-r700/edbb", "{}", JobCommand(("plan",)), "kuka-kr6-r700", person)
    contents = {p.name: p.read_bytes() for p in PLAN.iterdir() if p.is_file()} | changed
    outputs = [JobOutput(name, files.add(data), len(data)) for name, data in contents.items()]
    assert jobs.finish(jobs.take(9), "done", outputs, 0, None)


class Service:
    """A service that can be cut off and come back at the same address."""

    def __init__(self, folder, *words):
        self.folder, self.words, self.port = folder, words, free_port()
        self.address = f"http://127.0.0.1:{self.port}"

    def begin(self):
        command = ["-m", "planner.cli", "serve", "--port", self.port, "--data", self.folder, *self.words]
        self.process = subprocess.Popen([sys.executable, *map(str, command)], stderr=subprocess.PIPE, text=True)
        while "serving at" not in (line := self.process.stderr.readline()):
            assert line
        return self

    def cut(self):
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def service(tmp_path):
    made = Service(tmp_path)
    yield made
    made.cut()


@pytest.fixture
def browser():
    with sync_playwright() as library:
        started = library.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_3D)
        yield started
        started.close()


def open_page(browser, service, name, phone):
    size = {"width": 390, "height": 844} if phone else {"width": 1280, "height": 900}
    page = browser.new_context(base_url=service.address, viewport=size, has_touch=phone).new_page()
    page.set_default_timeout(60_000)
    if name:
        page.goto("/login")
        page.fill("#name", name)
        page.fill("#password", PASSWORD)
        page.get_by_role("button", name="Log in").click()
        expect(page.locator(".who")).to_contain_text(name)
    return page


def open_checklist(page, plan, serial="KR6-0815"):
    """Choose the robot that is measured; one that nobody knows is added after a question."""
    page.goto(f"/jobs/{plan}/session")
    page.fill("#serial", serial)
    page.click("text=To the checklist")
    page.locator("#new-robot:visible, .checklist").first.wait_for()
    if page.locator("#new-robot").count():
        page.click("#new-robot")
    page.wait_for_selector(".checklist")
    return page.url


def check_page(page, name):
    if SHOTS:
        page.screenshot(path=str(Path(SHOTS) / f"{name}.png"), full_page=True)
    found = Axe().run(page, options=RULES).response["violations"]
    assert not found, [(v["id"], v["nodes"][0]["html"]) for v in found]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), f"{name} scrolls sideways"


@needs_browser
@pytest.mark.long
def test_no_step_is_ticked_before_the_page_keeps_ticks(service, browser):
    """On a slow line the list is there before its script: what was ticked then would be gone after a reload."""
    add_plan(service.folder, "")
    service.begin()
    phone, held = open_page(browser, service, None, phone=True), []
    checklist = open_checklist(phone, JOB)
    phone.route("**/session.js*", lambda route: held.append(route), times=1)
    phone.goto(checklist, wait_until="commit")
    expect(phone.locator("#step-1")).to_be_disabled()
    while not held:
        phone.wait_for_timeout(50)
    held[0].continue_()
    phone.check("#step-1")
    phone.reload()
    expect(phone.locator("#step-1")).to_be_checked()


@needs_browser
@pytest.mark.long
def test_a_checklist_goes_on_without_a_network_and_is_seen_by_others_when_it_is_back(service, browser):
    people = PeopleStore(Database(service.folder / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, PASSWORD)
    people.add("wanda", Role.WORK, PASSWORD)
    add_plan(service.folder, "ada")
    service.begin()
    phone = open_page(browser, service, "wanda", phone=True)
    checklist = open_checklist(phone, JOB)
    expect(phone.locator("#offline")).to_contain_text("without a network", timeout=120_000)
    phone.check("#step-1")
    expect(phone.locator("#sent")).to_contain_text("All that is ticked is sent")
    check_page(phone, "checklist-phone")
    service.cut()
    phone.reload()
    assert phone.is_checked("#step-1")
    phone.check("#step-2")
    phone.uncheck("#step-1")
    expect(phone.locator("#sent")).to_contain_text("kept on this device and sent when it is back")
    check_page(phone, "checklist-phone-offline")
    service.begin()
    expect(phone.locator("#sent")).to_contain_text("All that is ticked is sent", timeout=120_000)
    desk = open_page(browser, service, "ada", phone=False)
    desk.goto(checklist)
    expect(desk.locator("#step-2")).to_be_checked(timeout=120_000)
    expect(desk.locator("#step-1")).not_to_be_checked()
    assert "wanda" in desk.locator("li:has(#step-2) .ticked").inner_text()
    desk.check("#step-3")
    expect(phone.locator("#step-3")).to_be_checked(timeout=120_000)
    check_page(desk, "checklist-desk")
    desk.goto("/deeds")
    assert "ticked a checklist" in desk.inner_text("main")
    check_page(desk, "deeds")
    assert [url for url in phone.evaluate(KEPT_PAGES) if "/sessions/" in url]
    phone.click("text=Log out")
    phone.wait_for_url("**/login")
    check_page(phone, "login-phone")
    wait_until(lambda: not [url for url in phone.evaluate(KEPT_PAGES) if "/sessions/" in url])


@needs_browser
@pytest.mark.long
def test_a_service_that_goes_is_said_and_the_page_goes_on_when_it_is_back(service, browser):
    service.begin()
    job = httpx.post(f"{service.address}/api/plans", json={"cell": "comau-nj130/edbb", "seed": 11}).json()
    page = open_page(browser, service, None, phone=False)
    page.goto(f"/jobs/{job['id']}")
    expect(page.locator("#stages li")).not_to_have_count(0)
    service.cut()
    expect(page.locator(".gone")).to_contain_text("The service does not answer")
    check_page(page, "gone")
    service.begin()
    expect(page.locator(".gone")).to_have_count(0, timeout=120_000)
    page.click("#cancel")
    expect(page.locator("text=It was stopped")).to_be_visible(timeout=120_000)


@needs_browser
@pytest.mark.long
@pytest.mark.parametrize("phone", [False, True])
def test_a_view_does_not_hold_the_page_and_says_axes_and_distances(service, browser, phone):
    service.begin()
    page = open_page(browser, service, None, phone=phone)
    page.goto("/cells/kuka-kr6-r700/edbb")
    page.wait_for_selector("#view canvas")
    expect(page.locator("#fixture-distances")).to_contain_text("from the robot's first axis")
    page.locator("#view").scroll_into_view_if_needed()
    box = page.locator("#view").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    before = page.evaluate("scrollY")
    page.mouse.wheel(0, 300)
    wait_until(lambda: page.evaluate("scrollY") > before + 100)
    assert page.evaluate("getComputedStyle(document.querySelector('#view')).touchAction") == "pan-y"
    expect(page.locator(".layers")).to_contain_text("axes x, y, z")
    x = float(page.input_value("#fixture-x"))
    page.fill("#fixture-x", str(x + 50))
    expect(page.locator("#fixture-distances")).to_contain_text("moved by 50 mm (x 50, y 0, z 0)")
    page.locator("[data-turn='+']").click()
    page.wait_for_timeout(500)
    check_page(page, f"cell-{'phone' if phone else 'desk'}")


@pytest.mark.slow
@pytest.mark.parametrize("too_few", [False, True])
def test_the_page_of_a_plan_warns_where_poses_are_too_few(tmp_path, too_few):
    plan = json.loads((PLAN / "plan.json").read_text())
    plan["notes"] = [warn_too_few_readings(10, 30)] if too_few else []
    add_plan(tmp_path, changed={"plan.json": json.dumps(plan).encode()})
    with client_of(tmp_path, workers=0, beside=0) as client:
        text = client.get(f"/jobs/{JOB}").text
    assert ("Too few poses to find causes" in text) is too_few
    assert ("ask for at least" in text) is too_few


@pytest.mark.slow
def test_ticks_are_merged_by_their_time(tmp_path):
    add_plan(tmp_path)
    with client_of(tmp_path, workers=0, beside=0) as client:
        path = f"/api{begin_session(client, JOB)}"

        def send(step, done, at):
            return client.post(f"{path}/ticks", json={"ticks": [{"step": step, "done": done, "at": at}]})

        assert send("step-1", True, "2026-01-01T10:00:00Z").status_code == 200
        send("step-1", False, "2026-01-01T09:00:00Z")  # made earlier on a device that had no network
        assert [(t["step"], t["done"]) for t in client.get(path).json()["ticks"]] == [("step-1", True)]
        send("step-1", False, "2026-01-01T12:00:00+01:00")
        assert client.get(path).json()["ticks"][0]["done"] is False
        send("step-2", True, "2099-01-01T00:00:00Z")
        send("step-2", False, "2098-01-01T00:00:00Z")
        assert [t["done"] for t in client.get(path).json()["ticks"]] == [False, False], (
            "a clock that is ahead counts as now"
        )
        assert send("step-x", True, "2026-01-01T10:00:00Z").status_code == 422
        assert send("step-1", True, "2026-01-01T10:00:00").status_code == 422
        assert client.get(f"/api/sessions/{'b' * 24}").status_code == 404
        assert "was measured by it" in client.delete(f"/api/jobs/{JOB}").json()["detail"]
        assert client.get("/worker.js").headers["content-type"].startswith("text/javascript")


@pytest.mark.slow
def test_the_page_of_a_session_needs_only_what_a_device_keeps(tmp_path):
    """All that the checklist is drawn by lies under /static/, which the worker keeps."""
    add_plan(tmp_path)
    with client_of(tmp_path, workers=0, beside=0) as client:
        text = client.get(begin_session(client, JOB)).text
    loaded = re.findall(r'<(?:script|link)[^>]*(?:src|href)="([^"]+)"', text)
    assert loaded
    assert all(path.startswith("/static/") for path in loaded)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "told"),
    [
        ("", ("drives on by itself", "waits until input 1 says that the gauge is ready", "Start the log")),
        ("hand", ("then the program stops and names the pose", "20 s for each reading", "Begin the table of readings")),
        ("trigger", ("output 1 is pulsed: it triggers the gauge",)),
        ("input", ("waits until input 1 is on", "Where nothing is wired to it the robot waits for ever")),
    ],
)
def test_the_checklist_says_how_the_gauge_is_read_and_how_it_is_mounted(tmp_path, way, told):
    cell = (PLAN / "cell.toml").read_text()
    cell = cell.replace("[gauge]\n", f'[gauge]\nread_by = "{way}"\n', 1) if way else cell
    add_plan(tmp_path, changed={"cell.toml": cell.encode()})
    with client_of(tmp_path, workers=0, beside=0) as client:
        text = html.unescape(client.get(begin_session(client, JOB)).text)
    for words in (*told, "at [430, 330, 60] mm of the base frame", "Set its display to the length"):
        assert words in text


@needs_browser
@pytest.mark.long
def test_a_validation_run_that_is_still_sent_is_not_left_out(service, browser):
    ur5, cells = PLAN.parent / "ur5-tracker", Path(__file__).parents[1] / "identification" / "cells"
    service.begin()
    desk, held = open_page(browser, service, None, phone=False), []
    desk.route("**/api/runs?name=validation.csv", lambda route: held.append(route))
    desk.route("**/api/identifications", lambda route: route.abort())
    desk.goto("/calibrate")
    desk.set_input_files("#run", ur5 / "run.csv")
    expect(desk.locator("#run-message")).to_contain_text("choose the plan")
    desk.set_input_files("#own-files", [cells / "ur5-tracker.toml", cells / "ur5.toml"])
    desk.wait_for_selector("#run-chart svg")
    desk.set_input_files("#validation", ur5 / "validation.csv")
    with desk.expect_request("**/api/identifications") as asked:
        desk.click("#identify")
        while not held:
            desk.wait_for_timeout(50)
        held[0].continue_()
    assert asked.value.post_data_json["validate_with"]["name"] == "validation.csv"


@needs_browser
@pytest.mark.long
def test_a_phone_sees_that_somebody_has_begun_its_session_again(service, browser):
    add_plan(service.folder)
    service.begin()
    phone, desk = (open_page(browser, service, None, phone=True) for _ in range(2))
    desk.goto(open_checklist(phone, JOB))
    for _ in range(2):
        desk.click("#again")
    desk.wait_for_url(lambda url: url != phone.url)
    phone.click("#step-1")
    expect(phone.locator("#ended")).to_contain_text("This session was begun again")
    expect(phone.locator("#step-1")).not_to_be_checked()
    expect(phone.locator("#step-2")).to_be_disabled()
    phone.click("#ended a")
    phone.click("text=To the checklist")
    phone.wait_for_url(desk.url)


@needs_browser
@pytest.mark.long
def test_a_day_that_is_typed_before_the_script_is_there_stays(service, browser):
    fill(service.folder)
    service.begin()
    page, held = open_page(browser, service, None, phone=False), []
    page.route("**/record.js*", lambda route: held.append(route), times=1)
    page.goto(f"/jobs/{SOUND}", wait_until="commit")
    page.fill("#date", FIRST)
    while not held:
        page.wait_for_timeout(50)
    held[0].continue_()
    expect(page.locator("#date[max]")).to_have_value(FIRST)
