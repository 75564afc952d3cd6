"""What the commands share: options, progress and the time left, and the one way in which a result is given."""

import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from planner.common.errors import FAILED, InputError, NoSolutionError, make_printable
from planner.common.exchange import check_place
from planner.common.file_names import check_names
from planner.common.files import check_writing, document_text, is_folder
from planner.common.progress import Progress, Stages
from planner.common.result import Result
from planner.common.result_folder import check_not_inside, check_overwriting
from planner.common.summary import SCREEN_LINES, Aside, Fact, count_alike, cut_facts, fact_lines, hang_lines, under_key

UNKNOWN = 0.15  # of the way to the next stage, for a step that nobody foresaw: how many come is not known


class TimeLeft:
    """Estimates the time left of a command: what has gone, times what is left over what is done.

    Args:
        starts: share of the command's time at which each stage usually begins.
    """

    def __init__(self, starts: Mapping[str, float]) -> None:
        self._starts, self._begun = starts, time.monotonic()
        self._stage, self._at, self._next = "", 0.0, 0.0
        self.share = 0.0

    def update(self, stage: str, done: int, of: int) -> None:
        """Take note of a stage, how much of it is done, and of how much (0 where that is not known)."""
        if stage != self._stage:
            self._stage = stage
            self._at = self._starts.get(stage, self._at + UNKNOWN * (self._next - self._at))
            self._next = min((s for s in self._starts.values() if s > self._at), default=1.0)
        now = self._at + (self._next - self._at) * (done / of if of else 0.0)
        self.share = max(self.share, now)

    @property
    def text(self) -> str:
        """What is left, in words; empty as long as nobody can know."""
        if self.share < 0.04:  # below this share a guess of the time left is worth nothing
            return ""
        left = (time.monotonic() - self._begun) * (1 - self.share) / self.share
        return f"about {left / 60:.0f} min left" if left > 90 else f"about {max(5 * round(left / 5), 5)} s left"


PROGRESS_VARIABLE = "EDBB_PROGRESS"  # "json": progress as lines
RESULTS = ("plan.json", "cell.toml", "trajectory.csv", "report.html", "identification.json", "robot.toml")


class SafeConsole(Console):
    """A terminal that text of files cannot steer: no markup, no emoji, no control signs."""

    def __init__(self, **how: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **how)

    def print(self, *objects: Any, **how: Any) -> None:
        """Print, with control signs in texts spelt out; where a person reads, long facts go on below themselves."""
        # 50_000: signs of a summary
        texts = (make_printable(o, 50_000) if isinstance(o, str) else o for o in objects)
        if self.is_terminal and self.soft_wrap:
            width = min(self.width, 100)  # signs of a line that an eye follows
            texts = (hang_lines(o, width) if isinstance(o, str) else o for o in texts)
        super().print(*texts, **how)


@dataclass(frozen=True)
class Manner:
    """How a command speaks and writes: ``verbose`` says all that there is, ``force`` writes over files of others."""

    verbose: bool = False
    force: bool = False


PLAINLY = Manner()
results = SafeConsole(soft_wrap=True)
"""Standard output: what a command found."""
errors = SafeConsole(stderr=True, soft_wrap=True)
"""Standard error: progress, notes, what went wrong."""

Json = Annotated[bool, typer.Option("--json", help="print a machine-readable summary on standard output")]
OutputFile = Annotated[
    str | None,
    typer.Option(
        "-o", "--output", metavar="FILE", help="file to write, or - (default: a new one named after the input)"
    ),
]


def environment_token() -> str:
    """Return the token of ``EDBB_TOKEN``, or of the file that ``EDBB_TOKEN_FILE`` names; empty where neither is set.

    Raises:
        InputError: the file cannot be read, or both are set.
    """
    token, file = os.environ.get("EDBB_TOKEN", ""), os.environ.get("EDBB_TOKEN_FILE", "")
    if not file:
        return token
    if token:
        raise InputError("EDBB_TOKEN and EDBB_TOKEN_FILE are both set; one of them is enough")
    try:
        return Path(file).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as err:
        raise InputError(f"EDBB_TOKEN_FILE={file}: cannot be read ({err})") from err


def parse_folder(text: str) -> Path:
    """Return the folder that a person names; an empty name is no way to mean the current one."""
    if not text.strip():
        raise InputError("-o '': names no folder; '-o .' would be the one that you are in")
    return Path(text)


Output = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="DIR",
        parser=parse_folder,
        help="folder to write to (default: a new one named after the input)",
    ),
]

OptionalOutput = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="DIR", help="folder to write the report to")
]


R = TypeVar("R", bound=Result)


def give(
    work: Callable[[Stages], R],
    output: Path | None,
    as_json: bool,
    starts: Mapping[str, float] = MappingProxyType({}),
    manner: Manner = PLAINLY,
) -> R:
    """Do the work of a command, write its result into a folder, say what was found, and return it.

    ``starts``: share of the command's time at which each stage usually begins; ``manner``: how it is said and written.

    Raises:
        NoSolutionError: the result must not be used.
        Exit: what was judged has failed.
    """
    if output is not None:
        check_folder(output, manner.force)
    with Screen(starts) as progress:
        result = work(Stages(progress))
        if output is not None:
            result.write(output, manner.force)
    if as_json:
        sys.stdout.write(result.to_json())
    else:
        results.print(screen_text(result, output, manner.verbose))
    if result.problems:
        raise NoSolutionError("; ".join(result.problems))
    if result.is_failed:
        raise typer.Exit(FAILED)
    return result


