"""One tool, one fixture and one value of each parameter leave the planner: those of the robot that is written.

Every number that a person can take for the robot's is looked up where it stands (document, robot.toml, page, Python,
what compensation takes) and held to the one robot, and this robot explains the readings by itself.
"""

import json
import math
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import CalibratedRobot
from planner.documents.calibration import joint_zeros_text
from planner.identification.pipeline import FitSettings, identify
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Identification
from planner.report.calibration_data import CalibrationFacts
from planner.report.calibration_report import calibration_content
from planner.runs.loader import load_run
from planner.workflow.identification import CalibrationResult
from tests.identification.few_draws import few_draws
from tests.identification.worlds import arm_of
from tests.simulation.generator import runs
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.truth import draw_truth

NAME = "kuka-kr6-r700"


@pytest.fixture(scope="module", params=["posterior", pytest.param("geometry", marks=pytest.mark.long)])
def written(request, tmp_path_factory):
    """A calibration of a bar's run, its folder, and the readings [m] with the angles [rad] that they belong to."""
    folder = tmp_path_factory.mktemp(request.param)
    made = runs.edbb_static(arm_of(NAME), 90, seed=2, truth=draw_truth(arm_of(NAME), 2), logs=())
    run_file, cell_file = made.write(folder)
    run, cell = load_run(run_file, 6), load_cell(str(cell_file), planning=False)
    with few_draws():
        found = CalibrationResult(identify(run, cell, settings=FitSettings(geometry=request.param == "geometry")), cell)
    found.write(folder / "out")
    return found, folder / "out", run


def document(folder):
    return json.loads((folder / "identification.json").read_text())


def of_parameters(parameters, what):
    """Position [mm] and standard deviation of what three parameters say."""
    rows = {p["name"]: p for p in parameters}
    return [[rows[f"{what}_{axis}"][key] for axis in "xyz"] for key in ("value", "std")]


@pytest.mark.slow
def test_the_tool_is_one_wherever_it_stands(written):
    found, folder, _ = written
    said, robot = document(folder), tomllib.loads((folder / "robot.toml").read_text())
    (frame,), (own,) = said["frames"]["tool"], robot["tool_points"]
    known = json.loads((folder / "expected_error.json").read_text())
    at, std = of_parameters(said["parameters"], "map")
    assert frame["map_mm"] == pytest.approx(at, abs=1e-6)
    assert own["position_mm"] == pytest.approx(at, abs=1e-6)
    assert known["tool_mm"] == pytest.approx(at, abs=6e-4)  # six digits
    assert [e.value * 1e3 for e in map(found.parameters.get, ("map_x", "map_y", "map_z"))] == pytest.approx(
        at, abs=1e-6
    )
    assert np.array(found.tool[0].p_FM) * 1e3 == pytest.approx(at, abs=1e-6)
    assert load_robot(str(folder)).tool_points[0].p_FM * 1e3 == pytest.approx(at, abs=1e-6)
    assert frame["std_mm"] == pytest.approx(std, rel=1e-6)
    assert own["std_mm"] == pytest.approx(std, abs=1e-5)
    assert all(0 < b <= s * 1.001 for b, s in zip(frame["std_beside_robot_mm"], std, strict=True))
    (shown,) = [row[1] for row in calibration_content(CalibrationFacts(found.calibration))["gauge"] if "tool" in row[0]]
    numbers = [float(v) for v in re.findall(r"-?\d+\.\d+", shown)]
    assert numbers[::2] == pytest.approx(at, abs=6e-4)
    assert numbers[1::2] == pytest.approx(std, abs=6e-4)


@pytest.mark.slow
def test_the_fixture_is_one_wherever_it_stands(written):
    found, folder, _ = written
    said = document(folder)
    (fixture,) = said["frames"]["fixtures"]
    at, std = of_parameters(said["parameters"], f"fixture_{fixture['name']}" if fixture["name"] else "fixture")
    assert fixture["position_mm"] == pytest.approx(at, abs=1e-6)
    assert fixture["std_mm"] == pytest.approx(std, rel=1e-6)
    (shown,) = [r[1] for r in calibration_content(CalibrationFacts(found.calibration))["gauge"] if "fixture" in r[0]]
    assert [float(v) for v in re.findall(r"-?\d+\.\d+", shown)][::2] == pytest.approx(at, abs=6e-4)


@pytest.mark.slow
def test_every_parameter_of_the_geometry_is_the_one_that_is_written(written):
    found, folder, _ = written
    said, nominal = document(folder), Arm.from_toml(NAME)
    now = {s.name: s.nominal for s in Arm.from_toml(folder / "robot.toml").slots}  # another reader's, of the same file
    before = {s.name: s.nominal for s in nominal.slots}
    seen = 0
    for p in said["parameters"]:
        if p["group"] == "geometry" and p["name"] in now:
            factor = {"mm": 1e-3, "deg": math.radians(1)}[p["unit"]]
            assert p["value"] * factor == pytest.approx(now[p["name"]], abs=2e-9), p["name"]
            assert p["nominal"] * factor == pytest.approx(before[p["name"]], abs=1e-12)
            assert found.parameters[p["name"]].value == pytest.approx(now[p["name"]], abs=1e-10)
            assert p["std"] > 0
            seen += 1
    assert seen > 20
    page = calibration_content(CalibrationFacts(found.calibration))
    rows = [(row[0], row[2], row[4]) for row in page["parameters"]] + [(r[0], r[2], r[4]) for r in page["unseen"]]
    for name, unit, value in rows:
        if name in now:
            decimals = len(value.partition(".")[2])
            factor = {"mm": 1e3, "deg": math.degrees(1)}[unit]
            assert float(value) == pytest.approx(now[name] * factor, abs=max(0.6 * 10**-decimals, 1e-6)), name


