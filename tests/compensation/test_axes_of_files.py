"""Targets are read and written in the axes of the file's controller, whatever the model calls its joints."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.compensation.correction_mark import CorrectionMark
from planner.compensation.languages import corrected_dialects
from planner.compensation.targets import ToolAndBase
from planner.kinematics.axes import AxisConvention
from planner.kinematics.robot_reader import load_robot
from planner.programs.controller_axes import in_controller_axes
from planner.programs.dialect import load_dialect
from planner.programs.verification import read_texts, write_and_read_back
from tests.compensation.robots import BentRobot, bent, exact, flange_pose, half_pulse_deg, regular_angles
from tests.compensation.test_cartesian import krl, rapid
from tests.kinematics.test_axes import ARMS, makers_joints
from tests.programs import sessions
from tests.programs.languages import targets_first
from tests.programs.test_controller_axes import SENSE, UNLIMITED, ZERO, as_the_pendant_shows, convention

NUMBER = re.compile(r"-?\d+\.\d+")
COMAU = ARMS[0]


@dataclass(frozen=True)
class BentComau:
    """A Comau with errors of 0.5 mm and 0.5 mrad in the rows of the catalogue's table; it knows no model of ours."""

    rows: tuple

    @classmethod
    def drawn(cls, seed):
        off = np.random.default_rng(seed).normal(0.0, 0.5, (6, 4)) * [np.rad2deg(1e-3), 1.0, 1.0, np.rad2deg(1e-3)]
        return cls(tuple((*np.add(row[:4], o), row[4]) for row, o in zip(COMAU["rows"], off, strict=True)))

    def stand(self, c):
        """The flange at Comau's angles c [rad], lengths in mm."""
        return makers_joints({**COMAU, "rows": self.rows}, c)[1]

    def flange(self, q):
        """The same as the model's joints, by hand."""
        c = np.column_stack([-q[:, 0], q[:, 1], -q[:, 2] - np.pi / 2, -q[:, 3], -q[:, 4], -q[:, 5]])
        T = np.array([self.stand(row) for row in c])
        return T[:, :3, 3] / 1e3, T[:, :3, :3]


def angles_in(text):
    rows = re.findall(r"MOVE TO \{([^}]*)\}", text)
    return np.deg2rad([[float(v) for v in row.split(",")] for row in rows])


@pytest.mark.slow
def test_a_pdl2_program_of_comaus_own_angles_is_corrected_and_not_made_worse(tmp_path):
    robot, real = load_robot("comau-nj130"), BentComau.drawn(3)
    q = regular_angles(robot, 30, seed=2, margin=0.3)
    c_deg = np.round(np.rad2deg(np.column_stack([-q[:, 0], q[:, 1], -q[:, 2] - np.pi / 2, *-q[:, 3:].T])), 4)
    moves = "".join(f"  MOVE TO {{{', '.join(f'{v:.4f}' for v in row)}}}\n" for row in c_deg)
    path = tmp_path / "part.pdl"
    path.write_text(f"PROGRAM part HOLD\nBEGIN\n{moves}END part\n")
    done = compensate_file(path, robot, real)
    before = angles_in(path.read_text())
    after = angles_in(done.text)
    wanted = [makers_joints(COMAU, row)[1] for row in before]
    error = [
        [np.linalg.norm((real.stand(c) - T)[:3, 3]) for c, T in zip(rows, wanted, strict=True)]
        for rows in (before, after)
    ]
    assert np.mean(error[0]) > 1.0  # mm, as it was
    assert np.max(error[1]) < 0.005  # as printed
    assert any(
        "joint angles are those of pdl2: J1 = -q1, J2 = q2, J3 = -q3 - 90 deg" in said for _, said in done.report.notes
    )
    np.testing.assert_allclose(done.q, q, atol=1e-6)  # what is said of errors is said of the model's joints


@pytest.mark.parametrize("name", [d.name for d in corrected_dialects()])
def test_every_language_is_corrected_in_axes_with_sense_zero_and_coupling(name, tmp_path):
    """Moves of all joints, written for such a controller; the corrected file is read back and turned by hand."""
    robot, real = bent("kuka-kr6-r700", seed=6)
    robot = replace(robot, conventions=(convention(name),))
    q_deg = np.round(np.rad2deg(regular_angles(robot, 4, seed=8, margin=0.2)), 4)
    session = sessions.static()
    moves = iter([*q_deg.tolist()] * 3)
    program = replace(
        session,
        robot=robot.name,
        instructions=tuple(
            replace(i, q_deg=tuple(next(moves))) if hasattr(i, "q_deg") else i for i in session.instructions
        ),
    )
    dialect, axes = load_dialect(name), convention(name)
    written, _ = write_and_read_back(in_controller_axes(program, axes, dialect, UNLIMITED.speed), name, "a")
    files = targets_first(name, written)
    for file in files:
        (tmp_path / file.name).write_text(file.text)
    done = compensate_file(tmp_path / files[0].name, robot, real, dialect=name)
    per_deg = axes.pulses_per_deg
    found = read_texts(dialect, (done.text, *(f.text for f in files[1:])), only_known=False, pulses_per_deg=per_deg)
    said = read_texts(dialect, tuple(f.text for f in files), pulses_per_deg=per_deg).joint_path_deg
    assert (np.abs(as_the_pendant_shows(q_deg[0]) - said[0]) <= 1.02 * dialect.resolution_deg(per_deg)).all()
    printed = np.deg2rad(half_pulse_deg(name, per_deg)).sum()  # a metre from every axis
    for corrected, written in zip(found.joint_path_deg, said, strict=True):
        stands, wanted = flange_pose(real, by_hand(corrected)), flange_pose(exact(robot), by_hand(written))
        assert np.abs(stands - wanted).max() < 5e-6 + printed


