"""Cartesian targets: the pose written is one that the nominal controller turns into the corrected joint angles."""

import re

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.compensated_program import compensate_program
from planner.compensation.targets import ToolAndBase
from planner.kinematics.robot import elementary_placement
from tests.compensation.robots import bent, exact, flange_pose, regular_angles
from tests.not_everywhere import pin

TOOL = np.array([30.0, -20.0, 180.0, 10.0, -35.0, 90.0])  # X Y Z [mm] A B C [deg]
BASE = np.array([400.0, 100.0, -50.0, 170.0, 3.0, -5.0])


def matrix(xyzabc):
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", xyzabc[3:], degrees=True).as_matrix()
    T[:3, 3] = np.array(xyzabc[:3]) * 1e-3
    return T


def abc_of(T):
    return np.hstack([T[:3, 3] * 1e3, Rotation.from_matrix(T[:3, :3]).as_euler("ZYX", degrees=True)])


def kuka_status(robot, q):
    """By the maker's words: the wrist in the A1 frame, axis 3 against the stretched arm, the sign of axis 5."""
    wrist = wrist_of(robot, q)
    in_a1 = np.cos(-q[0]) * wrist[0] + np.sin(-q[0]) * wrist[1]  # KUKA's axis 1 turns the other way round
    stretched = -np.arctan2(0.035, 0.365)
    return int(in_a1 < 0) | 2 * int(q[2] > stretched) | 4 * int(q[4] < 0)


def wrist_of(robot, q):
    T = flange_pose(exact(robot), q)
    return T[:3, 3] - 0.080 * T[:3, 2]


