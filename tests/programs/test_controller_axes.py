"""A program leaves in the axes of the controller that runs it: sense, zero and coupling, in every language."""

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError, NoSolutionError
from planner.kinematics.axes import ControllerTable, JointRange, convention_from_table
from planner.kinematics.robot_reader import load_robot
from planner.programs.controller_axes import axis_convention, check_model_angles, in_controller_axes
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.instructions import Entry, JointMove
from planner.programs.rendering import axis_names
from planner.programs.verification import ProgramMismatchError, read_texts, write_and_read_back
from planner.session.neutral_program import build_program, write_session
from planner.session.options import PlanOptions
from planner.session.planning import settle_dialects
from tests.kinematics.test_axes import ARMS, makers_joints
from tests.programs import sessions

SENSE, ZERO = np.array([-1, 1, -1, 1, -1, 1]), np.array([10, -90, 0, 0, 45, 180])
TURNED = ControllerTable(
    sense=tuple(SENSE.tolist()),
    zero_deg=tuple(ZERO.tolist()),
    coupling=((3, 2, -1.0),),
    pulses_per_deg=sessions.PULSES[:6],
    source="drawn for the test",
)
UNLIMITED = JointRange(np.full(6, -1e3), np.full(6, 1e3), np.deg2rad([100.0] * 6))


def as_the_pendant_shows(q_deg):
    """The rule of ``TURNED`` by hand, one axis after the other."""
    c = SENSE * np.asarray(q_deg) + ZERO
    c[2] -= c[1]
    return c


def convention(name):
    return convention_from_table("robot.toml", name, TURNED, UNLIMITED)


@pytest.mark.parametrize("name", [n for n in dialect_names() if load_dialect(n).angles == "controller"])
@pytest.mark.parametrize("session", [sessions.static, sessions.resumable], ids=["static", "resumable"])
def test_every_language_says_the_angles_that_the_controller_shows(name, session):
    program, dialect, axes = session(), load_dialect(name), convention(name)
    turned = in_controller_axes(program, axes, dialect, UNLIMITED.speed)
    files, found = write_and_read_back(turned, name, "a")
    wanted = np.array([as_the_pendant_shows(m.q_deg) for m in program.moves])
    printed = 1.02 * dialect.resolution_deg(sessions.PULSES[:6])
    assert (np.abs(found.joint_path_deg - wanted) <= printed).all()
    for (_, moves), entry in zip(found.entries, program.entries, strict=False):
        ways = [as_the_pendant_shows(m.q_deg) for m in entry.moves]
        assert (np.abs(np.subtract([m.angles_deg for m in moves], ways)) <= printed).all()
    check_model_angles(program, axes, found, dialect)
    head = re.sub(r"\W+", "", re.sub(r"(?m)^ *\d+:", "", "".join(f.text for f in files)))
    names = axis_names(dialect)
    assert re.sub(r"\W+", "", f"{names[2]} = -q3 - q2 + 90 deg, {names[3]} = q4") in head


def test_a_program_of_other_axes_is_not_released():
    program, dialect, axes = sessions.static(), load_dialect("pdl2"), convention("pdl2")
    found = write_and_read_back(in_controller_axes(program, axes, dialect, UNLIMITED.speed), "pdl2", "a")[1]
    other = replace(axes, zero=axes.zero + np.deg2rad([0, 0, 0, 0, 0, 0.001]))
    with pytest.raises(ProgramMismatchError, match=r"move \d leads joint 6 to"):
        check_model_angles(program, other, found, dialect)


def test_a_leg_takes_its_time_by_the_controllers_own_full_speeds():
    """Joints 2 and 3 turn against each other: the controller's axis 3 turns by the sum, or stands."""
    program, dialect, axes = sessions.static(), load_dialect("krl"), convention("krl")
    here = program.moves[0]
    for q3, by in ((40.0, 2.0), (0.0, 1.0)):
        to = tuple(np.add(here.q_deg, (0, 20.0, q3 - 20.0, 0, 0, 0)))
        leg = replace(program, instructions=(here, JointMove(to, 4.0, 10.0, 10.0)))
        assert in_controller_axes(leg, axes, dialect, UNLIMITED.speed).moves[1].axis_percent == pytest.approx(10.0 * by)


