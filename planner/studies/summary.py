"""What the study found, in a few lines for the person and as JSON for a program."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from planner.common.summary import Summary
from planner.common.units import MDEG, MM, UM, Array
from planner.design.fixtures.places import find_stands
from planner.design.observability.identifiability import join_names
from planner.design.observability.information import INDEX_RULES
from planner.studies.basis import StudyBasis
from planner.studies.fixture_count import FixtureCount
from planner.studies.fixture_places import FixtureMap

SCHEMA = "edbb-study/1"


@dataclass(frozen=True)
class StudySummary:
    """The findings, and the files that hold them."""

    basis: StudyBasis
    places: FixtureMap
    fixtures: FixtureCount
    files: tuple[str, ...]

    def overview(self) -> Summary:
        """Return which parameters are seen, with how many poses and from which places."""
        b = self.basis
        own = b.curve
        share = b.predicted.std / b.model.prior
        order = np.argsort(-share, kind="stable")[:3]
        least = ", ".join(f"{b.seen.names[k]} (σ {100 * share[k]:.0f} % of its prior)" for k in order)
        unseen = [d.name for d in b.seen.dropped]
        limit = f"no {own.knee} of the {len(b.pool)} candidates do better than {format_number(own.limit_at_knee)}"
        facts = [
            *([("unseen", f"{join_names(unseen)} (why: unseen.csv)")] if unseen else []),
            ("poses", f"{b.index} bends at {own.knee} poses, {format_number(own.at_knee)} (in m, rad); {limit}"),
            ("least sure", least),
            ("fixture", f"{describe_best_place(self.places)}{self._moved_text()}"),
            *(("fixtures", sentence) for sentence in describe_fixtures(self.fixtures, b.index)),
        ]
        title = (
            f"{b.cell.name}: {b.seen.rank} of {len(b.whole.names)} parameters can be seen, judged by {b.poses} poses"
        )
        return Summary(title, facts)

    def _stands(self) -> list[str]:
        """Names of the bodies that hold the fixture up."""
        return [self.basis.cell.obstacles[k].name for k in find_stands(self.basis.cell)]

    def _moved_text(self) -> str:
        names, fixtures = self._stands(), self.basis.cell.fixtures
        moved = f"; {' and '.join(names)} moved along, all other obstacles stayed" if names else ""
        return moved + (f"; fixture {fixtures[0].name} alone" if len(fixtures) > 1 else "")

    def content(self) -> dict[str, Any]:
        """Return the findings as ``study.json`` holds them; all places in mm, index values raw (m, rad)."""
        b = self.basis
        rms, most = b.effects
        return {
            "schema": SCHEMA,
            "robot": b.cell.robot.name,
            "cell": b.cell.name,
            "seed": b.seed,
            "index": b.index,
            "index_scaling": "m, rad",
            "candidates": len(b.pool),
            "poses": b.poses,
            "parameters": list(b.seen.names),
            "dropped": [{"name": d.name, "because": d.because} for d in b.seen.dropped],
            "absorbs": {name: carried for name, carried in b.absorbers.items() if carried},
            "predicted": [
                {"name": p.name, "std": _round(std), "prior": _round(p.prior), "unit": p.unit}
                for p, std in zip(b.model.parameters, b.predicted.std, strict=True)
            ],
            "sensitivity_um": {
                n: {"rms": _round(r), "max": _round(m)}
                for n, r, m in zip(b.whole.names, rms / UM, most / UM, strict=True)
            },
            "curves": [{"index": c.index, "scaling": c.scaling, "bend": c.knee} for c in b.curves],
            "fixture_map": self._map(),
            "fixtures": self._fixtures(),
            "files": list(self.files),
        }

    def _map(self) -> dict[str, Any]:
        m = self.places
        best, present = (
            {"position_mm": _mm(p.p_BX), "status": p.status, "parameters_seen": p.rank, "ratio": _round(m.ratio(p))}
            for p in (m.best_place, m.present)
        )
        counts = {"places": len(m.places), "usable": len(m.usable_places)}
        return counts | {
            "present": present,
            "best": best,
            "moves_along": self._stands(),
            "in_words": describe_best_place(m),
        }

    def _fixtures(self) -> dict[str, Any]:
        f = self.fixtures
        return {
            "needed": f.fewest_fixtures,
            "steps": [
                {"fixtures": s.fixtures, "position_mm": _mm(s.place), "parameters": s.parameters}
                | {"seen": s.seen, "robot_seen": s.robot_seen, "becomes_visible": list(s.becomes)}
                | {"value": _round(s.value)}
                for s in f.steps
            ],
            "remedies": [{"name": r.name, "shows": list(r.shows)} for r in f.remedies],
            "never": [{"name": d.name, "because": d.because} for d in f.lost_parameters],
            "in_words": list(describe_fixtures(f, self.basis.index)),
        }


def format_number(value: float) -> str:
    """Return a value with three significant digits, without exponents where a person would write none."""
    return f"{value:.3g}" if 1e-3 <= abs(value) < 1e3 else f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.2e}"


def _round(value: float) -> float | None:
    """Round to six significant digits; ``None`` for what is not finite."""
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _mm(p: Array) -> list[float]:
    return [round(float(v) / MM, 3) for v in p]


def format_place(p: Array) -> str:
    """Return a place as a person reads it."""
    return "[" + ", ".join(f"{v / MM:.0f}" for v in p) + "] mm"


def describe_best_place(m: FixtureMap) -> str:
    """Say where the fixture stands best, and how much that would gain."""
    best, present = m.best_place, m.present
    of = f"of {len(m.usable_places)} usable places on the grid ({len(m.places)} tried)"
    if best is present:
        return f"the present place is the best {of}"
    maximise = INDEX_RULES[m.index].maximise
    gain = (100.0 if maximise else -100.0) * (best.value / present.value - 1.0)
    side = "higher" if maximise else "lower"
    # 10.0: [%] places that mirror each other about axis 1 differ by up to 5 %: a smaller gain means little
    head = "" if abs(gain) >= 10.0 else "no place is clearly better than the present one; "
    return (
        f"{head}best {of} is {format_place(best.p_BX)}: {m.index} is {abs(gain):.0f} % {side} there than at the present"
        f" {format_place(present.p_BX)}, both with {m.poses} poses"
    )


def describe_fixtures(f: FixtureCount, index: str) -> tuple[str, ...]:
    """Say how many fixtures are needed, and what would show the rest."""
    out, steps = [], f.steps
    if f.fewest_fixtures == 1:
        more = ""
        if len(steps) > 1:
            times = max(steps[0].value, steps[1].value) / min(steps[0].value, steps[1].value)
            more = f" (but with one at {format_place(steps[1].place)} {index} of the robot's own parameters is "
            more += f"{times:.1f} times better)"
        out.append(f"one is enough: no further one makes a parameter visible{more}")
    else:
        shown = "; ".join(f"{', '.join(s.becomes)} with {s.fixtures}" for s in steps if s.becomes)
        out.append(f"{f.fewest_fixtures} are needed: becomes visible: {shown}")
    known: set[str] = set()
    for r in f.remedies:
        fresh = [n for n in r.shows if n not in known]
        known |= set(fresh)
        if fresh:
            out.append(f"{join_names(fresh)} would be seen with {r.name}")
    out += [
        f"{d.name} can never be seen by a length gauge, it {d.because.removeprefix(d.name + ' ')}"
        for d in f.lost_parameters
    ]
    return tuple(out)


def table_csv(data: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> str:
    """Return columns, or rows, as CSV, numbers to six significant digits."""
    frame = pl.DataFrame(data, infer_schema_length=None)
    numbers = [c for c, kind in frame.schema.items() if kind == pl.Float64]
    return frame.with_columns(pl.col(numbers).fill_nan(None).round_sig_figs(6)).write_csv()  # digits


def _in_unit(name: str, value: float | None, unit: str) -> dict[str, float | None]:
    """Two columns, lengths in mm and angles in thousandths of a degree, of which the other one is empty."""
    sizes = {"mm": MM if unit == "m" else None, "mdeg": MDEG if unit == "rad" else None}
    return {f"{name}_{u}": None if value is None or size is None else value / size for u, size in sizes.items()}


def identifiability_csv(study: StudySummary) -> str:
    """Each parameter: seen or not and why, prior and predicted standard deviation, whose errors it carries."""
    basis = study.basis
    known = zip(basis.predicted.std.tolist(), basis.predicted.inflation.tolist(), strict=True)
    seen = dict(zip(basis.seen.names, known, strict=True))
    why, carried = {d.name: d.because for d in basis.seen.dropped}, basis.absorbers
    rows = []
    for p in basis.whole.parameters:
        std, inflation = seen.get(p.name, (None, None))
        row = {"parameter": p.name, "seen": p.name in seen}
        row |= _in_unit("prior", p.prior, p.unit) | _in_unit("std", std, p.unit)
        row |= {"std_over_prior": None if std is None else std / p.prior, "inflation": inflation}
        row |= {"carries_the_error_of": " ".join(carried.get(p.name, [])), "because": why.get(p.name, "")}
        rows.append(row)
    return table_csv(rows)


def spectrum_csv(study: StudySummary) -> str:
    """Singular values: the root-mean-square reading per prior sigma along each direction, the strongest first."""
    mu = study.basis.seen.spectrum
    order = np.arange(1, len(mu) + 1)
    return table_csv({"direction": order, "reading_um": mu / UM, "seen": order <= study.basis.seen.rank})


def curves_csv(study: StudySummary) -> str:
    """Index against number of poses, raw (m, rad) and unit-free, with the proven limit and the bend."""
    return table_csv(
        [
            {"index": c.index, "scaling": c.scaling, "poses": n, "value": value, "bound": limit, "bend": n == c.knee}
            for c in study.basis.curves
            for n, value, limit in zip(c.sizes.tolist(), c.values.tolist(), c.bounds.tolist(), strict=True)
        ]
    )


def sensitivity_csv(study: StudySummary) -> str:
    """The effect of one prior sigma of each parameter on the reading, the largest first."""
    rms, most = (v / UM for v in study.basis.effects)
    seen = [n in study.basis.seen.names for n in study.basis.whole.names]
    frame = pl.DataFrame({"parameter": study.basis.whole.names, "seen": seen, "rms_um": rms, "max_um": most})
    order = pl.col("rms_um").round_sig_figs(9)
    return table_csv(frame.sort(order, descending=True, maintain_order=True).to_dict())


def correlation_csv(study: StudySummary) -> str:
    """Correlation of the identified parameters at the chosen poses, as a square."""
    names = study.basis.seen.names
    return table_csv({"parameter": names, **dict(zip(names, study.basis.predicted.correlation.T, strict=True))})


def map_csv(study: StudySummary) -> str:
    """Each place of the fixture: whether it can be used, what is seen from it, and the index."""
    places = study.places
    return table_csv(
        [
            {"plane": p.plane}
            | {f"{axis}_mm": float(x / MM) for axis, x in zip("xyz", p.p_BX, strict=True)}
            | {"status": p.status, "candidates": p.candidates}
            | {"parameters_seen": p.rank if p.information is not None else None, "index": places.index}
            | {"poses": places.poses, "ratio_to_present": places.ratio(p), "best": p is places.best_place}
            for p in places.places
        ]
    )


def fixtures_csv(study: StudySummary) -> str:
    """Fixtures one by one: what becomes visible with each, and the index of the robot's own parameters."""
    return table_csv(
        [
            {"fixtures": s.fixtures}
            | {f"{axis}_mm": float(x / MM) for axis, x in zip("xyz", s.place, strict=True)}
            | {"parameters": s.parameters, "seen": s.seen, "robot_seen": s.robot_seen}
            | {"becomes_visible": " ".join(s.becomes), "still_unseen": " ".join(d.name for d in s.dropped)}
            | {"index": f"{study.basis.index} of the robot's own", "value": s.value}
            for s in study.fixtures.steps
        ]
    )


def unseen_csv(study: StudySummary) -> str:
    """Each unseen parameter: the least effort that shows it, or why nothing does."""
    fixtures = study.fixtures
    last = {d.name: d.because for d in fixtures.lost_parameters}
    more = {n: f"{s.fixtures} fixtures" for s in fixtures.steps for n in s.becomes}
    columns = {"parameter": list[str](), "shown_by": list[str](), "because": list[str]()}
    for d in fixtures.steps[0].dropped:
        remedy = fixtures.find_remedy(d.name)
        columns["parameter"].append(d.name)
        columns["shown_by"].append(more.get(d.name, remedy.name if remedy else "nothing"))
        columns["because"].append(last.get(d.name, d.because))
    return table_csv(columns)


TABLES: dict[str, Callable[[StudySummary], str]] = {
    "correlation.csv": correlation_csv,
    "fixture_map.csv": map_csv,
    "fixtures_needed.csv": fixtures_csv,
    "identifiability.csv": identifiability_csv,
    "index_curve.csv": curves_csv,
    "sensitivity.csv": sensitivity_csv,
    "spectrum.csv": spectrum_csv,
    "unseen.csv": unseen_csv,
}
