"""A session in batches through the pages: measure, drop the log, see what is still to be expected, plan on, measure."""

import os
import re
from pathlib import Path

import pytest
from playwright.sync_api import expect, sync_playwright

from tests.service.conftest import begin_session, client_of, ended, upload
from tests.service.test_browser import CHROMIUM, SOFTWARE_3D, check_page
from tests.service.test_cell_side import Service
from tests.workflow.conftest import small_cell

SHOTS = os.environ.get("EDBB_PICTURES")  # folder for screenshots to be looked at
pytestmark = pytest.mark.long


class Session:
    """Two batches of a simulated robot as the pages ask for them, in the store of a service."""

    def __init__(self, folder):
        self.folder = folder
        cell = small_cell("kuka-kr6-r700/edbb", folder / "cell", ("candidates = 3000", "candidates = 1200"))
        with client_of(folder) as client:
            self.client = client
            sent = upload(client, "cells", cell.read_bytes(), "cell.toml")
            self.first = self.done("plans", {"cell": sent["id"], "poses": 30})
            self.runs = [self.measure(self.first, "run.csv")]
            self.known = self.done("identifications", {"runs": self.runs, "plan": self.first["id"], "no_trace": True})
            self.before = self.see(self.known)
            self.second = self.done("plans", {"after": self.known["id"], "same_mounting": True})
            self.page_of_second = client.get(f"/jobs/{self.second['id']}").text
            self.checklist = client.get(begin_session(client, self.second["id"])).text
            self.runs.append(self.measure(self.second, "run.csv"))
            names = [{"id": r["id"], "name": f"session-{k}-run.csv"} for k, r in enumerate(self.runs, start=1)]
            asked = {"runs": names, "plan": self.first["id"], "plans": [self.second["id"]], "no_trace": True}
            self.both = self.done("identifications", asked)
            self.after = self.see(self.both)

    def done(self, route, asked):
        job = ended(self.client, self.client.post(f"/api/{route}", json=asked))
        assert job["state"] == "done", job["problem"]
        return job

    def measure(self, plan, name):
        """The log of a batch: of one and the same simulated robot, as a file that a person drops."""
        made = self.done("simulations", {"plan": plan["id"], "seed": 4})
        log = self.client.get(next(f["url"] for f in made["files"] if f["name"] == "run.csv"))
        return upload(self.client, "runs", log.content, name)

    def see(self, calibration):
        """The page of a calibration, and its document."""
        page = self.client.get(f"/jobs/{calibration['id']}").text
        return page, self.client.get(f"{calibration['url']}/result").json()


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return Session(tmp_path_factory.mktemp("batches"))


def stated(page):
    """What a page says: error now and its limit, further poses with their minutes, error then and its limit [mm]."""
    now = re.search(r"<b>([\d.]+) mm</b> expected error of the tool.*?95 % sure below ([\d.]+) mm", page)
    more = re.search(
        r'<p id="more">(\d+) more poses, about (\d+) min, would bring it to ([\d.]+) mm \(95 % sure below ([\d.]+)',
        page,
    )
    return [float(v) for v in (*now.groups(), *more.groups())]


def test_a_dropped_log_says_where_the_robot_stands_and_what_the_next_batch_would_bring(session):
    page, found = session.before
    error, limit, poses, minutes, then, then_limit = stated(page)
    assert error == pytest.approx(found["known_anywhere_mm"], abs=1e-4)
    assert limit == pytest.approx(found["release"]["at_most_mm"], abs=1e-4)
    assert (poses, then) == (found["more"]["poses"], pytest.approx(found["more"]["anywhere_mm"], abs=1e-3))
    assert then < error < limit
    assert then_limit < limit
    assert minutes >= 1


def test_the_next_batch_is_planned_in_the_same_cell_and_leaves_the_gauge_standing(session):
    assert session.second["title"] == session.first["title"]
    assert session.second["robot"] == session.first["robot"]
    assert "left standing" in session.page_of_second
    assert "Leave every fixture as it stands" in session.checklist


def test_both_batches_together_state_less_than_the_first(session):
    before, after = stated(session.before[0]), stated(session.after[0])
    assert after[0] < before[0]
    assert after[1] < before[1]
    assert session.both["title"] == f"session-1-run.csv, session-2-run.csv of {session.first['title']}"


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_the_pages_lead_from_batch_to_batch(session):
    service = Service(session.folder).begin()
    try:
        with sync_playwright() as library:
            browser = library.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_3D)
            size = {"width": 1280, "height": 900}
            walk(browser.new_context(base_url=service.address, viewport=size).new_page(), session)
            browser.close()
    finally:
        service.cut()


def walk(page, session):
    """From the first calibration to the next plan and on to the second, by what stands on the pages."""
    page.faults = []
    page.on("pageerror", lambda fault: page.faults.append(str(fault)))
    page.set_default_timeout(300_000)
    page.goto(f"/jobs/{session.known['id']}")
    see(page, "calibration after the first batch")
    page.click("text=Plan the next poses")
    page.wait_for_url(f"**/jobs/{session.second['id']}")
    page.goto(f"/calibrate?plan={session.second['id']}")
    expect(page.locator("#before-runs")).to_have_text("run.csv", timeout=60_000)
    page.set_input_files("#run", files=[log_file(session)])
    page.wait_for_selector("#run-chart svg")
    see(page, "log of the second batch")
    page.uncheck("#trace")
    page.click("#identify")
    page.wait_for_url(f"**/jobs/{session.both['id']}")
    page.wait_for_selector("#more")
    see(page, "calibration after both batches")
    assert stated(page.content())[0] < stated(session.before[0])[0]


def log_file(session):
    with client_of(session.folder) as client:
        content = client.get(f"/api/files/{session.runs[1]['id']}").content
    return {"name": "run.csv", "mimeType": "text/csv", "buffer": content}


def see(page, name):
    if SHOTS:
        page.screenshot(path=str(Path(SHOTS) / f"{name}.png"), full_page=True)
    check_page(page)
