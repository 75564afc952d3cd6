"""Whatever is wrong in a run is said in one sentence with file, line and column, and ends with exit code 2."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.loader import load_run
from tests.runs.made import rows, write

HEAD = "t_s,q1_deg,q2_deg,length_mm"
FAST = "".join(f"{0.01 * i:.2f},{10 + 0.05 * i:.3f},{20 - 0.1 * i:.3f},{400 + 0.1 * i:.2f}\n" for i in range(20))

CASES = {
    "nan": (rows(change=(2, 1, "NaN")), r"line 4, column 'q1_deg': nan is no finite number"),
    "inf": (rows(change=(3, 3, "-inf")), r"line 5, column 'length_mm': -inf is no finite number"),
    "blank": (rows(change=(1, 2, "")), r"line 3, column 'q2_deg': the field is blank$"),
    "spaces": (rows(change=(1, 2, "  ")), r"line 3, column 'q2_deg': the field is blank$"),
    "not a number": (rows(change=(4, 3, "low")), r"line 6, column 'length_mm': 'low' is no number"),
    "digits of another script": (rows(change=(4, 3, "٣٥٠")), r"line 6, column 'length_mm': '٣٥٠' is no number"),
    "pose in another script": (
        "pose,q1_deg,q2_deg,length_mm\n1,1,20,3\n٣,1,20,3\n",
        r"line 3, column 'pose': '٣' is no number \(poses are numbered, or called like P1",
    ),
    "name of a pose in another script": (
        "pose,q1_deg,q2_deg,length_mm\nP1,1,20,3\nP٣,1,20,3\n",
        r"column 'pose': 'P1' is no number \(poses are numbered, or called like P1",
    ),
    "decimal comma": (rows(change=(0, 3, '"400,5"')), r"line 2, column 'length_mm': '400,5' is no number"),
    "below comments": ("# a\n\n" + rows(change=(2, 1, "x")), r"line 6, column 'q1_deg': 'x' is no number"),
    "after a blank line": (rows(change=(2, 1, "x")).replace("\n1,", "\n\n# b\n1,"), r"line 6, column 'q1_deg': 'x'"),
    "decimal commas between commas": (
        HEAD + "\n" + "0,0,1,5,20,5,400,1\n",
        r"line 2: there are 8 fields, but 4 columns; if the commas are decimal ones, save with ';' between",
    ),
    "micrometres called metres": (
        rows(change=(1, 3, "400123")).replace("length_mm", "length_m"),
        r"line 3, column 'length_m': 400123 m lies outside of 0 m to 1000 m; is it the unit of the numbers\?",
    ),
    "a beam that was lost from the first row on": (
        "q1_deg,q2_deg,x_mm,y_mm,z_mm\n1,20,0,0,0\n2,20,0.0,0,0\n",
        r"every position is 0, 0, 0: the tracker had lost its reflector",
    ),
    "too many fields": (rows(change=(1, 3, "1,2")), r"line 3: there are 5 fields, but 4 columns"),
    "endless field": (HEAD + "\n" + "x" * 200_000 + ",1,2,3,4\n", r"line 2: cannot be read \(field larger"),
    "too few fields": (
        rows().replace(",352", ""),
        r"line 4, column 'length_mm': the field is blank \(the line has 3 f.* of 4\)",
    ),
    "empty": ("", r"the file is empty; a line with the names of the columns"),
    "no rows": (HEAD + "\n# nothing\n", r"there is no row below the names of the columns"),
    "titles of its own": ("J1;J2;L\n1;2;3\n", r"no column has a name of a run's; edbb import .* --map map.toml -o run"),
    "no angles": ("t_s,length_mm\n1,2\n", r"no joint angles; q1_deg … q2_deg \(as read\) or cmd1_deg"),
    "joint missing": (
        rows().replace("q2_deg", "other"),
        r"the robot has 2 joints, but there is no column q2_deg or q2_rad",
    ),
    "joint too many": (rows().replace("length_mm", "q3_deg"), r"a column 'q3_deg', but the robot has 2 joints"),
    "no reading": (
        rows().replace("length_mm", "other"),
        r"there is no reading; one of length_mm; x_mm, y_mm, z_mm; ball",
    ),
    "reading under a title of its own": (
        rows().replace("length_mm", "Länge [cm]").replace("pose", "Pose"),
        r"there is no reading; .* titles of your own \('Länge \[cm\]'\) are read with --map",
    ),
    "two readings": ("q1_deg,q2_deg,length_mm,ball\n1,20,3,4\n", r"several readings \(length_mm; ball\)"),
    "half a position": ("q1_deg,q2_deg,x_mm,y_mm\n1,20,3,4\n", r"there is no column z_mm or z_m or z_um beside"),
    "half a rotation": (
        "q1_deg,q2_deg,x_mm,y_mm,z_mm,rx_deg\n1,20,3,4,5,6\n",
        r"no column ry_deg or ry_rad, rz_deg or rz_rad beside",
    ),
    "half a rotation in a convention": (
        "q1_deg,q2_deg,x_mm,y_mm,z_mm,rx_fixed_rad\n1,20,3,4,5,0.6\n",
        r"no column ry_fixed_deg or ry_fixed_rad, rz_fixed_deg or rz_fixed_rad beside",
    ),
    "a convention without unit": (
        "q1_deg,q2_deg,x_mm,y_mm,z_mm,rx_vector\n1,20,3,4,5,6\n",
        r"'rx_vector' does not say its unit; it is called rx_vector_deg or rx_vector_rad$",
    ),
    "rotation alone": ("q1_deg,q2_deg,length_mm,rx_deg,ry_deg,rz_deg\n1,20,3,4,5,6\n", r"turn with a position"),
    "offset alone": ("q1_deg,q2_deg,length_mm,dx_mm,dy_mm,dz_mm\n1,20,3,4,5,6\n", r"no column ball"),
    "one torque": ("q1_deg,q2_deg,length_mm,torque2_Nm\n1,20,3,4\n", r"no column torque1_Nm"),
    "no unit": (
        rows().replace("length_mm", "length"),
        r"'length' does not say its unit; it is called length_mm or length_m",
    ),
    "other unit": (rows().replace("length_mm", "length_inch"), r"'length_inch' .* length_mm or length_m or length_um"),
    "joint without unit": (
        rows().replace("q1_deg", "q1"),
        r"'q1' does not say its unit; it is called q1_deg or q1_rad",
    ),
    "time without unit": (rows().replace("t_s", "t"), r"'t' does not say its unit; it is called t_s"),
    "twice": (rows().replace("q2_deg", "q1_rad"), r"'q1_deg' and 'q1_rad' say the same; keep one"),
    "degrees as radians": (
        rows().replace("_deg", "_rad"),
        r"line 2, column 'q1_rad': -20 rad is more than two turns; .* q1_deg",
    ),
    "radians as degrees": (
        "q1_deg,q2_deg,length_mm\n" + "".join(f"{0.5 * i - 1},{2 - 0.3 * i},400\n" for i in range(6)),
        r"called degrees, but all joints stay within ±2: radians look like that; call them q1_rad",
    ),
    "half a session": (
        rows(header="session,q1_deg,q2_deg,length_mm", change=(1, 0, "1.5")),
        r"line 3, column 'session': 1.5 is no whole",
    ),
    "direction": (
        "q1_deg,length_mm,direction1,q2_deg\n1,400,1,20\n2,400,3,50\n",
        r"line 3, column 'direction1': 3 is none of -1, 0, 1",
    ),
    "clock back": (
        f"{HEAD}\n{FAST.replace('0.10,', '0.01,')}",
        r"line 12, column 't_s': time runs backwards from 0.09 s to 0.01 s",
    ),
    "clock stands": (
        f"{HEAD}\n{FAST.replace('0.10,', '0.09,')}",
        r"line 12, column 't_s': the time 0.09 s stands twice",
    ),
    "jump": (
        f"{HEAD}\n" + "".join(f"{0.01 * i:.2f},{i + 200 * (i > 4)},{i},400\n" for i in range(20)),
        r"line 7, column 'q1_deg': the angle jumps from 4 to 205 degrees within 0.01 s",
    ),
    "measure": ("# measure: standing\n" + rows(), r"'# measure: standing' is unknown; static or continuous is allowed"),
    "continuous without time": (
        "# measure: continuous\nq1_deg,q2_deg,length_mm\n1,20,400\n",
        r"there is no column t_s",
    ),
    "static but never at rest": (f"# measure: static\n{HEAD}\n{FAST * 1}", r"none of 20 samples is at rest"),
}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_one_sentence(tmp_path, case):
    text, message = CASES[case]
    path = write(tmp_path / "bad.csv", text)
    with pytest.raises(InputError, match=message) as caught:
        load_run(path, 2)
    assert caught.value.exit_code == 2
    assert "bad" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_capitals_in_a_title_make_no_other_column(tmp_path):
    text = rows().replace("q1_deg", "Q1_DEG").replace("t_s", "T_s")
    found, plain = (load_run(write(tmp_path / name, t), 2) for name, t in (("a.csv", text), ("b.csv", rows())))
    np.testing.assert_array_equal(found.samples.q, plain.samples.q)
    np.testing.assert_array_equal(found.samples.t, plain.samples.t)


def test_small_moves_in_degrees_can_be_declared(tmp_path):
    text = "# angles: degrees\n" + CASES["radians as degrees"][0]
    assert np.abs(load_run(write(tmp_path / "r.csv", text), 2).samples.q).max() < 0.04


def test_moves_too_small_to_tell_are_a_warning(tmp_path):
    text = "q1_deg,q2_deg,length_mm\n" + "".join(f"{0.1 * i},{0.2 - 0.03 * i},400\n" for i in range(6))
    assert "if these are radians, call them q1_rad" in load_run(write(tmp_path / "r.csv", text), 2).warnings[0]


def test_files_that_are_no_text(tmp_path):
    (tmp_path / "latin.csv").write_bytes(rows().replace("length_mm", "length_mm,Prüfer").encode("latin-1"))
    with pytest.raises(InputError, match="line 1: the text is not UTF-8; name its encoding"):
        load_run(tmp_path / "latin.csv", 2)
    with pytest.raises(InputError, match=r"absent\.csv: cannot be read"):
        load_run(tmp_path / "absent.csv", 2)


def test_rows_of_a_lost_beam_are_cut_out_and_named(tmp_path):
    text = "q1_deg,q2_deg,x_mm,y_mm,z_mm\n" + "1,20,900,3,4\n2,30,0,0,0\n3,50,0,700,0\n4,60,0.000,0,-0.0\n"
    run = load_run(write(tmp_path / "run.csv", text), 2)
    np.testing.assert_allclose(run.readings.position, [[0.9, 0.003, 0.004], [0, 0.7, 0]])
    assert run.samples.line.tolist() == [2, 4]
    (warning,) = run.warnings
    assert warning.startswith("run.csv: the position is 0, 0, 0 in line 3, line 5: the tracker had lost its reflector")


def test_a_plan_or_a_cell_is_not_taken_for_a_run_with_titles_of_its_own(tmp_path):
    path = write(tmp_path / "plan.json", '{"schema": "edbb-plan/1"}\n')
    with pytest.raises(InputError, match=r"plan.json: is no table: .* --plan names a plan, --cell a cell"):
        load_run(path, 2)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_what_a_spreadsheet_saves_as_unicode_is_read(tmp_path, encoding):
    (tmp_path / "run.csv").write_bytes(rows().replace("\n", "\r\n").encode(encoding))
    found, plain = load_run(tmp_path / "run.csv", 2), load_run(write(tmp_path / "plain.csv", rows()), 2)
    np.testing.assert_array_equal(found.samples.q, plain.samples.q)
    np.testing.assert_array_equal(found.readings.length, plain.readings.length)
