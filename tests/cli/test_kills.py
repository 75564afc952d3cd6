"""Whenever a command is killed, what it writes is as it was before or as it is after: all commands that write.

A kill before the k-th call that changes a file leaves what lies on the disk at that moment, so one run of a command in
which the disk is looked at before every one of them stands for a kill at each; beside that runs are really killed, at
random moments, most of them while they write: 200 of all commands with EDBB_ALL_TRIALS=1, else a sixth of them. What
takes long to compute is computed once, on small grids: no file may change meanwhile, so that a kill there is no trial.
"""

import json
import os
import pkgutil
import shutil
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

import planner
import tests.loaded.world as loaded
from planner.checks.record import RobotRecord
from planner.common.result_folder import changed_files
from tests.accuracy.worlds import NAME, poses, tracker_run
from tests.centring.conftest import Cell
from tests.centring.test_command import words as centring_words
from tests.centring.test_live_gauge import Gauge
from tests.centring.test_session import rows_of
from tests.checks.test_record import calibration, results
from tests.circular.conftest import ARC, cell_file
from tests.cli.states import state_of
from tests.cli.test_writing import MAP
from tests.command import edbb
from tests.loaded.test_both import write_inputs

pytestmark = pytest.mark.posix  # every command that is killed is a fork
KILLS = {
    "import": 4, "simulate": 20, "export": 20, "compensate": 20, "accuracy": 12, "circular": 12, "loaded": 8,
    "study": 10, "identify": 10, "plan": 10, "fixtures": 8, "loaded-places": 10, "plan-both": 8, "check": 10,
    "plan-check": 8, "centre": 10, "measure": 10, "record": 10,
}  # fmt: skip
assert sum(KILLS.values()) == 200
LIGHT = {"import": ("planner.cli.calibration_commands", "planner.runs.column_map", "planner.runs.traces")}
COMPUTED = ("study", "identify", "plan", "fixtures", "loaded-places", "plan-both", "check", "plan-check")
GROWING = ("centre", "measure", "record")  # have tests of their own: what they write grows
SMALL = {
    "planner.studies.basis:CANDIDATES": 600, "planner.studies.basis:GROWTH": [1.2, 1.6, 2.4],
    "planner.studies.basis:ANNEALING_STEPS": 10, "planner.studies.fixture_places:CANDIDATES": 300,
    "planner.studies.fixture_places:map_fixture_places.__defaults__": [4, 3],
    "planner.design.fixtures.addition:CANDIDATES_AT_A_PLACE": 200,
    "planner.design.fixtures.addition:FEWEST_JOINED_POSES": 50,
    "planner.loaded.circle_candidates:find_circle_places.__defaults__": [0, [3, 2]],
}  # fmt: skip
ALL = bool(os.environ.get("EDBB_ALL_TRIALS"))


def kills_of(kind: str) -> int:
    """How often a command is killed."""
    return KILLS[kind] if ALL else -(-KILLS[kind] // 6)


class Commands:
    """A process that runs commands for the tests, and their inputs."""

    def __init__(self, folder: Path) -> None:
        words, one = [sys.executable, "-m", "tests.cli.watched"], {"OMP_NUM_THREADS": "1"}
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True, env={**os.environ, **one})
        self.folder = folder

    def warm(self, *names: str) -> None:
        """Load these modules, or all that the commands need."""
        every = (m.name for m in pkgutil.walk_packages(planner.__path__, "planner."))
        self._order(warm=names or [n for n in every if not n.endswith("__main__")], settings={} if names else SMALL)

    def learn(self, words: Sequence[object], folder: Path) -> None:
        """Compute what a command will write, and see that no file changes before it does."""
        done = self._order(learn=[str(w) for w in words], folder=str(folder))
        assert done["said"] == "", done["said"]
        assert done["changed"] == []

    def run(self, words: Sequence[object], folder: Path, out: Path, **order: object) -> dict:
        """Run a command, watched or killed."""
        return self._order(words=[str(w) for w in words], folder=str(folder), out=str(out), **order)

    def _order(self, **said: object) -> dict:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(said) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    made = Commands(tmp_path_factory.mktemp("inputs"))
    yield made
    made.process.kill()  # it has nothing to put in order, and may be slow to end by itself
    made.process.wait()


