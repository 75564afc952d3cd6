"""The whole way through the pages in a browser: from a cell to its programs, and from a log to the calibration."""

import re
import shutil
import subprocess
import sys
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

from tests.service.pictures import check_sensitivity, compare
from tests.workflow.conftest import small_cell

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SOFTWARE_3D = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
RULES = {"runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]}
PLACE = ("390", "420", "60")  # mm, to which the fixture is dragged only roughly
MINUTES = 5 * 60_000  # of waiting at most: the machine may be busy
pytestmark = [pytest.mark.long, pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium here")]


@pytest.fixture
def address(tmp_path):
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(tmp_path / "data")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        yield re.search(r"http://\S+?(?=,)", server.stderr.readline())[0]
        server.terminate()


@pytest.fixture
def page(address):
    with sync_playwright() as library:
        browser = library.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_3D)
        page: Any = browser.new_context(base_url=address, viewport={"width": 1280, "height": 900}).new_page()
        page.set_default_timeout(MINUTES)
        page.faults = []
        page.on("pageerror", lambda fault: page.faults.append(str(fault)))
        page.on("console", lambda line: page.faults.append(line.text) if line.type == "error" else None)
        yield page
        browser.close()


def check_page(page, name=None):
    """No rule of accessibility is broken, no script failed, nothing scrolls sideways; it looks as the kept picture."""
    page.wait_for_load_state("load")  # else its style may not have come
    found = Axe().run(page, options=RULES).response["violations"]
    assert not found, [(v["id"], v["nodes"][0]["html"]) for v in found]
    assert not page.faults
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"], "no sideways scrolling"
    if name is not None:
        compare(page, name)


def shows_something(page):
    """The canvas is not of one colour: the middle of its picture has more than a few."""
    from io import BytesIO

    from PIL import Image

    picture = Image.open(BytesIO(page.locator("#view canvas").screenshot())).convert("RGB")
    return len(picture.getcolors(1 << 24)) > 200


def drag_fixture(page):
    """Drag the orange ball, which is found in the picture, and see what is foreseen follow."""
    from io import BytesIO

    import numpy as np
    from PIL import Image

    page.locator("#fixture-error", has_text="mm after").wait_for()
    before = page.input_value("#fixture-x"), page.input_value("#fixture-y"), page.input_value("#fixture-z")
    canvas = page.locator("#view canvas")
    picture = np.array(Image.open(BytesIO(canvas.screenshot())).convert("RGB")).astype(int)
    rows, columns = np.nonzero((np.abs(picture - (200, 115, 20)) < 60).all(axis=2) & (np.ptp(picture, axis=2) > 90))
    box, low = canvas.bounding_box(), rows > rows.max() - 12
    x, y = box["x"] + columns[low].mean(), box["y"] + rows.max() - 6
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y + 5, steps=4)
    page.mouse.up()
    after = page.input_value("#fixture-x"), page.input_value("#fixture-y"), page.input_value("#fixture-z")
    assert after[:2] != before[:2]
    assert after[2] == before[2], "the ball is dragged level"
    page.locator("#fixture-error", has_text="was").wait_for()
    assert shows_something(page)
    check_page(page)


def tick_on_a_phone(page):
    page.click("text=Go to the cell")
    page.set_viewport_size({"width": 390, "height": 844})
    page.fill("#serial", "KR6-0815")
    page.click("text=To the checklist")
    page.click("text=KR6-0815 is a new robot: add it")
    page.wait_for_selector(".checklist")
    page.check("#step-1")
    page.reload()
    assert page.is_checked("#step-1")
    check_page(page, "session on a phone")
    page.set_viewport_size({"width": 1280, "height": 900})


def test_from_cell_to_program_and_from_log_to_calibration(page, tmp_path):
    cell = small_cell("kuka-kr6-r700/edbb", tmp_path / "cell", ("candidates = 3000", "candidates = 1200"))
    page.goto("/")
    check_page(page, "robots")
    page.set_input_files("#cell-file", cell)
    page.click("text=Check the cell")
    page.wait_for_selector("#view canvas")
    page.locator("#fixture-error", has_text="mm after").wait_for()
    check_page(page, "cell")
    check_sensitivity(page, "cell")

    drag_fixture(page)
    for axis, value in zip("xyz", PLACE, strict=True):
        page.fill(f"#fixture-{axis}", value)
    page.fill("#poses", "30")
    page.click("#plan-form button:has-text('Plan')")
    page.wait_for_selector("text=What was planned")
    plan = page.url.rpartition("/")[2]
    page.wait_for_selector("#view svg.still")
    check_page(page, "plan")
    page.click("#turn")
    page.wait_for_selector("#view canvas")
    page.locator("#time").fill("100")
    assert "axes" in page.inner_text("#frame-text")
    with page.expect_download() as program:
        page.click("section:has-text('Programs') li a >> nth=0")
    assert program.value.path().stat().st_size > 1000

    tick_on_a_phone(page)
    page.click("text=The run is measured")
    page.click("#simulate")
    page.wait_for_selector("#run-chart svg")
    check_page(page, "log")
    page.uncheck("#trace")
    page.click("#identify")
    page.wait_for_selector("#report .big")
    before = re.search(r"uncalibrated\s([\d.]+)\smm", page.inner_text("#report h1"))
    assert before
    assert float(page.inner_text("#report .big").split()[0]) < float(before[1])
    check_page(page, "calibration")
    page.click("text=Certificate")
    page.wait_for_selector("text=A certificate is of one robot")
    check_page(page, "certificate")
    page.goto(f"/compare?first={plan}&second={plan}")
    check_page(page, "two plans")
