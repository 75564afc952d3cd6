"""A gauge whose reading is neither a length nor a position, in one file: an inclinometer."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from planner.cell.file import CellFile
from planner.cell.gauge_registry import gauge_kinds, register_gauge
from planner.cell.reading import cell_of, load_cell
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.common.schema import read_toml
from planner.common.units import DEG
from planner.documents.residual_table import residuals_csv
from planner.identification.pipeline import identify
from planner.model.model import Model
from planner.report.calibration_report import report_calibration
from planner.runs.loader import load_run
from planner.runs.run import Samples
from planner.runs.writer import save_run
from planner.session.movable_cell import cell_files
from planner.session.options import PlanOptions
from planner.session.planned_session import load_session
from planner.simulation.simulated_run import planned_samples, simulate_run
from planner.simulation.truth import draw_truth
from planner.workflow.fit_overview import fit_overview
from planner.workflow.plan_results import PlanResult
from planner.workflow.planning import plan_cell
from tests.gauges.inclinometer import InclineReadings, Inclinometer
from tests.identification.few_draws import few_draws
from tests.quick_search import quick_search

SHIPPED = load_cell("comau-nj130/edbb").path.read_text()
GAUGE = '[gauge]\nkind = "inclinometer"\nnoise_mdeg = 1\n\n'
POSES = 150


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    path = Path(tmp_path_factory.mktemp("cell")) / "level.toml"
    start, end = SHIPPED.index("[gauge]"), SHIPPED.index("[[obstacles]]")
    text = SHIPPED[:start] + GAUGE + SHIPPED[end:]
    lines = [line for line in text.splitlines() if not line.startswith("tool_about_bar_deg")]
    text = re.sub(r"^map_axis = .*\n", "", "\n".join(lines) + "\n", flags=re.MULTILINE)
    text = text.replace("[tool]\n", "[tool]\nmap_axis = [1, 0, 0]\n")
    path.write_text(text.replace('measure = "continuous"', 'measure = "static"'))
    return cell_of(read_toml(path, CellFile), path, "level")


@pytest.fixture(scope="module")
def poses(cell):
    """Poses all over the joints at which it is nearly level."""
    robot, rng = cell.robot, np.random.default_rng(4)
    q = rng.uniform(0.8 * robot.q_lower, 0.8 * robot.q_upper, (20_000, robot.n_joints))
    level = cell.chain.forward(robot.theta(q)).R[2, 0]
    q = q[np.abs(np.arcsin(level)) < cell.gauge.range][:POSES]
    return Samples(q, np.zeros(POSES, dtype=int), t=np.arange(POSES) * 5.0, pose=np.arange(POSES))


@pytest.fixture(scope="module")
def run(cell, poses):
    return simulate_run(cell, "0" * 12, poses, draw_truth(cell, 3), seed=4)


def test_its_reading_is_the_inclination_of_the_flange(cell, poses):
    """By the angle between the flange's x axis and the vertical, from their cross product."""
    model = Model.from_cell(cell)
    reading = model.reading(poses, np.zeros(len(model.names)))[:, 0]
    R = cell.chain.forward(cell.robot.theta(poses.q)).R
    sine = np.linalg.norm(np.cross(R[:, 0].T, [0.0, 0.0, 1.0]), axis=1)
    np.testing.assert_allclose(np.abs(reading), np.pi / 2 - np.arcsin(np.minimum(sine, 1.0)), atol=1e-6)


def test_its_jacobian_is_the_derivative_of_its_reading(cell, poses):
    model, at = Model.from_cell(cell), poses.take(slice(40))
    rows, step = model.rows(at)[:, 0], 1e-6
    for k in range(len(model.names)):
        errors = np.zeros(len(model.names))
        errors[k] = step
        slope = (model.reading(at, errors) - model.reading(at, -errors))[:, 0] / (2 * step)
        np.testing.assert_allclose(rows[:, k], slope, atol=1e-7)


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_its_run_is_written_in_degrees_and_read_again(run, tmp_path, ending):
    path = tmp_path / f"run.{ending}"
    save_run(run, path)
    table = (pl.read_csv if ending == "csv" else pl.read_parquet)(
        path, **({"comment_prefix": "#"} if ending == "csv" else {})
    )
    np.testing.assert_allclose(table["incline_deg"].to_numpy() * DEG, run.readings.scalar, atol=1e-10)
    again = load_run(path)
    assert isinstance(again.readings, InclineReadings)
    np.testing.assert_allclose(again.readings.scalar, run.readings.scalar, atol=1e-10)
    assert again.readings.columns == run.readings.columns == Inclinometer.columns == "incline_deg"


