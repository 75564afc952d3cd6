"""Pages of the service as a browser shows them."""

import re
import shutil
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

SIZE = (1100, 760)  # [px]
COLOURS = 64  # of a picture: pages have few, and the file stays small
PATIENCE_MS = 300_000  # the machine may be busy


def start_page() -> bytes:
    """Return the first page, as a double click shows it."""
    with tempfile.TemporaryDirectory() as folder, _Service(Path(folder)) as page:
        page.wait_for_selector("text=Nothing yet")
        return _picture(page)


def calibrate_page(plan: Path) -> bytes:
    """Return the page *Calibrate* with a plan that was made elsewhere, and a simulated run of it."""
    with tempfile.TemporaryDirectory() as folder, _Service(Path(folder)) as page:
        page.goto("/calibrate")
        page.set_input_files("#made-elsewhere", plan.parent)
        page.wait_for_selector("text=It is taken")
        page.click("#simulate")
        page.wait_for_selector("#run-chart svg")
        page.set_viewport_size({"width": SIZE[0], "height": 2 * SIZE[1]})
        return _picture(page)


class _Service:
    """A service on this machine, and a browser that shows its first page."""

    def __init__(self, folder: Path) -> None:
        self._command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(folder / "data")]

    def __enter__(self) -> Page:
        self._process = subprocess.Popen(self._command, stderr=subprocess.PIPE, text=True)
        assert self._process.stderr is not None
        address = next(found[0] for line in self._process.stderr if (found := re.search(r"http://[\w.:]+", line)))
        self._library = sync_playwright().start()
        self._browser = self._library.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        size = {"width": SIZE[0], "height": SIZE[1]}
        page = self._browser.new_page(base_url=address, viewport=size)
        page.set_default_timeout(PATIENCE_MS)
        page.goto("/")
        return page

    def __exit__(self, *failed: object) -> None:
        self._browser.close()
        self._library.stop()
        self._process.terminate()
        self._process.wait()


def _picture(page: Page) -> bytes:
    """Return what the browser shows as a small PNG."""
    made = BytesIO()
    Image.open(BytesIO(page.screenshot())).convert("RGB").quantize(COLOURS).save(made, "png", optimize=True)
    return made.getvalue()
