"""Table 9 of the TriCal paper and beyond it: one simulated arm, each instrument, judged at the same 500 poses."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from planner.identification.calibration import Calibration
from tests.reproduction.instruments import Measured, bar_run, identified, tracked, tricentred
from tests.reproduction.judge import Errors, validated
from tests.reproduction.planned import of_bar
from tests.reproduction.truth import hidden

PUBLISHED = {"TriCal": (0.326, 0.624, 0.107), "laser tracker": (0.231, 0.539, 0.087)}  # mean, max, std [mm]
SIZE = 1.2
"""Size of the hidden effects. It follows from one published figure, the mean of 0.231 mm that the tracker leaves, and
from nothing else: it is the size at which the mean over the five arms of seeds 0 to 4, by the 31 parameters alone, is
that (1.196; what is left grows in proportion to it). The tracker's maximum and standard deviation and all that TriCal
and the bar leave are predictions. The paper states no errors of the robot before calibration."""
PLANS = (
    (1, 1, None, None),
    (1, 1, 80, "index"),
    *((1, 1, poses, "tracing") for poses in (100, 200, 300)),
    *((2, 1, poses, "tracing") for poses in (100, 120, 150, 200)),
    *((3, 1, poses, "tracing") for poses in (100, 120, 150)),
    *((*places, 150, "tracing") for places in ((1, 2), (2, 2))),
)  # fmt: skip
"""Fixtures, tool points, poses and aim of the bar plans that are compared; the first one is the default plan."""
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
        """Held-out rms of the instrument's own readings, by the robot that is released."""
        released = self.calibration.release
        return 1e3 * (self.calibration.stages[-1] if released is None else released).held_out.rms

    @property
    def expected_mm(self):
        """Error over the workspace that the fit expects of itself."""
        return 1e3 * self.calibration.workspace_error

    @property
    def found(self):
        """What was traced, in words."""
        return tuple(f.note for f in self.calibration.findings)


@dataclass(frozen=True)
class Others:
    """Mean and maximum errors (k, 2) [mm] on other arms: a bar's session, traced, and a tracker with nothing traced."""

    name: str
    minutes: float
    bar: np.ndarray
    tracker: np.ndarray

    @property
    def hold(self):
        """On which of the arms (k,) the bar is no worse than the published tracker."""
        return (self.bar <= PUBLISHED["laser tracker"][:2]).all(axis=1)


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


def other_arms(table, size=SIZE, seeds=SEEDS, say=print) -> list[Others]:
    """Measure other arms, whose gears err in other ways, with the quickest session, the next, until one does for all.

    ``table``: rows on the first arm; only sessions that are good enough there are tried.
    """
    kinds = {seed: hidden(size, seed) for seed in seeds}
    tracker = [judged(tracked(more, seed), False, more, say).errors.row[:2] for seed, more in kinds.items()]
    out = []
    for row in quickest(table):
        plan = row.measured.session
        made, bar = of_bar(*plan), []
        for seed, more in kinds.items():
            bar.append(judged(bar_run(made, plan[3], more, seed), True, more, say).errors.row[:2])
        out.append(Others(row.measured.name, row.measured.minutes, np.array(bar), np.array(tracker)))
        if out[-1].hold.all():
            break
    return out


def quickest(table):
    """The bar's rows that are no worse than the published tracker, mean and maximum, the shortest robot time first."""
    mean, largest, _ = PUBLISHED["laser tracker"]
    good = [r for r in table if "bar" in r.measured.name and r.errors.row[0] <= mean and r.errors.row[1] <= largest]
    return sorted(good, key=lambda r: r.measured.minutes)
