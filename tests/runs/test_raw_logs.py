"""Logs as people have them: names of ROS, no titles, clocks and calendars, MATLAB, rows beside rows, whole turns."""

import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.runs.joint_motion import bring_within_limits
from planner.runs.loader import load_run
from planner.runs.proposed_map import proposed_map
from planner.runs.traces import import_run
from tests.command import edbb

UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
Q = np.round(np.random.default_rng(0).uniform(-2.5, 2.5, (12, 6)), 4)  # [rad]
P = np.round(np.random.default_rng(1).uniform(200, 900, (12, 3)), 3)  # [mm]


def imported(folder: Path, *traces: Path, add: str = ""):
    """Return the run that a proposed map makes of traces, with a line added at the map's head."""
    text = proposed_map(traces)
    (folder / "map.toml").write_text(text.replace('schema = "edbb-map/1"', f'schema = "edbb-map/1"\n{add}'))
    return import_run(traces, folder / "map.toml")


def table(path: Path, titles, columns, separator=",", encoding="utf-8") -> Path:
    rows = [separator.join(map(str, row)) for row in zip(*columns, strict=True)]
    path.write_text("\n".join([*([separator.join(titles)] if titles else []), *rows]), encoding=encoding)
    return path


def check(run, q=Q, p=P):
    np.testing.assert_allclose(run.samples.q, q, atol=1e-9)
    np.testing.assert_allclose(run.readings.position * 1e3, p, atol=1e-9)


