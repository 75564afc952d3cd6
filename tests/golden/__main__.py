"""``python -m tests.golden``: run the golden record and compare; see ``--help``."""

import argparse
import json
import os
import resource
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from tests.golden.case import run
from tests.golden.cases import CASES
from tests.golden.compare import differences

RECORD = Path(__file__).parent / "record"
MOST = 40  # differences printed of a case


def main():
    """Return 1 where anything differs."""
    given = _arguments()
    chosen = [c for c in CASES if not given.case or c.name in given.case]
    if unknown := set(given.case) - {c.name for c in CASES}:
        sys.exit(f"no case {', '.join(sorted(unknown))}; there are: {', '.join(c.name for c in CASES)}")
    if given.list:
        for c in chosen:
            print(c.name, *(f"\n    {' '.join(s.words)}" for s in c.steps))
        return 0
    bad = 0
    with ThreadPoolExecutor(given.jobs) as pool:
        waiting = {pool.submit(_timed, c): c for c in sorted(chosen, key=lambda c: -c.weight)}
        for done in as_completed(waiting):
            found, problems, seconds = done.result()
            bad += _judge(waiting[done], found, problems, seconds, given)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{usage.ru_utime + usage.ru_stime:.0f} s of one core")
    print(f"{len(chosen)} cases, {bad} with differences" if bad else f"{len(chosen)} cases, no difference")
    return 1 if bad else 0


def _timed(case):
    begin = time.monotonic()
    found, problems = run(case)
    return found, problems, time.monotonic() - begin


def _judge(case, found, problems, seconds, given):
    path = RECORD / f"{case.name}.json"
    print(f"{case.name}: {seconds:.0f} s", flush=True)
    for p in problems:
        print(f"  {p}")
    if given.update:
        if not problems:
            RECORD.mkdir(exist_ok=True)
            path.write_text(json.dumps(found, indent=1, ensure_ascii=False, sort_keys=True) + "\n")
        return bool(problems)
    if not path.exists():
        print("  there is no record of it; --update writes one")
        return True
    every = list(differences(json.loads(path.read_text()), json.loads(json.dumps(found))))
    for d in every[:MOST]:
        print(f"  {'~ wording' if d.wording else '≠'} {d.where}: {d.text}")
    if len(every) > MOST:
        print(f"  and {len(every) - MOST} more")
    return bool(problems) or any(given.words or not d.wording for d in every)


def _arguments():
    parser = argparse.ArgumentParser(
        prog="python -m tests.golden", description="Compare small runs of every command with the record."
    )
    parser.add_argument("--update", action="store_true", help="write the record anew")
    parser.add_argument("--case", nargs="+", default=[], metavar="NAME", help="these only")
    parser.add_argument("--list", action="store_true", help="list the cases and their commands")
    parser.add_argument("--words", action="store_true", help="a sentence in other words is a difference too")
    parser.add_argument("-j", "--jobs", type=int, default=min(2, os.cpu_count() or 1), help="cases at a time")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
