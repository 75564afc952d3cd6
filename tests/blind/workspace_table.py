"""``python -m tests.blind.workspace_table PLAN [PLAN ...] [--arms 12] [--gauge edbb] [--workers 1]``.

Each PLAN is a folder with a ``plan.json`` of a static session of the Comau NJ-130 (``edbb plan``), or ``random:N`` for
N poses at random. Every arm is measured with no, one, three and six hidden effects of the catalogue, and with one
effect that is in no catalogue, alone and beside two others. Errors are means over joint states anywhere [mm].
"""

import argparse
import itertools
import json
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from tests.blind.workspace import Outcome, Task, try_task
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.runs import edbb_static, tracker

HIDDEN = ((0, False), (1, False), (3, False), (6, False), (1, True), (3, True))
FIRST_SEED = 70_001


def safely(task: Task) -> Outcome:
    """Try a task; what goes wrong in it is part of the table."""
    try:
        return try_task(task)
    except Exception as wrong:
        return Outcome(task, failed=f"{type(wrong).__name__}: {wrong}\n{traceback.format_exc()}")


def poses(plan: str, gauge: str) -> np.ndarray:
    """Return the measured joint states (n, N) [rad] of a plan."""
    if plan.startswith("random:"):
        arm, count = Arm.from_toml("comau-nj130"), int(plan.split(":")[1])
        build = edbb_static if gauge == "edbb" else tracker
        return build(arm, count, seed=1, repeats=0.0).scene.q
    document = json.loads((Path(plan) / "plan.json").read_text())
    return np.radians([p["q_deg"] for p in document["poses"] if p["role"] in ("calibrate", "repeat")])


def table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield one line for each plan and number of hidden effects."""
    yield (
        f"{'gauge':8}{'plan':14}{'hidden':>8}{'arms':>5}{'nominal':>9}{'geometry':>9}{'released':>9}{'ratio':>7}"
        f"{'worst':>7}{'>1':>4}{'>1.1':>5}{'stated/rms':>11}{'(worst)':>8}{'seconds':>8}"
    )
    key = lambda o: (o.task.gauge, o.task.plan, o.task.outside, o.task.hidden)  # noqa: E731
    for (gauge, plan, outside, hidden), group in itertools.groupby(sorted(outcomes, key=key), key):
        some = [o for o in group if not o.failed]
        if not some:
            yield f"{gauge:8}{plan:14} all failed"
            continue
        ratio = np.array([o.released / o.geometry for o in some])
        truth = np.array([o.stated / o.rms for o in some])
        means = [1e3 * np.mean([getattr(o, name) for o in some]) for name in ("nominal", "geometry", "released")]
        yield (
            f"{gauge:8}{plan:14}{str(hidden) + ' out' * outside:>8}{len(some):5d}{means[0]:9.3f}{means[1]:9.3f}"
            f"{means[2]:9.3f}{np.median(ratio):7.2f}{ratio.max():7.2f}{(ratio > 1).sum():4d}{(ratio > 1.1).sum():5d}"
            f"{np.median(truth):11.2f}{truth.min():8.2f}{np.median([o.seconds for o in some]):8.1f}"
        )
    for o in outcomes:
        if o.failed:
            yield f"failed: {o.task.gauge} {o.task.plan} {o.task.hidden} {o.task.seed}: {o.failed.splitlines()[0]}"


def main() -> None:
    """Run the trials and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plan", nargs="+")
    parser.add_argument("--arms", type=int, default=12)
    parser.add_argument("--gauge", choices=("edbb", "tracker"), default="edbb")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    a = parser.parse_args()
    todo = []
    for plan in a.plan:
        q = tuple(map(tuple, poses(plan, a.gauge).tolist()))
        for k, (hidden, outside) in itertools.product(range(a.arms), HIDDEN):
            todo.append(Task(a.gauge, Path(plan).name, q, hidden, outside, FIRST_SEED + 2 * k))
    outcomes = []
    with ProcessPoolExecutor(a.workers) as pool:
        for o in pool.map(safely, todo):
            outcomes.append(o)
            if a.verbose:
                print(line(o), flush=True)
    print("\n".join(table(outcomes)))


def line(o: Outcome) -> str:
    """One outcome in a line."""
    if o.failed:
        return o.failed.splitlines()[0]
    numbers = " ".join(f"{1e3 * x:.3f}" for x in (o.nominal, o.geometry, o.released, o.rms, o.stated))
    effects = ", ".join(f"{e.kind} {e.joint} {e.size:.2g}" for e in o.effects)
    return f"{o.task.plan} {o.task.seed} {numbers} {o.seconds:.1f}s {'warned' * o.warned} [{effects}] -> {o.found}"


if __name__ == "__main__":
    main()
