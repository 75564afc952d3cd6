"""Poses of INFORM and AS, written by the makers' definitions alone: scipy's rotations, places of pinocchio."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.compensation.arm_shapes import shape_of
from planner.compensation.compensated_file import compensate_file
from planner.compensation.rotations import to_euler
from planner.compensation.targets import ToolAndBase
from planner.kinematics.robot import elementary_placement
from tests.compensation.robots import bent, exact, flange_pose, regular_angles
from tests.compensation.test_cartesian import BASE, TOOL, closes_at, matrix
from tests.not_everywhere import pin
from tests.speaking import speaking_all

AXES = {"ZYX": "ZYX", "ZYZ": "ZYZ", "xyz": "xyz", "XYZ": "XYZ", "ZXZ": "ZXZ"}
# height of the maker's base frame over the model's [mm], sense of axis 1 seen from above, wrist to flange [m]
ARMS = {"kuka-kr6-r700": (400.0, -1, 0.080), "yaskawa-ma2010": (505.0, 1, 0.100), "staubli-tx2-60": (375.0, 1, 0.070)}


@pytest.mark.parametrize("axes", AXES)
def test_three_angles_say_the_same_turn_as_scipy_and_stay_near(axes):
    rng = np.random.default_rng(3)
    angles = rng.uniform(-3.0, 3.0, (200, 3))
    special = 0.0 if axes[0] == axes[2] else np.pi / 2
    angles[:20, 1] = special
    R = Rotation.from_euler(axes, angles).as_matrix()
    found = to_euler(R, angles + rng.normal(0.0, 1e-3, angles.shape), axes)
    np.testing.assert_allclose(Rotation.from_euler(axes, found).as_matrix(), R, atol=1e-12)
    np.testing.assert_allclose(found[20:], angles[20:], atol=1e-9)
    assert np.abs(found - angles).max() < 0.1  # where only a sum is determined, near is enough


def arm(name):
    """A robot that speaks all languages, and the same with errors; of the KR 6 the base frame is drawn."""
    robot, real = bent(name, seed=4)
    robot = speaking_all(robot)
    if name == "kuka-kr6-r700":
        robot = replace(robot, conventions=tuple(replace(c, p_MC=(0.0, 0.0, 0.4)) for c in robot.conventions))
    return robot, replace(real, robot=robot)


@pytest.fixture(scope="module")
def kuka():
    return arm("kuka-kr6-r700")


def in_base(robot, row, tool, base):
    """The tool in its base, which stands in the maker's base frame."""
    return np.linalg.inv(makers_base(robot) @ base) @ flange_pose(exact(robot), row) @ tool


def makers_base(robot):
    T = np.eye(4)
    T[2, 3] = ARMS[robot.name][0] * 1e-3
    return T


def wrist_ahead(robot, q):
    """The wrist's centre (3,) [m], and the direction in which the arm looks."""
    _, sense, length = ARMS[robot.name]
    T = flange_pose(exact(robot), q)
    return T[:3, 3] - length * T[:3, 2], np.array([np.cos(sense * q[0]), np.sin(sense * q[0]), 0.0])


def elbow_is_up(robot, q):
    """The elbow above the line from axis 2 to the wrist, by places in the plane of the arm."""
    T, places = pin.SE3.Identity(), {}
    for t in robot.transforms:
        theta = 0.0 if t.joint is None else robot.theta(q[None])[0][t.joint]
        T = T * pin.SE3(elementary_placement(t, t.nominal + theta))
        if t.joint is not None:
            places[t.joint] = T.translation.copy()
    wrist, ahead = wrist_ahead(robot, q)
    to_wrist, to_elbow = wrist - places[1], places[2] - places[1]
    w, e = ((v @ ahead, v[2]) for v in (to_wrist, to_elbow))
    return w[0] * e[1] - w[1] * e[0] > 0.0


def is_rear(robot, q):
    wrist, ahead = wrist_ahead(robot, q)
    return wrist @ ahead < 0.0


def inform(robot, q, postype="USER"):
    """A job by the DX100 manual: RCONF is 0 flip, 0 upper, 0 front, 0 R, T, S under 180 deg."""
    base = matrix(BASE) if postype == "USER" else np.eye(4)
    head = ["/JOB", "//NAME PART", "//POS", f"///NPOS {len(q)},0,0,0,0,0", "///USER 2", "///TOOL 3"]
    lines = [*head, f"///POSTYPE {postype}", "///RECTAN"]
    for k, row in enumerate(q):
        flip, turned = np.cos(row[3]) > 0.0, np.abs(row[[3, 5, 0]]) > np.pi
        form = [int(not flip), int(not elbow_is_up(robot, row)), int(is_rear(robot, row)), *turned.astype(int)]
        T = in_base(robot, row, matrix(TOOL), base)
        pose = [*T[:3, 3] * 1e3, *Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True)]
        lines += [f"///RCONF {','.join(map(str, form))}", f"C{k:05d}={','.join(f'{v:.9f}' for v in pose)}"]
    lines += ["//INST", "///DATE 2020/01/01 00:00", "///ATTR SC,RW", "///GROUP1 RB1", "NOP"]
    return "\r\n".join([*lines, *(f"MOVJ C{k:05d} VJ=10.00" for k in range(len(q))), "END", ""])


