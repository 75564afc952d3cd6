"""Orientations of a table that contradict its joint angles are refused, and the convention that agrees is named."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.targets import ToolAndBase
from tests.compensation.robots import bent, exact, flange_pose

Q_DEG = [
    (10, -95, 100, -95, -90, 20),
    (25, -85, 95, -100, -80, 10),
    (-20, -100, 110, -100, -88, 5),
    (40, -80, 90, -110, -92, 35),
]
ANGLES, QUATERNION = "a_deg,b_deg,c_deg", "qw,qx,qy,qz"


@pytest.fixture(scope="module")
def ur5e():
    return bent("ur5e", seed=4)


def euler(sequence, columns=slice(None), unit=True):
    return lambda R: R.as_euler(sequence, degrees=unit)[columns]


WRITTEN = {  # columns, what stands in them of a rotation, and what the refusal says
    "fixed X, Y, Z": (ANGLES, euler("xyz"), "A, B, C about the fixed axes X, Y, Z (roll, pitch, yaw)"),
    "C, B, A": (ANGLES, euler("ZYX", [2, 1, 0]), "the order C, B, A"),
    "moving X, Y, Z": (ANGLES, euler("XYZ"), "A, B, C about X, Y', Z\" (moving axes)"),
    "moving Z, Y, Z": (ANGLES, euler("ZYZ"), "A, B, C about Z, Y', Z\" (moving axes)"),
    "moving Z, X, Z": (ANGLES, euler("ZXZ"), "A, B, C about Z, X', Z\" (moving axes)"),
    "fixed Z, Y, X": (ANGLES, euler("zyx"), "A, B, C about the fixed axes Z, Y, X"),
    "exchanged columns": (ANGLES, euler("ZYX", [1, 0, 2]), "B, A, C about Z, Y', X\" (moving axes)"),
    "rotation vector": (ANGLES, lambda R: np.degrees(R.as_rotvec()), "a rotation vector"),
    "rotation vector in radians": (
        ANGLES,
        lambda R: R.as_rotvec(),
        "radians under the name of degrees: a rotation vector",
    ),
    "radians": (ANGLES, euler("ZYX", unit=False), "radians under the name of degrees: A, B, C about Z, Y', X\""),
    "degrees": ("a_rad,b_rad,c_rad", euler("ZYX"), "degrees under the name of radians: A, B, C about Z, Y', X\""),
    "inverse": (
        ANGLES,
        lambda R: R.inv().as_euler("ZYX", degrees=True),
        "the inverse turn (of the base from the tool)",
    ),
    "x, y, z, w": (QUATERNION, lambda R: R.as_quat(), "quaternions x, y, z, w (scalar last)"),
    "inverse quaternion": (
        QUATERNION,
        lambda R: R.inv().as_quat()[[3, 0, 1, 2]],
        "the inverse turn (of the base from the",
    ),
    "inverse, x, y, z, w": (
        QUATERNION,
        lambda R: R.inv().as_quat(),
        "x, y, z, w: name the columns|x, y, z, w all agree",
    ),
}


def table(robot, columns, words, R_FT=None, sign=","):
    """Rows of joint angles, the place of the flange, and its orientation (turned by ``R_FT``) as ``words`` gives it."""
    rows = ["q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm," + columns]
    for q_deg in Q_DEG:
        T = flange_pose(exact(robot), np.radians(q_deg))
        R = Rotation.from_matrix(T[:3, :3] @ (np.eye(3) if R_FT is None else R_FT))
        numbers = [*q_deg, *T[:3, 3] * 1e3, *words(R)]
        rows.append(",".join(f"{v:.9f}" for v in numbers))
    return "\n".join(rows).replace(",", sign) + "\n"


@pytest.mark.parametrize("name", WRITTEN)
def test_another_convention_is_refused_and_named(name, ur5e, tmp_path):
    columns, words, said = WRITTEN[name]
    (tmp_path / "t.csv").write_text(table(ur5e[0], columns, words))
    with pytest.raises(InputError, match="poses contradicts the joint angles beside it, by") as refused:
        compensate_file(tmp_path / "t.csv", *ur5e)
    assert any(part in str(refused.value) for part in said.split("|"))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (ANGLES, euler("ZYX")),
        ("a_rad,b_rad,c_rad", euler("ZYX", unit=False)),
        (QUATERNION, lambda R: R.as_quat()[[3, 0, 1, 2]]),
        (QUATERNION, lambda R: -R.as_quat()[[3, 0, 1, 2]]),
    ],
)
def test_what_the_columns_say_is_read(columns, words, ur5e, tmp_path):
    (tmp_path / "t.csv").write_text(table(ur5e[0], columns, words))
    done = compensate_file(tmp_path / "t.csv", *ur5e)
    assert done.report.poses == len(Q_DEG)
    assert not done.partly
    assert not [said for _, said in done.report.notes if "written anew" in said]


def test_a_tool_that_is_turned_is_named_and_taken(ur5e, tmp_path):
    R_FT = Rotation.from_euler("ZYX", [30, -20, 75], degrees=True).as_matrix()
    (tmp_path / "t.csv").write_text(table(ur5e[0], ANGLES, euler("ZYX"), R_FT))
    with pytest.raises(InputError, match=r"--tool=0,0,0,30,-20,75 \(mm and degrees\)"):
        compensate_file(tmp_path / "t.csv", *ur5e)
    T_FT = np.eye(4)
    T_FT[:3, :3] = R_FT
    assert compensate_file(tmp_path / "t.csv", *ur5e, frames=ToolAndBase(T_FT)).report.poses == len(Q_DEG)


def test_one_row_that_contradicts_its_angles_is_left(ur5e, tmp_path):
    rows = table(ur5e[0], ANGLES, euler("ZYX")).splitlines()
    cells = rows[3].split(",")
    cells[9:] = ["100", "10", "20"]
    (tmp_path / "t.csv").write_text("\n".join([*rows[:3], ",".join(cells), *rows[4:], ""]))
    done = compensate_file(tmp_path / "t.csv", *ur5e)
    assert done.report.poses == 3
    assert [line for line, why in done.report.kept if "is turned by" in why] == [4]


def test_angles_that_are_a_rough_start_are_told(ur5e, tmp_path):
    rows = table(ur5e[0], ANGLES, euler("ZYX")).splitlines()
    cells = rows[2].split(",")
    cells[3] = str(float(cells[3]) + 4.0)
    (tmp_path / "t.csv").write_text("\n".join([*rows[:2], ",".join(cells), *rows[3:], ""]))
    done = compensate_file(tmp_path / "t.csv", *ur5e)
    assert done.report.poses == 4
    said = [why for line, why in done.report.notes if line == 3 and "written anew" in why]
    assert said
    assert "joint 4 moves by -4.0°" in said[0]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be"])
@pytest.mark.parametrize("sign", [",", ";", "\t"])
def test_a_table_is_written_back_as_it_was_encoded(encoding, sign, ur5e, tmp_path):
    text = table(ur5e[0], ANGLES, euler("ZYX"), sign=sign)
    text = text.replace(".", ",") if sign == ";" else text
    text = "\ufeff" + text if encoding == "utf-16-be" else text
    (tmp_path / "t.csv").write_bytes(text.encode(encoding))
    done = compensate_file(tmp_path / "t.csv", *ur5e)
    assert done.report.poses == len(Q_DEG)
    written = done.text.encode(done.encoding)
    marks = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")
    assert [written.startswith(m) for m in marks] == [text.encode(encoding).startswith(m) for m in marks]
    assert len(written.decode(encoding).splitlines()) >= len(Q_DEG) + 1
