"""Columns of joints that slide: in mm or m, held against the robot, and turned from a controller's axes."""

from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.units import DEG
from planner.runs.loader import load_run
from planner.runs.writer import save_run
from tests.kinematics.sliding_arms import lift_text
from tests.programs.test_slides import ROBOT
from tests.workflow.conftest import small_cell

ROWS = np.array([[100.0, 10, 20, 30, 40, 50, 60, 400], [350.5, 11, 21, 31, 41, 51, 61, 410]])
HEAD = ["q1_mm", *(f"q{j}_deg" for j in range(2, 8)), "length_mm"]


def run_of(folder: Path, head: list[str], rows: np.ndarray, note: str = ""):
    text = "\n".join(",".join(f"{v:.6f}" for v in row) for row in rows)
    (folder / "run.csv").write_text(f"{note}{','.join(head)}\n{text}\n")
    return folder / "run.csv"


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("m", 1e-3)])
def test_a_slide_is_read_in_its_unit_and_written_in_millimetres(tmp_path: Path, unit: str, factor: float) -> None:
    rows = ROWS * np.array([factor, *[1.0] * 7])
    run = load_run(run_of(tmp_path, [f"q1_{unit}", *HEAD[1:]], rows), 7)
    assert run.slides == {1}
    assert np.allclose(run.samples.q, ROWS[:, :7] * DEG)  # a millimetre counts as a degree does
    save_run(run, tmp_path / "again.csv")
    assert "q1_mm,q2_deg" in (tmp_path / "again.csv").read_text()
    assert np.allclose(load_run(tmp_path / "again.csv", 7).samples.q, run.samples.q, atol=1e-12)


@pytest.fixture
def cell(tmp_path: Path):
    (tmp_path / "lift.urdf").write_text(lift_text())
    (tmp_path / "robot.toml").write_text(ROBOT)
    return load_cell(small_cell("ur10/edbb", tmp_path, ('robot = "ur10"', 'robot = "robot.toml"\nhome_mm = [150]')))


def test_a_run_in_the_wrong_unit_is_told(cell, tmp_path: Path) -> None:
    cell.check_robot(load_run(run_of(tmp_path, HEAD, ROWS), 7))
    with pytest.raises(InputError, match=r"joint 1 of lift slides: its columns are q1_mm"):
        cell.check_robot(load_run(run_of(tmp_path, ["q1_deg", *HEAD[1:]], ROWS), 7))
    with pytest.raises(InputError, match=r"joint 2 of lift turns: its columns are q2_deg"):
        cell.check_robot(load_run(run_of(tmp_path, ["q1_mm", "q2_mm", *HEAD[2:]], ROWS), 7))


def test_a_controllers_external_axis_comes_back_to_its_joint(cell, tmp_path: Path) -> None:
    head = [*(f"q{j}_deg" for j in range(1, 7)), "q7_mm", "length_mm"]
    axes = cell.robot.axes_of("rapid")
    shown = np.rad2deg(axes.to_controller(ROWS[:, :7] * DEG))
    assert np.allclose(shown[:, 6], 1000 - ROWS[:, 0])
    path = run_of(tmp_path, head, np.column_stack([shown, ROWS[:, 7]]), "# axes_of: rapid\n")
    run = load_run(path, 7, cell.robot.axes_of)
    assert np.allclose(run.samples.q, ROWS[:, :7] * DEG, atol=1e-7)
    cell.check_robot(run)
