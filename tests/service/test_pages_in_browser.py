"""The pages of the service in a browser, of a folder in which two plans and a calibration lie."""

import subprocess
import sys
from pathlib import Path

import httpx
import numpy as np
import pytest

from planner.common.files import document_text
from planner.report.chart import Chart, Panel, Series
from planner.report.page import report_judged_run
from planner.service.job_record import JobOutput
from tests.checks.test_record import calibration
from tests.service.conftest import address_of, begin_session
from tests.service.test_crashes import CHEAP, Store

PLAN = Path(__file__).parents[1] / "data" / "kr6-plan"
PLANS, CALIBRATION = ("a" * 24, "b" * 24), "c" * 24


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A service whose folder holds two plans and a calibration."""
    folder = tmp_path_factory.mktemp("service")
    store = Store(folder)
    plan = {name: (PLAN / name).read_bytes() for name in ("plan.json", "cell.toml")}
    chart = Chart(
        "one", "A line", "drawn", (Panel("", "x", "y", (Series("a", np.arange(3.0), np.arange(3.0), "#000"),)),)
    )
    wide = ("Wide", tuple(f"column {k}" for k in range(20)), [("1",) * 20])
    report = report_judged_run("Good for 0.5 mm", "run.csv", ["It is."], [], wide, chart).html()
    known = {"identification.json": document_text(calibration(0.01)).encode(), "report.html": report.encode()}
    for id, kind, files in (*((id, "plan", plan) for id in PLANS), (CALIBRATION, "identification", known)):
        store.jobs.submit(id, kind, kind, "{}", CHEAP)
        outputs = [JobOutput(name, store.files.add(data), len(data)) for name, data in files.items()]
        assert store.jobs.finish(store.jobs.take(2), "done", outputs, 0, None)
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(folder)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        at = address_of(server)
        with httpx.Client(base_url=at, timeout=60) as client:
            begin_session(client, PLANS[0])
        yield at
        server.terminate()


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        "", "jobs", "calibrate", "deeds", "cells/ur10/edbb", f"jobs/{PLANS[0]}", f"jobs/{PLANS[0]}/session",
        f"compare?first={PLANS[0]}&second={PLANS[1]}", "jobs?q=kr6", "robots/KR6-0815",
        f"jobs/{CALIBRATION}", f"jobs/{CALIBRATION}/correct",
    ],
)  # fmt: skip
def test_a_page_is_silent_and_no_wider_than_a_phone(browser, address, page):
    browser.check_page(f"{address.rstrip('/')}/{page}")
