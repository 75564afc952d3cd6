"""Notices to other programs when a job ends: sent to the addresses that the service was started with, and no others.

What is to be sent is read from the events of the store, and how far it is noted there: nothing is forgotten by a crash,
and the same notice may come twice. A host of a private network is called only where that is allowed, by the address
that was looked at: a name cannot lead elsewhere in between. Redirects are not followed.
"""

import hashlib
import hmac
import http.client
import ipaddress
import json
import logging
import socket
import ssl
import threading
from typing import Any
from urllib.parse import SplitResult, urlsplit

from planner.service.answers import describe_job
from planner.service.database import Database
from planner.service.job_record import JobEvent
from planner.service.job_store import JobStore, UnknownJobError
from planner.service.settings import WebhookSettings

LOG = logging.getLogger("edbb.service")


class BlockedAddressError(OSError):
    """A receiver lies where notices may not go."""


def resolve_host(host: str, port: int, private: bool) -> str:
    """Return the address of a host.

    Raises:
        OSError: it has none, or one of them is private and may not be called.
    """
    found = [str(info[4][0]) for info in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)]
    for address in found:
        if not private and not is_public(address):
            raise BlockedAddressError(f"{host} is {address}, of a private network; --webhook-private allows it")
    return found[0]


def is_public(address: str) -> bool:
    """Tell whether an address can be reached from everywhere."""
    parsed = ipaddress.ip_address(address.partition("%")[0])
    mapped = parsed.ipv4_mapped if isinstance(parsed, ipaddress.IPv6Address) else None
    return (mapped or parsed).is_global and not (mapped or parsed).is_multicast


def send_notice(url: str, body: bytes, settings: WebhookSettings) -> int:
    """Send a notice; return the status of the answer.

    Raises:
        OSError: nobody takes it.
    """
    parts: SplitResult = urlsplit(url)
    host, secure = str(parts.hostname), parts.scheme == "https"
    port = parts.port or (443 if secure else 80)
    address = resolve_host(host, port, settings.private)
    connection = http.client.HTTPConnection(host, port, timeout=settings.answer_s)
    try:
        connection.sock = socket.create_connection((address, port), timeout=settings.answer_s)
        if secure:
            connection.sock = ssl.create_default_context().wrap_socket(connection.sock, server_hostname=host)
        headers = {"content-type": "application/json", "user-agent": "edbb"}
        if settings.secret:
            signature = hmac.new(settings.secret.encode(), body, hashlib.sha256).hexdigest()
            headers["x-edbb-signature"] = f"sha256={signature}"
        path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        connection.request("POST", path, body, headers)
        return connection.getresponse().status
    except http.client.HTTPException as err:
        raise OSError(f"no answer of HTTP: {err}") from err
    finally:
        connection.close()


class Notifier:
    """The threads that send notices, one an address, so that one that is gone holds off no other."""

    def __init__(self, settings: WebhookSettings, database: Database, jobs: JobStore) -> None:
        self._settings, self._db, self._jobs = settings, database, jobs
        self._stopping = threading.Event()
        self._threads = [
            threading.Thread(target=self._run, args=(url,), name="webhook", daemon=True) for url in settings.urls
        ]

    def start(self) -> None:
        """Begin with the next event; where notices were sent before, with those that nobody took."""
        last = self._jobs.last_event()
        with self._db.write() as db:
            for url in self._settings.urls:
                db.execute("INSERT OR IGNORE INTO notices VALUES (?, ?)", (url, last))
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop sending; the next server sends the notices that are left."""
        self._stopping.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join()

    def _run(self, url: str) -> None:
        tries, pauses = 0, self._settings.pauses_s
        while not self._stopping.wait(pauses[min(tries, len(pauses)) - 1] if tries else 0.5):  # [s] to the next look
            try:
                tries = 0 if self._send_next(url) else tries + 1
            except Exception:  # of the store
                LOG.exception("a notice to %s failed", url)
                tries += 1

    def _send_next(self, url: str) -> bool:
        """Send what has happened since the last notice; return whether all of it was taken."""
        rows = self._db.read("SELECT last FROM notices WHERE url = ?", url)
        for event in self._jobs.events_after(int(rows[0]["last"]), []):
            body = self._notice(event) if event.kind == "end" else None
            if body is not None and not self._is_taken(url, body):
                return False
            with self._db.write() as db:
                db.execute("UPDATE notices SET last = ? WHERE url = ?", (event.id, url))
            if self._stopping.is_set():
                break
        return True

    def _notice(self, event: JobEvent) -> bytes | None:
        """Return the notice about a job; ``None`` for one that is gone or only served a page."""
        try:
            job = self._jobs.get(event.job)
        except UnknownJobError:
            return None
        if job.command.task:
            return None
        said: dict[str, Any] = describe_job(job, []).model_dump(mode="json", exclude={"files", "request", "stage"})
        return json.dumps({"event": event.id} | said).encode()

    def _is_taken(self, url: str, body: bytes) -> bool:
        try:
            status = send_notice(url, body, self._settings)
        except OSError as err:
            LOG.error("the notice to %s was not taken: %s", url, err)
            return False
        if status >= 300:
            LOG.error("the notice to %s was not taken: it answers %d", url, status)
        return status < 300