def test_a_column_without_its_unit_and_two_readings_are_refused(tmp_path):
    head = ",".join(f"q{j}_deg" for j in range(1, 7))
    (tmp_path / "a.csv").write_text(f"{head},incline\n1,2,3,4,5,6,0.1\n")
    with pytest.raises(InputError, match="incline_deg or incline_rad"):
        load_run(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text(f"{head},incline_deg,length_mm\n10,20,30,40,50,60,0.1,400\n")
    with pytest.raises(InputError, match="several readings"):
        load_run(tmp_path / "b.csv")


def test_a_bars_run_is_refused_in_its_cell(cell, run):
    bar = load_cell("comau-nj130/edbb")
    with pytest.raises(InputError, match="has readings 'incline_deg', but the gauge 'edbb'"):
        bar.gauge.check_run(bar, run)


@pytest.mark.slow
@few_draws()
def test_a_simulated_run_is_identified(cell, run):
    """Joint angles come back from angles alone; what is left is the noise, in mrad. The cell has no place of a bar."""
    bare = cell_of(read_toml(cell.path, CellFile), cell.path, "level", planning=False)
    assert not bare.fixtures
    found = identify(run, bare)
    before, after = found.stages[0].held_out.rms, found.stages[-1].held_out.rms
    noise = float(np.median(Model.from_cell(cell).noise(replace(run.samples))))
    assert before > 10 * after
    assert after < 2 * noise
    said = fit_overview(found)
    assert any(" mrad  mean, largest " in text for key, text in said.details if key == "held out")
    assert dict(said.details)["stages"].startswith("held out, mrad ")
    page = report_calibration(found).html().replace("\u00a0", " ")
    assert re.search(r"Held-out error of inclinations, mean [0-9.]+ mrad → [0-9.]+ mrad", page)
    assert "fitted (mrad)" in page
    assert "held-out error (mrad" in page
    assert not re.search(r"(?<!expected )error \(mm|fitted \(mm|held out \(mm|reading[^.<]{0,40}[0-9] mm", page)
    assert json.loads(found.to_json())["angle_unit"] == "mrad"
    table = pl.read_csv(residuals_csv(found).encode())
    assert {"incline_deg", "residual_mrad", "held_out_mrad"} <= set(table.columns)
    assert np.sqrt(np.mean(table["held_out_mrad"].to_numpy() ** 2)) == pytest.approx(1e3 * after, rel=1e-3)


@pytest.mark.slow
def test_it_is_planned(cell, tmp_path):
    """Chosen poses show more of the robot than as many candidates at random, and no set shows more than the bound."""
    few = replace(cell, plan=replace(cell.plan, candidates=300))
    with quick_search():
        plan = plan_cell(few, PlanOptions(poses=32, index="O1"), Stages())
    assert plan.choice.certificate.verified
    assert plan.choice.certificate.value >= plan.choice.on_grid_value
    any_poses = np.random.default_rng(0).permutation(len(plan.pool))[:32]
    rows = plan.choice.model.rows(plan.pool.take(any_poses).samples)[:, 0]
    singular = np.linalg.svd(rows, compute_uv=False)
    assert plan.choice.value > 1.2 * np.exp(np.log(singular).mean()) / np.sqrt(32)
    assert sum(v.role == "calibrate" for d in plan.drives for v in d.visits) == 32
    inclined = np.arcsin(cell.chain.forward(cell.robot.theta(plan.choice.samples.q)).R[2, 0])
    assert np.abs(inclined).max() < cell.gauge.range
    assert plan.programs
    for name, content in cell_files(plan.cell).items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "plan.json").write_text(PlanResult(plan).to_json())
    session = load_session(tmp_path / "plan.json", "to test it", check=True)
    assert {p.fixture for p in session.document.poses} == {d.fixture for d in session.document.drives} == {"level"}
    planned = planned_samples(session.cell, session.document, session.courses)
    assert set(planned.pose) == {p.id for p in session.document.poses if p.role != "mount"}


CELL = (Path(__file__).parent / "inclinometer.toml").read_text()


def read(tmp_path, text):
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return load_cell(str(path))


def test_an_unknown_key_is_told_with_the_keys_of_its_own(tmp_path):
    with pytest.raises(InputError) as told:
        read(tmp_path, CELL.replace("noise_mdeg = 5", "noise_mdeg = 5\nrange_rad = 0.5"))
    assert "unknown key 'gauge.range_rad'; did you mean \"range_deg\"? (allowed here: " in str(told.value)
    named = str(told.value).partition("allowed here: ")[2].rstrip(")").split(", ")
    assert {"kind", "noise_mdeg", "range_deg"} <= set(named)
    assert "own" not in named


def test_the_noise_of_a_length_is_refused(tmp_path):
    assert read(tmp_path, CELL).gauge.noise_angle == pytest.approx(5e-3 * DEG)
    with pytest.raises(
        InputError, match=r"'gauge.noise_um' = 5: the gauge 'inclinometer' reads no length; .*noise_mdeg'"
    ):
        read(tmp_path, CELL.replace("noise_mdeg = 5", "noise_um = 5"))


@pytest.mark.parametrize(
    ("cell", "kind"), [("ur10/edbb", "edbb"), ("so101/wire", "draw-wire"), ("so101/sockets", "ball-socket")]
)
def test_the_noise_of_an_angle_is_refused_where_lengths_are_read(cell, kind, tmp_path):
    shipped = load_cell(cell).path.read_text()
    with pytest.raises(InputError, match=rf"'gauge.noise_mdeg' = 2: the gauge '{kind}' reads no angle; .*noise_um'"):
        read(tmp_path, shipped.replace("[gauge]\n", "[gauge]\nnoise_mdeg = 2\n", 1))
    read(tmp_path, shipped.replace("[gauge]\n", "[gauge]\nnoise_mdeg = 5.0\n", 1))  # as plans hold it for every gauge


def test_a_tracker_may_read_angles(tmp_path):
    shipped = load_cell("iiwa14/tracker").path.read_text()
    gauge = read(tmp_path, shipped.replace("[gauge]\n", "[gauge]\nnoise_mdeg = 2\n", 1)).gauge
    assert gauge.with_turns(True).noise_angle == pytest.approx(2e-3 * DEG)


def test_a_unit_of_an_angle_without_angles_is_refused():
    wrong = type("Wrong", (Inclinometer,), {"kind": "wrong", "angles": 0})
    with pytest.raises(ValueError, match=r'unit = "mrad", but angles = 0 of width = 1: .*; angles = 1 is needed'):
        register_gauge(wrong)
    assert "wrong" not in gauge_kinds()