def by_hand(c_deg):
    """The joints [rad] at what the pendant shows."""
    c = np.array(c_deg)
    c[2] += c[1]
    return np.deg2rad((c - ZERO) / SENSE)


def other_joints(robot, axes):
    """The same arm whose model counts its joints otherwise, and whose file says how the controller counts them."""
    joints = replace(axes, lower=np.full(6, -30.0), upper=np.full(6, 30.0))
    back = AxisConvention(
        "any", axes.inverse, -axes.inverse @ axes.zero, robot.q_lower, robot.q_upper, robot.speed, "drawn for a test"
    )
    return replace(robot.in_axes(joints), conventions=tuple(replace(back, controller=n) for n in ("krl", "rapid")))


@dataclass(frozen=True)
class Recounted:
    real: BentRobot
    axes: AxisConvention

    def flange(self, q):
        back = np.linalg.solve(self.axes.matrix, (q - self.axes.zero).T).T
        return self.real.flange(back)


@pytest.mark.slow
@pytest.mark.parametrize(("arm", "language", "suffix"), [("kuka-kr6-r700", krl, "src"), ("abb-irb120", rapid, "mod")])
@pytest.mark.parametrize("coupled", [False, True])
def test_status_turn_and_confdata_are_of_the_controllers_axes(arm, language, suffix, coupled, tmp_path):
    """One file, one arm, two models whose joints count otherwise: the corrected file is the same."""
    robot, real = bent(arm, seed=4)
    axes = convention("krl") if coupled else replace(convention("krl"), matrix=np.diag(SENSE.astype(float)))
    assert axes.is_coupled == coupled
    path = tmp_path / f"part.{suffix}"
    path.write_bytes(language(robot, regular_angles(robot, 25, seed=5)).encode())
    one = compensate_file(path, robot, real).text
    other = compensate_file(path, other_joints(robot, axes), Recounted(real, axes)).text
    assert NUMBER.sub("#", one) == NUMBER.sub("#", other)  # status, turn and confdata have no point
    both = (np.array([float(v) for v in NUMBER.findall(text)]) for text in (one, other))
    np.testing.assert_allclose(*both, atol=2e-4)
    assert one != path.read_text()


def numbers_of(text):
    rows = [line for line in text.splitlines() if not line.startswith("#")]
    return np.loadtxt(rows[1:], delimiter=",")


@pytest.mark.parametrize(
    ("line", "option", "said", "step"),
    [
        ("", "pdl2", "pdl2", r"has the angles of the axes of Comau PDL2: load it into that controller"),
        ("# axes_of: pdl2\n", None, "pdl2", r"has the angles of the axes of Comau PDL2: load it into that controller"),
        ("", None, "model", r"of the model's joints; Comau PDL2 counts 5 of 6 axes otherwise: .*--axes-of pdl2"),
        ("# Axes of = MODEL\n", None, "model", r"of the model's joints; Comau PDL2 counts 5 of 6 axes otherwise"),
    ],
)
@pytest.mark.parametrize("marked", [True, False])
def test_a_corrected_table_states_whose_axes_its_angles_are(line, option, said, step, marked, tmp_path):
    """What comes out is a file of its own: read again without any option it has the same angles."""
    robot, real = load_robot("comau-nj130"), BentComau.drawn(4)
    q_deg = np.round(np.rad2deg(regular_angles(robot, 5, seed=3, margin=0.3)), 4)
    shown = np.column_stack([-q_deg[:, 0], q_deg[:, 1], -q_deg[:, 2] - 90.0, *-q_deg[:, 3:].T])
    rows = shown if said == "pdl2" else q_deg
    head = ",".join(f"q{j}_deg" for j in range(1, 7)) + "\n"
    path = tmp_path / "targets.csv"
    path.write_text(line + head + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))
    mark = CorrectionMark("0123456789abcdef", False) if marked else None
    done = compensate_file(path, robot, real, axes_of=option, mark=mark)
    comments = [text for text in done.text.splitlines() if text.startswith("#")]
    stated = [text for text in comments if "axes" in text.lower()]
    assert stated == ([line.strip()] if line else [f"# axes_of: {said}"])
    assert re.search(step, done.step.format(file="corrected.csv"))
    np.testing.assert_allclose(done.q, np.deg2rad(q_deg), atol=1e-6)
    again = tmp_path / "again.csv"
    again.write_text(done.text)
    read = compensate_file(again, robot, real)
    found = numbers_of(done.text)
    if said == "pdl2":
        found = np.column_stack([-found[:, 0], found[:, 1], -found[:, 2] - 90.0, *-found[:, 3:].T])
    np.testing.assert_allclose(np.rad2deg(read.q), found, atol=1e-5)


