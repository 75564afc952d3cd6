"""Pages in a real browser: silent, drawn, no wider than a phone, and asking for nothing from elsewhere.

The browser runs in a process of its own (``python -m tests.browser``), one for all tests of a worker: playwright's loop
of events then meets no other one, and a page's script is compiled once. It reads addresses and answers with findings,
a line of JSON each.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
MISSING = "there is no Chromium here, so no page is opened: apt-get install chromium"
DESK, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}  # [px]
MINUTES = 5 * 60_000  # of waiting at most: the machine may be busy
FLAGS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
DRIVER = "GL Driver Message"  # of the software that stands for a graphics card: what it says is not of the page
SETTLED = "async () => { for (let n = 0; n < 4; n++) await new Promise((done) => requestAnimationFrame(done)); }"
PLACES = '() => [...document.querySelectorAll(".chart, #view")].map((e) => e.id)'
OPENED = "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
IN_SPACE = (
    '() => !document.querySelector("#view") || document.querySelector("#view canvas, .still, #view p:not(.waiting)")'
)
# a chart is drawn where something of its panels has a size; the view in space has a picture or a canvas
EMPTY = """() => [...document.querySelectorAll(".chart, #view")].filter((place) => {
    const marks = [...place.querySelectorAll("svg path:not(.grid), svg g.series, svg image, canvas")];
    return !marks.some((m) => { const r = m.getBoundingClientRect(); return r.width + r.height > 0; });
  }).map((e) => e.id)"""
TICKS = r"""() => [...document.querySelectorAll(".chart")].flatMap((chart) =>
    [...chart.querySelectorAll(".across, .down")].map((axis, k) => [`${chart.id} ${k}`,
      [...axis.querySelectorAll(".tick")].map((t) => {
        const box = t.getBoundingClientRect();
        return [t.innerHTML, box.x + box.width / 2, box.y + box.height / 2];
      })]))"""
WIDEST = """() => [...document.querySelectorAll("body *")]
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1 && !e.closest(".scroll, table, svg"))
    .map((e) => e.outerHTML.slice(0, 120))"""


class Browser:
    """A browser in a process of its own."""

    def __init__(self) -> None:
        pipe = subprocess.PIPE
        command = [sys.executable, "-m", "tests.browser"]
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, encoding="utf-8")

    def open(self, address, shots=""):
        """Return what a browser finds at an address: console, requests, charts, empty ones, ticks, width."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([str(address), shots]), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())

    def check_report(self, file):
        """A report opens as it does for a person who was sent the file alone; return the names of its charts."""
        address = Path(file).resolve().as_uri()
        found = self.open(address)
        check_found(found)
        assert found["asked"] == [address], "it asks for nothing else"
        assert found["text"].startswith("edbb-planner"), "its head"
        assert re.search(r"· written \d{4}-\d\d-\d\d", found["text"].replace("\n", " ")), "its date"
        for axis, ticks in found["ticks"]:
            check_ticks(axis, ticks)
        return found["charts"]

    def check_page(self, address):
        """A page of the service opens, and asks for nothing beyond the service."""
        found = self.open(address)
        check_found(found)
        host = re.match(r"https?://[^/]+/", address)
        assert host
        assert [a for a in found["asked"] if not a.startswith(host[0])] == []

    def stop(self):
        """End the browser; one that does not close by itself has nothing more to say."""
        try:
            self._process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()


def check_found(found):
    """Nothing was said on the console, every chart is drawn, nothing is wider than the phone or the desk."""
    faults = {what: found[what] for what in ("console", "empty", "wide") if found[what]}
    assert not faults, faults


def check_ticks(axis, ticks):
    """The numbers at an axis differ, and rise or fall all the way."""
    across = len({round(y) for _, _, y in ticks}) < len({round(x) for _, x, _ in ticks})
    texts = [text for text, *_ in sorted(ticks, key=lambda t: t[1] if across else t[2])]
    assert len(set(texts)) == len(texts), (axis, texts)
    numbers = [re.sub(r"^10<sup>(.*)</sup>$", r"1e\1", t.replace("−", "-")) for t in texts]
    if all(re.fullmatch(r"-?[\d.]+(e-?\d+)?", n) for n in numbers) and "polar" not in axis:
        steps = [b - a for a, b in pairwise(float(n) for n in numbers)]
        assert all(s > 0 for s in steps) or all(s < 0 for s in steps), (axis, texts)


def require_browser():
    """Skip where there is no browser; where the suite must be whole, fail."""
    if CHROMIUM is None:
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(MISSING)


def look(page, address, shots):
    """Return what a browser finds at an address, loaded on a phone and then made wider."""
    console, asked = [], []
    heard = {
        "pageerror": lambda fault: console.append(f"script: {fault}"),
        "console": lambda line: console.append(f"{line.type}: {line.text}"),
        "request": lambda request: asked.append(request.url),
    }
    for what, hear in heard.items():
        page.on(what, hear)
    wide = []
    page.set_viewport_size(PHONE)
    page.goto(address)
    page.wait_for_function(IN_SPACE)
    for name, size in (("phone", PHONE), ("desk", DESK)):
        page.set_viewport_size(size)
        page.evaluate(OPENED)
        page.evaluate(SETTLED)
        if page.evaluate("document.documentElement.scrollWidth") > size["width"]:
            wide.append([name, *page.evaluate(WIDEST)])
        if shots:
            page.wait_for_timeout(400)
            page.screenshot(path=f"{shots}_{name}.png", full_page=True)
    found = {"charts": page.evaluate(PLACES), "empty": page.evaluate(EMPTY), "ticks": page.evaluate(TICKS)}
    if page.locator("#turn").count():  # behind the still picture there is a view that turns
        page.click("#turn")
        page.wait_for_selector("#view canvas")
        page.evaluate(SETTLED)
        found["empty"] += page.evaluate(EMPTY)
    found["text"] = page.evaluate("document.body.innerText.slice(0, 400)")
    for what, hear in heard.items():
        page.remove_listener(what, hear)
    return found | {
        "console": [text for text in console if DRIVER not in text],
        "asked": [a for a in asked if not a.startswith(("data:", "blob:"))],
        "wide": wide,
    }


def main():
    """Answer addresses until there are none."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as library:
        browser = library.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_context(viewport=PHONE).new_page()
        page.set_default_timeout(MINUTES)
        for line in sys.stdin:
            print(json.dumps(look(page, *json.loads(line))), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
