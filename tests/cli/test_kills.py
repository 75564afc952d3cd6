"""Whenever a command is killed, what it writes is as it was before or as it is after: at every call that changes one.

A kill before the k-th of these calls leaves what lies on the disk at that moment, so one run of a command in which the
disk is looked at before every one of them stands for a kill at each; some runs are really killed beside that.
"""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cli.states import state_of
from tests.cli.test_writing import MAP
from tests.command import edbb


def _watched(words: tuple[object, ...], folder: Path, out: Path, kill_at: int = 0) -> list[dict[str, str]]:
    """Run the command in a process of its own; return what ``out`` was before each of its changes, and at the end."""
    arguments = [str(w) for w in (folder, out, kill_at, *words)]
    done = subprocess.run([sys.executable, "-m", "tests.cli.watched", *arguments], capture_output=True, text=True)
    if kill_at:
        assert done.returncode == -signal.SIGKILL, done.stderr
        return []
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["code"] in (0, 5), done.stderr
    return list(found["states"])


@pytest.fixture(scope="module")
def things(tmp_path_factory, request):
    """Inputs of the commands, two of each kind."""
    folder = tmp_path_factory.mktemp("inputs")
    for k in "ab":
        rows = (f"{i},{i * 2},3,4,{50 + i},6,{400 + i + (k == 'b')}\n" for i in range(20))
        (folder / f"trace_{k}.csv").write_text("".join(rows))
    (folder / "map.toml").write_text(MAP)
    return folder


def _commands(kind: str, things: Path, out: Path, request) -> tuple[tuple[object, ...], tuple[object, ...], Path]:
    """Two commands that write different results to one place, and the place."""
    if kind == "import":
        words = [
            ("import", things / f"trace_{k}.csv", "--map", things / "map.toml", "-o", out / "r.csv", "--force")
            for k in "ab"
        ]
        return words[0], words[1], out / "r.csv"
    plan = request.getfixturevalue("small").folder / "plan.json"
    cell = request.getfixturevalue("small").cell_path
    if kind == "simulate":
        words = [("simulate", plan, "-o", out / "r.csv", "--seed", s) for s in (1, 2)]
        return words[0], words[1], out / "r.csv"
    if kind == "export":
        words = [("export", plan, "--dialect", d, "-o", out / "p.src") for d in ("bnr", "krl")]
        return words[0], words[1], out / "p.src"
    if kind == "plan":
        words = [("plan", cell, "-o", out / "o", "--poses", n, "--dialect", "krl") for n in (30, 31)]
        return words[0], words[1], out / "o"
    run = things / "run.csv"
    if not run.exists():
        assert edbb("simulate", plan, "-o", run).returncode == 0
    words = [("identify", run, "--cell", cell, "-o", out / "o", "--no-trace", *w) for w in ((), ("--hold-out", 0.4))]
    if kind == "identify":
        return words[0], words[1], out / "o"
    assert edbb(*words[0][:4], "-o", things / "found", "--no-trace").returncode == 0
    program = next(p for p in plan.parent.iterdir() if p.suffix == ".src")
    for k in "ab":
        shutil.copy(program, things / f"{k}.src")
    (things / "b.src").write_text(program.read_text().replace("A1 0.0000", "A1 0.1000"))
    words = [
        ("compensate", things / f"{k}.src", "--model", things / "found" / "robot.toml", "-o", out / "c.src")
        for k in "ab"
    ]
    return words[0], words[1], out / "c.src"


QUICK = ("import",)
HEAVY = ("simulate", "export", "compensate", "identify", "plan")


@pytest.mark.parametrize("kind", [*QUICK, *(pytest.param(k, marks=pytest.mark.long) for k in HEAVY)])
def test_a_kill_at_any_change_leaves_old_or_new(kind, things, tmp_path, request):
    place = tmp_path / "place"
    place.mkdir()
    first, second, out = _commands(kind, things, place, request)
    done = edbb(*first)
    assert done.returncode in (0, 5), done.stderr
    old = state_of(out)
    found = _watched(second, tmp_path, out)
    assert len(found) > 3, "changes were seen"
    new = found[-1]
    assert new != old
    for state in found:
        nothing_to_start = kind == "export" and "p.src" not in state
        assert state in (old, new) or nothing_to_start


@pytest.mark.long
def test_commands_that_are_killed_leave_old_or_new(things, tmp_path, request):
    rng = np.random.default_rng(0)
    *words, out = _commands("import", things, tmp_path, request)
    looked = [_watched(word, tmp_path, out) for word in words]
    states = [found[-1] for found in looked]
    for k in range(8):
        _watched(words[k % 2], tmp_path, out, kill_at=int(rng.integers(1, len(looked[k % 2]))))
        assert state_of(out) in states
