"""One engine for the causes, held against the search by steps: ``python -m tests.benchmarks.one_engine --part single``.

Today a search by steps proposes causes, and the posterior judges them. Here the posterior's sampler proposes them
(``engine_by_draws``). The same runs are given to both ways; one line a run.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import planner.tracing.trace as trace_module
from planner.identification.pipeline import FitSettings
from planner.tracing.search import search
from tests.benchmarks.engine_by_draws import search_by_draws
from tests.blind.plan import tasks
from tests.blind.trial import tried
from tests.independent_arms import table
from tests.independent_arms.judge import judge
from tests.independent_arms.runs import Session


@dataclass
class Tally:
    """What came of one way over several runs."""

    hidden: int = 0
    right: int = 0
    rival: int = 0
    wrong: int = 0
    clean: int = 0
    invented: int = 0
    seconds: float = 0.0

    def line(self, way: str) -> str:
        """Return it in words."""
        return (
            f"{way}: of {self.hidden} hidden causes {self.right} named, {self.rival} more as a rival, {self.wrong} "
            f"names wrong; of {self.clean} clean runs {self.invented} with a name; {self.seconds:.0f} s of processor"
        )


WAYS = {"steps": search, "draws": search_by_draws}


def compare(part: str, count: int, gauges: tuple[str, ...], skip: int = 0) -> None:
    """Give the blind runs of a part to both ways; the stages are looked at, no robot is released."""
    tallies = {way: Tally() for way in WAYS}
    for task in tasks(part, count, table=False, gauges=gauges, skip=skip):
        for way, how in WAYS.items():
            with patch.object(trace_module, "search", how):
                found, tally = tried(task, FitSettings(release=False)), tallies[way]
            if found.failed:
                print(f"{part} {task.seed} {task.gauge} {task.kind}: {found.failed}", flush=True)
                break
            tally.hidden += len(found.planted)
            tally.right += sum(p.named for p in found.planted)
            tally.rival += sum(p.as_rival and not p.named for p in found.planted)
            tally.wrong += found.invented
            tally.clean += not found.planted
            tally.invented += not found.planted and bool(found.named)
            tally.seconds += found.seconds
            names = "; ".join(f"{'' if n.right else '!'}{n.effect}, {n.on}" for n in found.named) or "-"
            hidden = ", ".join(f"{p.kind}@{p.joint}" for p in found.planted)
            print(
                f"{part} {task.seed} {task.gauge} {way:5} [{hidden}] -> {names} | held out {found.geometry * 1e6:.1f} "
                f"-> {found.held_out * 1e6:.1f} um (oracle {found.oracle * 1e6:.1f}), {found.seconds:.1f} s",
                flush=True,
            )
    for way, tally in tallies.items():
        print(tally.line(way), flush=True)


def compare_arms(gauge: str, seeds: Sequence[int], causes: Sequence[int], foreign: bool) -> None:
    """Give arms of the independent simulator to both ways, as far as the released robot."""
    session, rows = Session(gauge), {way: [] for way in WAYS}
    for seed in seeds:
        for way, how in WAYS.items():
            start = time.process_time()
            with patch.object(trace_module, "search", how), TemporaryDirectory() as folder:
                row = judge(seed, session, causes[seed % len(causes)], foreign, Path(folder))
            rows[way].append(row)
            row["seconds"] = time.process_time() - start
            print(way, {k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}, flush=True)
    for way, own in rows.items():
        print(f"{way}\n{table.text(own)}", flush=True)


def main() -> None:
    """Compare both ways."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.one_engine", description=__doc__)
    parser.add_argument("--part", choices=("single", "clean", "arm", "outside", "independent"), default="single")
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--skip", type=int, default=0, help="seeds that are left out before them")
    parser.add_argument("--gauge", action="append", default=[])
    parser.add_argument("--foreign", action="store_true")
    given = parser.parse_args()
    if given.part == "independent":
        seeds = range(given.skip, given.skip + given.runs)
        compare_arms(given.gauge[0] if given.gauge else "bar", seeds, (0, 1, 2, 3, 6), given.foreign)
    else:
        compare(given.part, given.runs, tuple(given.gauge), given.skip)


if __name__ == "__main__":
    main()