def inform_poses(text):
    rows = [[float(v) for v in row.split(",")] for row in re.findall(r"^C\d+=(.*?)\r?$", text, re.MULTILINE)]
    return [pose_of(row, "xyz") for row in rows]


def pose_of(row, axes):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler(axes, row[3:], degrees=True).as_matrix(), np.array(row[:3]) * 1e-3
    return T


FRAMES = ToolAndBase(matrix(TOOL), matrix(BASE))


@pytest.mark.parametrize(
    ("postype", "name"), [("USER", "kuka-kr6-r700"), ("ROBOT", "kuka-kr6-r700"), ("USER", "yaskawa-ma2010")]
)
def test_a_job_of_poses_is_corrected_as_its_axes_are(postype, name, tmp_path):
    robot, real = arm(name)
    q = np.array([row for row in regular_angles(robot, 60, seed=5) if not is_rear(robot, row)])
    assert len({(elbow_is_up(robot, row), np.cos(row[3]) > 0.0) for row in q}) == 4
    path = tmp_path / "PART.JBI"
    path.write_text(inform(robot, q, postype), newline="")
    done = compensate_file(path, robot, real, frames=FRAMES)
    assert done.report.poses == len(q)
    np.testing.assert_allclose(done.q, q, atol=1e-7)
    base = matrix(BASE) if postype == "USER" else np.eye(4)
    closes(robot, real, q, inform_poses(done.text), base)
    assert re.findall(r"RCONF [\d,]+", done.text) == re.findall(r"RCONF [\d,]+", path.read_text())


def closes(robot, real, q, poses, base):
    """The controller, a general solver, drives the written poses; the bent robot stands where it was meant to."""
    closes_at(robot, real, q, [makers_base(robot) @ base @ T @ np.linalg.inv(matrix(TOOL)) for T in poses])


def test_a_pose_over_the_shoulder_is_left_with_the_reason(kuka, tmp_path):
    robot, real = kuka
    q = [row for row in regular_angles(robot, 200, seed=9) if is_rear(robot, row)][:1]
    path = tmp_path / "PART.JBI"
    path.write_text(inform(robot, np.array(q)), newline="")
    with pytest.raises(InputError, match="to the rear, and which elbow its maker then calls the upper"):
        compensate_file(path, robot, real, frames=FRAMES)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("///RCONF", "///COMM", "says no form"),
        ("POSTYPE USER", "POSTYPE MTOOL", "position type MTOOL"),
        (",0,0\r", ",0,2\r", "says no form"),
        ("VJ=10.00", "BC00000 VJ=10.00", "may shift it"),
    ],
)
def test_a_pose_that_is_not_certain_is_left(old, new, why, kuka, tmp_path):
    robot, real = kuka
    q = np.array([row for row in regular_angles(robot, 20, seed=5) if not is_rear(robot, row)])[:1]
    path = tmp_path / "PART.JBI"
    path.write_text(inform(robot, q).replace(old, new), newline="")
    with pytest.raises(InputError, match=why):
        compensate_file(path, robot, real, frames=FRAMES)


def test_poses_need_the_place_of_the_makers_base_frame(kuka, tmp_path):
    robot, real = kuka
    robot = replace(robot, conventions=tuple(replace(c, p_MC=None) for c in robot.conventions))
    path = tmp_path / "PART.JBI"
    path.write_text(inform(robot, ROW[:1]), newline="")
    with pytest.raises(InputError, match=r"base frame lies \(give base_mm under \[controllers.inform\] of robot.toml"):
        compensate_file(path, robot, real, frames=FRAMES)


def test_a_tool_that_no_file_holds_is_named(kuka, tmp_path):
    robot, real = kuka
    q = np.array([row for row in regular_angles(robot, 20, seed=5) if not is_rear(robot, row)])[:1]
    path = tmp_path / "PART.JBI"
    path.write_text(inform(robot, q), newline="")
    with pytest.raises(InputError, match=r"TOOL 3 is not in the files \(--tool\)"):
        compensate_file(path, robot, real)


