"""Table 9 of the TriCal paper and beyond it: one simulated arm, each instrument, judged at the same 500 poses."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.identification import Calibration
from tests.reproduction.instruments import Measured, bar_run, identified, tracked, tricentred
from tests.reproduction.judge import Errors, validated
from tests.reproduction.planned import of_bar
from tests.reproduction.truth import hidden

PUBLISHED = {"TriCal": (0.326, 0.624, 0.107), "laser tracker": (0.231, 0.539, 0.087)}  # mean, max, std [mm]
SIZE = 1.62  # of the hidden effects: what the tracker leaves is then of the published order
PLANS = (
    (1, 1, 80, "index"),
    *((1, 1, poses, "tracing") for poses in (100, 200, 300)),
    *((2, 1, poses, "tracing") for poses in (100, 120, 150, 200)),
    *((*places, 150, "tracing") for places in ((3, 1), (1, 2), (2, 2))),
)  # fmt: skip
"""Fixtures, tool points, poses and aim of the bar plans that are compared."""
SEEDS = range(1, 5)  # other arms of the same kind


@dataclass(frozen=True)
class Row:
    """One instrument and one depth of modelling, with the errors at the validation poses."""

    measured: Measured
    traced: bool
    errors: Errors
    calibration: Calibration

    @property
    def held_out_mm(self):
        """Held-out rms of the instrument's own readings."""
        return 1e3 * self.calibration.stages[-1].held_out.rms

    @property
    def found(self):
        """What was traced, in words."""
        traced = self.calibration.traced
        return () if traced is None else tuple(f.note for f in traced.findings)


@dataclass(frozen=True)
class Others:
    """Mean and maximum errors (k, 2) [mm] over other arms: a bar, traced, and a tracker whose model lacks the same."""

    bar: np.ndarray
    tracker: np.ndarray


def rows(size=SIZE, plans=PLANS, say=print) -> Iterator[Row]:
    """Calibrate with every instrument, first with the geometry and the compliances, then with what is traced."""
    more = hidden(size) if size else ()
    makers = [lambda: tracked(more), lambda: tricentred(more)]
    makers += [lambda plan=plan: bar_run(of_bar(*plan), plan[3], more) for plan in plans]
    for make in makers:
        measured = make()
        for traced in (False, True) if size else (False,):
            yield judged(measured, traced, more, say)


def judged(measured, traced, more, say=print) -> Row:
    """Calibrate from one run and judge."""
    found = identified(measured, traced)
    row = Row(measured, traced, validated(found, measured, more), found)
    say(f"{measured.name}{', traced' * traced}: mean {row.errors.row[0]:.3f}, max {row.errors.row[1]:.3f} mm")
    return row


def other_arms(plan, size=SIZE, seeds=SEEDS, say=print) -> Others:
    """Measure other arms, whose gears err in other ways, with the session ``plan`` (fixtures, points, poses, aim)."""
    session, bar, tracker = of_bar(*plan), [], []
    for seed in seeds:
        more = hidden(size, seed)
        bar.append(judged(bar_run(session, plan[3], more, seed), True, more, say).errors.row[:2])
        tracker.append(judged(tracked(more, seed), False, more, say).errors.row[:2])
    return Others(np.array(bar), np.array(tracker))


def quickest(table):
    """The bar plan of the shortest robot time that is no worse than the published tracker, mean and maximum."""
    mean, largest, _ = PUBLISHED["laser tracker"]
    good = [
        r for r in table
        if "bar" in r.measured.name and r.errors.row[0] <= mean and r.errors.row[1] <= largest
    ]  # fmt: skip
    return min(good, key=lambda r: r.measured.minutes, default=None)
