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
import time
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

from tests.cli.states import state_of

CHANGES = {"os.rename", "os.remove", "os.link", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "shutil.move"}
LEARNT: dict[str, object] = {}  # results of commands, by their words


class _LearntError(Exception):
    """The result is there; it is not written."""


def _learn(words: list[str], folder: str) -> dict[str, object]:
    """Compute what a command would write; how often it changed ``folder`` meanwhile."""
    from planner.cli import calibration_commands, check_commands, plan_commands
    from planner.cli.terminal import give
    from tests.command import edbb

    changed: list[str] = []
    looking = True

    def remember(work, *options, **named):  # type: ignore[no-untyped-def]
        def learn(stages):  # type: ignore[no-untyped-def]
            LEARNT[str(words)] = work(stages)
            raise _LearntError

        return give(learn, *options, **named)

    def recall(work, *options, **named):  # type: ignore[no-untyped-def]
        return give(lambda stages: LEARNT.get(str(sys.argv[1:])) or work(stages), *options, **named)

    def look(event: str, args: tuple[object, ...]) -> None:
        if looking and _changes(event, args, folder):
            changed.append(event)

    said, modules = "", (calibration_commands, check_commands, plan_commands)
    for module in modules:
        module.give = remember  # type: ignore[attr-defined]
    sys.addaudithook(look)
    with suppress(_LearntError):
        said = edbb(*words).stderr
    looking = False
    for module in modules:
        module.give = recall  # type: ignore[attr-defined]
    return {"changed": changed, "said": said}


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
        "code": done.returncode, "said": done.stderr, "states": [*states, state_of(out)],
        "times": [*times, time.perf_counter() - begin],
    }  # fmt: skip


def _fork(order: dict[str, object]) -> dict[str, object]:
    """Do an order in a child; ``kill_s``: kill it after this time."""
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        with os.fdopen(theirs, "w") as file:
            found = _run(list(order["words"]), str(order["folder"]), Path(str(order["out"])))  # type: ignore[call-overload]
            json.dump(found if "kill_s" not in order else found | {"states": []}, file)
            file.flush()
            os._exit(0)
    os.close(theirs)
    if "kill_s" in order:
        select.select([ours], [], [], float(str(order["kill_s"])))
        os.kill(child, signal.SIGKILL)
    with os.fdopen(ours) as file:
        text = file.read()
    killed = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    return {"killed": killed} | (json.loads(text) if text.endswith("}") else {})


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
            setattr(owner, last, tuple(value) if isinstance(value, list) else value)
        done = _learn(order["learn"], order["folder"]) if "learn" in order else {}
        print(json.dumps(_fork(order) if "words" in order else done), flush=True)


if __name__ == "__main__":
    main()
