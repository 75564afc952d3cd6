"""``python -m tests.golden``: run the cases of the record and say what moved; see ``--help``."""

import argparse
import json
import os
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import astuple, replace
from datetime import date
from hashlib import sha256
from pathlib import Path

from tests.golden.case import ROOT, run
from tests.golden.cases import CASES
from tests.golden.quantity import Quantity, changes, read_table, renewed, write_table

TABLE = Path(__file__).parent / "quantities.csv"
REASONS = Path(__file__).parent / "reasons.md"
RESULTS = ROOT / ".golden"  # of this state of the code, so that an interrupted call goes on
CODE = ("planner", "robots", "g-code", "tests/golden", "tests/simulation/generator")


def main():
    """Return 1 where a quantity moved beyond its tolerance, or a command did not do what its case says."""
    given = _arguments()
    chosen = [c for c in CASES if not given.case or c.name in given.case]
    if unknown := set(given.case) - {c.name for c in CASES}:
        sys.exit(f"no case {', '.join(sorted(unknown))}; there are: {', '.join(c.name for c in CASES)}")
    if given.list:
        for c in chosen:
            print(c.name, *(f"\n    {' '.join(s.words)}" for s in c.steps))
        return 0
    results = RESULTS / _state()
    results.mkdir(parents=True, exist_ok=True)
    found, wrong = [], []
    with ThreadPoolExecutor(given.jobs) as pool:
        waiting = {pool.submit(_result, c, results, given.anew): c for c in sorted(chosen, key=lambda c: -c.weight)}
        for done in as_completed(waiting):
            case, (quantities, problems, seconds) = waiting[done], done.result()
            print(f"{case.name}: {len(quantities)} quantities, {seconds:.0f} s", *problems, sep="\n  ", flush=True)
            found += quantities
            wrong += [case.name] if problems else []
    return _judge(chosen, found, wrong, given)


def _judge(chosen, found, wrong, given):
    names = {c.name for c in chosen}
    table = read_table(given.against)
    kept = [q for q in table if q.case in names]
    every = changes(kept, found)
    for c in every:
        if c.outside or given.all:
            print(c.text)
    count = Counter(c.verdict for c in every)
    said = ", ".join(f"{n} {verdict}" for verdict, n in sorted(count.items()))
    print(f"{len(chosen)} cases, {len(every)} quantities: {said}" + (f"; wrong: {', '.join(wrong)}" if wrong else ""))
    if given.update and not wrong:
        others = [q for q in table if q.case not in names and q.case in {c.name for c in CASES}]
        write_table(TABLE, [*others, *renewed(kept, found)])
        before = REASONS.read_text() if REASONS.exists() else "# Why quantities of the record moved\n"
        REASONS.write_text(f"{before}\n- {date.today()}: {given.update} ({said})\n")
        return 0
    return 1 if wrong or any(c.outside for c in every) else 0


def _result(case, folder, anew):
    """Return quantities, problems and seconds of a case, from a file where this state of the code has run it."""
    path = folder / f"{case.name}.json"
    if path.exists() and not anew:
        rows, problems, seconds = json.loads(path.read_text())
        return [Quantity(*row) for row in rows], problems, seconds
    begin = time.monotonic()
    found, problems = run(case)
    seconds = time.monotonic() - begin
    found = [replace(q, value=float(q.value)) for q in found]
    path.with_suffix(".part").write_text(json.dumps([[astuple(q) for q in found], problems, seconds]))
    path.with_suffix(".part").replace(path)
    return found, problems, seconds


def _state():
    """Return a hash of all that decides a result: code, robots, languages, cases, kernels of linear algebra."""
    text = sha256(os.environ.get("OPENBLAS_CORETYPE", "").encode())
    for name in CODE:
        for path in sorted(p for p in (ROOT / name).rglob("*") if p.is_file() and "__pycache__" not in p.parts):
            if path not in (TABLE, REASONS):
                text.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return text.hexdigest()[:16]


def _arguments():
    parser = argparse.ArgumentParser(
        prog="python -m tests.golden",
        description="Run small cases of every command and say which quantities moved: by how much, in which direction, "
        "against which tolerance. A call that was interrupted goes on where it was.",
    )
    parser.add_argument("--update", metavar="REASON", help="write what moved into the table, and why into reasons.md")
    parser.add_argument("--case", nargs="+", default=[], metavar="NAME", help="these only")
    parser.add_argument("--list", action="store_true", help="list the cases and their commands")
    parser.add_argument("--all", action="store_true", help="print what stayed within its tolerance too")
    parser.add_argument("--anew", action="store_true", help="run what has been run with this code already")
    parser.add_argument("--against", type=Path, default=TABLE, metavar="TABLE", help="of another version")
    parser.add_argument("-j", "--jobs", type=int, default=min(2, os.cpu_count() or 1), help="cases at a time")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
