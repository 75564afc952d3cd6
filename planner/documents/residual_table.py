"""``residuals.csv``: one row a sample, what was read and what the calibrated model leaves of it."""

from __future__ import annotations

import numpy as np

from planner.common.lazy_modules import pl
from planner.common.units import Array, to_deg, to_mm
from planner.documents.calibration import Calibration
from planner.runs.run import Run, ScalarReadings

DECIMALS = 7  # of a millimetre or degree: far below any gauge


def residuals_csv(calibration: Calibration) -> str:
    """Return the text of ``residuals.csv``.

    ``residual_mm`` is reading less prediction, ``held_out_mm`` the same by the fit that did not see the sample's group
    (three columns each, in the base frame, where a position is read); ``whitened`` is the residual's size in standard
    deviations; ``outlier`` is 1 where the noise does not explain it, and ``weight`` by how much the row counts.
    """
    run, fit, last = calibration.run, calibration.fit, calibration.stages[-1]
    white = fit.problem.white_residual(fit.errors)
    columns = _circumstances(run) | _reading(run)
    unit = fit.model.setup.gauge.unit
    columns |= _errors("residual", last.residual, unit) | _errors("held_out", last.held_residual, unit)
    outlier = np.zeros(len(run), dtype=np.int8)
    outlier[calibration.outliers] = 1
    columns |= {"whitened": _round_column(np.sqrt((white**2).mean(axis=1)), 4), "outlier": outlier}
    columns["weight"] = _round_column(calibration.row_weight, 6)
    return pl.DataFrame(columns).write_csv()


def _circumstances(run: Run) -> dict[str, np.ndarray]:
    s = run.samples
    out: dict[str, np.ndarray] = {}
    if s.t is not None:
        out["t_s"] = _round_column(s.t, 9)
    if s.pose is not None:
        out["pose"] = s.pose
    out["place"] = np.array(run.places)[s.place]
    if s.point is not None:
        out["point"] = np.array(run.points)[s.point]
    return out | {
        f"q{j}_{'mm' if j in run.slides else 'deg'}": _round_column(to_deg(q)) for j, q in enumerate(s.q.T, start=1)
    }


def _reading(run: Run) -> dict[str, np.ndarray]:
    r = run.readings
    if r.length is not None:
        return {"length_mm": _round_column(to_mm(r.length))}
    if isinstance(r, ScalarReadings):
        unit, factor = next(iter(r.units.items()))
        return {f"{r.key}_{unit}": _round_column(np.asarray(r.scalar) / factor)}
    if r.position is not None:
        return {f"{axis}_mm": _round_column(to_mm(v)) for axis, v in zip("xyz", r.position.T, strict=True)}
    if r.pixels is not None:
        return {"corners": (~np.isnan(r.pixels[..., 0])).sum(axis=1)}
    assert r.ball is not None
    out: dict[str, np.ndarray] = {"ball": np.array(run.balls)[r.ball]}
    if r.offset is None:
        return out
    return out | {f"d{axis}_mm": _round_column(to_mm(v)) for axis, v in zip("xyz", r.offset.T, strict=True)}


def _errors(name: str, residual: Array, unit: str) -> dict[str, np.ndarray]:
    """Columns of residuals (n, r) [m, rad]: one number, or x, y, z and where the probe turns rx, ry, rz.

    ``unit``: what a thousandth of the one number is called.
    """
    if residual.shape[1] == 1:
        return {f"{name}_{unit}": _round_column(to_mm(residual[:, 0]))}
    out = {f"{name}_{axis}_mm": _round_column(to_mm(residual[:, k])) for k, axis in enumerate("xyz")}
    turns = residual[:, 3:].T
    return out | {f"{name}_r{axis}_deg": _round_column(to_deg(v)) for axis, v in zip("xyz", turns, strict=False)}


def _round_column(values: Array, decimals: int = DECIMALS) -> Array:
    return np.round(values, decimals) + 0.0
