"""The quantities of what a command writes: which numbers of a document an engineer looks at, and what is a change.

A tolerance is what such a person would notice, and above what the linear algebra of another processor moves.
"""

import csv
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.quantity import Quantity

COUNT = "0"  # a count does not move unseen
DRAWN = "30 %"  # of the posterior: with a quarter of the draws, others move it by up to a quarter
Document = dict[str, Any]
Read = str | Callable[[Document], float | None]


@dataclass(frozen=True)
class Row:
    """A quantity of a document: its name, unit, where it stands (keys joined by dots, or a function), tolerance."""

    name: str
    unit: str
    where: Read
    tolerance: str
    better: str = ""
    factor: float = 1.0

    def value(self, document: Document) -> float | None:
        """Return the number, or ``None`` where the document has none."""
        found: Any = document
        if not isinstance(self.where, str):
            found = self.where(document)
        else:
            for key in self.where.split("."):
                found = found.get(key) if isinstance(found, dict) else None
        return None if found is None else self.factor * float(found)


def _count(*keys: str) -> Callable[[Document], float | None]:
    return lambda d: next((len(d[k]) for k in keys if d.get(k) is not None), None)


def _index(name: str) -> Callable[[Document], float | None]:
    """Return the index of a plan whose poses were chosen by it."""
    return lambda d: d["observability"][name] if d.get("observability", {}).get("index") == name else None


def _fixtures(d: Document) -> float | None:
    named = {p["fixture"] for p in d.get("poses", ()) if "fixture" in p}
    return len(named) or None


PLAN = (
    Row("poses", "", _count("poses"), COUNT),
    Row("fixtures used", "", _fixtures, COUNT),
    Row("support poses", "", _count("supports"), "2", "less"),
    Row("parameters seen", "", _count("parameters"), COUNT, "more"),
    Row("index O2", "1", _index("O2"), "3 %", "less"),
    Row("index O1", "1", _index("O1"), "3 %", "more"),
    Row("gap to the bound", "1", "observability.gap", "0.02", "less"),
    Row("drive", "min", "trajectory.duration_s", "4 %", "less", 1 / 60),
    Row("cost of the tour", "s", "tour.cost_s", "4 %", "less"),
    Row("clearance", "mm", "path.clearance_mm", "10 %"),
    Row("legs that needed a detour", "", "path.planned_legs", "3"),
)
IDENTIFICATION = (
    Row("readings rejected", "", _count("rejected"), COUNT),
    Row("degrees of freedom", "", "degrees_of_freedom", "10 %"),
    Row("rms of the nominal robot", "mm", lambda d: d["stages"][0]["train"]["rms_mm"], "2 %"),
    Row("rms held out", "mm", lambda d: d["stages"][-1]["held_out"]["rms_mm"], "10 %", "less"),
    Row("rms of the validation run", "mm", "release.validation.rms_mm", "10 %", "less"),
    Row("noise of repeats", "mm", "noise_floor_mm", "10 %"),
    Row("stated error anywhere", "mm", "known_anywhere_mm", DRAWN, "less"),
    Row("stated error where measured", "mm", "release.where_measured_mm", DRAWN, "less"),
    Row("limit", "mm", "release.at_most_mm", DRAWN, "less"),
    Row("stated error of the nominal robot", "mm", "release.nominal_anywhere_mm", "5 %"),
    Row("share of the posterior in what is released", "1", "release.share", "0.05"),
    Row("findings", "", _count("findings"), COUNT),
)


def _known(d: Document) -> float | None:
    each = d.get("compliances")
    return each and sum(c["share_of_prior"] < 1 / 3 for c in each)


LOADED = (
    Row("compliances known to a third", "", _known, COUNT, "more"),
    Row("compliance of joint 3", "urad/Nm", lambda d: d["compliances"][2]["value_urad_Nm"], "0.05"),
    Row("std of compliance 3", "urad/Nm", lambda d: d["compliances"][2]["std_urad_Nm"], "5 %", "less"),
    Row("noise", "um", "noise_um", "10 %"),
    Row("deflection, rms of the circle", "um", lambda d: d["circles"][0]["kinematic_error_um"]["rms"], "5 %"),
)
CIRCULAR = (
    Row("bidirectional deviation G(b)", "um", lambda d: d["circles"][0]["G_b_um"], "5 %"),
    Row("hysteresis H", "um", lambda d: d["circles"][0]["H_um"], "10 %"),
    Row("mean bidirectional D", "um", lambda d: d["circles"][0]["D_um"], "1 %"),
    Row("reversal steps", "", lambda d: len(d["circles"][0]["paths"][0]["reversals"]), COUNT),
)
ACCURACY = (
    Row("poses", "", lambda d: d.get("n_poses", d.get("poses")), COUNT),
    Row("mean error before", "mm", "before.mean_mm", "3 %"),
    Row("mean error after", "mm", "after.mean_mm", "15 %", "less"),
    Row("largest error after", "mm", "after.max_mm", "15 %", "less"),
    Row("centrings, rms apart", "um", "rms_um", "15 %"),
    Row("centrings, rms expected", "um", "expected_rms_um", "5 %"),
)
STUDY = (
    Row("parameters seen", "", _count("parameters"), COUNT, "more"),
    Row("fixtures needed", "", "fixtures.needed", COUNT, "less"),
    Row("usable places", "", "fixture_map.usable", "3", "more"),
    Row("index at the present place", "1", "fixture_map.present.value", "3 %"),
    Row("index at the best place", "1", "fixture_map.best.value", "3 %", "less"),
    Row("sensitivity to theta2, rms", "um", "sensitivity_um.theta2.rms", "2 %"),
)
PLACES = (
    Row("candidates", "", "candidates", "3 %", "more"),
    Row("compliance 2 left by own circle", "1", "own_circle.share_of_prior.compliance2", "5 %", "less"),
    Row("sets of places", "", _count("sets"), COUNT),
)


