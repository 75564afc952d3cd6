"""``python -m tests.long_runs``: run long tests, those that a change may have broken first; see ``--help``.

A file of long tests belongs to the room of its folder; what drives the whole program belongs to ``cli``. The table
``tests/long_runs.csv`` says when each file last passed, at which commit and in how many seconds of one processor.
"""

import argparse
import csv
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, fields
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from pathlib import Path

from tests.test_layers import ORDER, ROOT, imported_rooms

TESTS = Path(__file__).parent
TABLE = TESTS / "long_runs.csv"
WHOLE = "cli"  # the room of tests that drive the whole program
RUNS = 10  # within so many runs each file has its turn
UNKNOWN_S = 60  # of a file that has not run yet


@dataclass(frozen=True, order=True)
class LongRun:
    """A file of long tests, and its last pass: UTC date, commit, seconds; empty where it has not passed yet."""

    file: str
    date: str = ""
    commit: str = ""
    seconds: str = ""

    @property
    def room(self) -> str:
        """The room that the file tests."""
        folder = Path(self.file).parts[1]
        return folder if folder in ORDER else WHOLE

    @property
    def cost(self) -> float:
        """How long it takes [s]."""
        return float(self.seconds or UNKNOWN_S)


def main() -> int:
    """Return what pytest returns; 0 where nothing was to be run."""
    asked = _arguments()
    table = read_table()
    changed = changed_rooms(asked.base or _last_commit(table))
    order = in_order(table, changed, _git("rev-parse", "HEAD"))
    chosen = order if asked.all else within(order, 60 * asked.minutes * asked.jobs)
    print(f"changed: {', '.join(sorted(changed, key=ORDER.index)) or 'no room'}")
    for run in chosen:
        print(f"  {run.file} ({run.room}): {'passed ' + run.date if run.date else 'not run yet'}, {run.cost:.0f} s")
    print(f"{len(chosen)} of {len(table)} files of long tests")
    if asked.list or not chosen:
        write_table(table)  # files that are new have their row, those that are no more have none
        return 0
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        words = f"-m pytest -m long -rs -n {asked.jobs} --junitxml={report} -o junit_family=xunit1".split()
        command = [sys.executable, *words, *(r.file for r in chosen)]
        code, is_cut = run_within(command, asked.stop_after_s)
        if report.exists():
            if not is_cut:  # else a file of which half has run would look whole
                write_table(updated(table, report, _git("rev-parse", "--short=8", "HEAD")))
            fell = failed_files(report)
            print("failed:", ", ".join(sorted(fell)) or "none")
            if (code == 1 or is_cut) and not fell & {r.file for r in table if r.date}:
                print("The time was over." if is_cut else "None passed before: they are not counted until they have.")
                return 0
    return code


def run_within(command: Sequence[str], seconds: float | None) -> tuple[int, bool]:
    """Run a command, interrupted after so many seconds if it must be; return its code, and whether it was."""
    with subprocess.Popen(command, cwd=TESTS.parent) as running:
        try:
            return running.wait(seconds), False
        except subprocess.TimeoutExpired:
            running.send_signal(signal.SIGINT)
        try:
            return running.wait(60), True  # [s] in which pytest writes its report
        except subprocess.TimeoutExpired:  # it ignores the signal, as what a shell starts in the background does
            running.kill()
            return running.wait(), True


def failed_files(report: Path) -> set[str]:
    """Return the files with a test that failed, by pytest's report."""
    cases = ET.parse(report).iter("testcase")
    return {str(c.get("file")) for c in cases if c.find("failure") is not None or c.find("error") is not None}


