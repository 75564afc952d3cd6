"""Workers on other machines, here with folders of their own over loopback: whatever dies, a job is done once."""

import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress

import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError, MissingProgramError
from planner.service.cluster import Cluster
from planner.service.settings import ClusterSettings, JobLimits
from tests.command import edbb
from tests.service.conftest import PATIENCE_S, upload, wait_until
from tests.service.test_crashes import children_of
from tests.service.test_remote import TARGETS

httpx = pytest.importorskip("httpx")
pytest.importorskip("distributed")
QUICK = {"DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "8s", "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "50"}
FILES = {"targets.csv": TARGETS}
TRIALS = 12
SEEDS = range(7, 16 if os.environ.get("EDBB_ALL_TRIALS") else 8)


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Plant:
    """A scheduler, a service and workers, each a process; each can be killed and begun again."""

    def __init__(self, folder, jobs=2, on_cluster=True):
        self.folder, self.processes, self.jobs, self.on_cluster = folder, {}, jobs, on_cluster
        self.scheduler, self.port = f"tcp://127.0.0.1:{free_port()}", free_port()
        self.client = httpx.Client(base_url=f"http://127.0.0.1:{self.port}", timeout=300)

    def begin(self, name):
        at = self.scheduler.rpartition(":")[2]
        modules = {
            "scheduler": ("distributed.cli.dask_scheduler", "--port", at, "--host", "127.0.0.1", "--no-dashboard"),
            "service": (
                "planner.cli", "serve", "--port", self.port, "--data", self.folder / "data", "--workers", self.jobs,
                *(("--cluster", self.scheduler) if self.on_cluster else ()),
                *(("--cluster-url", f"http://127.0.0.1:{self.port}") if self.on_cluster else ()),
            ),
        }  # fmt: skip
        worker = (
            "distributed.cli.dask_worker", self.scheduler, "--nthreads", 1, "--no-nanny", "--no-dashboard",
            "--local-directory", self.folder / name, "--name", f"{name}-{time.monotonic_ns()}", "--host", "127.0.0.1",
        )  # fmt: skip
        words = [str(w) for w in (sys.executable, "-m", *modules.get(name, worker))]
        log = (self.folder / f"{name}.log").open("ab")
        self.processes[name] = subprocess.Popen(
            words, stdout=log, stderr=log, start_new_session=True, env=os.environ | QUICK | {"OMP_NUM_THREADS": "1"}
        )

    def kill(self, name):
        process = self.processes.pop(name)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()

    def revive(self):
        """Begin anew what has ended, as units of systemd are."""
        for name in [n for n, process in self.processes.items() if process.poll() is not None]:
            self.begin(name)

    def has_scheduler(self):
        with suppress(OSError), socket.create_connection(("127.0.0.1", int(self.scheduler.rpartition(":")[2]))):
            return True
        return False

    def wait_for_service(self):
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            with suppress(httpx.TransportError):
                return self.client.get("/api/health")
            self.revive()  # the service ends where the scheduler was not back yet
            time.sleep(0.1)
        raise AssertionError((self.folder / "service.log").read_text()[-2000:])

    def ask(self, words, files=()):
        answer = self.client.post("/api/commands", json={"words": list(words), "files": list(files)})
        assert answer.status_code == 202, answer.text
        return answer.json()["id"]

    def wait(self, id, states=("done", "failed", "cancelled"), seconds=PATIENCE_S):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.revive()  # workers end some time after their scheduler
            with suppress(httpx.TransportError):
                job = self.client.get(f"/api/jobs/{id}").json()
                if job["state"] in states:
                    return job
            time.sleep(0.1)
        raise AssertionError(job)

    def ends(self):
        told = self.client.get("/api/events", params={"after": 0, "wait": "false"}).text
        return re.findall(r'event: end\ndata: \{"job":"(\w+)"', told)


@contextmanager
def plant_in(folder):
    plant = Plant(folder)
    try:
        plant.begin("scheduler")
        wait_until(plant.has_scheduler)
        for name in ("one", "two", "service"):
            plant.begin(name)
        plant.wait_for_service()
        yield plant
    finally:
        for name in list(plant.processes):
            plant.kill(name)


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    with plant_in(tmp_path_factory.mktemp("plant")) as made:
        yield made