def _share(kind: str) -> Callable[[Document], float]:
    """Return the mean share of the prior that is left of the compliances."""
    return lambda d: float(np.mean([p[f"share_{kind}"] for p in d["parameters"] if p["name"].startswith("compliance")]))


BOTH = tuple(
    Row(f"share of prior left of compliances, {k}", "1", _share(k), "5 %", "less")
    for k in ("unloaded", "loaded", "together")
)
KNOWN = {
    "edbb-plan/1": PLAN,
    "edbb-identification/1": IDENTIFICATION,
    "edbb-loaded/1": LOADED,
    "edbb-circular/1": CIRCULAR,
    "edbb-accuracy/1": ACCURACY,
    "edbb-study/1": STUDY,
    "edbb-places/1": PLACES,
    "edbb-both/1": BOTH,
}
PROGRAMS = {".src", ".mod", ".pdl", ".nc", ".mpf", ".cnc", ".ngc", ".script", ".yaml", ".dat"}
CONTINUOUS = 1000  # rows and more are those of a drive that is measured all along, as many as it lasts
NUMBER = re.compile(r"-?\d+\.\d+")


def of_files(case: str, folder: Path, laid: set[str]) -> Iterator[Quantity]:
    """Yield the quantities of every file that the commands of a case wrote; ``laid`` were there before."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file() and str(p.relative_to(folder)) not in laid):
        suffix, inside = path.suffix.lower(), path.relative_to(folder)
        if suffix == ".json":
            found = of_document(json.loads(path.read_text()))
        elif suffix == ".csv" and path.parent == folder:
            found = _of_table(path)
        elif suffix in PROGRAMS:
            found = iter([Quantity("", "lines", float(len(_lines(path))), "", "3 %")])
        else:
            continue
        for q in found:
            name = inside if suffix in PROGRAMS else inside.with_suffix("")
            yield replace(q, case=case, name=f"{name}: {q.name}")


def of_document(document: Document) -> Iterator[Quantity]:
    """Yield the quantities of a document, by its schema; none of a schema that the record does not follow."""
    for row in KNOWN.get(document.get("schema", ""), ()):
        value = row.value(document)
        if value is not None:
            yield Quantity("", row.name, value, row.unit, row.tolerance, row.better)
    for f in document.get("findings", ()):
        name = f"{f['effect']}, {f['on']}"
        if f.get("probability") is not None:
            yield Quantity("", f"probability of {name}", f["probability"], "1", "0.1")
        if f.get("value") is not None:
            yield Quantity("", f"value of {name}", f["value"], f["unit"], "10 %")


def of_correction(before: Path, after: Path) -> Iterator[Quantity]:
    """Yield how many lines of a program, or of a table of targets, have other numbers, and by how much."""
    pairs = [pair for pair in _same_words(_lines(before), _lines(after)) if pair[0] != pair[1]]
    yield Quantity("", "lines corrected", float(len(pairs)), "", COUNT, "more")
    steps = [abs(float(b) - float(a)) for one, other in pairs for a, b in _numbers(one, other) if a != b]
    yield Quantity("", "mean change of a number", float(np.mean(steps)) if steps else 0.0, "mm or deg", "10 %")


def _same_words(before: list[str], after: list[str]) -> Iterator[tuple[str, str]]:
    """Yield the lines of two texts that have the same words; a remark that was put in has no partner."""
    words = [[NUMBER.sub("#", line) for line in text] for text in (before, after)]
    for block in SequenceMatcher(None, *words, autojunk=False).get_matching_blocks():
        yield from zip(before[block.a :][: block.size], after[block.b :][: block.size], strict=True)


def _numbers(one: str, other: str) -> Iterator[tuple[str, str]]:
    a, b = NUMBER.findall(one), NUMBER.findall(other)
    return zip(a, b, strict=True) if len(a) == len(b) else iter(())


def _of_table(path: Path) -> Iterator[Quantity]:
    """Yield how many rows a run has, and the means of what was measured."""
    rows = list(csv.DictReader(line for line in _lines(path) if not line.startswith("#")))
    yield Quantity("", "rows", float(len(rows)), "", COUNT if len(rows) < CONTINUOUS else "4 %")
    lengths = [float(r["length_mm"]) for r in rows if r.get("length_mm")]
    if lengths:
        yield Quantity("", "mean length", float(np.mean(lengths)), "mm", "0.02")


def _lines(path: Path) -> list[str]:
    return [line for line in path.read_text(encoding="latin-1").splitlines() if line.strip()]
