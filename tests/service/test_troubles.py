"""A full disk, clients that vanish or stall, and a newer version that takes over: nothing accepted is lost."""

import asyncio
import errno
import threading
from collections import namedtuple
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

import planner.service.context as context
import planner.service.file_api as file_api
from planner.service.command import free_port
from planner.service.file_store import FileStore
from tests.service.conftest import client_of, wait_until
from tests.service.test_crashes import CHEAP, Store

JOB = "0" * 24


def done_in(store):
    """The job, once it has ended in a store whose supervisor runs."""
    store.supervisor.start()
    wait_until(lambda: store.jobs.get(JOB).ended)
    store.supervisor.stop()
    return store.jobs.get(JOB)


def test_a_full_disk_refuses_uploads_and_keeps_nothing(tmp_path, monkeypatch):
    usage = namedtuple("usage", "free")
    with client_of(tmp_path) as client:
        monkeypatch.setattr("planner.service.file_store.shutil.disk_usage", lambda _: usage(0))
        answer = client.post("/api/runs", params={"name": "run.csv"}, content=b"t_s\n1\n")
        assert (answer.status_code, answer.headers["content-type"]) == (507, "application/problem+json")
        assert "disk of the service is full" in answer.json()["detail"]
        monkeypatch.undo()
        assert client.get("/api/runs").json() == []
        assert client.post("/api/runs", params={"name": "run.csv"}, content=b"t_s\n1\n").status_code == 201
    assert not list((tmp_path / "drafts").iterdir())


@pytest.mark.slow
def test_a_result_that_found_no_room_is_computed_again_and_ends_once(tmp_path, monkeypatch):
    monkeypatch.setattr(context, "TROUBLE_S", 0.1)
    full, take = [True], FileStore.take

    def take_or_fail(self, path):
        if full.pop() if full else False:
            raise OSError(errno.ENOSPC, "No space left on device")
        return take(self, path)

    monkeypatch.setattr(FileStore, "take", take_or_fail)
    store = Store(tmp_path)
    store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    job = done_in(store)
    assert (job.state, job.crashes) == ("done", 1)
    assert [e.kind for e in store.jobs.events_after(0, [JOB], 100)].count("end") == 1
    assert len(store.jobs.outputs(JOB)) == 1


@pytest.mark.slow
def test_a_newer_version_takes_over_what_an_older_one_had_accepted(tmp_path):
    """The older one was killed at work; its lease has run out when the newer one starts."""
    old = Store(tmp_path)
    old.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    taken = old.jobs.take(2)
    with old.jobs._db.write() as db:
        db.execute("UPDATE jobs SET version = '0.0.1', owner = 'elsewhere:1:1', lease_until = 0")
    job = done_in(Store(tmp_path))
    assert (job.state, job.fence) == ("done", taken.fence + 1)
    assert not old.jobs.finish(taken, "failed", [], None, None)


def received(tmp_path, receive):
    """What comes of an upload whose client sends as ``receive`` does."""
    request = Request({"type": "http", "method": "POST", "headers": []}, receive)
    return asyncio.run(file_api.receive_body(request, FileStore(tmp_path), "run.csv", None, print))


@pytest.mark.slow
def test_clients_that_stall_or_vanish_leave_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(file_api, "STALL_S", 0.05)
    begun = []

    async def stall():
        if not begun:
            begun.append(1)
            return {"type": "http.request", "body": b"half", "more_body": True}
        await asyncio.sleep(30)

    with pytest.raises(HTTPException) as told:
        received(tmp_path, stall)
    assert told.value.status_code == 408

    async def vanish():
        return {"type": "http.disconnect"}

    with pytest.raises(ClientDisconnect):
        received(tmp_path, vanish)
    assert not list((tmp_path / "drafts").iterdir())
    assert not list((tmp_path / "files").iterdir())


def test_the_next_port_is_taken_where_another_program_has_the_first(monkeypatch):
    """For a person who double-clicks; where edbb itself answers, its page is shown."""
    said, shown = [b"a printer"], []
    monkeypatch.setattr("webbrowser.open", shown.append)

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.end_headers()
            self.wfile.write(said[0])

    with HTTPServer(("127.0.0.1", 0), Answer) as other:
        port = other.server_address[1]
        threading.Thread(target=other.serve_forever, daemon=True).start()
        assert port < free_port("127.0.0.1", port) < port + 10
        assert shown == []
        said[0] = b'{"jobs_waiting": 0}'
        assert free_port("127.0.0.1", port) is None
        assert shown == [f"http://127.0.0.1:{port}"]
        other.shutdown()
    assert free_port("127.0.0.1", port) == port