@pytest.mark.long
def test_a_job_is_computed_there_with_its_files_and_gives_what_it_gives_here(plant, tmp_path):
    robot = load_cell("ur10/edbb").robot.path.read_text()
    robot = robot.replace("a_mm = -612.0", "a_mm = -612.5") + "\n[nominal]\na2_mm = -612.0\n"
    files = [upload(plant.client, "files", text.encode(), name) for name, text in FILES.items()]
    files.append(upload(plant.client, "files", robot.encode(), "robot.toml"))
    words = ["compensate", "targets.csv", "--model", "robot.toml", "-o", "out/a.csv"]
    job = plant.wait(plant.ask(words, files))
    assert job["state"] == "done", job["problem"]
    there = plant.client.get(next(f["url"] for f in job["files"] if f["name"] == "a.csv")).text
    for name, text in (*FILES.items(), ("robot.toml", robot)):
        (tmp_path / name).write_text(text)
    done = edbb("compensate", tmp_path / "targets.csv", "--model", tmp_path / "robot.toml", "-o", tmp_path / "a.csv")
    assert done.returncode == 0, done.stderr
    assert there == (tmp_path / "a.csv").read_text()
    wrong = plant.wait(plant.ask(["plan", "ur10/nothing", "-o", "out"]))
    assert (wrong["state"], wrong["exit_code"]) == ("failed", 2)
    assert "neither a file nor a shipped cell" in wrong["problem"]["detail"]


def job_processes():
    found = subprocess.run(["pgrep", "-f", "planner.service.job_process"], capture_output=True, text=True, check=False)
    return found.stdout.split()


@pytest.mark.long
def test_a_job_that_is_stopped_ends_on_its_worker(plant):
    before = set(job_processes())
    id = plant.ask(["plan", "comau-nj130/edbb", "-o", "out", "--seed", "5"])
    plant.wait(id, ("running",))
    wait_until(lambda: set(job_processes()) - before)
    told = {"job": id, "wait": "false"}
    wait_until(lambda: "event: progress" in plant.client.get("/api/events", params=told).text)
    plant.client.post(f"/api/jobs/{id}/cancel")
    assert plant.wait(id)["state"] == "cancelled"
    wait_until(lambda: not set(job_processes()) - before)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_is_killed_each_job_is_done_once(tmp_path, seed):
    """Workers, scheduler and service are killed at random while jobs come.

    A worker is also stopped for a while, as one whose network is lost: it comes back after it was taken for dead, and
    its late result is not looked at.
    """
    rng, accepted = random.Random(seed), []
    with plant_in(tmp_path) as plant:
        for _ in range(TRIALS):
            sent = upload(plant.client, "files", rng.randbytes(100), "a.txt")
            accepted.append(plant.ask(["robots", "--json"], [sent]))
            time.sleep(rng.uniform(0.0, 1.0))
            victim = rng.choice(["one", "two", "one", "two", "service", "scheduler", "freeze"])
            if victim == "freeze":
                frozen = rng.choice(["one", "two"])
                os.killpg(plant.processes[frozen].pid, signal.SIGSTOP)
                time.sleep(9.0)  # longer than the scheduler waits
                os.killpg(plant.processes[frozen].pid, signal.SIGCONT)
                plant.revive()
                continue
            plant.kill(victim)
            plant.begin(victim)
            plant.wait_for_service()
            plant.revive()
        jobs = [plant.wait(id, seconds=240) for id in accepted]
        assert all(j["state"] == "done" for j in jobs), [j["problem"] for j in jobs if j["state"] != "done"]
        ends = plant.ends()
        assert sorted(ends) == sorted(set(accepted)), "each ends once"


@pytest.mark.long
def test_what_a_worker_sends_after_it_was_taken_for_dead_is_not_looked_at(tmp_path):
    """It is held while its job's process goes on; another does the job, and only then it comes back with its result."""
    with plant_in(tmp_path) as plant:
        id = plant.ask(["robots", "--json"])
        wait_until(lambda: any(children_of(plant.processes[w].pid) for w in ("one", "two")), pause_s=0.005)
        held = next(w for w in ("one", "two") if children_of(plant.processes[w].pid))
        os.killpg(plant.processes[held].pid, signal.SIGSTOP)
        first = plant.wait(id)
        assert first["state"] == "done"
        os.killpg(plant.processes[held].pid, signal.SIGCONT)
        wait_until(lambda: not children_of(plant.processes[held].pid))
        again = plant.ask(["dialects", "--json"])  # by then whatever it had to send has come
        assert plant.wait(again)["state"] == "done"
        assert plant.client.get(f"/api/jobs/{id}").json() == first
        assert sorted(plant.ends()) == sorted([id, again])


def test_an_address_where_nobody_answers_is_said(tmp_path):
    with pytest.raises(InputError, match="--cluster-url"):
        ClusterSettings("tcp://127.0.0.1:1")
    settings = ClusterSettings(f"tcp://127.0.0.1:{free_port()}", "http://127.0.0.1:8017", answer_s=0.5)
    with pytest.raises(MissingProgramError, match="nobody answers"):
        Cluster(settings, JobLimits())