FORMS = {
    "plain": "{}",
    "path": "/joint_states/{}",
    "path and position": "/joint_states/{}/position",
    "dots": "{}.position",
    "with the unit": "{} [rad]",
    "position behind": "{}_position",
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", range(3))
def test_joints_of_ros_are_found_by_their_names_in_any_order(tmp_path, form, seed):
    order = np.random.default_rng(seed).permutation(6)
    titles = [FORMS[form].format(UR[k]) for k in order] + ["x1", "y1", "z1", "/joint_states/elbow_joint/velocity"]
    log = table(tmp_path / "log.csv", titles, [*Q[:, order].T, *P.T, Q[:, 0]])
    check(imported(tmp_path, log))
    assert '# not understood: "/joint_states/elbow_joint/velocity"' in proposed_map([log])


OTHER_NAMES = {
    "panda": [f"panda_joint{k}" for k in range(1, 7)],
    "kuka": [f"joint_a{k}" for k in range(1, 7)],
    "motoman": [f"joint_{k}_{c}" for k, c in zip(range(1, 7), "slurbt", strict=True)],
    "arrays": [f"position[{k}]" for k in range(6)],
    "topic": [f"/joint_states/position[{k}]" for k in range(6)],
    "bag": [f"field.position{k}" for k in range(6)],
    "rtde": [f"actual_q_{k}" for k in range(6)],
    "abb": [f"rob1_joint_{k}/position" for k in range(1, 7)],
}


@pytest.mark.parametrize("names", OTHER_NAMES)
@pytest.mark.parametrize(
    "place", [("x", "y", "z"), ("tracker_x", "tracker_y", "tracker_z"), ("position.x", "position.y", "position.z"),
              ("x_pos", "y_pos", "z_pos"), ("/at/pose/position/x", "/at/pose/position/y", "/at/pose/position/z")]
)  # fmt: skip
def test_numbered_joints_and_coordinates_are_found_by_other_names(tmp_path, names, place):
    check(imported(tmp_path, table(tmp_path / "log.csv", [*OTHER_NAMES[names], *place], [*Q.T, *P.T])))


def test_the_names_beside_an_array_say_whose_angle_is_whose(tmp_path):
    """As rostopic writes a bag: elbow first, as the names go by the alphabet."""
    order = sorted(range(6), key=lambda k: UR[k])
    stamp = np.arange(12) * 10_000_000_000 + 1_795_823_990_100_000_000
    titles = ["%time", *(f"field.name{k}" for k in range(6)), *(f"field.position{k}" for k in range(6)), *"xyz"]
    log = table(tmp_path / "log.csv", titles, [stamp, *([UR[k]] * 12 for k in order), *Q[:, order].T, *P.T])
    run = imported(tmp_path, log)
    check(run)
    np.testing.assert_allclose(np.diff(run.samples.t), 10.0, atol=1e-6)


LAYOUTS = {
    "angles and place": (lambda n: [*Q.T, *P.T], None),
    "pose before": (lambda n: [np.arange(1, n + 1), *Q.T, *P.T], None),
    "time before": (lambda n: [np.arange(n) * 12.5, *Q.T, *P.T], "t"),
    "clock before": (lambda n: [[f"12:{k:02d}:30" for k in range(n)], *Q.T, *P.T], "t"),
}


@pytest.mark.parametrize("separator", [",", ";", "\t", "  "])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_log_without_titles_is_guessed_from_the_places_of_its_columns(tmp_path, layout, separator):
    columns, time = LAYOUTS[layout]
    log = table(tmp_path / "log.txt", None, columns(12), separator)
    run = imported(tmp_path, log)
    check(run)
    assert (run.samples.t is not None) == (time is not None)
    assert proposed_map([log]).count("no title says it: is this one true?") >= 9


def test_a_log_without_titles_and_with_decimal_commas_in_utf_16(tmp_path):
    columns = [[f"{v:.4f}".replace(".", ",") for v in column] for column in (*Q.T, *P.T)]
    check(imported(tmp_path, table(tmp_path / "log.txt", None, columns, ";", "utf-16")), p=P)


def clocks(form: str, n: int = 12) -> list[str]:
    """Return times ten seconds apart, over midnight, as a clock writes them."""
    stamps = np.datetime64("2026-11-27T23:59:05.100") + np.arange(n) * np.timedelta64(10, "s")
    return [stamp.astype(object).strftime(form)[: -3 if "%f" in form else None] + form[-1:] * 0 for stamp in stamps]


CLOCKS = {
    "iso": ("%Y-%m-%dT%H:%M:%S.%f", ""), "iso with zone": ("%Y-%m-%dT%H:%M:%S.%f", "Z"),
    "iso with hours": ("%Y-%m-%d %H:%M:%S.%f", "+01:00"), "german": ("%d.%m.%Y %H:%M:%S,%f", ""),
    "american": ("%m/%d/%Y %H:%M:%S.%f", ""), "clock": ("%H:%M:%S.%f", ""), "clock with comma": ("%H:%M:%S,%f", ""),
    "slashes": ("%Y/%m/%d %H:%M:%S.%f", ""),
}  # fmt: skip


@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("title", ["Zeitstempel", "timestamp", "Time", "Uhrzeit"])
def test_times_of_clocks_and_calendars_become_seconds(tmp_path, clock, title):
    form, zone = CLOCKS[clock]
    log = table(
        tmp_path / "log.csv", [title, *(f"J{k}" for k in range(1, 7)), "x", "y", "z"],
        [[text + zone for text in clocks(form)], *Q.T, *P.T], ";",
    )  # fmt: skip
    run = imported(tmp_path, log)
    check(run)
    np.testing.assert_allclose(np.diff(run.samples.t), 10.0, atol=1e-5)


def test_a_clock_of_twelve_hours_goes_on_after_midnight(tmp_path):
    texts = ["11:59:40 PM", "11:59:50 PM", *(f"12:{k // 60:02d}:{k % 60:02d} AM" for k in range(0, 100, 10))]
    titles = ["Time", *(f"J{k}" for k in range(1, 7)), "x", "y", "z"]
    log = table(tmp_path / "log.csv", titles, [texts, *Q.T, *P.T], ";")
    np.testing.assert_allclose(np.diff(imported(tmp_path, log).samples.t), 10.0, atol=1e-5)


def test_names_of_joints_that_change_places_are_refused_with_their_line(tmp_path):
    """From row 8 on ROS writes elbow and pan in each other's places."""
    places = [[k if n < 8 else (2, 1, 0, 3, 4, 5)[k] for k in range(6)] for n in range(len(Q))]
    titles = [f"{what}[{k}]" for k in range(6) for what in ("name", "position")]
    columns = [
        c for k in range(6) for c in ([UR[p[k]] for p in places], [q[p[k]] for q, p in zip(Q, places, strict=True)])
    ]
    log = table(tmp_path / "log.csv", [*titles, "x", "y", "z"], [*columns, *P.T])
    with pytest.raises(InputError, match=r"log\.csv, line 10: 'name\[0\]' names another joint than the rows before"):
        proposed_map([log])


def test_joints_that_only_a_number_names_are_doubted(tmp_path):
    log = table(tmp_path / "log.csv", [*(f"position[{k}]" for k in range(6)), "x", "y", "z"], [*Q.T, *P.T])
    assert proposed_map([log]).count("# which joint is it?") == 6


def test_a_date_beside_its_clock_and_seconds_beside_nanoseconds(tmp_path):
    titles = [*(f"J{k}" for k in range(1, 7)), "x", "y", "z"]
    two = table(tmp_path / "log.csv", ["Datum", "Uhrzeit", *titles],
                [clocks("%d.%m.%Y"), clocks("%H:%M:%S"), *Q.T, *P.T], ";")  # fmt: skip
    np.testing.assert_allclose(np.diff(imported(tmp_path, two).samples.t), 10.0, atol=1e-5)
    seconds, nanoseconds = np.divmod(np.arange(12) * 2_700_000_000 + 1_795_823_990_100_000_000, 1_000_000_000)
    ros = table(tmp_path / "ros.csv", ["header.stamp.sec", "header.stamp.nanosec", *titles],
                [seconds, nanoseconds, *Q.T, *P.T])  # fmt: skip
    np.testing.assert_allclose(np.diff(imported(tmp_path, ros).samples.t), 2.7, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gestern", "'gestern' is no time of the form '%H:%M:%S'"),
        ("12:00:00+02:00", "is of another time zone than the rows before"),
    ],
)
def test_a_time_that_is_none_is_told_with_its_line(tmp_path, text, said):
    titles = ["time", *(f"J{k}" for k in range(1, 7)), "x", "y", "z"]
    log = table(tmp_path / "log.csv", titles, [clocks("%H:%M:%S"), *Q.T, *P.T])
    (tmp_path / "map.toml").write_text(proposed_map([log]))
    lines = log.read_text().splitlines()
    log.write_text("\n".join([*lines[:5], text + lines[5][8:], *lines[6:]]))
    with pytest.raises(InputError, match=re.escape(said)) as told:
        import_run([log], tmp_path / "map.toml")
    assert "log.csv, line 6, column 'time'" in str(told.value)


