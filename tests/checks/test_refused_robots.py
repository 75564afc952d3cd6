"""A robot that its identification says not to use: its file says so, and no later command makes anything of it."""

import dataclasses
import json
import tomllib

import pytest

from planner.checks.record import Circumstances
from planner.checks.record_changes import add_entry
from planner.cli.terminal import screen_text
from planner.common.errors import InputError
from planner.common.units import MM
from planner.design.discrimination.findings import read_identification
from planner.kinematics.robot_reader import load_robot
from planner.next_session.remaining_errors import CalibratedState
from planner.workflow.compensation import compensate
from planner.workflow.fleet import read_robot
from tests.command import edbb
from tests.golden.wire import fitted_wire

TARGETS = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,-20,30,15,50,-20\n"
WORSE = "WORSE THAN THE NOMINAL ROBOT, do not use it: held-out samples 0.100 → 0.200 mm (rms)"
FAILED = "all lengths are off by one factor (5.0 %): scale or unit; check the unit"


@pytest.fixture(scope="module")
def fitted():
    return fitted_wire()


def refused(fitted, why, worse):
    update = {"problems": (why,), "worse_than_nominal": why if worse else None, "summary": None}
    return dataclasses.replace(fitted, calibration=fitted.calibration.model_copy(update=update))


@pytest.fixture(scope="module")
def worse(fitted, tmp_path_factory):
    """The folder of a robot that is worse than the nominal one, and its result."""
    made = refused(fitted, WORSE, worse=True)
    folder = tmp_path_factory.mktemp("worse") / "out"
    made.write(folder)
    return made, folder


@pytest.mark.slow
def test_its_file_bears_the_verdict_and_goes_without_what_others_are_made_of(worse):
    made, folder = worse
    assert tomllib.loads((folder / "robot.toml").read_text())["not_for_use"] == WORSE
    assert json.loads((folder / "identification.json").read_text())["worse_than_nominal"] == WORSE
    assert not list(folder.glob("posterior.json")) + list(folder.glob("expected_error*"))
    assert made.problems == (WORSE,)  # by which the command ends with exit code 3


@pytest.mark.slow
def test_the_screen_recommends_nothing_and_names_no_cause(worse, tmp_path):
    lines = screen_text(worse[0], tmp_path).splitlines()
    assert lines[0] == WORSE
    assert "NOT calibrated" in lines[1]
    assert not any(word in line for line in lines for word in ("next", "compensate", "tool error", "good for", "found"))


@pytest.mark.slow
def test_no_later_command_makes_anything_of_it(worse, fitted, tmp_path):
    _, folder = worse
    (tmp_path / "targets.csv").write_text(TARGETS)
    robot = fitted.calibration.robot
    for use in (
        lambda: load_robot(folder),
        lambda: compensate(tmp_path / "targets.csv", model=folder),
        lambda: compensate(tmp_path / "targets.csv", model=worse[0]),
        lambda: CalibratedState.read(folder, fitted.cell),
        lambda: read_identification(folder / "identification.json", robot, 6),
        lambda: read_robot(folder),
        lambda: add_entry(tmp_path / "record", folder, Circumstances(date="2026-01-02", operator="A"), "1"),
    ):
        with pytest.raises(InputError, match="WORSE THAN THE NOMINAL ROBOT"):
            use()


@pytest.mark.slow
def test_the_command_corrects_by_it_with_force_alone(worse, tmp_path):
    (tmp_path / "targets.csv").write_text(TARGETS)
    words = "compensate", tmp_path / "targets.csv", "--model", worse[1], "-o", tmp_path / "corrected.csv"
    done = edbb(*words)
    assert done.returncode == 2
    assert "not to be used" in done.screen
    assert "--force" in done.screen
    assert not (tmp_path / "corrected.csv").exists()
    assert edbb(*words, "--force").returncode == 0


@pytest.mark.slow
def test_of_a_fit_that_failed_no_robot_is_written_and_the_folder_says_why(fitted, tmp_path):
    made = refused(fitted, FAILED, worse=False)
    fitted.write(tmp_path / "out")  # of a run before
    made.write(tmp_path / "out")
    assert not (tmp_path / "out" / "robot.toml").exists()
    assert made.problems[0].startswith("no robot was written: all lengths")
    (tmp_path / "targets.csv").write_text(TARGETS)
    for model in (tmp_path / "out", made):
        with pytest.raises(InputError, match="all lengths are off by one factor"):
            compensate(tmp_path / "targets.csv", model=model)
    with pytest.raises(InputError, match="all lengths are off by one factor"):
        CalibratedState.read(tmp_path / "out", fitted.cell)


@pytest.mark.slow
def test_a_calibrated_robot_is_used_as_before(fitted, tmp_path):
    fitted.write(tmp_path / "out")
    assert load_robot(tmp_path / "out").not_for_use == ""
    assert CalibratedState.read(tmp_path / "out", fitted.cell).stated > 0.001 * MM
