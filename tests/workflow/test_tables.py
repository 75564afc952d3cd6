"""A calibration's tables: the numbers of its document, as data frames in mm and degrees."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.identification.pipeline import FitSettings, identify
from planner.model.finding import Finding
from planner.runs.loader import load_run
from planner.tracing.trace import trace
from planner.workflow.identification import CalibrationResult
from tests.identification.few_draws import few_draws
from tests.identification.worlds import arm_of
from tests.simulation.generator.truth import draw_truth

NAME = "kuka-kr6-r700"


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """A calibration of a bar's run, its joints soft, which nobody declared."""
    folder = tmp_path_factory.mktemp("tables")
    made = runs.edbb_static(arm_of(NAME), 90, seed=2, truth=draw_truth(arm_of(NAME), 2), logs=())
    run_file, cell_file = made.write(folder)
    run, cell = load_run(run_file, 6), load_cell(str(cell_file), planning=False)
    with few_draws():
        return CalibrationResult(identify(run, cell, settings=FitSettings(geometry=True), tracer=trace), cell)


@pytest.mark.slow
def test_parameters_are_read_by_name_and_as_a_frame_in_the_units_of_the_document(robot):
    document = {p["name"]: p for p in json.loads(robot.to_json())["parameters"]}
    frame = robot.parameters.to_frame()
    assert set(frame["parameter"]) == set(document) == set(robot.parameters)
    for row in frame.iter_rows(named=True):
        said = document[row["parameter"]]
        scale = {"mm": 1e3, "deg": 180 / np.pi}.get(row["unit"])
        if scale is not None and row["group"] == "geometry":
            assert row["unit"] == said["unit"]
            assert row["value"] == pytest.approx(said["value"], rel=1e-8)
            assert row["value"] == pytest.approx(robot.parameters[row["parameter"]].value * scale, rel=1e-9)
        assert (row["sigma"] is None) == (not said["identifiable"])
        assert row["seen"] or row["because"]


@pytest.mark.slow
def test_findings_tool_and_stages_have_their_unit_in_the_name(robot):
    play = Finding(effect="backlash", on="joint 3", value=2e-4, std=1e-5, unit="rad", gain=3e-5, rivals=("a", "b"))
    known = replace(robot, calibration=robot.calibration.model_copy(update={"findings": (play,)}))
    (row,) = known.findings.to_frame().iter_rows(named=True)
    assert (row["value"], row["sigma"], row["unit"]) == (pytest.approx(200.0), pytest.approx(10.0), "µrad")
    assert (row["held_out_gain_mm"], row["rivals"]) == (pytest.approx(0.03), "a, b")
    assert known.findings[0] is play
    point = robot.tool.to_frame()
    assert point[["x_mm", "y_mm", "z_mm"]].row(0) == pytest.approx(tuple(1e3 * v for v in robot.tool[0].p_FM))
    stages = robot.stages.to_frame()
    assert stages["stage"].to_list() == [s.name for s in robot.calibration.stages]
    assert stages["held_out_mean_mm"][-1] == pytest.approx(1e3 * robot.stages[-1].held_out.mean)


@pytest.mark.slow
def test_the_expected_error_is_that_of_the_file(robot, tmp_path):
    robot.write_robot(tmp_path)
    written = pl.read_csv(tmp_path / "expected_error.csv")
    frame = robot.expected_error.to_frame()
    assert frame.columns == written.columns
    assert frame.to_numpy() == pytest.approx(written.to_numpy(), abs=1e-4)


@pytest.mark.slow
def test_tables_show_themselves_short_and_as_html(robot):
    for table in (robot.parameters, robot.findings, robot.tool, robot.stages, robot.expected_error, robot):
        assert len(repr(table)) < 300
        assert "array" not in repr(table)
    assert "<table" in robot.parameters._repr_html_()
