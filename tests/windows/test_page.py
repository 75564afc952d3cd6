"""Calibrate.cmd is double-clicked: the page opens, and a browser outside sees it work."""

import os
import socket
import stat
import time

import httpx
import pytest

from tests.browser import CHROMIUM
from tests.service.conftest import wait_until
from tests.windows.conftest import PLAN
from tests.windows.wine import PATIENCE_S

pytestmark = pytest.mark.long
ADDRESS, PORT = "http://127.0.0.1:8017", 8017
RECORD = '#!/bin/sh\necho "$1" >> "{}"\n'
"""Stands for the browser that Wine starts: writes down which address it is given."""


@pytest.fixture(scope="module")
def page(wine, tmp_path_factory):
    """The service as a double click starts it; yields where a browser notes its address, and seconds."""
    with socket.socket() as probe:
        if probe.connect_ex(("127.0.0.1", PORT)) == 0:
            pytest.skip(f"something listens at port {PORT} of this machine already")
    folder = tmp_path_factory.mktemp("browser")
    opened = folder / "opened.txt"
    for name in ("xdg-open", "firefox", "chromium"):
        (folder / name).write_text(RECORD.format(opened))
        (folder / name).chmod(stat.S_IRWXU)
    began = time.monotonic()
    env = {"PATH": f"{folder}:{os.environ['PATH']}"}
    process = wine.start("cmd", "/c", wine.program / "Calibrate.cmd", env=env)
    wait_until(answers, PATIENCE_S, 0.5)
    seconds = time.monotonic() - began
    yield opened, seconds
    wine.end("serve")
    process.wait(timeout=120)


def answers():
    """Tell whether the service answers."""
    try:
        return httpx.get(f"{ADDRESS}/api/health", timeout=60).is_success
    except httpx.TransportError:
        return False


def finish(job):
    """Wait until a job has ended, and return it."""
    wait_until(
        lambda: httpx.get(ADDRESS + job["url"], timeout=60).json()["state"] not in ("queued", "running"), PATIENCE_S, 1
    )
    return httpx.get(ADDRESS + job["url"], timeout=60).json()


def test_the_page_opens_in_the_browser(page):
    opened, seconds = page
    print(f"first answer after {seconds:.1f} s")
    wait_until(opened.exists, PATIENCE_S, 0.5)
    assert [line.rstrip("/") for line in opened.read_text().split()] == [ADDRESS]


def test_a_second_double_click_shows_the_same_page(wine, page):
    said = wine.edbb("serve", "--open", timeout=PATIENCE_S)
    assert f"served already at {ADDRESS}" in said


def test_a_job_runs_on_windows(page):
    """A command with a plan that was sent; planning itself ends with the sentence that says what to do."""
    with httpx.Client(base_url=ADDRESS, timeout=120) as outside:
        files = []
        for name in ("plan.json", "cell.toml"):
            sent = outside.post(f"/api/files?name={name}", content=(PLAN / name).read_bytes()).raise_for_status()
            files.append({"id": sent.json()["id"], "name": name})
        asked = {
            "words": ["export", "plan.json", "--dialect", "krl", "-o", "out/p.src"],
            "files": files,
        }
        done = finish(outside.post("/api/commands", json=asked).raise_for_status().json())
        assert done["state"] == "done", done
        assert "p.src" in {file["name"] for file in done["files"]}
        failed = finish(outside.post("/api/plans", json={"cell": "kuka-kr6-r700/edbb"}).raise_for_status().json())
        assert failed["problem"]["exit_code"] == 4
        assert "--server URL" in failed["problem"]["detail"]


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")
def test_a_browser_outside_shows_the_page(page):
    from playwright.sync_api import sync_playwright

    with sync_playwright() as library:
        browser = library.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        shown, faults = browser.new_page(viewport={"width": 1280, "height": 800}), []
        shown.on("pageerror", lambda error: faults.append(error))
        shown.goto(ADDRESS, timeout=PATIENCE_S * 1000)
        assert "KUKA KR 6 R700" in shown.inner_text("main", timeout=PATIENCE_S * 1000)
        if os.environ.get("EDBB_PICTURES"):
            shown.screenshot(path=f"{os.environ['EDBB_PICTURES']}/windows_start.png")
        browser.close()
    assert not faults
