"""Many clients at once at a service whose jobs take no time: everything happens at the same moment, nothing breaks.

``python -m tests.service.stress [SECONDS]`` runs it by itself, and prints what was answered how often.
"""

import random
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import httpx
import uvicorn

from planner.service import runner
from planner.service.serving import add_guard
from tests.service.conftest import settings
from tests.service.test_remote import TARGETS

CLIENTS = 30


class QuickProcess:
    """Stands for the process of a job: what it writes is there at once, and alike for many jobs."""

    id = 0

    def __init__(self, _, folder):
        results = folder / runner.INPUT_FOLDER / runner.RESULTS
        (results / "plan.json").write_text(f'{{"schema": "edbb-plan/1", "plan_id": "{random.randrange(4):012x}"}}')
        for name in ("printed", "log"):
            (folder / name).write_text("the same of every job\n")

    def exit_code(self):
        return 0 if random.random() < 0.7 else None

    def kill(self):
        pass

    def memory(self):
        return 0


@contextmanager
def serving(folder):
    """The address of a service in this process, with jobs that take no time."""
    real, runner.ProcessGroup = runner.ProcessGroup, QuickProcess
    config = uvicorn.Config(add_guard(settings(folder)), port=0, log_level="critical", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            time.sleep(0.01)
        yield f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()
        runner.ProcessGroup = real


class Client:
    """One of many: does at random what pages and programs do."""

    def __init__(self, address, seed):
        self.http, self.rng = httpx.Client(base_url=address, timeout=60.0), random.Random(seed)
        self.answers, self.faults, self.known = Counter(), [], []

    def ask(self, method, path, **named):
        answer = self.http.request(method, path, **named)
        self.answers[f"{method} {answer.status_code}"] += 1
        if answer.status_code >= 500:
            self.faults.append(f"{method} {path}: {answer.status_code} {answer.text[:200]}")
        return answer

    def submit(self):
        """One of few plans: others have asked for it too."""
        asked = {"cell": "ur10/edbb", "poses": self.rng.randrange(30, 50)}
        self.know(self.ask("POST", "/api/plans", json=asked))

    def follow(self):
        """What starts from a plan that others may be deleting."""
        path, extra = self.rng.choice((("simulations", {}), ("plan-views", {}), ("exports", {"dialect": "rapid"})))
        self.know(self.ask("POST", f"/api/{path}", json={"plan": self.one(), **extra}))

    def send(self):
        name = self.rng.choice(("targets.csv", "run.csv"))
        sent = self.ask("POST", "/api/files", params={"name": name}, content=TARGETS)
        if sent.status_code == 201:
            got = self.ask("GET", f"/api/files/{sent.json()['id']}")
            if got.text != TARGETS:
                self.faults.append(f"a file that was sent is not there: {got.status_code}")

    def know(self, answer):
        if answer.status_code == 202:
            self.known = [*self.known, answer.json()["id"]][-20:]

    def one(self):
        listed = self.known
        if self.rng.random() < 0.7:
            listed = [j["id"] for j in self.ask("GET", "/api/jobs", params={"most": 30, "tasks": True}).json()]
        return self.rng.choice(listed) if listed else "0" * 24

    def read(self):
        job = self.ask("GET", f"/api/jobs/{self.one()}")
        for file in job.json().get("files", []):
            self.ask("GET", file["url"])
        self.ask("GET", f"/api/jobs/{self.one()}/result")

    def change(self):
        changes = {"note": "x", "archived": self.rng.random() < 0.5}
        self.ask("PATCH", f"/api/jobs/{self.one()}", json=changes)

    def tick(self):
        ticks = [{"step": "step-1", "done": True, "at": "2026-01-01T00:00:00Z"}]
        self.ask("PUT", "/api/records/S-1", json={"robot": "kuka-kr6-r700"})
        begun = self.ask("POST", "/api/sessions", json={"plan": self.one(), "serial": "S-1"})
        if begun.status_code == 201:
            self.ask("POST", f"/api{begun.json()['url']}/ticks", json={"ticks": ticks})

    def look(self):
        pages = ("/", "/jobs", "/calibrate", f"/jobs/{self.one()}", "/metrics", "/api/health", "/api/records", "/deeds")
        self.ask("GET", self.rng.choice(pages))
        self.ask("GET", "/api/events", params={"wait": False, "after": 0})

    def run(self, until):
        deeds = (
            *[self.submit] * 3, *[self.follow] * 2, *[self.read] * 3, self.send, self.change, self.tick, self.look,
            lambda: self.ask("POST", f"/api/jobs/{self.one()}/cancel"),
            *[lambda: self.ask("DELETE", f"/api/jobs/{self.one()}")] * 3,
        )  # fmt: skip
        while time.monotonic() < until:
            try:
                self.rng.choice(deeds)()
            except Exception as err:
                self.faults.append(repr(err))


def stress(folder, seconds, clients=CLIENTS):
    """What was answered how often, and what should not have been."""
    with serving(folder) as address:
        made, until = [Client(address, seed) for seed in range(clients)], time.monotonic() + seconds
        threads = [threading.Thread(target=c.run, args=(until,)) for c in made]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return sum((c.answers for c in made), Counter()), [f for c in made for f in c.faults]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        answers, faults = stress(Path(place), float(sys.argv[1]) if len(sys.argv) > 1 else 60.0)
    print(dict(sorted(answers.items())), f"{sum(answers.values())} answers", *sorted(set(faults)), sep="\n")
    raise SystemExit(bool(faults))