def test_a_move_beyond_the_stroke_of_a_coupled_axis_is_refused():
    narrow = TURNED.model_copy(update={"limit_deg": ((-400, 400), (-400, 400), (-100, 400), *[(-400, 400)] * 3)})
    axes = convention_from_table("robot.toml", "krl", narrow, UNLIMITED)
    program = sessions.static()
    to = JointMove((0.0, 100.0, 100.0, 0.0, 0.0, 0.0), 4.0, 10.0, 10.0)
    entry = Entry(2, program.home_deg, (to,))
    for item in (to, entry):
        longer = replace(program, instructions=(*program.instructions[:-1], item, program.moves[-1]))
        with pytest.raises(
            NoSolutionError, match=r"would take A3 of the controller to -110\.0000 deg, its stroke is -100"
        ):
            in_controller_axes(longer, axes, load_dialect("krl"), UNLIMITED.speed)


PDL_MOVE = re.compile(r"^\s*MOVE TO \{([^}]*)\}", re.MULTILINE)


def test_a_pdl2_program_of_the_seeds_cell_stands_in_comaus_strokes_where_the_plan_wants_the_tool():
    """Read by a pattern, turned by the catalogue's own chain: neither is code that wrote it."""
    cell, arm = load_cell("comau-nj130/edbb"), ARMS[0]
    rng = np.random.default_rng(5)
    q_deg = np.round(np.rad2deg(rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (60, 6))), 4)
    moves = [JointMove(tuple(row), 60.0, 5.0, 1.0) for row in q_deg.tolist()]
    program = build_program(cell, "0" * 12, [*moves])
    (file,) = write_session(cell, program, "pdl2", "a")
    read = np.array([[float(v) for v in row.split(",")] for row in PDL_MOVE.findall(file.text)])[1:]
    assert read.shape == (60, 6)
    low, high = np.array(arm["limit_deg"], dtype=float).T
    assert ((read >= low - 1e-9) & (read <= high + 1e-9)).all()
    x = cell.robot.chain.forward(cell.robot.theta(np.deg2rad(q_deg))).x.T * 1e3
    for c, wanted in zip(np.deg2rad(read), x, strict=True):
        np.testing.assert_allclose(makers_joints(arm, c)[1][:3, 3], wanted, atol=1e-6)
    assert "J3 = -q3 - 90 deg" in " ".join(file.text.replace("-- ", "").split())


def test_without_a_convention_nothing_is_written_and_planning_ends_at_once():
    cell = load_cell("comau-nj130/edbb")
    with pytest.raises(InputError, match=r"(?s)'urscript'.*\[controllers\.urscript\]"):
        settle_dialects(cell, PlanOptions(dialect=("bnr", "urscript")))
    program = build_program(cell, "0" * 12, [])
    with pytest.raises(InputError, match=r"\[controllers\.urscript\]"):
        write_session(cell, program, "urscript", "a")


def test_lists_are_in_the_joints_of_the_model_and_say_so():
    robot, cell = load_robot("comau-nj130"), load_cell("comau-nj130/edbb")
    assert axis_convention(robot, load_dialect("poses-csv")).is_same
    (file,) = write_session(cell, build_program(cell, "0" * 12, []), "poses-csv", "a")
    assert "q1 to q6 are the joints of the robot model" in file.text


def test_an_option_of_a_dialect_has_the_axes_of_its_controller():
    name = next(f"{d}+{o}" for d in dialect_names() for o in load_dialect(d).options)
    base = name.partition("+")[0]
    robot = replace(load_robot("comau-nj130"), conventions=(convention(base),))
    assert axis_convention(robot, load_dialect(name)).controller == base


def test_files_of_a_read_program_are_those_of_the_turned_one():
    program, axes = sessions.static(), convention("rapid")
    files, found = write_and_read_back(
        in_controller_axes(program, axes, load_dialect("rapid"), UNLIMITED.speed), "rapid", "a"
    )
    again = read_texts(load_dialect("rapid"), tuple(f.text for f in files))
    np.testing.assert_array_equal(again.joint_path_deg, found.joint_path_deg)