def in_order(table: Iterable[LongRun], changed: set[str], head: str) -> list[LongRun]:
    """Return the files in the order in which they are run.

    First the tenth that has waited longest, so that each has its turn within ten runs; then what tests a room that
    changed, and what tests a room above one, from the ground up; then the rest. Of equal age, another is first at
    each commit.
    """
    waiting = sorted(table, key=lambda r: (r.date, sha256(f"{head} {r.file}".encode()).hexdigest()))
    due = waiting[: -(-len(waiting) // RUNS)]
    rest = [r for r in waiting if r not in due]
    touched = sorted((r for r in rest if rooms_below(r.room) & changed), key=lambda r: ORDER.index(r.room))
    return [*due, *sorted(touched, key=lambda r: r.room not in changed), *(r for r in rest if r not in touched)]


def within(order: Sequence[LongRun], seconds: float) -> list[LongRun]:
    """Return the files that fit into a time [s of one processor], in order; the first in any case."""
    out, left = [], seconds
    for run in order:
        if run.cost <= left or not out:
            out.append(run)
            left -= run.cost
    return out


@cache
def rooms_below(room: str) -> frozenset[str]:
    """Return a room and all that it imports, and these import."""
    files = [*(ROOT / room).rglob("*.py")] or [ROOT / f"{room}.py"]
    direct = {r for f in files for r in imported_rooms(f)} & set(ORDER) - {room}
    return frozenset({room}.union(*(rooms_below(r) for r in direct)))


def changed_rooms(base: str) -> set[str]:
    """Return the rooms whose code, or tests, are not as at a commit; all where it is not known."""
    try:
        files = [*_git("diff", "--name-only", base, "--", "planner", "tests", "robots", "g-code").splitlines()]
    except subprocess.CalledProcessError:
        return set(ORDER)
    parts = [Path(f).parts for f in files]
    data = {"robots": "kinematics", "g-code": "programs"}
    rooms = {data.get(p[0], p[1].removesuffix(".py")) for p in parts if len(p) > 1}
    return rooms & set(ORDER)


def updated(table: Iterable[LongRun], report: Path, commit: str) -> list[LongRun]:
    """Return the table with the files that ran whole and passed, by pytest's report."""
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M")
    seconds: dict[str, float] = {}
    failed = failed_files(report)
    for case in ET.parse(report).iter("testcase"):
        file = str(case.get("file"))
        seconds[file] = seconds.get(file, 0.0) + float(case.get("time", 0))
        if _out_of_time(case):
            failed.add(file)
    passed = {f: LongRun(f, now, commit, f"{max(s, 1):.0f}") for f, s in seconds.items() if f not in failed}
    return [passed.get(r.file, r) for r in table]


def _out_of_time(case: ET.Element) -> bool:
    skipped = case.find("skipped")
    return skipped is not None and "no time was left" in str(skipped.get("message"))


def read_table() -> list[LongRun]:
    """Return a row for each file that has long tests today."""
    rows = csv.DictReader(TABLE.read_text().splitlines()) if TABLE.exists() else ()
    known = {r["file"]: LongRun(**r) for r in rows}
    files = sorted(str(p.relative_to(TESTS.parent)) for p in TESTS.rglob("test_*.py") if "mark.long" in p.read_text())
    return [known.get(f, LongRun(f)) for f in files]


def write_table(table: Iterable[LongRun]) -> None:
    """Write the rows, sorted by file."""
    with TABLE.open("w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow([f.name for f in fields(LongRun)])
        out.writerows(astuple(r) for r in sorted(table))


def _last_commit(table: Iterable[LongRun]) -> str:
    """Return the commit of the newest pass, or the one before this."""
    return max(table, key=lambda r: r.date).commit or "HEAD~1"


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=TESTS.parent, capture_output=True, text=True, check=True).stdout.strip()


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.long_runs",
        description="Run long tests: a tenth that has waited longest, those of rooms that changed since the last run "
        "and of rooms above them, then others, as many as the time holds. What passed goes into the table.",
    )
    parser.add_argument("--list", action="store_true", help="say what would be run")
    parser.add_argument("--all", action="store_true", help="all of them, however long")
    parser.add_argument("--minutes", type=float, default=15.0, help="for all processors together (default: 15)")
    parser.add_argument("--stop-after-s", type=float, help="interrupt what still runs after so many seconds")
    parser.add_argument("--base", metavar="COMMIT", help="what changed since then (default: the last run)")
    parser.add_argument("-j", "--jobs", type=int, default=2, help="processors (default: 2)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
