"""``identification.json`` and ``residuals.csv``: contract, units, frames, and the test of what is left."""

import csv
import io
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.documents.calibration import Calibration
from planner.documents.residual_table import residuals_csv
from planner.fit.assumptions import SIGNIFICANCE
from planner.model.identification_document import Identification, error_size
from tests.report.calibrated import calibrated

CASES = [("edbb_static", 90), ("tracker", 60), ("balls", 60), ("edbb_continuous", 2500)]
KEYS = {
    "schema", "robot", "n_samples", "n_groups", "split", "stages", "parameters", "findings", "unexplained",
    "noise_floor_mm", "condition_number", "warnings",
}  # fmt: skip


LAST = pytest.param(CASES[-1], marks=pytest.mark.long)  # the fit of a drive alone is looked at below


@pytest.fixture(params=[*CASES[:-1], LAST], ids=[c[0] for c in CASES])
def c(request: pytest.FixtureRequest) -> Calibration:
    return calibrated(*request.param)


@pytest.mark.slow
def test_keys_are_the_contracts(c: Calibration) -> None:
    content: dict[str, Any] = c.content()
    assert content.keys() >= KEYS
    assert content["schema"] == "edbb-identification/1"
    assert content["robot"] == "comau-nj130"
    assert content["split"].keys() == {"by", "hold_out"}
    assert [s["name"] for s in content["stages"]][:3] == ["nominal", "frames", "geometry"]
    for stage in content["stages"]:
        assert stage.keys() >= {"name", "effects", "parameters", "train", "held_out"}
        assert stage["held_out"].keys() >= {"rms_mm", "mean_mm", "max_mm"}
    for p in content["parameters"]:
        assert p.keys() >= {"name", "value", "nominal", "std", "unit", "identifiable", "absorbs"}
        assert p["std"] > 0  # of what the run does not show its usual size is known
        assert p["identifiable"] or p["because"]
    assert content["unexplained"].keys() >= {"structured", "along", "rms_mm"}


@pytest.mark.slow
def test_numbers_are_in_the_units_that_they_name(c: Calibration) -> None:
    content: dict[str, Any] = c.content()
    factor = {"mm": 1e3, "deg": 180 / math.pi, "urad/Nm": 1e6}
    for p, e in zip(content["parameters"], c.estimates, strict=True):
        assert p["unit"] == {"m": "mm", "rad": "deg", "rad/Nm": "urad/Nm"}[e.unit]
        assert p["value"] == pytest.approx(e.value * factor[p["unit"]], rel=1e-8, abs=1e-12)
        assert p["nominal"] == pytest.approx(e.nominal * factor[p["unit"]], rel=1e-8, abs=1e-12)
    last = content["stages"][-1]
    each = np.sqrt((c.stages[-1].held_residual[:, :3] ** 2).sum(axis=1)) * 1e3
    assert last["held_out"]["rms_mm"] == pytest.approx(math.sqrt((each**2).mean()))
    assert last["held_out"]["mean_mm"] == pytest.approx(each.mean())
    assert last["held_out"]["max_mm"] == pytest.approx(each.max())
    assert content["unexplained"]["rms_mm"] == last["held_out"]["rms_mm"]


@pytest.mark.slow
def test_text_is_json_without_nan_and_reads_back(c: Calibration) -> None:
    text = c.to_json()
    assert text == c.to_json()
    data = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} in JSON"))
    read = Identification.model_validate(data)
    assert read.n_samples == len(c.run)
    assert [p.name for p in read.estimates] == [e.name for e in c.estimates]


@pytest.mark.slow
def test_condition_without_end_is_null() -> None:
    c = calibrated("edbb_static", 90).model_copy(update={"condition_number": math.inf, "noise_floor": None})
    assert c.content()["condition_number"] is None
    assert c.content()["noise_floor_mm"] is None