def kawasaki(robot, q, words="TOOL grip\nBASE table\n"):
    """A program of joints and poses by the AS manual; the first target, in joint angles, says the shape of the arm."""
    lines = [".PROGRAM part()", *words.splitlines(), "JMOVE #start"]
    lines += [f"LMOVE p[{k}]" for k in range(len(q))]
    lines += [".END", ".JOINTS", f"#start {' '.join(f'{v:.9f}' for v in np.degrees(q[0]))}", ".END", ".TRANS"]
    for name, T in (("grip", matrix(TOOL)), ("table", matrix(BASE))):
        lines.append(f"{name} {oat(T)}")
    lines += [f"p[{k}] {oat(in_base(robot, row, matrix(TOOL), matrix(BASE)))}" for k, row in enumerate(q)]
    return "\r\n".join([*lines, ".END", ""])


def oat(T):
    values = [*T[:3, 3] * 1e3, *Rotation.from_matrix(T[:3, :3]).as_euler("ZYZ", degrees=True)]
    return " ".join(f"{v:.9f}" for v in values)


def oat_poses(text):
    rows = re.findall(r"^p\[\d+\] (.*?)\r?$", text, re.MULTILINE)
    return [pose_of([float(v) for v in row.split()], "ZYZ") for row in rows]


ROW = np.linspace(np.radians([10, -80, 100, 20, 40, 30]), np.radians([30, -60, 80, 40, 60, 200]), 12)
UPRIGHT = np.linspace(np.radians([10, -40, -70, 20, 40, 30]), np.radians([30, -20, -90, 40, 60, 200]), 6)  # over itself


def test_an_as_program_of_poses_keeps_the_shape_of_the_joints_before(kuka, tmp_path):
    robot, real = kuka
    path = tmp_path / "part.as"
    path.write_text(kawasaki(robot, ROW), newline="")
    done = compensate_file(path, robot, real)
    assert done.report.poses == len(ROW)
    closes(robot, real, ROW, oat_poses(done.text), matrix(BASE))
    for frame in ("grip", "table"):
        assert f"{frame} {oat(matrix(TOOL if frame == 'grip' else BASE))}\r\n" in done.text


@pytest.mark.parametrize(
    ("words", "old", "new", "why"),
    [
        ("TOOL grip\n", "", "", r"the file does not say the base \(--base\)"),
        ("BASE table\n", "", "", r"the file does not say the tool \(--tool\)"),
        ("TOOL grip\nBASE table\n", "JMOVE #start", "JMOVE #start\r\nLEFTY", "whose shape of the arm is kept"),
        ("TOOL grip\nBASE table\nPOINT table = HERE\n", "", "", "base table may be written by the program"),
        ("TOOL grip\nBASE Table\nPOINT TABLE = HERE\n", "", "", "base table may be written by the program"),
        ("TOOL other\nBASE table\n", "", "", r"other is not in the files \(--tool\)"),
    ],
)
def test_an_as_pose_that_is_not_certain_is_left(words, old, new, why, kuka, tmp_path):
    robot, real = kuka
    path = tmp_path / "part.as"
    path.write_text(kawasaki(robot, ROW[:2], words).replace(old, new, 1), newline="")
    done = compensate_file(path, robot, real)
    assert (done.report.joint_targets, done.report.poses) == (1, 0 if words else 1)
    assert re.search(why, done.summary)


def val3(folder, robot, q, words="movel", shape="lefty epositive wpositive", tool="flange", more=""):
    """An application as RoboDK's post processor writes it; the first target, in joint angles, says the shape."""
    (folder / "start.pgx").write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<Programs xmlns="http://www.staubli.com/robotics/VAL3/Program/2">\n  <Program name="start">\n'
        "    <Code><![CDATA[begin\n"
        f"  movej(jStart,tGrip,mFast)\n{more}"
        + "".join(f"  {words}(p[{k}],tGrip[0], mFast) // to a point\n" for k in range(len(q)))
        + "  waitEndMove()\nend]]></Code>\n  </Program>\n</Programs>\n"
    )
    angles = " ".join(f'j{k}="{v:.9f}"' for k, v in enumerate(np.degrees(q[0]), 1))
    form = " ".join(f'{key}="{word}"' for key, word in zip(("shoulder", "elbow", "wrist"), shape.split(), strict=True))
    values = [f"{frame_words(in_base(robot, row, matrix(TOOL), matrix(BASE)))} {form}" for row in q]
    path = folder / "app.dtx"
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<Database xmlns="http://www.staubli.com/robotics/VAL3/Data/2">\n  <Datas>\n'
        + data_of("jStart", "jointRx", [angles])
        + data_of("fTable", "frame", [f'{frame_words(matrix(BASE))} fatherId="world[0]"'])
        + data_of("tGrip", "tool", [f'{frame_words(matrix(TOOL))} fatherId="{tool}[0]"'])
        + data_of("mFast", "mdesc", ['accel="100" vel="50" blend="joint" leave="50" reach="50"'])
        + data_of("p", "pointRx", [f'{value} fatherId="fTable[0]"' for value in values])
        + "  </Datas>\n</Database>\n"
    )
    return path


