"""What a planned check will show (``shows.json``) and what a check finds (``check.json``), in files and words."""

from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.checks.assumptions import FALSE_ALARM, POWER
from planner.checks.evaluation import (
    ANYTHING,
    Change,
    CheckVerdict,
    JudgedChange,
    build_detector,
    hidden_changes_text,
    possible_changes,
    shows_play,
)
from planner.common.numbers import number_of
from planner.common.summary import Fact, Summary
from planner.common.units import Array, in_units, round_finite, to_deg, to_mm
from planner.documents.baseline import Baseline
from planner.model.finding import percent
from planner.runs.run import Samples

MM_DECIMALS = 4  # of a tenth of a micrometre
MOST_SHOWN = 2  # changes that would have shown, of the smallest and of the largest, which are said
SHOWN_RATES = f"found {100 * POWER:.0f} times of 100, with {100 * FALSE_ALARM:g} false alarm in 100 sound robots"
RATES = {"false_alarm": FALSE_ALARM, "power": POWER}


@dataclass(frozen=True)
class CheckForecast:
    """What a planned check will tell: least motion of the tool [m] found with the stated power, of every change."""

    changes: tuple[Change, ...]
    detectable: tuple[float, ...]
    hidden: tuple[Change, ...] = ()
    title = "Plan of a check"
    purpose = "A few poses tell whether and where the robot has changed since its calibration; they do not calibrate."
    rates = SHOWN_RATES

    @classmethod
    def of(cls, baseline: Baseline, cell: Cell, samples: Samples) -> "CheckForecast":
        """Foresee the check of some poses."""
        known = baseline.restrict_to_samples(samples)
        every = possible_changes(cell, known.model.setup, shows_play(samples))
        detector, changes, hidden = build_detector(known, every, samples)
        return cls(changes, tuple(detector.detectable_motion(k, c.square) for k, c in enumerate(changes)), hidden)

    @property
    def hidden_because(self) -> str:
        """Say which changes no reading shows, and why; empty where all show."""
        return hidden_changes_text(self.hidden) if self.hidden else ""

    def content(self) -> dict[str, object]:
        """Return ``shows.json``."""
        each = zip(self.changes, self.detectable, strict=True)
        changes = [{"change": c.name, "detectable_mm": _mm(d)} for c, d in each]
        changes += [{"change": c.name, "detectable_mm": None} for c in self.hidden]
        why = {"hidden_because": self.hidden_because} if self.hidden else {}
        return {"schema": "edbb-check-forecast/1", **RATES, "changes": changes, **why}

    def rows(self) -> list[tuple[str, str]]:
        """Return every change that shows, and from which motion of the tool on, in mm."""
        return [(c.name, f"{to_mm(d):.3f}") for c, d in zip(self.changes, self.detectable, strict=True)]

    def facts(self) -> list[Fact]:
        """Say from which motion of the tool on each change shows, the smallest first."""
        least = sorted(self.rows(), key=lambda row: float(row[1]))
        return [("shows", f"{size} mm  {name}") for name, size in least] + [("rates", SHOWN_RATES)]


def verdict_content(verdict: CheckVerdict, robot: str) -> dict[str, object]:
    """Return ``check.json``."""
    best = verdict.likeliest_change
    return {
        "schema": "edbb-check/1",
        "robot": robot,
        "run": verdict.run,
        "outcome": verdict.outcome,
        "passed": verdict.passed,
        "advice": verdict.advice,
        "cause": None if verdict.outcome == "unchanged" else ANYTHING if best is None else best.change.name,
        "rivals": [] if verdict.outcome == "unchanged" else [j.change.name for j in verdict.rivals],
        "p_value": round_finite(verdict.smallest_p),
        "threshold": round_finite(verdict.threshold),
        **RATES,
        **in_units(MM_DECIMALS, limit_mm=verdict.limit),
        "changes": [_change_section(j) for j in verdict.judged],
        "nameless": round(verdict.nameless, 4),
        "readings": [
            {"pose": int(p), **_reading(d, "difference"), **_reading(s, "std")}
            for p, d, s in zip(verdict.poses, verdict.difference, verdict.std, strict=True)
        ],
        "notes": list(verdict.notes),
        **({"doubtful": verdict.doubtful} if verdict.doubtful else {}),
    }


def _reading(numbers: Array, name: str) -> dict[str, object]:
    """Name the numbers (r,) of one reading [m, rad]: a length, a position, or a position with turns."""
    if len(numbers) == 1:
        return in_units(2, **{f"{name}_um": numbers[0]})
    turns = in_units(5, **{f"{name}_turn_deg": numbers[3:]}) if len(numbers) > 3 else {}
    return in_units(2, **{f"{name}_um": numbers[:3]}) | turns


def _change_section(j: JudgedChange) -> dict[str, object]:
    values = {p.name: float(v) for p, v in zip(j.change.parameters, j.values, strict=True)}
    sized = {f"{n}_mm": to_mm(v) for n, v in values.items() if n.startswith(("tool", "fixture"))}
    sized |= {f"{n}_deg": to_deg(v) for n, v in values.items() if f"{n}_mm" not in sized}
    return {
        "change": j.change.name,
        "p_value": round_finite(j.test.p_value),
        "probability": round(j.probability, 4),
        **{f"{k}_mm": _mm(v) for k, v in (("motion", j.motion), ("std", j.motion_std), ("detectable", j.detectable))},
        "values": {k: round(float(v), 5) for k, v in sized.items()},
    }


def _mm(value: float) -> float | None:
    return round(float(to_mm(value)), MM_DECIMALS) if np.isfinite(value) else None


def verdict_overview(verdict: CheckVerdict) -> Summary:
    """Return the verdict in words."""
    said = "passed" if verdict.passed else "FAILED"
    chance = f"{verdict.smallest_p:.2g}" if verdict.smallest_p >= 1e-6 else "below 1 in a million"
    p = f"chance of such readings without a change: {chance}; the check fails below {verdict.threshold:.2g}"
    facts: list[Fact] = [("do", verdict.advice), ("test", f"{p} ({100 * FALSE_ALARM:g} of 100 sound robots)")]
    if verdict.doubtful:
        facts.append(("cause", f"one wrong reading: {verdict.doubtful}"))
    elif verdict.outcome != "unchanged":
        best = verdict.likeliest_change
        facts.append(("cause", ANYTHING if best is None else _cause_text(best)))
        facts += [("or", _cause_text(j)) for j in verdict.rivals]
    else:
        least = sorted((j for j in verdict.judged if j.change.kind != "collision"), key=lambda j: j.detectable)
        some = least if len(least) <= 2 * MOST_SHOWN else [*least[:MOST_SHOWN], *least[-MOST_SHOWN:]]
        facts += [("would show", f"{to_mm(j.detectable):.3f} mm  {j.change.name}") for j in some]
    title = f"{verdict.run}: {said}, {verdict.outcome} since the calibration ({number_of(len(verdict.poses), 'pose')})"
    return Summary(title, facts, notes=verdict.notes)


def _cause_text(j: JudgedChange) -> str:
    """Name a change with its size."""
    turn = f", {to_deg(j.values[0]):+.4f} deg" if j.change.kind == "zero" else ""
    size = f"{to_mm(j.motion):.3f} ± {to_mm(j.motion_std):.3f} mm of the tool"
    return f"{j.change.name}{turn}: {size} ({percent(j.probability)})"