@pytest.mark.parametrize("kind", ["matrices", "vectors", "structure"])
def test_tables_of_matlab_are_read(tmp_path, kind):
    vectors = {f"q{k + 1}": column for k, column in enumerate(Q.T)} | dict(zip("xyz", P.T, strict=True))
    content = {
        "matrices": {"q": Q, "xyz": P, "note": "by hand", "rate": 100.0},
        "vectors": vectors,
        "structure": {"log": vectors},
    }[kind]
    scipy.io.savemat(tmp_path / "log.mat", content)
    check(imported(tmp_path, tmp_path / "log.mat"))


def test_a_mat_file_that_is_none_is_told(tmp_path):
    (tmp_path / "log.mat").write_bytes(
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + b" " * 86 + b"\x00\x02IM" + b"\0" * 99
    )
    with pytest.raises(InputError, match=r"version 7.3: save it by save\('log.mat', '-v7'\)"):
        proposed_map([tmp_path / "log.mat"])
    (tmp_path / "log.mat").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"cannot be read as a .mat file"):
        proposed_map([tmp_path / "log.mat"])
    scipy.io.savemat(tmp_path / "log.mat", {"note": "no numbers"})
    with pytest.raises(InputError, match="holds no array of numbers"):
        proposed_map([tmp_path / "log.mat"])