@pytest.mark.slow
def test_frames_stand_for_the_fitted_corrections(c: Calibration) -> None:
    """With the gauge put where the frames say, and its parameters at zero, the residuals stay what they are."""
    assert c.released is not None
    fit = c.released.fit
    plain = [k for k, p in enumerate(fit.model.parameters) if p.group in ("gauge", "geometry")]
    frames, model, setup, errors = c.frames, fit.model.subset(plain), fit.model.setup, fit.errors[plain]
    moved = replace(setup, p_FM=np.array([x.p_FM for x in frames.tool]))
    if frames.fixtures:
        moved = replace(moved, p_BX=np.array([x.position for x in frames.fixtures]), zero=frames.zero)
    else:
        moved = replace(
            moved,
            p_BG=np.array([x.position for x in frames.places]),
            R_BG=np.array([_rpy(x.rpy) for x in frames.places]),
        )
    gauge = np.array([p.group == "gauge" for p in model.parameters])
    samples, readings = c.run.samples, c.run.readings
    found = replace(model, setup=moved).residual(
        samples, moved.targets(samples, readings), np.where(gauge, 0.0, errors)
    )
    wanted = model.residual(samples, setup.targets(samples, readings), errors)
    assert np.allclose(error_size(found), error_size(wanted), atol=1e-12)


def _rpy(angles: np.ndarray) -> np.ndarray:
    """Rotation of roll, pitch, yaw about fixed axes, written out."""
    (a, b, c), cos, sin = angles, math.cos, math.sin
    X = np.array([[1, 0, 0], [0, cos(a), -sin(a)], [0, sin(a), cos(a)]])
    Y = np.array([[cos(b), 0, sin(b)], [0, 1, 0], [-sin(b), 0, cos(b)]])
    Z = np.array([[cos(c), -sin(c), 0], [sin(c), cos(c), 0], [0, 0, 1]])
    return Z @ Y @ X


@pytest.mark.slow
def test_residuals_read_back(c: Calibration) -> None:
    rows = list(csv.DictReader(io.StringIO(residuals_csv(c))))
    assert len(rows) == len(c.run)
    last = c.stages[-1]
    for name, residual in (("residual", last.residual), ("held_out", last.held_residual)):
        one = residual.shape[1] == 1
        columns = [f"{name}_mm"] if one else [f"{name}_{axis}_mm" for axis in "xyz"]
        read = np.array([[float(r[k]) for k in columns] for r in rows])
        assert np.allclose(read, residual * 1e3, atol=1e-7)
    q = np.array([[float(r[f"q{j}_deg"]) for j in range(1, 7)] for r in rows])
    assert np.allclose(np.radians(q), c.run.samples.q, atol=1e-8)
    if c.run.readings.length is not None:
        assert np.allclose([float(r["length_mm"]) for r in rows], c.run.readings.length * 1e3, atol=1e-6)
    assert [k for k, r in enumerate(rows) if r["outlier"] == "1"] == c.outliers.tolist()
    white = np.array([float(r["whitened"]) for r in rows])
    assert 0.7 < np.sqrt((white**2).mean()) < 1.1


@pytest.mark.slow
def test_degrees_of_freedom_are_those_of_the_readings() -> None:
    c = calibrated("edbb_static", 90)
    dof = c.content()["degrees_of_freedom"]
    fitted = sum(e.identifiable for e in c.estimates)
    assert len(c.run) - fitted <= dof < len(c.run) - 0.7 * fitted
    long = calibrated("edbb_continuous", 2500, 0.0, False)
    assert long.content()["degrees_of_freedom"] < 2500 / long.correlation_time


@pytest.mark.slow
def test_what_is_left_reads_as_the_tests_say() -> None:
    c = calibrated("edbb_static", 160, 1e-4, released=False)
    assert all(t.p_value < SIGNIFICANCE for t in c.diagnosis.found)
    unexplained = c.content()["unexplained"]
    assert unexplained["structured"] is True
    assert "joint 4" in unexplained["along"]
    assert 0 < unexplained["structured_rms_mm"] < 1.05 * unexplained["rms_mm"]