@pytest.mark.slow
def test_effects_are_those_of_the_file_or_none(written):
    """An effect of the last stage that the robot does not hold is none of its parameters."""
    found, folder, _ = written
    effects = {e["name"]: e for e in tomllib.loads((folder / "robot.toml").read_text()).get("effects", [])}
    for p in document(folder)["parameters"]:
        if p["group"] not in ("gauge", "geometry") and p["name"] in effects:
            assert p["value"] == pytest.approx(effects[p["name"]]["value"], rel=1e-6)
    held = set(effects) | set(() if found.calibration.released is None else found.calibration.released.effects)
    assert {p["name"] for p in document(folder)["parameters"] if p["group"] not in ("gauge", "geometry")} <= held


@pytest.mark.slow
def test_what_is_written_explains_the_readings_by_itself(written):
    """Robot, tool, fixture and zero, each from where a person reads it, put together by hand."""
    _, folder, run = written
    said, robot = document(folder), load_robot(str(folder / "robot.toml"))
    p, R = CalibratedRobot(robot).flange(run.samples.q)
    tool = np.array(tomllib.loads((folder / "robot.toml").read_text())["tool_points"][0]["position_mm"]) / 1e3
    fixture = np.array(said["frames"]["fixtures"][0]["position_mm"]) / 1e3
    zero = said["frames"].get("zero_mm", 0.0) / 1e3
    off = np.linalg.norm(p + R @ tool - fixture, axis=1) + zero - run.readings.length
    rms = float(np.sqrt((off**2).mean()))
    assert rms < 1.2 * said["release"]["held_out"]["rms_mm"] / 1e3
    assert rms < 0.05e-3


@pytest.mark.slow
def test_what_the_last_stage_fitted_stands_apart(written):
    found, folder, _ = written
    fit, said = found.calibration.fit, document(folder)
    assert [p["name"] for p in said["fitted"]] == [e.name for e in found.calibration.last_fit]
    assert {p["name"] for p in said["fitted"]} == set(fit.model.names)
    for p, error in zip(said["fitted"], [fit.values[p["name"]] for p in said["fitted"]], strict=True):
        factor = {"mm": 1e-3, "deg": math.radians(1)}.get(p["unit"])
        if factor is not None:
            assert (p["value"] - p["nominal"]) * factor == pytest.approx(error, abs=2e-9)


@pytest.mark.slow
def test_standard_deviations_hold_the_truth(written, tmp_path):
    """The square error that is expected of each joint zero, against the arm that was drawn; four of them at most."""
    found, _, _ = written
    truth = draw_truth(arm_of(NAME), 2)
    off = [
        (e.value - e.nominal - truth.errors.get(name, 0.0)) / e.std
        for name, e in found.parameters.items()
        if e.group == "geometry" and e.std and name in Arm.from_toml(NAME).geometry
    ]
    assert len(off) > 15
    assert max(map(abs, off)) < 4.5
    assert np.sqrt(np.mean(np.square(off))) < 1.6


@pytest.mark.slow
def test_the_zeros_on_the_screen_are_those_of_the_released_robot(written):
    found, folder, _ = written
    now = {s.name: s.nominal for s in Arm.from_toml(folder / "robot.toml").slots}
    arm, before = Arm.from_toml(NAME), {s.name: s.nominal for s in Arm.from_toml(NAME).slots}
    shift = np.degrees([now[f"theta{k + 1}"] - before[f"theta{k + 1}"] for k in range(6)])
    zeros = np.linalg.solve(arm.sense, shift)
    stated = re.findall(r"joint (\d) ([+-][\d.]+) ± ([\d.]+)°", joint_zeros_text(found.calibration))
    assert stated
    for joint, value, std in stated:
        assert float(value) == pytest.approx(zeros[int(joint) - 1], abs=0.6 * 10 ** -len(value.partition(".")[2]))
        assert len(std.replace(".", "").lstrip("0")) in (2, 3)  # digits of the deviation, and so of the value
        assert not re.fullmatch(r"-0\.0+", value)
    said = document(folder)["joint_zeros"]
    assert [z["joint"] for z in said] == [int(joint) for joint, _, _ in stated]
    assert [z["zero_deg"] for z in said] == pytest.approx([zeros[z["joint"] - 1] for z in said], abs=1e-7)
    page, screen = calibration_content(CalibrationFacts(found.calibration))["zeros"], found.summary(verbose=True)
    for text in (page, " ".join(screen.split())):
        assert "set these zeros in the controller, or correct programs by robot.toml, not both" in text
        assert all(f"joint {joint} {value} ± {std}°" in text for joint, value, std in stated)


@pytest.mark.slow
def test_a_document_of_the_version_before_is_read(written, tmp_path):
    _, folder, _ = written
    old = document(folder)
    fitted = old.pop("fitted")
    old["parameters"] = fitted
    for part in (*old["frames"]["fixtures"], *old["frames"]["tool"]):
        part.pop("std_mm", None)
        part.pop("std_beside_robot_mm", None)
    old["frames"].pop("zero_std_mm", None)
    (tmp_path / "identification.json").write_text(json.dumps(old))
    read = Identification.read(tmp_path / "identification.json")
    assert [e.name for e in read.last_fit] == [p["name"] for p in fitted]
    assert read.frames.tool[0].position_std is None
    text = re.sub(r"\[\[tool_points\]\].*?(?=\n\[|\Z)", "", (folder / "robot.toml").read_text(), flags=re.DOTALL)
    (tmp_path / "robot.toml").write_text(re.sub(r"^simulated = .*\n", "", text, flags=re.MULTILINE))
    robot = load_robot(str(tmp_path))
    assert (robot.tool_points, robot.simulated) == ((), None)
    assert replace(robot, path=folder).name == NAME
