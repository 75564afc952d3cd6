"""Many clients of a service at once, in a process of its own: how long a status takes while plans run.

``python -m tests.benchmarks.service_load [ADDRESS]`` asks the service there, or one that it starts
(20 s on a quiet machine, 3 min at most), and then prints a table.
"""

import asyncio
import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlsplit

import numpy as np

POLLING, SUBMITTING, STREAMS, SECONDS = 50, 10, 5, 10.0
EACH_S = 1.0  # a client asks so often
BOUND_S = 180  # it ends there, whatever has come
WARM_S = 3.0  # until the first plans run


class Connection:
    """HTTP/1.1 over one kept connection, with as little work as possible: the server is what is measured."""

    def __init__(self, reader, writer, host):
        self._reader, self._writer, self._host = reader, writer, host

    @classmethod
    async def open(cls, address):
        where = urlsplit(address)
        return cls(*await asyncio.open_connection(where.hostname, where.port), where.netloc)

    def send(self, method, path, body=b""):
        head = f"{method} {path} HTTP/1.1\r\nhost: {self._host}\r\ncontent-type: application/json\r\n"
        self._writer.write(f"{head}content-length: {len(body)}\r\n\r\n".encode() + body)

    async def ask(self, method, path, content=None):
        self.send(method, path, b"" if content is None else json.dumps(content).encode())
        head = await self._reader.readuntil(b"\r\n\r\n")
        length = int(re.search(rb"content-length: (\d+)", head)[1])
        return int(head.split(b" ", 2)[1]), await self._reader.readexactly(length)

    async def next_line(self):
        return await self._reader.readline()


async def poll(address, job, until, waits, phase):
    c = await Connection.open(address)
    await asyncio.sleep(phase)
    while time.monotonic() < until:
        begun = time.monotonic()
        status, _ = await c.ask("GET", f"/api/jobs/{job}")
        waits.append(time.monotonic() - begun)
        assert status == 200
        await asyncio.sleep(EACH_S)


async def submit(address, number, until, made):
    c, seed = await Connection.open(address), 0
    await asyncio.sleep(number * EACH_S / SUBMITTING)
    while time.monotonic() < until:
        seed += 1
        status, answer = await c.ask(
            "POST", "/api/plans", {"cell": "ur10/edbb", "poses": 20, "seed": 1000 * number + seed}
        )
        assert status == 202
        made.append(json.loads(answer)["id"])
        await asyncio.sleep(EACH_S)


async def listen(address, until, events):
    c = await Connection.open(address)
    c.send("GET", "/api/events")
    while (left := until - time.monotonic()) > 0:
        try:
            line = await asyncio.wait_for(c.next_line(), left)
        except TimeoutError:
            return
        if line.startswith(b"data: "):
            events.append(line)


async def load(address):
    """Return seconds that each status took, jobs that were accepted, and events that came."""
    asking = await Connection.open(address)
    _, first = await asking.ask("POST", "/api/plans", {"cell": "comau-nj130/edbb"})
    job = json.loads(first)["id"]
    await asking.ask("POST", "/api/plans", {"cell": "comau-nj130/edbb", "seed": 1})
    await asyncio.sleep(WARM_S)
    waits, made, events, until = [], [job], [], time.monotonic() + SECONDS
    work = [poll(address, job, until, waits, k * EACH_S / POLLING) for k in range(POLLING)]
    work += [submit(address, k, until, made) for k in range(SUBMITTING)]
    await asyncio.gather(*work, *(listen(address, until, events) for _ in range(STREAMS)))
    asking = await Connection.open(address)  # the server has closed the first, which was idle
    _, there = await asking.ask("GET", "/api/jobs?most=1000")
    for known in json.loads(there):
        await asking.ask("POST", f"/api/jobs/{known['id']}/cancel")
    return np.array(waits), len(made), len(events)


def measure(address):
    """Return times of a status in ms, and counts."""
    waits, made, events = asyncio.run(load(address))
    figures = {
        "median_ms": 1e3 * np.median(waits),
        "p99_ms": 1e3 * np.quantile(waits, 0.99),
        "max_ms": 1e3 * waits.max(),
    }
    counts = {"requests": len(waits), "accepted": made, "events": events}
    return {k: round(float(v), 2) for k, v in figures.items()} | counts


def main(address=None):
    if address is not None:
        print(json.dumps(measure(address)), flush=True)
        return
    signal.alarm(BOUND_S)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "planner.cli", "serve", "--port", "0", "--data", folder]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
            try:
                found = measure(re.search(r"http://\S+?(?=,)", server.stderr.readline())[0])
            finally:
                server.terminate()
    print(f"{POLLING} clients polling, {SUBMITTING} submitting, {STREAMS} event streams, {SECONDS:g} s\n")
    for row in (found, ["---"] * len(found), found.values()):
        print("|", " | ".join(map(str, row)), "|")


if __name__ == "__main__":
    main(*sys.argv[1:])