def _made(path: Path, *words: object) -> Path:
    """A file that a command makes, once."""
    if not path.exists():
        done = edbb(*words)
        assert done.returncode in (0, 5), done.stderr
    return path


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


Words = tuple[object, ...]


def _import(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    for k in "ab":
        rows = (f"{i},{i * 2},3,4,{50 + i},6,{400 + i + (k == 'b')}\n" for i in range(20))
        _written(place / f"trace_{k}.csv", "".join(rows))
    mapped = _written(place / "map.toml", MAP)
    one, two = (("import", place / f"trace_{k}.csv", "--map", mapped, "-o", out / "r.csv", "--force") for k in "ab")
    return one, two, out / "r.csv"


def _simulate(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    plan = small.folder / "plan.json"
    one, two = (("simulate", plan, "-o", out / "r.csv", "--seed", s, "--force") for s in (1, 2))
    return one, two, out / "r.csv"


def _export(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    plan = small.folder / "plan.json"
    one, two = (("export", plan, "--dialect", d, "-o", out / "p.src", "--force") for d in ("bnr", "krl"))
    return one, two, out / "p.src"


def _plan(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    one, two = (("plan", small.cell_path, "-o", out / "o", "--poses", n, "--dialect", "krl") for n in (30, 31))
    return one, two, out / "o"


def _fixtures(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    words = ("plan", small.cell_path, "-o", out / "o", "--fixtures", 2, "--dialect", "krl", "--poses")
    return (*words, 40), (*words, 41), out / "o"


def _study(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    words = ("study", small.cell_path, "-o", out / "o")
    return words, (*words, "--seed", 1), out / "o"


def _circular(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    ring, folder = cell_file(place, ARC + "speed_mm_s = 150\n"), place / "ring"
    plan = _made(folder / "plan.json", "plan", ring, "-o", folder, "--dialect", "krl")
    files = [place / f"r{s}.csv" for s in (0, 1)]
    runs = [_made(file, "simulate", plan, "-o", file, "--seed", s) for s, file in enumerate(files)]
    one, two = (("circular", run, "--plan", plan, "-o", out / "o") for run in runs)
    return one, two, out / "o"


def _loaded(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    arm = loaded.arm()
    way = loaded.course(arm, repeats=1)
    drawn = [loaded.readings(arm, loaded.World(), way, np.random.default_rng(s))[0] for s in (1, 2)]
    runs = [_written(place / f"loaded_{k}.csv", loaded.run_text(way, d)) for k, d in enumerate(drawn)]
    one, two = (("loaded", run, "--cell", "abb-irb6700/ldbb", "-o", out / "o") for run in runs)
    return one, two, out / "o"


def _places(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    words = ("loaded-places", "abb-irb6700/ldbb", "-o", out / "o", "--places")
    return (*words, 2), (*words, 3), out / "o"


def _both(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    write_inputs(place)
    words = ("plan-both", place / "plan.json", place / "loaded.toml", "-o", out / "o", "--places", 1, "--dialect")
    return (*words, "rapid"), (*words, "krl"), out / "o"


def _accuracy(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    runs = [_written(place / f"v{s}.csv", tracker_run(poses(seed=s))) for s in (2, 3)]
    one, two = (("accuracy", run, "--cell", f"{NAME}/tracker", "-o", out / "o") for run in runs)
    return one, two, out / "o"


def _identify(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    run = _made(place / "run.csv", "simulate", small.folder / "plan.json", "-o", place / "run.csv")
    words = ("identify", run, "--cell", small.cell_path, "-o", out / "o", "--no-trace")
    return words, (*words, "--hold-out", 0.4), out / "o"


def _calibrated(place: Path, small) -> Path:
    return _made(place / "o" / "robot.toml", *_identify(place, place, small)[0])


def _check(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    known, plan = _calibrated(place, small).parent, small.folder / "plan.json"
    words = ("check", place / "run.csv", "--model", known, "--plan", plan, "-o", out / "o", "--limit-mm")
    return (*words, 5), (*words, 6), out / "o"


def _plan_check(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    words = ("plan-check", small.cell_path, "--model", _calibrated(place, small).parent, "-o", out / "o", "--poses")
    return (*words, 10), (*words, 12), out / "o"


def _compensate(place: Path, out: Path, small) -> tuple[Words, Words, Path]:
    robot = _calibrated(place, small)
    text = next(p for p in small.folder.iterdir() if p.suffix == ".src").read_text()
    sources = [_written(place / "a.src", text), _written(place / "b.src", text.replace("A1 0.0000", "A1 0.1000"))]
    one, two = (("compensate", s, "--model", robot, "--measuring", "-o", out / "c.src", "--force") for s in sources)
    return one, two, out / "c.src"


PAIRS = {
    "import": _import, "simulate": _simulate, "export": _export, "compensate": _compensate, "accuracy": _accuracy,
    "circular": _circular, "loaded": _loaded, "study": _study, "identify": _identify, "plan": _plan,
    "fixtures": _fixtures, "loaded-places": _places, "plan-both": _both, "check": _check, "plan-check": _plan_check,
}  # fmt: skip


def _same(state: dict[str, str]) -> dict[str, str]:
    """A state without what differs from run to run: seconds, and the hash of them."""
    return {k: v for k, v in state.items() if Path(k).name not in ("timings.json", "manifest.json")}


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [k if k in LIGHT else pytest.param(k, marks=pytest.mark.long) for k in KILLS if k not in GROWING]
)
def test_a_kill_leaves_old_or_new(kind, commands, tmp_path, request):
    if kind in COMPUTED and not ALL:
        pytest.skip("takes minutes: only with EDBB_ALL_TRIALS=1")
    out = tmp_path / "place"
    out.mkdir()
    commands.warm(*LIGHT.get(kind, ()))
    *words, where = PAIRS[kind](commands.folder, out, None if kind in LIGHT else request.getfixturevalue("small"))
    ends, slowest = [], []
    for number, word in enumerate(words):
        if kind in COMPUTED:
            commands.learn(word, out)
        before = state_of(where) if number else {}
        found = commands.run(word, out, where)
        assert found["code"] in (0, 5), found["said"]
        states = found["states"]
        assert len(states) > 3, "changes were seen"
        assert states[-1] != before
        for state in states:
            nothing_to_start = kind == "export" and "p.src" not in state
            assert state in (before, states[-1]) or nothing_to_start
        ends.append(_same(states[-1]))
        slowest.append(found["times"])
    rng = np.random.default_rng(0)
    for k in range(kills_of(kind)):
        times = slowest[k % 2]
        moment = rng.uniform(0.0, times[-1]) if k % 4 == 0 else rng.uniform(0.95 * times[0], 1.05 * times[-1])
        commands.run(words[k % 2], out, where, kill_s=moment)
        state = _same(state_of(where))
        if kind == "export" and state.get("p.src") == ends[0]["p.src"]:
            state.pop("p.dat", None)  # a program of one file leaves the companion of the other language alone
        assert state in ends or (kind == "export" and "p.src" not in state)
        if where.is_dir():
            (main,) = (p.name for p in where.glob("*.json") if changed_files(where, p.name) is not None)
            assert changed_files(where, main) == []
    assert commands.run(words[0], out, where)["code"] in (0, 5), "the next command goes through"
    assert not [p for p in out.rglob("*") if p.name.startswith(".edbb-")], "drafts of the killed are cleared"


@pytest.mark.long
def test_a_session_of_centring_that_is_killed_loses_no_pose(commands, tmp_path):
    """The run grows pose by pose: after a kill it is whole up to the last one, and the next session goes on there."""
    rng = np.random.default_rng(0)
    commands.warm()
    with ExitStack() as stack:
        made = Cell(tmp_path, stack, count=4, faults={"slow": 0.05})
        kept: list[list[str]] = []
        for _ in range(kills_of("centre")):
            commands.run(centring_words(made, tmp_path), tmp_path, made.output, kill_s=rng.uniform(0.3, 1.2))
            text = made.output.read_text() if made.output.exists() else ""
            rows = [row.split(",")[:13] for row in text[text.find("t_s") :].splitlines()[1:]]
            assert rows[: len(kept)] == kept, "what was measured stays"
            assert text.endswith("\n") or not text
            kept = rows
            made.revive()
        done = commands.run(centring_words(made, tmp_path), tmp_path, made.output)
        assert done["code"] == 0, done["said"]
        table = rows_of(made.output)
        assert table["pose"].to_list() == [1, 3, 5, 7]


@pytest.mark.long
def test_a_run_at_a_gauge_that_is_killed_loses_no_pose(commands, tmp_path, small):
    """What was read stays, whatever was killed; the next command goes on behind it."""
    commands.warm()
    gauge, run = Gauge(), tmp_path / "run.csv"
    words = ("measure", small.folder / "plan.json", "--serial-port", gauge.port, "-o", run)
    poses = [p["id"] for p in small.plan["poses"] if p["role"] != "mount"]
    whole = commands.run(words, tmp_path, run)
    assert whole["code"] == 0, whole["said"]
    assert _measured(run) == poses
    rng, kept, seen = np.random.default_rng(0), poses, set()
    for _ in range(kills_of("measure")):
        if kept == poses:
            run.unlink()
            kept = []
        commands.run(words, tmp_path, run, kill_s=rng.uniform(whole["times"][0], whole["times"][-1]))
        found = _measured(run)
        assert found[: len(kept)] == kept
        assert found == poses[: len(found)]
        kept = found
        seen.add(len(found))
    assert len(seen) > 1 or kills_of("measure") < 5, "so many kills meet the run at more than one pose"
    assert commands.run(words, tmp_path, run)["code"] == 0
    assert _measured(run) == poses
    gauge.on = False


def _measured(run: Path) -> list[int]:
    """The poses of a run that is being measured, which is whole whenever one looks."""
    if not run.exists():
        return []
    text = run.read_text()
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    assert text.endswith("\n")
    assert {len(row) for row in rows} == {len(rows[0])}
    return [int(row[rows[0].index("pose")]) for row in rows[1:]]


@pytest.mark.long
@pytest.mark.parametrize("begun", [False, True])
def test_an_entry_of_a_record_is_there_or_not(commands, tmp_path, begun):
    commands.warm()
    added = [results(tmp_path / f"c{k}", "identification.json", calibration(0.01 * k)) for k in (1, 2)]
    place, record = tmp_path / "place", tmp_path / "place" / "record"
    words = [("record", record, "--add", a, "--date", "2024-01-01", "--serial", "S1") for a in added]

    def begin() -> None:
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        if begun:
            assert edbb(*words[0]).returncode == 0

    begin()
    before = state_of(record) if begun else {}
    whole = commands.run(words[-1], place, record)
    assert whole["code"] == 0, whole["said"]
    assert [s for s in whole["states"] if s not in (before, whole["states"][-1])] == []
    rng = np.random.default_rng(0)
    for _ in range(kills_of("record") // 2):
        begin()
        commands.run(words[-1], place, record, kill_s=rng.uniform(0.9 * whole["times"][0], whole["times"][-1]))
        there = len(RobotRecord.read(record).entries) if record.exists() else 0
        assert there in (begun, begun + 1)
        assert commands.run(words[-1], place, record)["code"] == (2 if there > begun else 0)
        assert len(RobotRecord.read(record).entries) == begun + 1
