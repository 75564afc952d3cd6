"""Runs commands that are watched or killed, each in a process of its own: ``python -m tests.cli.watched``.

It takes one order a line (JSON) and forks for each, so that no command waits for its libraries. What a command has to
compute can be learnt before: then its forks only write, and are killed while they do.
"""

import importlib
import io
import json
import os
import select
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from unittest.mock import patch

import cloudpickle

from planner.common.progress import Stages
from tests.cli.states import state_of

CHANGES = {"os.rename", "os.remove", "os.link", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "shutil.move"}
LEARNT: dict[str, Path] = {}  # files with results of commands, by their words


class _LearntError(Exception):
    """The result is there; it is not written."""


def _replace_give(change) -> None:  # type: ignore[no-untyped-def]
    """Let commands do their work as ``change`` says it, given the work."""
    from planner.cli import calibration_commands
    from planner.cli.terminal import give

    for module in (calibration_commands,):
        module.give = lambda work, *options, **named: give(change(work), *options, **named)  # type: ignore[attr-defined]


def _learn(words: list[str], folder: str, kept: Path) -> dict[str, object]:
    """Compute what a command would write, and keep it in a file; how often it changed ``folder`` meanwhile."""
    from tests.command import edbb

    changed: list[str] = []
    looking = True

    def remember(work):  # type: ignore[no-untyped-def]
        def learn(_: Stages) -> None:
            kept.write_bytes(cloudpickle.dumps(work(Stages())))  # without the terminal, which is not kept
            raise _LearntError

        return learn

    def look(event: str, args: tuple[object, ...]) -> None:
        if looking and _changes(event, args, folder):
            changed.append(event)

    said = ""
    _replace_give(remember)
    sys.addaudithook(look)
    with suppress(_LearntError):
        said = edbb(*words).screen
    looking = False
    return {"changed": changed, "said": said}


def _recall(work):  # type: ignore[no-untyped-def]
    kept = LEARNT.get(str(sys.argv[1:]))
    return work if kept is None else lambda stages: cloudpickle.loads(kept.read_bytes())


def _changes(event: str, args: tuple[object, ...], folder: str) -> bool:
    writes = event == "open" and isinstance(args[2], int) and bool(args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
    if event == "open" and os.path.isdir(str(args[0])):  # a try whether a folder can be written
        return False
    return (writes or event in CHANGES) and folder in str(args[0])


def _run(words: list[str], folder: str, out: Path) -> dict[str, object]:
    """Run the command; what ``out`` was before every call that changes a file in ``folder``, and when that was [s]."""
    from tests.command import edbb

    states: list[dict[str, str]] = []
    times: list[float] = []
    begin, busy = time.perf_counter(), False

    def look(event: str, args: tuple[object, ...]) -> None:
        nonlocal busy
        if busy or not _changes(event, args, folder):
            return
        busy = True
        times.append(time.perf_counter() - begin)
        states.append(state_of(out))
        busy = False

    sys.addaudithook(look)
    with patch.object(sys, "stdin", io.StringIO("\n" * 1000)):
        done = edbb(*words)
    busy = True
    return {
        "code": done.returncode, "said": done.screen, "states": [*states, state_of(out)],
        "times": [*times, time.perf_counter() - begin],
    }  # fmt: skip


def _fork(work: Callable[[], dict[str, object]], kill_s: object = None) -> dict[str, object]:
    """Do work in a child, whose threads end with it; ``kill_s``: kill it after this time."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        with os.fdopen(theirs, "w") as file:
            file.write(json.dumps(work()) + "\n")  # the end of the line tells a whole answer from one that was cut
            file.flush()
            os._exit(0)
    os.close(theirs)
    if kill_s is not None:
        select.select([ours], [], [], float(str(kill_s)))
        os.kill(child, signal.SIGKILL)
    with os.fdopen(ours) as file:
        text = file.read()
    killed = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    return {"killed": killed} | (json.loads(text) if text.endswith("\n") else {})


def main() -> None:
    """Serve orders until the input ends."""
    for line in sys.stdin:
        order = json.loads(line)
        for module in order.get("warm", ()):
            importlib.import_module(module)
        for name, value in order.get("settings", {}).items():
            module, _, attribute = name.partition(":")
            owner = importlib.import_module(module)
            *inner, last = attribute.split(".")
            for part in inner:
                owner = getattr(owner, part)
            getattr(owner, last)  # what is set is there: else the setting would do nothing
            setattr(owner, last, tuple(value) if isinstance(value, list) else value)
        done: dict[str, object] = {}
        if "learn" in order:
            handle, name = tempfile.mkstemp()
            os.close(handle)
            done = _fork(partial(_learn, order["learn"], order["folder"], Path(name)))
            LEARNT[str(order["learn"])] = Path(name)
            _replace_give(_recall)
        if "words" in order:
            run = partial(_run, order["words"], order["folder"], Path(order["out"]))
            done = _fork(run, order.get("kill_s"))
        print(json.dumps(done), flush=True)


if __name__ == "__main__":
    main()
