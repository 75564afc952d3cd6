"""``python -m tests.blind [--part single] [--runs 100] [--gauge edbb] [--kind coupling] [--table] [--save FILE]``."""

import argparse
import os
import pickle
import sys
import traceback
from concurrent.futures import ProcessPoolExecutor, as_completed

from tests.blind.plan import PARTS, tasks
from tests.blind.table import table
from tests.blind.trial import Outcome, Task, tried

os.environ.setdefault("OMP_NUM_THREADS", "1")


RUNS = {"single": 200, "arm": 30, "clean": 500, "outside": 100}


def safely(task: Task) -> Outcome:
    """One trial; what goes wrong in it is part of the table."""
    try:
        return tried(task)
    except Exception as wrong:
        return Outcome(task, failed=f"{type(wrong).__name__}: {wrong}\n{traceback.format_exc()}")


def main() -> None:
    """Run the trials and print the table."""
    arguments = _arguments()
    parts = arguments.part or list(PARTS)
    todo = [
        t
        for part in parts
        for t in tasks(
            part,
            arguments.runs or RUNS[part],
            arguments.table,
            tuple(arguments.gauge),
            tuple(arguments.kind),
            arguments.skip,
        )
    ]
    outcomes = []
    with ProcessPoolExecutor(arguments.workers) as pool:
        for done in as_completed([pool.submit(safely, t) for t in todo]):
            outcomes.append(done.result())
            if arguments.verbose:
                print(line(outcomes[-1]), flush=True)
            elif sys.stderr.isatty():
                print(f"\r{len(outcomes)}/{len(todo)}", end="", file=sys.stderr, flush=True)
    outcomes.sort(key=lambda o: (o.task.part, o.task.seed))
    if arguments.save:
        with open(arguments.save, "wb") as file:
            pickle.dump(outcomes, file)
    print("\n".join(table(outcomes)))


def line(o: Outcome) -> str:
    """One outcome in a line."""
    t = o.task
    head = f"{t.part} {t.seed} {t.gauge} {t.kind or '-'} {t.share:g} {t.noise}"
    if o.failed:
        return f"{head} FAILED {o.failed}"
    planted = ", ".join(
        f"{p.kind}@{p.joint} {p.share:.1f}x{'' if p.named else '(rival)' if p.as_rival else '(MISSED)'}"
        for p in o.planted
    )
    names = "; ".join(f"{'' if n.right else '!'}{n.effect}, {n.on} {list(n.rivals[:3])}{n.log_p:.0f}" for n in o.named)
    return (
        f"{head} [{planted}] -> {names or '-'} | {o.geometry * 1e6:.1f} {o.held_out * 1e6:.1f} µm "
        f"(oracle {o.oracle * 1e6:.1f}), {o.seconds:.1f} s"
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.blind")
    parser.add_argument("--part", action="append", choices=PARTS)
    parser.add_argument("--runs", type=int, help="of each part")
    parser.add_argument("--gauge", action="append", default=[], choices=("edbb", "moving", "tracker", "balls"))
    parser.add_argument("--kind", action="append", default=[])
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--table", action="store_true", help="the seeds that are kept for the table")
    parser.add_argument("--skip", type=int, default=0, help="seeds that were looked at before")
    parser.add_argument("--save")
    parser.add_argument("--verbose", action="store_true")
    return parser.parse_args()


if __name__ == "__main__":
    main()
