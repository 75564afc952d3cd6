"""What a table says beside its angles is taken in, refused or named, never passed over."""

from dataclasses import replace

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.kinematics.robot_reader import load_robot
from tests.compensation.robots import bent

HEAD = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg"
ROW = "10,-70,80,5,40,0"


@pytest.fixture(scope="module")
def arm():
    return bent("kuka-kr6-r700", seed=6)


def corrected(arm, tmp_path, text, name="t.csv", robot=None):
    path = tmp_path / name
    path.write_text(text)
    return compensate_file(path, robot or arm[0], arm[1])


@pytest.mark.parametrize(
    ("columns", "cells", "named"),
    [
        ("tool", "1", "column tool"),
        ("e1_mm", "500", "column e1_mm"),
        ("base,motion", "2,abs", "columns base, motion"),
        ("frame,pose,speed_mm_s,comment", "3,7,100,above", "column frame"),
        ("pose,name,duration_s,blend_mm,text", "7,P7,1.5,0,above", None),
    ],
)
def test_columns_of_which_nothing_is_taken_in_are_named(arm, tmp_path, columns, cells, named):
    done = corrected(arm, tmp_path, f"{HEAD},{columns}\n{ROW},{cells}\n")
    said = [text for _, text in done.report.notes if "nothing is taken in" in text]
    assert bool(said) == (named is not None)
    assert named is None or f"of the {named} nothing" in said[0]
    plain = corrected(arm, tmp_path, f"{HEAD}\n{ROW}\n")
    np.testing.assert_array_equal(done.text.splitlines()[-1].split(",")[:6], plain.text.splitlines()[-1].split(","))


def test_relative_rows_are_refused_with_their_line(arm, tmp_path):
    with pytest.raises(InputError, match=r"t\.csv:3: 'rel' found"):
        corrected(arm, tmp_path, f"{HEAD},motion\n{ROW},abs\n5,0,0,0,0,0,rel\n")


OWN = "; robot: {}\nDEF p()\nPTP {{A1 10,A2 -70,A3 80,A4 5,A5 40,A6 0}}\nEND\n"


@pytest.mark.slow
def test_a_head_that_names_another_robot_is_honoured(arm, tmp_path):
    for name, text in (("t.csv", f"# robot: {{}}\n{HEAD}\n{ROW}\n"), ("p.src", OWN)):
        for robot in ("kuka-kr6-r700", "KUKA KR 6 R700"):
            assert not [
                t for _, t in corrected(arm, tmp_path, text.format(robot), name).report.notes if "robot's?" in t
            ]
        with pytest.raises(InputError, match=f"{name}:1: the (table|program) is for the robot 'abb-irb6700'"):
            corrected(arm, tmp_path, text.format("abb-irb6700"), name)
    with pytest.raises(InputError, match="robot 'cell 5'"):
        corrected(arm, tmp_path, f'"# robot: cell 5",,,,,\n{HEAD}\n{ROW}\n')
    done = corrected(arm, tmp_path, OWN.format("R1 of cell 5"), "p.src")  # a remark of the person's own
    assert any("'robot: R1 of cell 5' is said here" in text for _, text in done.report.notes)


def test_one_row_that_looks_like_radians_is_refused(arm, tmp_path):
    radians = ",".join(f"{v:.5f}" for v in np.radians([10, -70, 80, 5, 40, 0]))
    for rows in (radians, f"{radians}\n{radians}"):
        with pytest.raises(InputError, match=r"called degrees.*radians look like that.*q1_rad"):
            corrected(arm, tmp_path, f"{HEAD}\n{rows}\n")
    degrees, meant = (
        corrected(arm, tmp_path, text).text.splitlines()[-1].split(",")
        for text in (f"{HEAD}\n{ROW}\n", f"{HEAD.replace('deg', 'rad')}\n{radians}\n")
    )
    np.testing.assert_allclose(np.degrees([float(v) for v in meant]), [float(v) for v in degrees], atol=5e-4)
    assert corrected(arm, tmp_path, f"# angles: degrees\n{HEAD}\n{radians}\n").report.corrected


def test_the_last_line_says_for_which_controller_the_angles_are(arm, tmp_path):
    text = f"{HEAD}\n{ROW}\n"
    nobody = replace(arm[0], conventions=())
    pdl2 = next(c for c in load_robot("comau-nj130").conventions if c.controller == "pdl2")
    other = replace(arm[0], conventions=(*arm[0].conventions, pdl2))
    assert "as KUKA KRL counts them: load it into that controller" in corrected(arm, tmp_path, text).step
    assert "says of no controller how it counts" in corrected(arm, tmp_path, text, robot=nobody).step
    assert "Comau PDL2 counts 5 of 6 axes otherwise" in corrected(arm, tmp_path, text, robot=other).step
