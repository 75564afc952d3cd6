"""Faults that were found once: each is held here by what a person or a program would have met."""

import asyncio
import os
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace

import pytest

from planner.common.errors import InputError
from planner.common.files import INPUTS
from planner.kinematics.bodies import BodyFile
from planner.service import file_api, job_store, methods, serving
from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_process import DAMAGED
from planner.service.job_record import JobCommand, JobInput
from planner.service.job_requests import CommandRequest
from planner.service.job_store import MOST_DEATHS
from planner.service.serving import build_context, start_notices
from planner.service.settings import GB, JobShares, share_memory
from tests.service.conftest import client_of, ended, settings, upload
from tests.service.test_crashes import CHEAP, Store
from tests.service.test_interface import CELL
from tests.service.test_troubles import JOB, done_in


@pytest.mark.slow
def test_a_damaged_file_that_is_sent_again_heals_its_job(tmp_path):
    store = Store(tmp_path)
    sent = store.files.add(b"whole")
    command = replace(CHEAP, inputs=(JobInput("a.txt", sent),))
    for damage in (lambda p: p.write_bytes(b"broken"), lambda p: p.unlink()):
        damage(store.files.path(sent))
        store = Store(tmp_path)
        store.jobs.submit(JOB, "plan", "cheap", "{}", command)
        job = done_in(store)
        assert (job.state, job.exit_code) == ("failed", None)
        assert "a.txt" in job.problem.detail
        assert "end it again" in job.problem.detail
        store.files.add(b"whole")
    store = Store(tmp_path)
    store.jobs.submit(JOB, "plan", "cheap", "{}", command)
    assert done_in(store).state == "done"


@pytest.mark.parametrize(("code", "tried"), [(4, True), (1, True), (None, True), (2, False), (3, False)])
def test_a_job_whose_program_was_missing_is_tried_again(tmp_path, code, tried):
    store = Store(tmp_path)
    store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    store.jobs.finish(store.jobs.take(2), "failed", [], code, None)
    assert (store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP).state == "queued") is tried


def test_a_job_that_takes_its_server_along_is_given_up(tmp_path):
    store = Store(tmp_path)
    store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    for _ in range(MOST_DEATHS):
        assert store.jobs.take(2).state == "running"
        with store.jobs._db.write() as db:
            db.execute("UPDATE jobs SET owner = ?", (job_store.own_name().rpartition(":")[0] + ":0",))  # it has died
    assert store.jobs.take(2) is None
    job = store.jobs.get(JOB)
    assert (job.state, job.exit_code) == ("failed", None)
    assert f"killed or broke down {MOST_DEATHS} times" in job.problem.detail
    assert [e.kind for e in store.jobs.events_after(0, [JOB])].count("end") == 1
    assert store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP).state == "queued", "a person may try again"


def test_a_clock_that_is_set_does_not_start_running_jobs_anew(tmp_path, monkeypatch):
    """Forward or back by a day; a server that really does not renew its lease is still found."""
    store, real, steady = Store(tmp_path), time.time, time.monotonic
    store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    job = store.jobs.take(2)
    for step in (86_400, -86_400):
        monkeypatch.setattr(time, "time", lambda step=step: real() + step)
        assert store.jobs.running_jobs() == {f"{JOB}-{job.fence}"}
    monkeypatch.setattr(time, "monotonic", lambda: steady() + job_store.LEASE_S + 1)
    assert store.jobs.running_jobs() == set()
    assert store.jobs.get(JOB).state == "queued"