def controller(robot, T, near):
    """Angles at which the nominal robot stands at T, by a general least-squares solver."""
    fit = least_squares(
        lambda q: (flange_pose(exact(robot), q) - T)[:3].ravel(), near, xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    assert np.abs(fit.fun).max() < 1e-9
    return fit.x


def krl(robot, q, word="PTP", with_status=True):
    lines = ["&ACCESS RVP", "DEF PART ( )", "$TOOL=" + frame_text(TOOL), f"$BASE={frame_text(BASE)}"]
    for row in q:
        pose = abc_of(np.linalg.inv(matrix(BASE)) @ flange_pose(exact(robot), row) @ matrix(TOOL))
        numbers = ",".join(f"{k} {v:.9f}" for k, v in zip("XYZABC", pose, strict=True))
        status = f",S {kuka_status(robot, row)},T {int((row < 0) @ (1 << np.arange(6)))}" if with_status else ""
        lines.append(f"{word} {{{numbers}{status},E1 0.0}} ; a point {{X 1}}")
    return "\r\n".join([*lines, "END", ""])


def frame_text(frame):
    return "{" + ",".join(f"{k} {v:.3f}" for k, v in zip("XYZABC", frame, strict=True)) + "}"


def poses_in(text):
    found = []
    for line in text.splitlines():
        if match := re.match(r"\w+ \{X ([^}]*)\}", line):
            found.append([float(re.split(r"\s", c)[-1]) for c in match[1].split(",")[:6]])
    return np.array(found)


def closes(robot, real, wanted, text, tolerance=1e-6):
    poses = [matrix(BASE) @ matrix(pose) @ np.linalg.inv(matrix(TOOL)) for pose in poses_in(text)]
    closes_at(robot, real, wanted, poses, tolerance)


def closes_at(robot, real, wanted, flanges, tolerance=1e-6):
    """A controller drives the flange of the nominal robot to the poses, and the real one stands as was wanted."""
    for row, T in zip(wanted, flanges, strict=True):
        stands = flange_pose(real, controller(robot, T, row))
        assert np.abs(stands - flange_pose(exact(robot), row)).max() < tolerance


@pytest.mark.slow
def test_krl_poses_with_status_and_turn(kuka, tmp_path):
    robot, real = kuka
    q = regular_angles(robot, 60, seed=5)
    path = tmp_path / "part.src"
    path.write_bytes(krl(robot, q).encode())
    done = compensate_file(path, robot, real)
    closes(robot, real, q, done.text)
    assert done.report.poses == 60
    assert done.report.left_m < 1e-6
    assert re.findall(r"S \d+", done.text) == re.findall(r"S \d+", path.read_text())
    assert done.text.count("; a point {X 1}") == 60


@pytest.mark.slow
def test_krl_joint_angles_are_found_from_status_and_turn(kuka, tmp_path):
    """The joint target and the pose of the same point must get the same correction."""
    robot, real = kuka
    q = regular_angles(robot, 30, seed=6)
    path = tmp_path / "part.src"
    path.write_bytes(krl(robot, q).encode())
    by_pose = poses_in(compensate_file(path, robot, real).text)
    angles = "\n".join(
        "PTP {" + ",".join(f"A{i} {v:.10f}" for i, v in enumerate(np.degrees(row), 1)) + "}" for row in q
    )
    path.write_text(f"DEF P ( )\n{angles}\nEND\n")
    text = compensate_file(path, robot, real).text
    for line, pose in zip(re.findall(r"PTP \{(.*)\}", text), by_pose, strict=True):
        row = np.radians([float(c.split()[1]) for c in line.split(",")])
        T = np.linalg.inv(matrix(BASE)) @ flange_pose(exact(robot), row) @ matrix(TOOL)
        np.testing.assert_allclose(matrix(pose), T, atol=1e-6)


@pytest.mark.slow
def test_a_line_keeps_the_shape_of_the_move_before(kuka, tmp_path):
    robot, real = kuka
    q = np.linspace(np.radians([10, -80, 100, 20, 40, 30]), np.radians([30, -60, 80, 40, 60, 300]), 12)
    text = krl(robot, q, "LIN", with_status=False)
    first = "PTP {" + ",".join(f"A{i} {v:.6f}" for i, v in enumerate(np.degrees(q[0]), 1)) + "}"
    path = tmp_path / "part.src"
    path.write_text(text.replace("LIN", first + "\nLIN", 1))
    closes(robot, real, q, compensate_file(path, robot, real).text)
    path.write_text(text)
    with pytest.raises(InputError, match=r"part\.src:5: the pose says no status and turn"):
        compensate_file(path, robot, real)


@pytest.mark.slow
def test_a_taught_point_takes_its_frames_from_its_fdat(kuka, tmp_path):
    robot, real = kuka
    q = regular_angles(robot, 1, seed=7)
    point = re.search(r"\{X [^}]*S[^}]*\}", krl(robot, q))[0]
    path = tmp_path / "part.dat"
    path.write_text(
        f"DEFDAT PART\nDECL E6POS XP1={point}\nDECL FDAT FP1={{TOOL_NO 3,BASE_NO 2,IPO_FRAME #BASE}}\nENDDAT\n"
    )
    with pytest.raises(InputError, match=r"part\.dat:1: .* whose program \(\.src\) does not lie beside it"):
        compensate_file(path, robot, real)
    path.write_text(path.read_text().replace("DEFDAT PART", "DEFDAT PART PUBLIC"))  # other modules may drive to XP1
    with pytest.raises(InputError, match=r"part\.dat:2: .*TOOL_DATA\[3\] is not in .*\$config\.dat"):
        compensate_file(path, robot, real)
    table = f"TOOL_DATA[3]={frame_text(TOOL)}\nBASE_DATA[2]={frame_text(BASE)}\n"
    done = compensate_file(path, robot, real, frames=ToolAndBase(data=table))
    closes(robot, real, q, done.text.replace("DECL E6POS XP1=", "PTP "))
    assert "no move of the files drives to XP1" in done.summary
    named = compensate_file(path, robot, real, frames=ToolAndBase(matrix(TOOL), matrix(BASE)))  # the only ones missing
    assert named.text == done.text
    other = "DEF PART ( )\nFDAT_ACT=FP1\nBAS(#PTP_PARAMS,1)\nPTP XP1\nBAS(#TOOL,1)\nEND\n"
    (tmp_path / "PART.SRC").write_text(other)
    with pytest.raises(InputError, match=r"part\.dat:2: .*TOOL_DATA\[3\] is not in the files"):  # 1 is missing too
        compensate_program(path, robot, real, frames=ToolAndBase(matrix(TOOL), matrix(BASE)))


@pytest.mark.slow
def test_inline_forms_select_tool_and_base_for_what_follows(kuka, tmp_path):
    """BAS (#PTP_PARAMS) and spline moves take the frames of FDAT; those of a spline hold for it alone."""
    robot, real = kuka
    q = regular_angles(robot, 1, seed=7)
    point = re.search(r"\{X [^}]*S[^}]*\}", krl(robot, q))[0]
    data = f"TOOL_DATA[3]={frame_text(TOOL)}\nBASE_DATA[2]={frame_text(BASE)}\n"
    taught = "DECL FDAT FP1={TOOL_NO 3,BASE_NO 2,IPO_FRAME #BASE}\n"
    spline = "SPTP XP1 WITH $TOOL=STOOL2(FP1), $BASE= SBASE(FP1.BASE_NO), $IPO_MODE =SIPO_MODE(FP1.IPO_FRAME)\n"
    for body in (f"FDAT_ACT=FP1\nBAS(#PTP_PARAMS,50)\nPTP {point}\n", f"XP1={point}\n{spline}"):
        path = tmp_path / "p.src"
        path.write_text(f"DEF P ( )\n{taught}BAS(#TOOL,0)\nBAS(#BASE,0)\n{body}END\n")
        done = compensate_file(path, robot, real, frames=ToolAndBase(data=data))
        assert done.report.poses == 1
        closes(robot, real, q, done.text.replace("XP1=", "PTP "))
    path.write_text(path.read_text().replace("END\n", "LIN XP1\nEND\n"))
    with pytest.raises(InputError, match="its moves have different tools or bases"):
        compensate_file(path, robot, real, frames=ToolAndBase(data=data))


def test_bases_on_an_external_kinematic_are_not_taken_for_fixed(kuka, tmp_path):
    robot, real = kuka
    point = re.search(r"\{X [^}]*S[^}]*\}", krl(robot, regular_angles(robot, 1, seed=7)))[0]
    (tmp_path / "p.dat").write_text(
        f"DEFDAT P PUBLIC\nDECL E6POS XP1={point}\nDECL FDAT FP1={{TOOL_NO 0,BASE_NO 17}}\nENDDAT\n"
    )
    on = 'MACHINE_DEF[2]={NAME[] "T",MECH_TYPE #EASYS}\nMACHINE_FRAME_DAT[17]={MACH_DEF_INDEX 2,PARENT[] "T"}\n'
    data = f"{on}BASE_DATA[17]={frame_text(BASE)}\n"
    with pytest.raises(InputError, match=r"BASE_DATA\[17\] stands on an external kinematic \(MACHINE_DEF\[2\]\)"):
        compensate_file(tmp_path / "p.dat", robot, real, frames=ToolAndBase(data=data))


def test_turn_bits_follow_an_axis_over_zero(kuka, tmp_path):
    robot, _ = kuka
    real = exact(robot)
    real.delta[[k for k, t in enumerate(robot.transforms) if t.joint == 5]] = robot.coupling_matrix[5, 5] * 0.02
    q = np.radians([[10, -80, 100, 20, 40, 0.5]])
    path = tmp_path / "part.src"
    path.write_bytes(krl(robot, q).encode())
    assert re.search(r"T (\d+)", path.read_text())[1] == "2"
    assert re.search(r"T (\d+)", compensate_file(path, robot, real).text)[1] == "34"


def rapid(robot, q):
    tool, base = matrix(TOOL), matrix(BASE)
    lines = ["MODULE Part", f"  PERS tooldata tGrip:=[TRUE,{pose_text(tool)},[1,[0,0,1],[1,0,0,0],0,0,0]];"]
    lines.append(f'  PERS wobjdata wTable:=[FALSE,TRUE,"",{pose_text(base)},[[0,0,0],[1,0,0,0]]];')
    moves = []
    for k, row in enumerate(q):
        T = np.linalg.inv(base) @ flange_pose(exact(robot), row) @ tool
        quarters = [int(np.floor(row[j] / (np.pi / 2))) for j in (0, 3, 5)]
        behind = stretched_side(robot, row) < 0
        conf = [*quarters, 2 * int(behind) + int(row[4] < 0)]
        value = f"{pose_text(T)[:-1]},{conf},[9E9,9E9,9E9,9E9,9E9,9E9]]"
        if k % 2:
            lines.append(f"  CONST robtarget p{k}:={value};  ! taught")
            moves.append(f"    MoveL p{k}, v100, fine, tGrip\\WObj:=wTable;")
        else:
            moves.append(f"    MoveJ {value}, v100, z10, tGrip\\WObj:=wTable;")
    return "\n".join([*lines, "  PROC main()", *moves, "  ENDPROC", "ENDMODULE", ""])


def stretched_side(robot, row):
    """Positive where the wrist is on the side of the lower arm on which it is at zero."""

    def side(angles):
        p = [pin_flange_of_axis(robot, angles, j) for j in (1, 2)]
        wrist = flange_pose(exact(robot), angles)
        wrist = wrist[:3, 3] - 0.072 * wrist[:3, 2]
        return np.cross(p[1][:3, 3] - p[0][:3, 3], wrist - p[1][:3, 3]) @ p[1][:3, 2]

    return side(row) * side(np.zeros(6))


def pin_flange_of_axis(robot, q, joint):
    """Frame whose z axis is a joint's axis: the row before the joint's rotation (standard DH)."""
    T, theta = pin.SE3.Identity(), robot.theta(q[None])[0]
    for t in robot.transforms:
        if t.joint == joint:
            return T.homogeneous
        T = T * pin.SE3(elementary_placement(t, t.nominal + (0.0 if t.joint is None else theta[t.joint])))
    raise AssertionError


def pose_text(T):
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return (
        "[[" + ",".join(f"{v * 1e3:.7f}" for v in T[:3, 3]) + "],[" + ",".join(f"{v:.10f}" for v in (w, x, y, z)) + "]]"
    )


@pytest.mark.slow
def test_rapid_robtargets_with_confdata(tmp_path):
    robot, real = bent("abb-irb120", seed=8)
    q = regular_angles(robot, 400, seed=9)
    ahead = [np.cos(r[0]) * w[0] + np.sin(r[0]) * w[1] > 0.01 for r in q for w in [wrist_abb(robot, r)]]
    q = q[ahead][:60]
    path = tmp_path / "part.mod"
    path.write_text(rapid(robot, q))
    done = compensate_file(path, robot, real)
    assert done.report.poses == len(q) > 40
    by_name = dict(re.findall(r"robtarget (p\d+):=(\[\[.*\]\]);", done.text))
    moves = re.findall(r"Move[JL] (p\d+|\[\[.*?9E9\]\])", done.text)
    for row, move in zip(q, moves, strict=True):
        x, y, z, qw, qx, qy, qz = (float(v) for v in re.findall(r"-?\d+\.\d+", by_name.get(move, move)))
        T = np.eye(4)
        T[:3, :3] = Rotation.from_quat([qx, qy, qz, qw]).as_matrix()
        T[:3, 3] = np.array([x, y, z]) * 1e-3
        flange = matrix(BASE) @ T @ np.linalg.inv(matrix(TOOL))
        stands = flange_pose(real, controller(robot, flange, row))
        assert np.abs(stands - flange_pose(exact(robot), row)).max() < 1e-6
    assert done.text.count("! taught") == len(q) // 2


def wrist_abb(robot, q):
    T = flange_pose(exact(robot), q)
    return T[:3, 3] - 0.072 * T[:3, 2]


@pytest.mark.slow
def test_a_table_of_poses_with_angles_to_start_from(tmp_path):
    robot, real = bent("ur10", seed=10)
    q = regular_angles(robot, 25, seed=11)
    rng = np.random.default_rng(0)
    rows = ["# wanted;x", "name,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg," + ",".join(f"q{i}_deg" for i in range(1, 7))]
    for k, row in enumerate(q):
        numbers = [*abc_of(flange_pose(exact(robot), row)), *np.degrees(row + rng.normal(0, 0.01, 6))]
        rows.append(f"p{k}," + ",".join(f"{v:.9f}" for v in numbers))
    path = tmp_path / "targets.csv"
    path.write_text("\n".join(rows))
    done = compensate_file(path, robot, real)
    for row, line in zip(q, done.text.splitlines()[3:], strict=True):
        values = np.array([float(v) for v in line.split(",")[1:]])
        found = controller(robot, matrix(values[:6]), row)
        np.testing.assert_allclose(found, np.radians(values[6:]), atol=1e-6)
        assert np.abs(flange_pose(real, found) - flange_pose(exact(robot), row)).max() < 1e-6
