"""Units, comments, places, sessions and names of a run that is right."""

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.runs.loader import load_run, load_runs
from tests.runs.made import MEASURED, rows, write


def test_both_units_of_a_pair_say_the_same(tmp_path):
    a = write(tmp_path / "a.csv", "q1_deg,q2_deg,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n90,-45,100,200,-300,10,20,30\n")
    turn = ",".join(repr(float(np.deg2rad(v))) for v in (10, 20, 30))
    b = write(
        tmp_path / "b.csv",
        f"q1_rad,q2_rad,x_m,y_um,z_m,rx_rad,ry_rad,rz_rad\n{np.pi / 2!r},{-np.pi / 4!r},0.1,200000,-0.3,{turn}\n",
    )
    one, two = load_run(a, 2), load_run(b, 2)
    np.testing.assert_allclose(one.samples.q, [[np.pi / 2, -np.pi / 4]], atol=1e-15)
    np.testing.assert_allclose(two.samples.q, one.samples.q, atol=1e-15)
    np.testing.assert_allclose(one.readings.position, [[0.1, 0.2, -0.3]], atol=1e-15)
    np.testing.assert_allclose(two.readings.position, one.readings.position, atol=1e-15)
    x, y, z = (Rotation.from_rotvec(np.deg2rad(a) * e) for a, e in zip((10, 20, 30), np.eye(3), strict=True))
    np.testing.assert_allclose(one.readings.rotation[0], (x * y * z).as_matrix(), atol=1e-14)  # about the turned axes
    np.testing.assert_allclose(two.readings.rotation, one.readings.rotation, atol=1e-14)


def test_read_angles_go_before_commanded_ones(tmp_path):
    run = load_run(write(tmp_path / "r.csv", "cmd1_deg,q1_deg,length_mm\n20,21,400\n90,88,401\n"), 1)
    np.testing.assert_allclose(np.rad2deg(run.samples.q[:, 0]), [21, 88])
    np.testing.assert_allclose(np.rad2deg(run.samples.q_cmd[:, 0]), [20, 90])
    assert run.samples.q_read is not None
    only = load_run(write(tmp_path / "c.csv", "cmd1_deg,length_mm\n20,400\n90,401\n"), 1)
    np.testing.assert_allclose(only.samples.q, run.samples.q_cmd)
    assert only.samples.q_read is None


def test_comments_blank_lines_spaces_and_windows_line_ends(tmp_path):
    text = (
        "\ufeff# plan_id: 0123456789ab\n#robot: comau-nj130\n\n"
        + rows().replace("\n", " \r\n", 3)
        + "# the end\n\n  \n"
    )
    run = load_run(write(tmp_path / "r.csv", text), 2)
    assert (run.plan_id, run.robot, len(run), run.warnings) == ("0123456789ab", "comau-nj130", 5, ())
    np.testing.assert_allclose(run.readings.length, [0.35, 0.351, 0.352, 0.353, 0.354])
    assert not run.continuous


def test_columns_of_a_laboratory_are_left_out_and_named(tmp_path):
    text = (
        rows()
        .replace("length_mm", "length_mm,operator,temprature_degC")
        .replace("\n", ",x,20\n")
        .replace("C,x,20", "C")
    )
    run = load_run(write(tmp_path / "r.csv", text), 2)
    assert len(run.warnings) == 2
    assert "'operator' is not part of a run" in run.warnings[0]
    assert 'did you mean "temperature_degC"?' in run.warnings[1]
    assert run.samples.temperature is None


def test_a_joint_that_never_moves_is_no_error(tmp_path):
    text = "q1_deg,q2_deg,length_mm\n" + "".join(f"{30 * i},0,{400 + i}\n" for i in range(5))
    assert np.all(load_run(write(tmp_path / "r.csv", text), 2).samples.q[:, 1] == 0.0)


def test_static_clock_that_steps_back_begins_a_session(tmp_path):
    path = write(tmp_path / "r.csv", rows().replace("\n3,", "\n0.5,"))
    run = load_run(path, 2)
    assert run.samples.session.tolist() == [0, 0, 0, 1, 1]
    assert run.warnings == ("r.csv: the clock steps back 1 time (line 5): a new session begins at each",)


def test_named_sessions_may_begin_their_clock_anew(tmp_path):
    text = "session,t_s,q1_deg,length_mm\n7,0,10,400\n7,1,90,401\n4,0,20,402\n4,5,30,403\n"
    run = load_run(write(tmp_path / "r.csv", text), 1)
    assert run.samples.session.tolist() == [0, 0, 1, 1]
    assert run.warnings == ()
    back = load_run(write(tmp_path / "s.csv", text.replace("4,5,", "4,-5,")), 1)
    assert back.samples.session.tolist() == [0, 0, 1, 1]
    assert "within a session; its number was kept" in back.warnings[0]


def test_files_are_placements_of_a_ball_plate(tmp_path):
    for name in ("left", "right"):
        write(tmp_path / f"{name}.csv", "q1_deg,ball\n10,2\n90,10\n45,2\n")
    run = load_runs([tmp_path / "right.csv", tmp_path / "left.csv"], 1)
    assert run.places == ("right", "left")
    assert run.samples.place.tolist() == [0, 0, 0, 1, 1, 1]
    assert run.samples.session.tolist() == [0, 0, 0, 1, 1, 1]
    assert run.balls == ("2", "10")
    assert run.readings.ball.tolist() == [0, 1, 0, 0, 1, 0]