@pytest.mark.parametrize("total", [1 * GB, 4 * GB, 16 * GB, 512 * GB])
@pytest.mark.parametrize("workers", [1, 2, 7, 64])
@pytest.mark.parametrize("asked", [None, GB // 2, 6 * GB])
def test_the_limits_of_all_jobs_together_stay_within_the_machine(total, workers, asked):
    if asked and asked > 0.9 * total:
        with pytest.raises(InputError, match="--memory-gb 6: this machine has"):
            share_memory(workers, asked, total)
        return
    shares = share_memory(workers, asked, total)
    assert (shares.workers + shares.beside) * shares.memory_bytes <= total
    assert 1 <= shares.workers <= workers
    assert asked in (None, shares.memory_bytes)


def test_where_no_memory_is_left_no_task_runs_beside(tmp_path):
    store = Store(tmp_path)
    store.jobs.submit(JOB, "plan", "cheap", "{}", CHEAP)
    assert store.jobs.take(1, beside=0)
    store.jobs.submit("1" * 24, "cell-check", "short", "{}", replace(CHEAP, task=True))
    assert store.jobs.take(1, beside=0) is None
    assert store.jobs.take(1, beside=1)


@pytest.mark.parametrize(
    "word", ["-o/etc/x", "-fo/etc/x", "--cell=/etc/x", "/etc/x", "a,/etc/x", "a//etc", "a:/x", "../x"]
)
def test_no_word_leads_out_of_the_folder(word):
    with pytest.raises(InputError, match="leads out of the folder"):
        CommandRequest(words=["plan", "ur10/edbb", word])


def test_words_between_names_pass():
    for word in ("ur10/edbb", "-o", "out/a.csv", "--cell=a1/cell.toml", "theta3_deg=-0.2", "a1/b-2/run.csv"):
        CommandRequest(words=["plan", word])


def test_where_jobs_cannot_be_confined_it_is_said(monkeypatch):
    shares = JobShares(workers=2, beside=1, memory_bytes=2 * GB)
    assert start_notices(4, shares) == ["jobs at a time: 2, not 4, as each may use 2 GB and has a core"]
    monkeypatch.setattr(serving, "confinement_version", lambda: 0)
    assert "no Landlock" in start_notices(None, shares)[0]


@pytest.mark.slow
def test_a_wrong_option_is_told_as_the_command_line_tells_it(client):
    job = ended(client, client.post("/api/commands", json={"words": ["plan", "ur10/edbb", "--poses", "many"]}))
    assert (job["exit_code"], job["problem"]["title"]) == (2, "The input is wrong")
    expected = "Invalid value for '--poses': Input should be a valid integer, unable to parse string as an integer"
    assert job["problem"]["detail"] == expected


def test_a_mesh_outside_does_not_tell_whether_it_is_there(tmp_path, monkeypatch):
    (tmp_path / "there.stl").write_bytes(b"x")
    (tmp_path / "job").mkdir()
    monkeypatch.setattr(INPUTS, "_within", (tmp_path / "job",))
    said = []
    for name in ("there", "none_"):
        with pytest.raises(InputError) as told:
            BodyFile(kind="mesh", file=f"../{name}.stl").body("x", tmp_path / "job")
        said.append(str(told.value).replace(name, ""))
    assert said[0] == said[1]
    assert "outside the folder of this job" in said[0]


@pytest.mark.parametrize("origin", ["http://[", "null", "http://[::1", "//", "http://evil.example"])
def test_an_origin_that_is_none_is_refused(client, origin):
    assert client.get("/api/robots", headers={"origin": origin}).status_code == 403


@pytest.mark.parametrize(
    "path", ["/", "/api/robots", "/api/events", "/static/style.css", "/api/cells/ur10/edbb", "/no"]
)
def test_head_is_get_without_the_body(client, path):
    got = client.get(path, params={"wait": "false"})
    head = client.head(path)
    assert (head.status_code, head.content) == (got.status_code, b"")
    assert head.headers["content-type"] == got.headers["content-type"]
    assert head.headers.get("content-length") == got.headers.get("content-length")


@pytest.mark.parametrize(
    ("path", "allowed"),
    [("/api/runs", "GET, HEAD, OPTIONS, POST"), ("/api/plans", "OPTIONS, POST"), ("/static/x", "GET, HEAD, OPTIONS")],
)
def test_options_tells_what_a_path_takes(client, path, allowed):
    answer = client.options(path)
    assert (answer.status_code, answer.headers["allow"]) == (204, allowed)
    assert client.options("/nowhere").status_code == 404


def test_a_damaged_store_is_one_sentence(tmp_path):
    """Pages of the file are overwritten: at the start and while it serves."""
    store = Store(tmp_path)
    for k in range(300):
        store.jobs.submit(f"{k:024x}", "plan", "x" * 200, "{}", CHEAP)
    store.jobs._db.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    store.jobs._db.connection.close()
    path = tmp_path / "jobs.sqlite3"
    with client_of(tmp_path) as client:
        client.app._app._app.state.context.supervisor.stop()
        size = path.stat().st_size
        with path.open("r+b") as file:
            file.seek(4096)
            file.write(b"\xff" * (size - 4096))
        for url in ("/api/jobs", "/jobs/" + "0" * 24):
            answer = client.get(url)
            assert answer.status_code == 500
            assert "the store of jobs is damaged (" in answer.text.lower().replace("<p>", "")
    with pytest.raises(InputError, match="the store of jobs is damaged"):
        build_context(settings(tmp_path))


def test_a_store_of_the_version_before_is_taken_over(tmp_path):
    from planner.service.database import FIRST

    with sqlite3.connect(tmp_path / "jobs.sqlite3") as old:
        old.executescript(FIRST + "PRAGMA user_version = 1;")
        values = f"('{JOB}', 'plan', 'kept', '{{}}', '{{\"words\":[\"plan\"]}}', 'queued', 1.0)"
        old.execute(f"INSERT INTO jobs (id, kind, title, request, command, state, created) VALUES {values}")
    old.close()
    job = job_store.JobStore(Database(tmp_path / "jobs.sqlite3")).get(JOB)
    assert (job.title, job.command, job.state) == ("kept", JobCommand(("plan",)), "queued")


def test_a_large_upload_does_not_hold_up_others(tmp_path, monkeypatch):
    """While the disk takes its time to keep a file, the loop that serves everybody goes on."""
    served, finish = threading.Event(), FileStore.finish
    monkeypatch.setattr(
        FileStore, "finish", lambda *a, **k: finish(*a, **k) if served.wait(PATIENCE_S) else pytest.fail("held up")
    )

    class Sent:
        async def chunks(self):
            yield b"data"

        def stream(self):
            return self.chunks()

    async def receive_while_serving():
        sending = asyncio.create_task(file_api.receive_body(Sent(), FileStore(tmp_path), "a", None, print))
        for _ in range(20):
            await asyncio.sleep(0.01)
            assert not sending.done()  # it waits for the disk
        served.set()
        return await sending

    assert asyncio.run(receive_while_serving()).size == 4


PATIENCE_S = 60.0  # of a test: the machine may be busy


@pytest.fixture(scope="module")
def impatient_server(tmp_path_factory):
    """A service that waits 1 s for headers, and as long for a body that is no upload."""
    code = (
        "import planner.service.methods as c, planner.service.guards as g, sys; c.HEADER_S = g.Guard.body_s = 1.0;"
        "from planner.cli.app import main;"
        f"sys.argv = ['edbb', 'serve', '--port', '0', '--data', {str(tmp_path_factory.mktemp('data'))!r}]; main()"
    )
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True) as server:
        while "http://" not in (line := server.stderr.readline()):
            assert line
        threading.Thread(target=server.stderr.read, daemon=True).start()  # so that it never waits for a reader
        yield int(line.partition(",")[0].rpartition(":")[2])
        server.terminate()


@pytest.fixture
def impatient(impatient_server):
    """Its port, once it serves again after what an earlier test did to it."""
    assert b"200" in ask_until_served(impatient_server)
    return impatient_server


def ask(port, path="/api/health"):
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as c:
        c.sendall(f"GET {path} HTTP/1.1\r\nhost: 127.0.0.1\r\nconnection: close\r\n\r\n".encode())
        return c.makefile("rb").readline()


def is_closed(connection):
    """Tell whether the other side closes a connection, after what it still has to say."""
    connection.settimeout(PATIENCE_S)
    try:
        while connection.recv(10_000):
            pass
    except ConnectionResetError:
        return True
    except TimeoutError:
        return False
    return True


SLOW_HEAD = b"GET / HTTP/1.1\r\nx"
SLOW_BODY = b"POST /login HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-length: 1000\r\n\r\nname"


@pytest.mark.parametrize("begun", [SLOW_HEAD, pytest.param(SLOW_BODY, marks=pytest.mark.slow)])
def test_connections_that_say_nothing_hold_off_nobody(impatient, begun):
    """A thousand and ten of one address that never finish what they ask: others are served, and these are closed."""
    held = []
    try:
        for _ in range(1010):
            c = socket.create_connection(("127.0.0.1", impatient), timeout=PATIENCE_S)
            held.append(c)
            with suppress(OSError):  # it was closed at once
                c.sendall(begun)
        assert b"200" in ask_until_served(impatient)
        assert all(is_closed(c) for c in held)
    finally:
        for c in held:
            c.close()


def ask_until_served(port):
    """What is answered once the door is free for this address."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        with suppress(OSError):
            if answer := ask(port):
                return answer
    return b""


def test_headers_without_an_end_are_not_taken(impatient):
    with socket.create_connection(("127.0.0.1", impatient), timeout=PATIENCE_S) as c:
        sent = 0
        with suppress(OSError):
            c.sendall(b"GET /login HTTP/1.1\r\nhost: 127.0.0.1\r\nx: ")
            while sent < 64 << 20:
                sent += c.send(b"y" * 65536)
        assert is_closed(c)
    assert sent < 16 << 20, "what is under way when it is closed, and no more"
    assert b"200" in ask(impatient)


def test_a_second_request_over_one_connection_has_the_same_time(impatient):
    with socket.create_connection(("127.0.0.1", impatient), timeout=PATIENCE_S) as c:
        c.sendall(b"GET /api/health HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n")
        assert c.recv(10_000)
        begun = time.monotonic()
        c.sendall(b"GET /api/hea")
        assert is_closed(c)
        assert time.monotonic() - begun > 0.9


def test_the_limits_at_the_door():
    assert methods.HEADER_S <= 20
    assert methods.MOST_WAITING * 9 < 1000, "nine addresses leave room for a tenth"
    assert DAMAGED not in (0, 1, 2, 3, 4, 5)
    assert os.path.exists("/proc/self/oom_score_adj") == (sys.platform == "linux")


@pytest.mark.slow
def test_a_cell_that_is_told_by_its_own_folder(client):
    """The sentence about a mesh outside is the same through a job."""
    mesh = '[[obstacles]]\nkind = "mesh"\nfile = "{}"\n'
    said = []
    for file in ("/etc/passwd", "/etc/nothing-is-here"):
        cell = upload(client, "cells", CELL + mesh.format(file), "cell.toml")
        job = ended(client, client.post("/api/cell-checks", json={"cell": cell["id"]}))
        said.append(job["problem"]["detail"].replace(os.path.basename(file), ""))
    assert said[0] == said[1]


@pytest.mark.slow
def test_a_cell_that_is_nested_without_end_is_told_as_wrong(tmp_path):
    with client_of(tmp_path, workers=0, beside=0) as client:
        cell = upload(client, "cells", b"a=" + b"[" * 100_000, "cell.toml")
        assert client.post("/api/plans", json={"cell": cell["id"]}).status_code == 202, "the job says what is wrong"
