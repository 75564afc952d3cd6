"""``python -m tests.blind.workspace_table FOLDER LOG.jsonl [--arms 2] [--first 70001] [--gauge …]``.

FOLDER holds the plans, ``FOLDER/GAUGE/PLAN/plan.json``; what is missing is planned first. Every arm of every cell
is one line of LOG; a run that was stopped goes on where it was, and the table is that of the whole file. ``--arms 0``
only prints it. Errors are means over joint states anywhere [mm].
"""

import argparse
import itertools
import json
import subprocess
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tests.blind.workspace import Outcome, Task, try_task
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.runs import tracker
from tests.simulation.generator.writing import cell_toml

ARM = "comau-nj130"
NOISE = {"edbb": 3e-6, "tracker": 15e-6}  # [m] as the cell states it
AIMS = {"O2": ("--index", "O2"), "aim": ("--aim", "tracing")}
PLANS = {
    "edbb": tuple(f"{aim}{count}" for count in (80, 40, 120) for aim in AIMS),
    "tracker": ("any80", "any40", "any120"),  # poses at random: what is aimed at tracing is for bars
}
HIDDEN = ((0, False), (1, False), (3, False), (6, False), (1, True))
ROUNDED = 1.001  # a robot that is that of geometry alone, by the digits of its file
FIRST_SEED = 70_001  # odd seeds are for the table alone


def safely(task: Task, q: np.ndarray) -> Outcome:
    """Try a task; what goes wrong in it is part of the table."""
    try:
        return try_task(task, q)
    except Exception as wrong:
        return Outcome(task, failed=f"{type(wrong).__name__}: {wrong}\n{traceback.format_exc()}")


def poses(folder: Path, gauge: str, plan: str) -> np.ndarray:
    """Return the joint states (n, N) [rad] that a plan measures; plan them where they are not there yet."""
    arm, out = Arm.from_toml(ARM), folder / gauge / plan
    if plan.startswith("any"):
        return tracker(arm, int(plan.removeprefix("any")), seed=1).scene.q
    if not (out / "plan.json").exists():
        out.mkdir(parents=True, exist_ok=True)
        cell = out.parent / "cell.toml"
        cell.write_text(cell_toml(arm, BENCHES[ARM], gauge, NOISE[gauge], False, ARM))
        aim = next(a for a in AIMS if plan.startswith(a))
        command = ["plan", str(cell), "--poses", plan.removeprefix(aim), *AIMS[aim], "-o", str(out)]
        subprocess.run([sys.executable, "-m", "planner.cli", *command], check=True, stdout=subprocess.DEVNULL)
    document = json.loads((out / "plan.json").read_text())
    return np.radians([p["q_deg"] for p in document["poses"] if p["role"] in ("calibrate", "repeat")])


def all_tasks(gauges: Sequence[str], arms: int, first: int) -> Iterator[Task]:
    """Yield an arm of every cell before the next one, each with a seed of its own.

    What is outside the catalogue is alone, or beside two effects of it.
    """
    cells = [(gauge, plan) for gauge in gauges for plan in PLANS[gauge]]
    every = itertools.product(range(arms), cells, HIDDEN)
    for number, (k, (gauge, plan), (hidden, outside)) in enumerate(every):
        yield Task(gauge, plan, hidden + 2 * (k % 2) * outside, outside, first + 2 * number)


def read_log(log: Path) -> list[Outcome]:
    """Return what a log holds; a line that was cut off is none."""
    out = []
    for text in log.read_text().splitlines() if log.exists() else ():
        try:
            content = json.loads(text)
        except json.JSONDecodeError:
            continue
        out.append(Outcome(**content | {"task": Task(**content["task"])}))
    return out


def table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield one line for each gauge, plan and number of hidden effects."""
    yield (
        f"{'gauge':8}{'plan':8}{'hidden':>8}{'arms':>5}{'nominal':>9}{'geometry':>9}{'released':>9}{'ratio':>7}"
        f"{'worst':>7}{'>1':>4}{'>1.1':>5}{'stated/rms':>11}{'(least':>7}{'most)':>6}{'in 95 %':>8}{'seconds':>8}"
    )
    for (gauge, plan, outside, hidden), group in itertools.groupby(sorted(outcomes, key=_cell), _cell):
        some = [o for o in group if not o.failed]
        if not some:
            yield f"{gauge:8}{plan:8} all failed"
            continue
        ratio = np.array([o.released / o.geometry for o in some])
        truth = np.array([o.stated / o.rms for o in some])
        means = [1e3 * np.mean([getattr(o, name) for o in some]) for name in ("nominal", "geometry", "released")]
        yield (
            f"{gauge:8}{plan:8}{'outside' if outside else hidden:>8}{len(some):5d}{means[0]:9.3f}{means[1]:9.3f}"
            f"{means[2]:9.3f}{np.median(ratio):7.2f}{ratio.max():7.2f}"
            f"{(ratio > ROUNDED).sum():4d}{(ratio > 1.1).sum():5d}"
            f"{np.median(truth):11.2f}{truth.min():7.2f}{truth.max():6.2f}"
            f"{100 * np.mean([o.covered for o in some]):8.1f}{np.median([o.seconds for o in some]):8.1f}"
        )
    for o in outcomes:
        if o.failed:
            yield f"failed: {o.task.gauge} {o.task.plan} {o.task.hidden} {o.task.seed}: {o.failed.splitlines()[0]}"


def _cell(o: Outcome) -> tuple[str, str, bool, int]:
    aim = next((a for a in (*AIMS, "any") if o.task.plan.startswith(a)), "")
    plan = f"{aim:4}{o.task.plan.removeprefix(aim):>4}"
    return o.task.gauge, plan, o.task.outside, 0 if o.task.outside else o.task.hidden


def main() -> None:
    """Run the trials that the log lacks and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("--arms", type=int, default=2)
    parser.add_argument("--first", type=int, default=FIRST_SEED)
    parser.add_argument("--gauge", action="append", choices=tuple(NOISE))
    a = parser.parse_args()
    done = {o.task for o in read_log(a.log)}
    for task in all_tasks(a.gauge or tuple(NOISE), a.arms, a.first):
        if task not in done:
            outcome = safely(task, poses(a.folder, task.gauge, task.plan))
            with a.log.open("a") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")
    print("\n".join(table(read_log(a.log))))


if __name__ == "__main__":
    main()
