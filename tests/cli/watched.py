"""Runs the command with the disk looked at before every call that changes a file: ``python -m tests.cli.watched``."""

import json
import os
import signal
import sys
from pathlib import Path

from tests.cli.states import state_of

CHANGES = {"os.rename", "os.remove", "os.link", "os.mkdir", "os.rmdir", "os.truncate", "os.chmod", "shutil.move"}


def _changes(event: str, args: tuple[object, ...], folder: str) -> bool:
    writes = event == "open" and isinstance(args[2], int) and bool(args[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
    return (writes or event in CHANGES) and folder in str(args[0])


def main() -> None:
    """Arguments: folder that is watched, what is written there, number of the call to die at (0 none), the command."""
    folder, out, kill_at, words = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4:]
    states: list[dict[str, str]] = []
    busy = False

    def look(event: str, args: tuple[object, ...]) -> None:
        nonlocal busy
        if busy or not _changes(event, args, folder):
            return
        busy = True
        states.append(state_of(out))
        busy = False
        if len(states) == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)

    from planner.cli.app import main as command

    sys.addaudithook(look)
    sys.argv = ["edbb", *words]
    code: object = 0
    try:
        command()
    except SystemExit as done:
        code = done.code or 0
    busy = True
    print("\n" + json.dumps({"code": code, "states": [*states, state_of(out)]}))


if __name__ == "__main__":
    main()
