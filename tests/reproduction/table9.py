"""Table 9 of the TriCal paper and beyond it: one simulated arm, each instrument, judged at the same 500 poses."""

from collections.abc import Iterator
from dataclasses import dataclass

from planner.identification import Calibration
from tests.reproduction.instruments import Measured, arm, bars, bench, identified, tracked, tricentred
from tests.reproduction.judge import Errors, in_frame, validated, validation
from tests.reproduction.truth import hidden

PUBLISHED = {"TriCal": (0.326, 0.624, 0.107), "laser tracker": (0.231, 0.539, 0.087)}  # mean, max, std [mm]
SIZE = 1.62  # of the hidden effects: what the tracker leaves is then of the published order
PLANS = ((1, 1, 100), (1, 1, 150), (1, 1, 200), (1, 1, 300), (1, 1, 400), (2, 1, 200), (2, 1, 300), (2, 1, 400),
         (3, 1, 300), (2, 2, 300), (2, 2, 400))  # fmt: skip
"""Fixtures, tool points and poses of the bar plans that are compared."""


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


def nominal(size=SIZE):
    """Errors of the arm by its data sheet."""
    q, x = validation(hidden(size))
    R, p = arm().flange(q)
    return Errors(in_frame(p + R @ bench().tool, x))


def rows(size=SIZE, plans=PLANS, say=print) -> Iterator[Row]:
    """Calibrate with every instrument, first with the geometry and the compliances, then with what is traced."""
    more = hidden(size) if size else ()
    q, x = validation(more)
    makers = [lambda: tracked(more), lambda: tricentred(more)]
    makers += [lambda plan=plan: bars(*plan, more) for plan in plans]
    for make in makers:
        measured = make()
        for traced in (False, True):
            found = identified(measured, traced)
            row = Row(measured, traced, validated(found, q, x), found)
            say(f"{measured.name}{', traced' * traced}: mean {row.errors.row[0]:.3f}, max {row.errors.row[1]:.3f} mm")
            yield row


def quickest(table):
    """The bar plan of the shortest robot time that is no worse than the published tracker, mean and maximum."""
    mean, largest, _ = PUBLISHED["laser tracker"]
    good = [
        r for r in table
        if r.measured.euros < 20_000 and "bar" in r.measured.name
        and r.errors.row[0] <= mean and r.errors.row[1] <= largest
    ]  # fmt: skip
    return min(good, key=lambda r: r.measured.minutes, default=None)