def frame_words(T):
    row = [*T[:3, 3] * 1e3, *Rotation.from_matrix(T[:3, :3]).as_euler("XYZ", degrees=True)]
    return " ".join(f'{key}="{v:.9f}"' for key, v in zip(("x", "y", "z", "rx", "ry", "rz"), row, strict=True))


@pytest.mark.parametrize("name", ["staubli-tx2-60", "kawasaki-rs007n"])
def test_an_arm_that_stands_upright_at_zero_has_a_front_and_a_rear(name):
    robot, _ = arm(name)
    forward, back = np.radians([[10, 40, 20, 20, 40, 30], [10, -40, 20, 20, 40, 30]])
    assert shape_of(robot, np.array([forward, back])).tolist() == [2, 3]  # and the elbow bent forward in both


def data_of(name, kind, rows):
    values = "".join(f'      <Value key="{k}" {row} />\n' for k, row in enumerate(rows))
    return f'    <Data name="{name}" access="private" xsi:type="array" type="{kind}">\n{values}    </Data>\n'


@pytest.mark.parametrize(("name", "row"), [("kuka-kr6-r700", ROW), ("staubli-tx2-60", UPRIGHT)])
def test_points_of_val3_keep_the_shape_of_the_joints_before(name, row, tmp_path):
    robot, real = arm(name)
    path = val3(tmp_path, robot, row)
    done = compensate_file(path, robot, real)
    assert (done.report.joint_targets, done.report.poses) == (1, len(row))
    np.testing.assert_allclose(done.q[1:], row, atol=1e-7)
    number = r'="([-\d.]+)"'
    rows = re.findall(
        rf"<Value key=\"\d+\" x{number} y{number} z{number} rx{number} ry{number} rz{number} sh", done.text
    )
    closes(robot, real, row, [pose_of([float(v) for v in cells], "XYZ") for cells in rows], matrix(BASE))
    assert done.text.count('shoulder="lefty" elbow="epositive" wrist="wpositive" fatherId="fTable[0]"') == len(row)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"words": "movej"}, "no source says which shape of the arm is 'lefty epositive wpositive'"),
        ({"more": "  tGrip.trsf.z=120\n"}, r"tool tGrip\[0\] may be written by the program"),
        ({"more": "  p[0].trsf.z=120\n"}, r"p\[0\] is not certain: 'p\[0\].trsf.z=120' .* uses it too"),
        ({"more": "  movel(appro(p[0],tUp),tGrip,mFast)\n"}, r"p\[0\] is not certain"),
        ({"tool": "tOther"}, r"tool tGrip\[0\] stands on tOther\[0\]"),
    ],
)
def test_a_point_of_val3_that_is_not_certain_is_left(said, why, kuka, tmp_path):
    robot, real = kuka
    done = compensate_file(val3(tmp_path, robot, ROW[:1], **said), robot, real)
    assert (done.report.joint_targets, done.report.poses) == (1, 0)
    assert re.search(why, done.summary)
    kept = compensate_file(val3(tmp_path, robot, ROW[:1], "movej", "ssame esame wsame"), robot, real)
    assert kept.report.poses == 1


def test_data_of_an_older_val3_are_named(kuka, tmp_path):
    robot, real = kuka
    (tmp_path / "app.dtx").write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n<dataList xmlns="DataNameSpace">\n  <pointSection>\n'
        '    <point name="p1" public="false">\n      <valuePoint index="0">\n        <tpValue x="366.58" z="0" />\n'
        "      </valuePoint>\n    </point>\n  </pointSection>\n</dataList>\n"
    )
    path = tmp_path / "start.pgx"
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n<programList xmlns="ProgramNameSpace">\n  <program name="start">\n'
        "    <source>\n      <code>\nbegin\n  movej(p1,flange,mFast)\nend\n      </code>\n    </source>\n"
        "  </program>\n</programList>\n"
    )
    for file in (path, tmp_path / "app.dtx"):
        assert (
            "p1[0] stands in data of VAL3 s6, read are those of s7 and s8" in compensate_file(file, robot, real).summary
        )
