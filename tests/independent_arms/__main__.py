"""``python -m tests.independent_arms --gauge bar --causes 0,1,3 --foreign 0 --arms 20 -o table.csv``."""

import argparse
import csv
import os
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported


def _one(task):
    from tests.independent_arms.judge import judge

    seed, session, count, foreign, product_geometry = task
    with tempfile.TemporaryDirectory() as folder:
        return judge(seed, session, count, foreign, Path(folder), product_geometry)


def _arguments():
    parser = argparse.ArgumentParser(prog="python -m tests.independent_arms", description=__doc__)
    parser.add_argument("--gauge", choices=["bar", "driven", "tracker"], default="bar")
    parser.add_argument(
        "--plan", type=Path, help="folder of `edbb plan comau-nj130/edbb`, for a driven bar (else it is planned)"
    )
    parser.add_argument("--causes", default="0,1,2,3,6", help="numbers of hidden causes, taken in turn")
    parser.add_argument("--foreign", type=int, choices=[0, 1], default=0, help="1: one cause that no catalogue lists")
    parser.add_argument("--arms", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0, help="0 to 199 to develop, from 1000 on to judge")
    parser.add_argument("--product-geometry", action="store_true", help="also judge `edbb identify --geometry`")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--read", nargs="+", help="print the figures of tables that were written before")
    parser.add_argument("-o", dest="output", default="table.csv")
    return parser.parse_args()


def _run(given, folder):
    from tests.command import edbb
    from tests.independent_arms import table
    from tests.independent_arms.runs import Session

    plan = given.plan
    if given.gauge == "driven" and plan is None:
        plan = folder / "plan"
        done = edbb("plan", "comau-nj130/edbb", "-o", plan)
        if done.returncode:
            raise SystemExit(f"edbb plan: exit {done.returncode}: {done.stderr}")
    session = Session(given.gauge, plan)
    counts = [int(c) for c in given.causes.split(",")]
    tasks = [
        (seed, session, counts[seed % len(counts)], bool(given.foreign), given.product_geometry)
        for seed in range(given.first_seed, given.first_seed + given.arms)
    ]
    rows = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for future in as_completed([pool.submit(_one, task) for task in tasks]):
            rows.append(future.result())
            rows.sort(key=lambda row: row["seed"])
            table.write(rows, given.output)
    return rows


def main():
    given = _arguments()
    from tests.independent_arms import table

    if given.read:
        tables = [Path(path).read_text(encoding="utf-8").splitlines() for path in given.read]
        rows = [row for table_rows in tables for row in csv.DictReader(table_rows)]
    else:
        with tempfile.TemporaryDirectory() as folder:
            rows = _run(given, Path(folder))
    print(table.text(rows))


if __name__ == "__main__":
    main()