def screen_text(result: Result, output: Path | None, verbose: bool = False) -> str:
    """Return the lines on the screen about a result in a folder: at most eight, or all with ``verbose``."""
    files = "" if output is None else result.files(output)
    facts = [("written to", f"{output}: {files}")] if files else []
    step = "" if output is None or result.problems else result.next_step(output)
    below = fact_lines([*facts, *_next_facts(step)])
    return "\n".join([result.full_summary(verbose, SCREEN_LINES - len(below)), *below])


def screen_of(output: str) -> SafeConsole:
    """Return where a summary is printed: on standard error where the file itself goes to standard output."""
    return errors if output == "-" else results


def give_file(text: str, write: Callable[[Path], object], output: str, step: str = "") -> None:
    """Print the text of a file on standard output, or write it and say the next ``step``."""
    if output == "-":
        sys.stdout.write(text)
        return
    write(Path(output))
    print_next(step)


def _next_facts(step: str) -> list[Fact]:
    """Return the next steps of a person as facts, one a line."""
    return under_key("next", step.splitlines())


def print_next(step: str) -> None:
    """Print what a person does next."""
    results.print("\n".join(fact_lines(_next_facts(step))))


def evaluation_step(run: Path | str, plan: Path) -> str:
    """Return the command that evaluates the run of a plan."""
    from planner.common.schema import read_json  # other commands start quicker without
    from planner.session.evaluations import evaluation_of

    content = read_json(plan)
    assert isinstance(content, dict)  # it was read before
    return evaluation_of(
        run, plan, content.get("kind"), any(p["role"] == "calibrate" for p in content.get("poses", ()))
    )


def check_folder(output: Path, force: bool = False) -> None:
    """Refuse, before any work is done, a folder of results that is a file or cannot be written."""
    if str(output) == "-":
        raise InputError("-o needs a folder: several files are written")
    check_names(output)
    try:
        output.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass  # as it should be, or told below
    except (OSError, ValueError) as err:
        raise InputError(f"{output}: cannot be written ({getattr(err, 'strerror', None) or err})") from err
    _check_place(output)
    check_not_inside(output)
    check_overwriting(output.resolve(), [name for name in RESULTS if (output / name).exists()], force)


def check_file(output: str, force: bool = False, into_folder: bool = False) -> None:
    """Refuse, before any work is done, a file that cannot be written; ``into_folder``: a folder may be named too.

    Raises:
        InputError: its folder is missing or may not be written, it is a folder, or it was not written by edbb.
    """
    path = Path(output)
    if output == "-":
        return
    check_names(path)
    if path.exists() and not path.is_file() and not path.is_dir():  # a device is written to
        return
    if into_folder and is_folder(output):
        _check_place(path)
        return
    check_writing(path, force=force)
    if is_folder(output):
        raise InputError(f"{output}: is a folder; -o needs the name of a file")
    folder = path.resolve().parent  # of what a link leads to
    if not folder.exists():
        raise InputError(f"{output}: the folder {folder} is missing; make it, or name another file with -o")
    _check_place(folder)


def _check_place(output: Path) -> None:
    """Refuse a folder in which nothing may be written, or the lowest above it that there is."""
    there = next(p for p in (output, *output.absolute().parents) if p.exists())
    if not there.is_dir():
        raise InputError(f"{there} is a file; -o needs a folder")
    try:
        check_place(there)
    except OSError as err:
        above = "" if there == output else f"{there} "
        raise InputError(f"{output}: {above}may not be written ({err.strerror or err})") from err


def print_json(content: object) -> None:
    """Print the machine-readable summary."""
    sys.stdout.write(document_text(content))


def print_notes(notes: tuple[str, ...], verbose: bool = False) -> None:
    """Print what a person must know of a file, at most as much as a screen holds; ``verbose``: all, asides too."""
    facts = [("note", n) for n in count_alike(n for n in notes if verbose or not isinstance(n, Aside))]
    for _, note in facts if verbose else cut_facts(facts, SCREEN_LINES - 2):  # 2: lines of the next step
        errors.print(f"note: {note}")


class Screen:
    """Shows the stages of a long task in one line, which vanishes; nothing where standard error is no terminal.

    The bar is the share of the whole that is done, where it is known when stages usually begin, else that of the stage.
    """

    def __init__(self, starts: Mapping[str, float] = MappingProxyType({})) -> None:
        self._left = TimeLeft(starts) if starts else None
        self._lines = ProgressLines() if os.environ.get(PROGRESS_VARIABLE) == "json" else None
        text = TextColumn("{task.description:<18}"), TextColumn("{task.fields[left]}")
        columns = (SpinnerColumn(), text[0], BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), text[1])
        self._bar = Bar(*columns, console=errors, transient=True, disable=not sys.stderr.isatty())
        self._task = self._bar.add_task("starting", total=None, left="")

    def __enter__(self) -> Progress:
        """Start showing; returns what is to be told the progress."""
        self._bar.start()
        return self._say

    def __exit__(self, *_: object) -> None:
        """Stop showing."""
        self._bar.stop()

    def _say(self, stage: str, done: int, of: int) -> None:
        if self._lines is not None:
            self._lines.say(stage, done, of)
        if self._left is None:
            self._bar.update(self._task, description=stage, completed=done, total=of or None)
            return
        self._left.update(stage, done, of)
        self._bar.update(self._task, description=stage, completed=self._left.share, total=1.0, left=self._left.text)


class ProgressLines:
    """Says the stages of a long task as lines of JSON on standard error, for a program that watches: two a second."""

    def __init__(self) -> None:
        self._stage, self._next = "", 0.0

    def say(self, stage: str, done: int, of: int) -> None:
        """Print a line, where the stage is new or half a second has gone."""
        now = time.monotonic()
        if stage != self._stage or now >= self._next:
            self._stage, self._next = stage, now + 0.5
            print(json.dumps({"stage": stage, "done": done, "of": of}), file=sys.stderr, flush=True)
