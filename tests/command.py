"""The command ``edbb``: in this process, where it takes no second to start, or in one of its own."""

import io
import os
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout

from planner.cli.app import main, verbs
from planner.common.commands import extension_commands
from planner.common.extensions import shipped_extensions
from tests.processors import with_threads


class Done(subprocess.CompletedProcess):
    """A command that has ended; ``screen``: all that a person sees, both streams."""

    @property
    def screen(self):
        return self.stdout + self.stderr


def commands_that_run():
    """The names of all commands but those that need an extension which is not installed here."""
    brought, there = extension_commands(), {module.rpartition(".")[2] for module in shipped_extensions()}
    return [name for name in verbs() if name not in brought or there.issuperset(brought[name].needs)]


def edbb(*words, threads=None, cwd=None, **env):
    """Run the command; what it printed and its exit code, as from ``subprocess.run``.

    It has a process of its own where threads or the environment are asked for.
    """
    arguments = [str(w) for w in words]
    if threads is None and not env:
        with chdir(cwd or "."):
            return _here(arguments)
    done = subprocess.run(
        [sys.executable, "-m", "planner.cli", *arguments],
        capture_output=True,
        encoding="utf-8",
        cwd=cwd,
        check=False,
        **(with_threads(threads) if threads else {"env": {**os.environ, "OMP_NUM_THREADS": "1", **env}}),
    )
    return Done(done.args, done.returncode, done.stdout, done.stderr)


def _here(arguments):
    out, told, before, code = io.StringIO(), io.StringIO(), sys.argv, 0
    sys.argv = ["edbb", *arguments]
    try:
        with redirect_stdout(out), redirect_stderr(told):
            main()
    except SystemExit as done:
        code = done.code or 0
    finally:
        sys.argv = before
    return Done(arguments, code, out.getvalue(), told.getvalue())
