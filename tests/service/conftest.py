"""A service in this process, as a browser on this machine reaches it."""

import re
import subprocess
import sys
import time
from functools import partial

import pytest
from argon2 import PasswordHasher
from fastapi.testclient import TestClient

from planner.service.serving import add_guard
from planner.service.settings import JobLimits, ServiceSettings

AT_HOME = "http://127.0.0.1:8017"
PATIENCE_S = 300.0  # of a test that waits for what should happen soon


@pytest.fixture(scope="session", autouse=True)
def quick_passwords():
    """Passwords whose check costs little: their number is tested, not the cost, which the library decides."""
    with pytest.MonkeyPatch.context() as patch:
        cheap = partial(PasswordHasher, time_cost=1, memory_cost=64, parallelism=1)
        patch.setattr("planner.service.people.PasswordHasher", cheap)
        yield


def settings(folder, **changes):
    return ServiceSettings(**{"folder": folder, "workers": 2, "limits": JobLimits(3 << 30, 120.0), **changes})


def client_of(folder, **changes):
    return TestClient(add_guard(settings(folder, **changes)), base_url=AT_HOME, raise_server_exceptions=False)


@pytest.fixture(scope="session")
def client(tmp_path_factory):
    with client_of(tmp_path_factory.mktemp("service")) as made:
        yield made


def ended(client, answer):
    """The job, once it has ended."""
    assert answer.status_code == 202, answer.text
    at = answer.headers["location"]
    wait_until(lambda: client.get(at).json()["state"] not in ("queued", "running"))
    return client.get(at).json()


def wait_until(is_so, seconds=PATIENCE_S, pause_s=0.05):
    """Wait until something is so; the machine may be busy."""
    until = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < until, "it did not come about"
        time.sleep(pause_s)


def address_of(server):
    """Where a service listens, once it says so."""
    while not (found := re.search(r"http://\S+?(?=,)", line := server.stderr.readline())):
        assert line, "it ended"
    return found[0]


def upload(client, route, data, name):
    answer = client.post(f"/api/{route}", params={"name": name}, content=data)
    assert answer.status_code == 201, answer.text
    return {"id": answer.json()["id"], "name": name}


def begin_session(client, plan, serial="KR6-0815", robot="kuka-kr6-r700"):
    """The page of the session of a robot that is measured by a plan."""
    assert client.put(f"/api/records/{serial}", json={"robot": robot}).status_code == 200
    begun = client.post("/api/sessions", json={"plan": plan, "serial": serial})
    assert begun.status_code == 201, begun.text
    return begun.json()["url"]


@pytest.fixture
def service(tmp_path):
    """The address and process of a service of its own."""
    command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", str(tmp_path / "data")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        yield address_of(server), server.pid
        server.terminate()
