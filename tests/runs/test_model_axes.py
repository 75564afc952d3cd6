"""Angles of a controller's own axes become the joints of the model: run files, maps and their quantities."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_run, load_runs
from planner.runs.traces import import_run

SENSE, ZERO = np.array([-1, 1, -1, 1, -1, 1]), np.array([10, -90, 0, 0, 45, 180])
TABLE = f"""
[controllers.fanuc-tp]
sense = {SENSE.tolist()}
zero_deg = {ZERO.tolist()}
{{coupling}}
source = "drawn for the test"
"""
N = 12


@pytest.fixture(params=["coupled", "alone"])
def robot_file(request, tmp_path):
    text = load_robot("kuka-kr6-r700").path.read_text()
    coupling = "coupling = [[3, 2, -1]]" if request.param == "coupled" else ""
    (tmp_path / "robot.toml").write_text(text + TABLE.format(coupling=coupling))
    return tmp_path / "robot.toml"


def shown(q_deg, coupled):
    """What the pendant shows, by hand."""
    c = SENSE * q_deg + ZERO
    c[..., 2] -= c[..., 1] if coupled else 0.0
    return c


@pytest.fixture
def measured(robot_file):
    """Joints of the model, and the same as columns of a controller's axes: read, commanded, torques, directions."""
    rng = np.random.default_rng(7)
    q = np.round(rng.uniform(-80, 80, (N, 6)), 4)
    cmd = np.round(q + rng.normal(0, 0.01, (N, 6)), 4)
    coupled = "coupling = " in robot_file.read_text()
    return q, cmd, shown(q, coupled), shown(cmd, coupled), rng.normal(0, 50, (N, 6)), coupled


def table(names, *columns):
    rows = np.column_stack(columns)
    return ",".join(names) + "\n" + "".join(",".join(f"{v:.10g}" for v in row) + "\n" for row in rows)


def names(stem, unit):
    return [f"{stem}{j}{unit}" for j in range(1, 7)]


def test_a_run_file_that_says_whose_axes_it_has(robot_file, measured, tmp_path):
    q, cmd, c, c_cmd, torque, coupled = measured
    head = [*names("q", "_deg"), *names("cmd", "_deg"), *names("torque", "_Nm"), *names("direction", ""), "length_mm"]
    direction = np.sign(np.random.default_rng(1).normal(size=(N, 6)))
    path = tmp_path / "run.csv"
    path.write_text("# axes_of: fanuc-tp\n" + table(head, c, c_cmd, torque, direction, 300 + np.arange(N)))
    axes_of = load_robot(str(robot_file)).axes_of
    for run in (load_run(path, 6, axes_of), load_runs([path], 6, axes_of)):
        np.testing.assert_allclose(np.rad2deg(run.samples.q), q, atol=1e-10)
        np.testing.assert_allclose(np.rad2deg(run.samples.q_cmd), cmd, atol=1e-10)
        wanted = torque * SENSE
        if coupled:  # as joint 2 turns the controller's axis 3 turns too
            wanted[:, 1] -= torque[:, 2]
            wanted[:, 2] = -torque[:, 2]
            assert run.samples.direction is None
            assert "directions of the last movement" in " ".join(run.warnings)
        else:
            np.testing.assert_array_equal(run.samples.direction, direction * SENSE)
        np.testing.assert_allclose(run.samples.torque, wanted)


def test_a_map_names_the_controller_and_the_robot(robot_file, measured, tmp_path):
    q, _, c, *_ = measured
    (tmp_path / "log.csv").write_text(table([*names("J", ""), "mm"], c, 300 + np.arange(N)))
    columns = "".join(f'q{j}_deg = "J{j}"\n' for j in range(1, 7)) + 'length_mm = "mm"\n'
    path = tmp_path / "map.toml"
    path.write_text(f'schema = "edbb-map/1"\nrobot = "robot.toml"\naxes_of = "fanuc-tp"\n[columns]\n{columns}')
    run = import_run([tmp_path / "log.csv"], path)
    np.testing.assert_allclose(np.rad2deg(run.samples.q), q, atol=1e-10)
    assert run.robot == "kuka-kr6-r700"
    assert not run.warnings
    path.write_text(f'schema = "edbb-map/1"\naxes_of = "model"\n[columns]\n{columns}')
    plain = import_run([tmp_path / "log.csv"], path)
    np.testing.assert_allclose(np.rad2deg(plain.samples.q), c, atol=1e-10)
    assert not plain.warnings
    path.write_text(f'schema = "edbb-map/1"\n[columns]\n{columns}')
    assert "does not say whose axes the angles are" in import_run([tmp_path / "log.csv"], path).warnings[-1]


@pytest.mark.parametrize(
    ("robot", "language", "said"),
    [
        ('robot = "robot.toml"', "pdl2", r"(?s)robot.toml.*'pdl2'.*fanuc-tp.*\[controllers.pdl2\]"),
        ("", "fanuc-tp", "but not of which robot"),
        ('robot = "no-such"', "fanuc-tp", "no-such"),
    ],
)
def test_a_map_of_axes_that_nobody_describes_is_refused(robot_file, measured, tmp_path, robot, language, said):
    (tmp_path / "log.csv").write_text(table([*names("q", "_deg"), "mm"], measured[2], 300 + np.arange(N)))
    columns = "".join(f"q{j}_deg = {j}\n" for j in range(1, 7)) + "length_mm = 7\n"
    path = tmp_path / "map.toml"
    path.write_text(f'schema = "edbb-map/1"\n{robot}\naxes_of = "{language}"\n[columns]\n{columns}')
    with pytest.raises(InputError, match=said):
        import_run([tmp_path / "log.csv"], path)


def test_axes_that_are_missing_or_too_many_are_told(robot_file, measured, tmp_path):
    axes_of, path = load_robot(str(robot_file)).axes_of, tmp_path / "run.csv"
    few = table([*names("q", "_deg")[:5], "length_mm"], measured[2][:, :5], 300 + np.arange(N))
    path.write_text(f"# axes_of: fanuc-tp\n{few}")
    with pytest.raises(InputError, match="a robot of 6 joints are to be turned, found are only q1, q2, q3, q4, q5"):
        load_run(path, 6, axes_of)
    with pytest.raises(InputError, match="but not of which robot"):
        load_run(path, 6)
