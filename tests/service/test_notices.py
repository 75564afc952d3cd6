"""Notices when a job ends, and the log of accesses."""

import hashlib
import hmac
import json
import logging
import re
import socket
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from urllib.parse import urlsplit

import pytest

from planner.common.errors import InputError
from planner.service.callers import Caller
from planner.service.database import Database
from planner.service.job_record import JobCommand
from planner.service.job_store import JobStore
from planner.service.methods import LOG, access_line, open_log
from planner.service.settings import WebhookSettings
from planner.service.webhook import BlockedAddressError, Notifier, is_public, resolve_host, send_notice
from tests.service.conftest import client_of, wait_until


class Receiver(HTTPServer):
    """Keeps what is sent to it; answers with the codes that it is given, then with 204."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        self.got: list[tuple[str, dict[str, str], bytes]] = []
        self.codes: list[int] = []
        self.url = f"http://127.0.0.1:{self.server_port}/hook?a=b"
        threading.Thread(target=self.serve_forever, daemon=True).start()


class Handler(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["content-length"]))
        server = self.server
        assert isinstance(server, Receiver)
        server.got.append((self.path, dict(self.headers), body))
        self.send_response(server.codes.pop(0) if server.codes else 204)
        self.send_header("location", "http://127.0.0.1:9/elsewhere")
        self.end_headers()

    def log_message(self, *_):
        pass


@pytest.fixture
def receiver():
    made = Receiver()
    yield made
    made.shutdown()
    made.server_close()


def end_job(store, number, task=False):
    store.submit(f"{number:024x}", "plan", f"plan {number}", "{}", JobCommand(("plan",), task=task), person="wanda")
    store.finish(store.take(9), "done", [], 0, None)


def test_each_job_that_ends_is_told_signed_and_also_after_a_crash(tmp_path, receiver):
    database = Database(tmp_path / "jobs.sqlite3")
    store = JobStore(database)
    settings = WebhookSettings((receiver.url,), private=True, secret="a secret of the plant", pauses_s=(0.05,))
    end_job(store, 1)  # before anybody wanted notices
    receiver.codes = [500, 302, 204]
    notifier = Notifier(settings, database, store)
    notifier.start()
    end_job(store, 2)
    end_job(store, 3, task=True)
    wait_until(lambda: len(receiver.got) == 3)
    notifier.stop()
    end_job(store, 4)  # while no server runs
    again = Notifier(settings, database, store)
    again.start()
    wait_until(lambda: len(receiver.got) == 4)
    again.stop()
    told = [json.loads(body) for _, _, body in receiver.got]
    assert [t["title"] for t in told] == ["plan 2", "plan 2", "plan 2", "plan 4"], "until it is taken, then no more"
    assert (told[0]["state"], told[0]["person"], told[0]["url"]) == ("done", "wanda", f"/api/jobs/{2:024x}")
    path, headers, body = receiver.got[0]
    signature = hmac.new(b"a secret of the plant", body, hashlib.sha256).hexdigest()
    assert (path, {k.lower(): v for k, v in headers.items()}["x-edbb-signature"]) == (
        "/hook?a=b",
        f"sha256={signature}",
    )


@pytest.mark.parametrize(
    ("address", "public"),
    [
        ("127.0.0.1", False), ("10.0.0.1", False), ("192.168.1.4", False), ("169.254.169.254", False),
        ("0.0.0.0", False), ("::1", False), ("fe80::1%eth0", False), ("fd00::1", False), ("::ffff:127.0.0.1", False),
        ("224.0.0.1", False), ("100.64.0.1", False), ("93.184.216.34", True), ("2606:2800:220:1::1", True),
    ],
)  # fmt: skip
def test_which_addresses_are_public(address, public):
    assert is_public(address) is public


def test_a_private_receiver_is_called_only_where_that_is_allowed(receiver, monkeypatch):
    with pytest.raises(BlockedAddressError, match="--webhook-private"):
        send_notice(receiver.url, b"{}", WebhookSettings((receiver.url,)))
    assert not receiver.got
    both = [(0, 0, 0, "", ("93.184.216.34", 80)), (0, 0, 0, "", ("127.0.0.1", 80))]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *a, **k: both)
    with pytest.raises(BlockedAddressError):
        resolve_host("two.example", 80, private=False)


def test_a_name_that_leads_elsewhere_in_between_is_not_followed(receiver, monkeypatch):
    """The address that was looked at is the one that is called, though the name is looked up once alone."""
    asked, called, connect = [], [], socket.create_connection
    port = urlsplit(receiver.url).port

    def resolve(host, port, **_):
        asked.append(host)
        return [(0, 0, 0, "", ("127.0.0.1", port))]

    def connect_to(address, **named):
        called.append(address)
        monkeypatch.undo()  # so that the connection itself is made as ever
        return connect(address, **named)

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    monkeypatch.setattr(socket, "create_connection", connect_to)
    url = f"http://mes.plant.example:{port}/"
    assert send_notice(url, b"{}", WebhookSettings((url,), private=True)) == 204
    assert (asked, called) == (["mes.plant.example"], [("127.0.0.1", port)])
    assert receiver.got[0][1]["Host"].startswith("mes.plant.example")


@pytest.mark.parametrize("url", ["ftp://x/", "file:///etc/passwd", "http://", "https://me:word@x.example/", "x"])
def test_addresses_that_are_none(url):
    with pytest.raises(InputError, match="--webhook"):
        WebhookSettings((url,))


LINE = re.compile(r'^(\S+) - (\S+) \[\d\d/\w{3}/\d{4}:\d\d:\d\d:\d\d \+0000\] "([^"]+)" (\d{3}) (\d+) (\d+\.\d{3})$')


@pytest.mark.slow
def test_each_request_is_a_line(tmp_path):
    with client_of(tmp_path, workers=0, beside=0, access_log=str(tmp_path / "access.log")) as client:
        open_log(str(tmp_path / "access.log"))
        client.get("/api/health")
        client.get("/jobs/%22%0aevil?q=%22x")
        client.get("/api/robots", headers={"host": "evil.example"})
    lines = (tmp_path / "access.log").read_text().splitlines()
    found = [LINE.match(line) for line in lines]
    assert all(found)
    assert [(m[3].split()[1], m[4]) for m in found] == [
        ("/api/health", "200"), ("/jobs/%22%0aevil?q=%22x", "404"), ("/api/robots", "421"),
    ]  # fmt: skip
    assert int(found[0][5]) > 10
    LOG.handlers[:] = [logging.NullHandler()]


def test_no_name_begins_a_line_or_ends_a_quotation():
    scope = {
        "method": "GET",
        "path": "/",
        "raw_path": b'/"\n',
        "query_string": b"a b",
        "edbb.caller": Caller('x" y\nz'),
    }
    line = access_line(scope, 200, 1, 0.5)
    assert LINE.match(line)
    assert "\n" not in line
    with pytest.raises(InputError, match="--access-log"):
        open_log("/nowhere/at/all.log")
