"""The study as CSV tables: one a finding, units in the column names, six significant digits."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from planner.common.units import DEG, MM, UM
from planner.studies.summary import StudySummary

MDEG = DEG * 1e-3  # [rad]
DIGITS = 6


def table_csv(data: Mapping[str, Any] | Sequence[Mapping[str, Any]]) -> str:
    """Return columns, or rows, as CSV, numbers to six significant digits."""
    frame = pl.DataFrame(data, infer_schema_length=None)
    numbers = [c for c, kind in frame.schema.items() if kind == pl.Float64]
    return frame.with_columns(pl.col(numbers).fill_nan(None).round_sig_figs(DIGITS)).write_csv()


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
    """Singular values: the root-mean-square reading per prior size along each direction, the strongest first."""
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
    """The effect of one prior size of each parameter on the reading, the largest first."""
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
            | {"poses": places.poses, "value": p.value, "best": p is places.best}
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
    last = {d.name: d.because for d in fixtures.never}
    more = {n: f"{s.fixtures} fixtures" for s in fixtures.steps for n in s.becomes}
    columns = {"parameter": list[str](), "shown_by": list[str](), "because": list[str]()}
    for d in fixtures.steps[0].dropped:
        remedy = fixtures.remedy(d.name)
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
