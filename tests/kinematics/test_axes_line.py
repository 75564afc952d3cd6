"""The line that says whose axes the angles of a table are is understood or refused, however it is spelt."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.kinematics.axes_line import axes_line
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_run
from planner.runs.traces import import_run
from tests.compensation.robots import bent

UNDERSTOOD = [
    "# axes_of: pdl2",
    "#axes_of:pdl2",
    " # axes_of: pdl2",
    "\ufeff# axes_of: pdl2",
    "# AXES_OF: pdl2",
    "# Axes_of: PDL2",
    "# axes-of: pdl2",
    "# axes of: pdl2",
    "# axes_of = pdl2",
    "# axes_of pdl2",
    "## axes_of: pdl2",
    "# # axes_of: pdl2",
    "# axis_of: pdl2",
    "# axes_of: pdl2,,,,,",
    "# axes_of: pdl2;;;;;",
    "# axes_of: pdl2\t\t\t\t\t",
    '"# axes_of: pdl2",,,,,',
    '# axes_of: "pdl2"',
    "# axes_of: pdl2  # as Comau counts",
]
REFUSED = [
    "# axes_of:",
    "# axes_of: ,,,,,",
    "# axes_of: pdl2 or bnr",
    "# axes_of: 2",
    "# axs_of: pdl2",
    "# axesof_: pdl2?",
    "# axes_off: pdl2",
    "# axes_o: pdl2",
    "# axes: pdl2",
    "# the same\n# axes of the robot are those of the pendant",
]
OTHER = ["# max_of: 3", "# axes: A1 = q1, A2 = -q2", "# robot: comau-nj130", "# faxes: none", "# measured on Monday"]
HEAD = ",".join(f"q{j}_deg" for j in range(1, 7))
C = np.array([[10, 20, -60, 30, 40, 50], [-15, 5, -90, 20, 35, 10.0]])
Q = np.column_stack([-C[:, 0], C[:, 1], -C[:, 2] - 90, *-C[:, 3:].T])
ROWS = [",".join(f"{v:.4f}" for v in row) for row in C]


def write_run(path, line, at=0):
    lines = [f"{HEAD},length_mm", *(f"{row},{400 + k}" for k, row in enumerate(ROWS))]
    lines.insert(at, line)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize("line", UNDERSTOOD)
def test_every_spelling_is_understood_in_a_run_and_in_a_table(line, tmp_path):
    robot, real = bent("comau-nj130", seed=2)
    write_run(tmp_path / "run.csv", line)
    run = load_run(tmp_path / "run.csv", 6, robot.axes_of)
    np.testing.assert_allclose(np.rad2deg(run.samples.q), Q, atol=1e-9)
    (tmp_path / "t.csv").write_text("\n".join([line, HEAD, *ROWS]) + "\n")
    done = compensate_file(tmp_path / "t.csv", robot, real)
    np.testing.assert_allclose(np.rad2deg(done.q), Q, atol=1e-6)


@pytest.mark.parametrize("line", REFUSED)
def test_what_is_not_understood_is_refused_in_a_run_and_in_a_table(line, tmp_path):
    robot, real = bent("comau-nj130", seed=2)
    write_run(tmp_path / "run.csv", line)
    number = 1 + line.count("\n")
    with pytest.raises(InputError, match=rf"run.csv, line {number}: .*'# axes_of: pdl2' is allowed"):
        load_run(tmp_path / "run.csv", 6, robot.axes_of)
    (tmp_path / "t.csv").write_text("\n".join([line, HEAD, *ROWS]) + "\n")
    with pytest.raises(InputError, match=rf"t.csv, line {number}: .*'# axes_of: pdl2' is allowed"):
        compensate_file(tmp_path / "t.csv", robot, real)


@pytest.mark.parametrize("line", OTHER)
def test_other_remarks_stay_remarks(line):
    assert axes_line("a.csv", [line, HEAD]) is None


def test_a_line_below_the_names_of_the_columns_counts_too(tmp_path):
    robot = load_robot("comau-nj130")
    write_run(tmp_path / "run.csv", "# Axes-of: pdl2", at=1)
    np.testing.assert_allclose(np.rad2deg(load_run(tmp_path / "run.csv", 6, robot.axes_of).samples.q), Q, atol=1e-9)


def test_two_controllers_are_refused(tmp_path):
    write_run(tmp_path / "run.csv", "# axes_of: pdl2\n# Axes of: model")
    with pytest.raises(InputError, match="said to be of model and of pdl2; name one"):
        load_run(tmp_path / "run.csv", 6, load_robot("comau-nj130").axes_of)


@pytest.mark.parametrize("said", ['axes_of = "model"\n', ""])
def test_a_trace_that_says_otherwise_than_its_map_is_refused(said, tmp_path):
    write_run(tmp_path / "log.csv", "# AXES_OF: pdl2")
    columns = "".join(f'q{j}_deg = "q{j}_deg"\n' for j in range(1, 7)) + 'length_mm = "length_mm"\n'
    text = f'schema = "edbb-map/1"\nrobot = "comau-nj130"\n{said}[columns]\n{columns}'
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(InputError, match=r"log.csv: says 'axes_of: pdl2', the map says"):
        import_run([tmp_path / "log.csv"], tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text(text.replace("[columns]", 'axes_of = "pdl2"\n[columns]').replace(said, "", 1))
    run = import_run([tmp_path / "log.csv"], tmp_path / "map.toml")
    np.testing.assert_allclose(np.rad2deg(run.samples.q), Q, atol=1e-9)
