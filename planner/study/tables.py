"""The study as CSV tables: one a finding, units in the column names, six significant digits."""

import polars as pl

from planner.common.units import DEG, MM, UM, Array
from planner.design.observability.information import rms_sensitivity
from planner.effects.parameters import Parameter
from planner.study.basis import StudyBasis
from planner.study.fixture_count import FixtureCount
from planner.study.fixture_places import FixtureMap

MDEG = DEG * 1e-3  # [rad]
DIGITS = 6


def _to_csv(frame: pl.DataFrame) -> str:
    numbers = [c for c, kind in frame.schema.items() if kind == pl.Float64]
    return frame.with_columns(pl.col(numbers).fill_nan(None).round_sig_figs(DIGITS)).write_csv()


def find_absorbers(basis: StudyBasis) -> dict[str, list[str]]:
    """Return, for each kept parameter, the dropped ones whose error it also carries."""
    out: dict[str, list[str]] = {name: [] for name in basis.seen.names}
    for dropped in basis.seen.dropped:
        for name, _ in dropped.direction:
            if name in out:
                out[name].append(dropped.name)
    return out


def _columns_in_unit(
    parameters: tuple[Parameter, ...], values: list[float | None], what: str
) -> dict[str, list[float | None]]:
    """Two columns, lengths in mm and angles in thousandths of a degree, each empty where the other one holds."""
    pairs = list(zip(parameters, values, strict=True))
    return {
        f"{what}_mm": [v / MM if v is not None and p.unit == "m" else None for p, v in pairs],
        f"{what}_mdeg": [v / MDEG if v is not None and p.unit == "rad" else None for p, v in pairs],
    }


def identifiability_csv(basis: StudyBasis) -> str:
    """Each parameter: seen or not and why, prior and predicted standard deviation, whose errors it carries."""
    parameters = basis.whole.parameters
    std = dict(zip(basis.seen.names, basis.predicted.std.tolist(), strict=True))
    inflation = dict(zip(basis.seen.names, basis.predicted.inflation.tolist(), strict=True))
    why, carried = {d.name: d.because for d in basis.seen.dropped}, find_absorbers(basis)
    names = [p.name for p in parameters]
    priors: list[float | None] = [p.prior for p in parameters]
    return _to_csv(
        pl.DataFrame(
            {
                "parameter": names,
                "seen": [n in std for n in names],
                **_columns_in_unit(parameters, priors, "prior"),
                **_columns_in_unit(parameters, [std.get(n) for n in names], "std"),
                "std_over_prior": [std[p.name] / p.prior if p.name in std else None for p in parameters],
                "inflation": [inflation.get(n) for n in names],
                "carries_the_error_of": [" ".join(carried.get(n, [])) for n in names],
                "because": [why.get(n, "") for n in names],
            },
            schema_overrides=dict.fromkeys(
                ("prior_mm", "prior_mdeg", "std_mm", "std_mdeg", "std_over_prior", "inflation"), pl.Float64
            ),
        )
    )


def spectrum_csv(basis: StudyBasis) -> str:
    """Singular values: the root-mean-square reading per prior size along each direction, the strongest first."""
    mu = basis.seen.spectrum
    return _to_csv(
        pl.DataFrame(
            {
                "direction": list(range(1, len(mu) + 1)),
                "reading_um": (mu / UM).tolist(),
                "seen": [k < basis.seen.rank for k in range(len(mu))],
            }
        )
    )


def curves_csv(basis: StudyBasis) -> str:
    """Index against number of poses, raw (m, rad) and unit-free, with the proven limit and the bend."""
    return _to_csv(
        pl.DataFrame(
            [
                {
                    "index": c.index,
                    "scaling": "unit-free" if c.scaled else "raw",
                    "poses": int(n),
                    "value": float(value),
                    "bound": float(limit),
                    "bend": bool(n == c.knee),
                }
                for c in basis.curves
                for n, value, limit in zip(c.sizes, c.values, c.bounds, strict=True)
            ]
        )
    )


def prior_size_effects(basis: StudyBasis) -> tuple[Array, Array]:
    """Return what one prior size of each parameter changes a reading by, rms and largest, (P,) [m]."""
    change = basis.whole_rows * basis.whole.prior
    return rms_sensitivity(change), abs(change).max(axis=(0, 1))


def sensitivity_csv(basis: StudyBasis) -> str:
    """The effect of one prior size of each parameter on the reading, the largest first."""
    rms, most = prior_size_effects(basis)
    seen = set(basis.seen.names)
    frame = pl.DataFrame(
        {
            "parameter": list(basis.whole.names),
            "seen": [n in seen for n in basis.whole.names],
            "rms_um": (rms / UM).tolist(),
            "max_um": (most / UM).tolist(),
        }
    )
    return _to_csv(frame.sort(pl.col("rms_um").round_sig_figs(9), descending=True, maintain_order=True))


def correlation_csv(basis: StudyBasis) -> str:
    """Correlation of the identified parameters at the chosen poses, as a square."""
    rho = basis.predicted.correlation
    columns = {name: rho[:, k].tolist() for k, name in enumerate(basis.seen.names)}
    return _to_csv(pl.DataFrame({"parameter": list(basis.seen.names), **columns}))


def map_csv(places: FixtureMap) -> str:
    """Each place of the fixture: whether it can be used, what is seen from it, and the index."""
    return _to_csv(
        pl.DataFrame(
            [
                {
                    "plane": p.plane,
                    "x_mm": float(p.p_BX[0] / MM),
                    "y_mm": float(p.p_BX[1] / MM),
                    "z_mm": float(p.p_BX[2] / MM),
                    "status": p.status,
                    "candidates": p.candidates,
                    "parameters_seen": p.rank if p.information is not None else None,
                    "index": places.index,
                    "poses": places.poses,
                    "value": p.value,
                    "best": p is places.best,
                }
                for p in places.places
            ],
            infer_schema_length=None,
        )
    )


def fixtures_csv(fixtures: FixtureCount, index: str) -> str:
    """Fixtures one by one: what becomes visible with each, and the index of the robot's own parameters."""
    return _to_csv(
        pl.DataFrame(
            [
                {
                    "fixtures": s.fixtures,
                    "x_mm": float(s.place[0] / MM),
                    "y_mm": float(s.place[1] / MM),
                    "z_mm": float(s.place[2] / MM),
                    "parameters": s.parameters,
                    "seen": s.seen,
                    "robot_seen": s.robot_seen,
                    "becomes_visible": " ".join(s.becomes),
                    "still_unseen": " ".join(d.name for d in s.dropped),
                    "index": f"{index} of the robot's own",
                    "value": s.value,
                }
                for s in fixtures.steps
            ]
        )
    )


def remedies_csv(fixtures: FixtureCount) -> str:
    """Each unseen parameter: the least effort that shows it, or why nothing does."""
    last = {d.name: d.because for d in fixtures.never}
    first = fixtures.steps[0].dropped
    more = {n: s.fixtures for s in fixtures.steps for n in s.becomes}
    rows = []
    for d in first:
        remedy = fixtures.remedy(d.name)
        shown = f"{more[d.name]} fixtures" if d.name in more else remedy.name if remedy else "nothing"
        rows.append({"parameter": d.name, "shown_by": shown, "because": last.get(d.name, d.because)})
    return _to_csv(pl.DataFrame(rows, schema={"parameter": pl.String, "shown_by": pl.String, "because": pl.String}))
