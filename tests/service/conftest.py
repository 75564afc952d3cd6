"""A service in this process, as a browser on this machine reaches it."""

import re
import subprocess
import sys
import time

import pytest
from fastapi.testclient import TestClient

from planner.service.serving import guarded_app
from planner.service.settings import JobLimits, ServiceSettings

AT_HOME = "http://127.0.0.1:8017"


def settings(folder, **changes):
    return ServiceSettings(**{"folder": folder, "workers": 2, "limits": JobLimits(3 << 30, 120.0), **changes})


def client_of(folder, **changes):
    return TestClient(guarded_app(settings(folder, **changes)), base_url=AT_HOME, raise_server_exceptions=False)


@pytest.fixture(scope="session")
def client(tmp_path_factory):
    with client_of(tmp_path_factory.mktemp("service")) as made:
        yield made


def ended(client, answer):
    """The job, once it has ended."""
    assert answer.status_code == 202, answer.text
    for _ in range(1200):
        job = client.get(answer.headers["location"]).json()
        if job["state"] not in ("queued", "running"):
            return job
        time.sleep(0.05)
    raise AssertionError(job)


def upload(client, route, data, name):
    answer = client.post(f"/api/{route}", params={"name": name}, content=data)
    assert answer.status_code == 201, answer.text
    return {"id": answer.json()["id"], "name": name}


@pytest.fixture
def service(tmp_path):
    """The address and process of a service of its own."""
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(tmp_path / "data")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        yield re.search(r"http://\S+?(?=,)", server.stderr.readline())[0], server.pid
        server.terminate()