def test_two_logs_without_time_and_pose_are_joined_row_by_row_where_the_map_says_so(tmp_path):
    angles = table(tmp_path / "angles.txt", None, Q.T)
    place = table(tmp_path / "tracker.txt", None, P.T, " ")
    assert 'join = "rows"  # no time or number of the pose' in proposed_map([angles, place])
    check(imported(tmp_path, angles, place))
    text = (tmp_path / "map.toml").read_text()
    (tmp_path / "map.toml").write_text(re.sub('join = "rows".*\n', "", text))
    with pytest.raises(InputError, match=r'both have 12 rows: if each row belongs .* write join = "rows"'):
        import_run([angles, place], tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text(text)
    table(place, None, P[:-1].T, " ")
    with pytest.raises(InputError, match=r"has 11 rows, .*angles.txt has 12.*which rows are missing"):
        import_run([angles, place], tmp_path / "map.toml")


@pytest.mark.parametrize("shift", [-2, -1, 1, 3])
@pytest.mark.parametrize("kind", ["length_mm", "place"])
def test_readings_that_stand_rows_beside_their_angles_are_told_at_import(tmp_path, kind, shift):
    robot = load_robot("ur5e")
    rng = np.random.default_rng(5)
    q = rng.uniform(-2, 2, (60, 6))
    stand = robot.chain.forward(robot.theta(q))
    p = stand.x.T + np.einsum("ijn,j->ni", stand.R, [0.02, 0.03, 0.1])
    if kind == "place":
        columns, titles = (1e3 * p + rng.normal(0, 0.3, (60, 3))).T, ["x_mm", "y_mm", "z_mm"]
    else:
        length = 1e3 * np.linalg.norm(p - [0.9, 0.4, 0.1], axis=1) + rng.normal(0, 0.3, 60)
        columns, titles = length[None], ["length_mm"]
    right = table(tmp_path / "run.csv", [*(f"q{k}_deg" for k in range(1, 7)), *titles], [*np.rad2deg(q).T, *columns])
    robot_line = 'robot = "ur5e"\naxes_of = "model"'
    imported(tmp_path, right, add=robot_line)
    rows = slice(3, 57)
    beside = slice(3 + shift, 57 + shift)
    wrong = table(tmp_path / "wrong.csv", [*(f"q{k}_deg" for k in range(1, 7)), *titles],
                  [*np.rad2deg(q[rows]).T, *columns[:, beside]])  # fmt: skip
    count, side = abs(shift), "above" if shift > 0 else "below"
    with pytest.raises(InputError, match=rf"those {count} rows? {side} fit ur5e to .* mm"):
        imported(tmp_path, wrong, add=robot_line)


def test_a_drive_that_is_counted_within_a_turn_goes_on(tmp_path):
    t = np.arange(200) * 0.05
    q = np.stack([3.0 + 0.2 * t, *(0.3 * np.sin(t + k) for k in range(5))], axis=1)
    wrapped = (np.rad2deg(q) + 180) % 360 - 180
    titles = ["t_s", *(f"q{k}_deg" for k in range(1, 7)), "length_mm"]
    run = load_run(table(tmp_path / "run.csv", titles, [t, *wrapped.T, 400 + t]), 6)
    np.testing.assert_allclose(run.samples.q, q, atol=1e-9)
    assert any("q1_deg jump by whole turns along the drive: they were taken to go on" in w for w in run.warnings)


def test_angles_of_0_to_360_degrees_are_brought_within_the_limits_and_said(tmp_path):
    robot = load_robot("ur5e")
    q = np.random.default_rng(3).uniform(-3, 3, (20, 6))
    titles = [*(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    log = table(tmp_path / "run.csv", titles, [*(np.rad2deg(q) % 360).T, *np.ones((3, 20))])
    run = bring_within_limits(load_run(log, 6), robot.q_lower, robot.q_upper, robot.slides)
    assert np.allclose(np.exp(1j * run.samples.q), np.exp(1j * q))
    assert (run.samples.q <= robot.q_upper + 1e-9).all()
    assert any("joint 3 are counted from 0 to 360 degrees" in w for w in run.warnings)
    beyond = bring_within_limits(run, np.full(6, 0.1), np.full(6, 0.2), robot.slides)
    assert beyond is run  # what no turn brings inside stays, and is refused with its row


def test_the_screen_says_how_many_poses_and_readings_were_imported(tmp_path):
    log = table(
        tmp_path / "log.csv", [*UR, "x1", "y1", "z1"], [*np.vstack([Q, Q[:3]]).T, *np.vstack([P, P[:3] + 0.01]).T]
    )
    words = ("import", str(log), "--map", str(tmp_path / "map.toml"), "-o", str(tmp_path / "run.csv"))
    first, second = edbb(*words), edbb(*words)
    assert first.returncode == 2
    assert second.returncode == 0, second.stderr
    assert "15 readings (x_mm, y_mm, z_mm) at 12 poses" in second.screen