def test_files_of_one_name_in_two_folders_are_two_placements(tmp_path):
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        write(tmp_path / name / "run.csv", "q1_deg,ball\n10,2\n90,10\n")
    run = load_runs([tmp_path / "left" / "run.csv", tmp_path / "right" / "run.csv"], 1)
    assert run.places == ("left/run", "right/run")
    assert run.samples.place.tolist() == [0, 0, 1, 1]
    with pytest.raises(InputError, match="is given twice"):
        load_runs([tmp_path / "left" / "run.csv", tmp_path / "right" / ".." / "left" / "run.csv"], 1)


def test_names_lose_the_spaces_around_them(tmp_path):
    run = load_run(write(tmp_path / "r.csv", "q1_deg,length_mm,fixture\n10,400,A \n90,410, A\n"), 1)
    assert run.places == ("A",)
    with pytest.raises(InputError, match=r"line 3, column 'fixture': the field is blank"):
        load_run(write(tmp_path / "s.csv", "q1_deg,length_mm,fixture\n10,400,A\n90,410, \n"), 1)


def test_sockets_counted_in_floats(tmp_path):
    pl.DataFrame({"q1_deg": [1.0, 50.0], "ball": [1.0, 2.0]}).write_parquet(tmp_path / "r.parquet")
    assert load_run(tmp_path / "r.parquet", 1).balls == ("1", "2")


def test_lengths_have_fixtures_by_name_over_files(tmp_path):
    a = write(tmp_path / "a.csv", "q1_deg,length_mm,fixture\n10,400,B\n90,410,A\n")
    b = write(tmp_path / "b.csv", "q1_deg,length_mm,fixture\n20,400,C\n70,410,B\n")
    run = load_runs([a, b], 1)
    assert [run.places[i] for i in run.samples.place] == ["B", "A", "C", "B"]
    plain = [write(tmp_path / f"{i}.csv", "q1_deg,length_mm\n10,400\n90,410\n") for i in range(2)]
    assert load_runs(plain, 1).places == ("",)


def test_what_one_file_lacks_is_left_out_of_all_with_a_warning(tmp_path):
    a = write(tmp_path / "a.csv", "q1_deg,length_mm,temperature_degC\n10,400,20\n90,410,21\n")
    b = write(tmp_path / "b.csv", "q1_deg,length_mm\n10,400\n90,410\n")
    run = load_runs([a, b], 1)
    assert run.samples.temperature is None
    assert run.warnings == ("temperature is not logged in b, so it was left out of the other files too",)


def test_files_of_different_kinds_are_not_joined(tmp_path):
    a = write(tmp_path / "a.csv", "q1_deg,length_mm\n10,400\n90,410\n")
    b = write(tmp_path / "b.csv", "q1_deg,ball\n10,1\n90,1\n")
    with pytest.raises(InputError, match="b reads ball, but a reads length_mm; only runs of one kind are joined"):
        load_runs([a, b], 1)
    with pytest.raises(InputError, match="no run was given"):
        load_runs([], 1)


def test_parquet_names_its_rows(tmp_path):
    path = tmp_path / "r.parquet"
    pl.DataFrame({"q1_deg": [1.0, 50.0, None], "length_mm": [400.0, 410.0, 420.0]}).write_parquet(path)
    with pytest.raises(InputError, match=r"r\.parquet, row 3, column 'q1_deg': the field is blank"):
        load_run(path, 1)
    pl.DataFrame({"q1_deg": ["a"], "length_mm": [400.0]}).write_parquet(path)
    with pytest.raises(InputError, match="'q1_deg' holds String, not numbers"):
        load_run(path, 1)
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        load_run(write(tmp_path / "x.parquet", "no parquet"), 1)


def test_measured_ur10():
    run = load_runs([MEASURED / "ur10-tracker" / "run.csv"], 6)
    assert (len(run), run.samples.session.max() + 1, run.continuous) == (11911, 10, False)
    assert run.readings.rotation.shape == (11911, 3, 3)
    assert run.samples.temperature.min() > 15.0
    assert run.samples.q_read is None
    assert "the clock steps back 9 times" in run.warnings[0]


def test_measured_ur5():
    folder = MEASURED / "ur5-tracker"
    run, validation = (load_run(folder / name, 6) for name in ("run.csv", "validation.csv"))
    assert (len(run), len(validation), run.warnings) == (1000, 20, ())
    np.testing.assert_allclose(run.readings.position[0], [-0.42818372, -0.0027528, -0.09945126], atol=1e-12)
    np.testing.assert_allclose(np.rad2deg(run.samples.q[0, 5]), -5.552225, atol=1e-12)


def test_measured_panda():
    files = sorted((MEASURED / "panda-ball").glob("*.csv"))
    run = load_runs(files, 7)
    assert (len(run), run.balls, run.continuous) == (497, ("1", "2"), False)
    assert run.places == tuple(f.stem for f in files)
    assert np.bincount(run.samples.place).tolist() == [sum(1 for _ in f.open()) - 1 for f in files]