def test_a_table_says_whose_axes_its_angles_are(tmp_path):
    robot, real = load_robot("comau-nj130"), BentComau.drawn(4)
    q_deg = np.round(np.rad2deg(regular_angles(robot, 5, seed=3, margin=0.3)), 4)
    c_deg = np.column_stack([-q_deg[:, 0], q_deg[:, 1], -q_deg[:, 2] - 90.0, *-q_deg[:, 3:].T])
    head = ",".join(f"q{j}_deg" for j in range(1, 7)) + "\n"
    rows = {k: "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in v) for k, v in (("q", q_deg), ("c", c_deg))}
    path = tmp_path / "targets.csv"
    made = []
    for text, option in (
        (head + rows["q"], None),
        ("# axes_of: pdl2\n" + head + rows["c"], None),
        (head + rows["c"], "pdl2"),
    ):
        path.write_text(text)
        done = compensate_file(path, robot, real, axes_of=option)
        made.append(numbers_of(done.text))
    plain = np.column_stack([-made[0][:, 0], made[0][:, 1], -made[0][:, 2] - 90.0, *-made[0][:, 3:].T])
    np.testing.assert_allclose(made[1], plain, atol=2e-6)
    np.testing.assert_allclose(made[2], made[1], atol=0)
    path.write_text(head + rows["q"])
    said = compensate_file(path, robot, real).report.notes
    assert any("taken for the model's" in text and "axes_of: pdl2" in text for _, text in said)
    path.write_text("# axes_of: pdl2\n" + head + rows["c"])
    with pytest.raises(InputError, match="said to be of bnr and of pdl2"):
        compensate_file(path, robot, real, axes_of="bnr")


def test_whose_axes_a_program_has_is_no_matter_of_an_option(tmp_path):
    path = tmp_path / "part.pdl"
    path.write_text("PROGRAM part HOLD\nBEGIN\n  MOVE TO {1, 2, -90, 4, 5, 6}\nEND part\n")
    with pytest.raises(InputError, match=r"--axes-of is for tables"):
        compensate_file(path, load_robot("comau-nj130"), BentComau.drawn(4), axes_of="bnr")


JOINTS = ",".join(f"q{j}_deg" for j in range(1, 7))
RADIANS = np.round(np.deg2rad(np.random.default_rng(2).uniform(-60, 60, (5, 6)) + np.array([0, -60, 60, 0, 60, 0])), 5)


@pytest.mark.parametrize("pose", [False, True])
def test_a_table_of_radians_that_are_called_degrees_is_refused(tmp_path, pose):
    robot, real = bent("kuka-kr6-r700")
    beside = [",x_mm,y_mm,z_mm,a_deg,b_deg,c_deg", ",400,0,600,0,90,0"] if pose else ["", ""]
    rows = "".join(",".join(map(str, row)) + beside[1] + "\n" for row in RADIANS)
    path = tmp_path / "targets.csv"
    frames = ToolAndBase(T_FT=np.eye(4), T_WB=np.eye(4))
    path.write_text(f"{JOINTS}{beside[0]}\n{rows}")
    with pytest.raises(
        InputError, match=r"targets.csv: the columns q1_deg … .*radians look like that; call them q1_rad"
    ):
        compensate_file(path, robot, real, frames=frames)
    if not pose:
        path.write_text(f"{JOINTS.replace('deg', 'rad')}\n{rows}")
        assert len(compensate_file(path, robot, real).targets) == len(RADIANS)


def test_small_angles_are_degrees_where_the_table_says_so(tmp_path):
    robot, real = bent("comau-nj130")
    table = f"{JOINTS}\n1,-3.5,2.5,2,5.5,1\n-2,-5.5,3.1,-1,4.5,-3\n"
    path = tmp_path / "targets.csv"
    path.write_text(table)
    with pytest.raises(InputError, match="radians look like that"):
        compensate_file(path, robot, real)
    path.write_text("# angles: degrees\n" + table)
    done = compensate_file(path, robot, real)
    assert (len(done.targets), "radians" in done.summary) == (2, False)


def test_one_target_whose_angles_are_small_is_corrected_where_its_unit_is_said(tmp_path):
    robot, real = bent("comau-nj130")
    path = tmp_path / "one.csv"
    path.write_text(f"{JOINTS}\n1,-3.5,2.5,2,5.5,1\n")
    with pytest.raises(InputError, match="call them q1_rad"):
        compensate_file(path, robot, real)
    path.write_text(f"# angles: degrees\n{JOINTS}\n1,-3.5,2.5,2,5.5,1\n")
    assert len(compensate_file(path, robot, real).targets) == 1
