"""The pages of the service in a browser, of a folder in which two plans lie."""

import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from planner.service.job_record import JobOutput
from tests.service.conftest import address_of, begin_session
from tests.service.test_crashes import CHEAP, Store

PLAN = Path(__file__).parents[1] / "data" / "kr6-plan"
PLANS = ("a" * 24, "b" * 24)


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A service whose folder holds two plans."""
    folder = tmp_path_factory.mktemp("service")
    store = Store(folder)
    plan = {name: (PLAN / name).read_bytes() for name in ("plan.json", "cell.toml")}
    for id in PLANS:
        store.jobs.submit(id, "plan", "a plan", "{}", CHEAP)
        outputs = [JobOutput(name, store.files.add(data), len(data)) for name, data in plan.items()]
        assert store.jobs.finish(store.jobs.take(2), "done", outputs, 0, None)
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(folder)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        at = address_of(server)
        with httpx.Client(base_url=at, timeout=60) as client:
            begin_session(client, PLANS[0])
        yield at
        server.terminate()


@pytest.mark.parametrize(
    "page",
    [
        "", "jobs", "calibrate", "deeds", "cells/ur10/edbb", f"jobs/{PLANS[0]}", f"jobs/{PLANS[0]}/session",
        f"compare?first={PLANS[0]}&second={PLANS[1]}", "jobs?q=kr6", "robots/KR6-0815",
    ],
)  # fmt: skip
def test_a_page_is_silent_and_no_wider_than_a_phone(browser, address, page):
    browser.check_page(f"{address.rstrip('/')}/{page}")
