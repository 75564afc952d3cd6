"""A program is written later only from a plan and its own cell, into the file that was asked for."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell, read_cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.units import MM, round_angles
from planner.kinematics.axes import AxisConvention
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.verification import shared_notes, write_and_read_back
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import assemble_programs, check_emitted_speeds, session_program
from planner.session.notes import bar_notes, session_notes
from planner.session.plan_record import content_hash
from planner.session.plan_types import Drive, Visit, Waypoints, time_course
from planner.session.planned_session import NOT_HASHED, load_session
from planner.workflow.plan_results import write_cell, write_program_as
from planner.workflow.plan_use import export
from tests.command import edbb
from tests.speaking import let_speak_all
from tests.workflow.small_plan import proven_tour, small_course

CELL = "kuka-kr6-r700/edbb"


def _course(cell):
    return small_course(cell, proven_tour(CELL, 2))


def _points(way):
    rows = zip(way.q, way.visit, way.blend, strict=True)
    return [{"q_deg": np.rad2deg(q).tolist(), "visit": int(v), "blend_mm": 1e3 * float(b)} for q, v, b in rows]


def _sign(folder):
    """Give plan and cell the id of their content."""
    plan = json.loads((folder / "plan.json").read_text())
    said = {k: v for k, v in plan.items() if k not in NOT_HASHED}
    plan["plan_id"] = content_hash(said, read_cell(folder / "cell.toml", "cell"))
    (folder / "plan.json").write_text(json.dumps(plan))


@pytest.fixture
def folder(tmp_path):
    """A small plan at rest: its keys are those of the contract, its lengths come from plain distances."""
    cell = load_cell(CELL)
    made = _course(cell)
    q = made.measuring.q
    lengths = np.linalg.norm(cell.map_position(q) - cell.fixtures[0].p_BX, axis=1) * 1e3
    pose = {"fixture": "A", "role": "calibrate"}
    plan = {
        "schema": "edbb-plan/1",
        "plan_id": "0123456789ab",
        "robot": cell.robot.name,
        "poses": [
            {"id": i, "q_deg": np.rad2deg(q[i]).tolist(), "length_mm": float(lengths[i]), **pose} for i in range(4)
        ],
        "trajectory": {"duration_s": made.trajectory.duration_s},
        "drives": [{"fixture": "A", "travel": _points(made.travel), "waypoints": _points(made.measuring)}],
    }
    write_cell(cell, tmp_path)
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    _sign(tmp_path)
    return tmp_path


def _change(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_a_plan_and_its_cell_belong_together(folder):
    files = export(folder / "plan.json", dialect="krl", name="a.src").programs
    assert [f.name for f in files] == ["A.src", "A.dat"]


@pytest.mark.slow
def test_signals_and_numbers_may_be_named_later(folder):
    _change(folder / "cell.toml", "log_axes = true", "log_axes = true\nsync_output = 33")
    (note,) = export(folder / "plan.json", dialect="krl", name="a").notes
    assert "is not as it was planned" in note
    assert "its path was proven anew by both engines" in note
    _sign(folder)
    assert "PULSE ($OUT[33]," in export(folder / "plan.json", dialect="krl", name="a").programs[0].text


@pytest.mark.parametrize(
    "dialect",
    [n if n in ("krl", "din66025", "poses-csv") else pytest.param(n, marks=pytest.mark.slow) for n in dialect_names()],
)
def test_the_program_of_a_changed_plan_says_so_at_its_head(folder, monkeypatch, dialect):
    let_speak_all(monkeypatch)
    path = folder / "plan.json"
    plain = export(path, dialect=dialect, name="a").programs[0].text
    note = f"{path} is not as it was planned: a)\nG0 X999 was changed"
    monkeypatch.setattr("planner.session.planned_session.integrity_notes", lambda *_: (note,))
    lines = export(path, dialect=dialect, name="a").programs[0].text.split("\n")
    more = [line for line in lines if line not in plain.split("\n")]
    words = re.sub(r"\W+|\d+", "", "".join(more))
    assert re.search("theplanisnotasitwasplanneda.*waschangeditspathwasproven", words)
    assert not [line for line in more if line.startswith("G0")]
    assert str(folder) not in "".join(more)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('robot = "kuka-kr6-r700"', 'robot = "ur10"', "plan for kuka-kr6-r700, but .* is a cell of ur10"),
        ('name = "A"', 'name = "North"', "drives the fixtures A, but .* has North"),
        ("position_mm = [\n    ", "position_mm = [\n    1", "the bar at pose . would be .* mm longer than planned"),
        ("map_mm = [\n    ", "map_mm = [\n    1", "the bar at pose . would be .* mm longer than planned"),
        ("home_deg = [\n    0.0", "home_deg = [\n    3.0", "home is 3 deg away"),
        ("settle_s = ", "settle_s = 1", "measuring would take .* s, planned are"),
    ],
)
def test_another_cell_is_refused(folder, old, new, said):
    _change(folder / "cell.toml", old, new)
    with pytest.raises(InputError, match=said):
        export(folder / "plan.json", dialect="krl", name="a")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda plan: plan["poses"][2]["q_deg"].__setitem__(0, 160.0), "pose 2 has joint 1 at 160 deg in 'poses', but"),
        (lambda plan: plan["poses"].pop(), "pose 3 is driven, but 'poses' does not have it"),
        (lambda plan: plan["poses"].append(plan["poses"][0] | {"id": 7}), "pose 7 is in 'poses', but no drive goes"),
        (lambda plan: plan["poses"][1].update(id=0), "4 poses with 3 ids"),
        (lambda plan: plan.update(supports=[{"after": 1, "q_deg": [0.0] * 6}]), "to the support pose after pose 1"),
        (lambda plan: plan.update(robot="x\nMoveAbsJ evil"), "'robot' = 'x.nMoveAbsJ evil': a name on one line"),
    ],
)
def test_poses_that_are_not_those_driven_are_refused(folder, change, said):
    path = folder / "plan.json"
    plan = json.loads(path.read_text())
    change(plan)
    path.write_text(json.dumps(plan))
    _sign(folder)
    with pytest.raises(InputError, match=said):
        export(path, dialect="krl", name="a")


@pytest.mark.slow
def test_the_file_as_given_is_written_and_the_rest_is_told(folder, tmp_path):
    for given, rest in (("p.src", "p.dat"), ("Tour 1.src", "TOUR_1.dat"), ("p.txt", "p.dat")):
        out = tmp_path / given.replace(".", "_")
        out.mkdir()
        done = edbb("export", folder / "plan.json", "--dialect", "krl", "-o", out / given)
        assert done.returncode == 0, done.stderr
        assert sorted(p.name for p in out.iterdir()) == sorted([given, rest])
        legal = given.partition(".")[0].upper().replace(" ", "_") + ".src"
        assert f"{given} is written; the controller takes it under the name {legal}" in done.screen
        assert f"{rest} is written too" in done.screen
        assert "DEF " + legal.removesuffix(".src") in (out / given).read_text()


def test_the_name_of_a_companion_is_refused(folder, tmp_path):
    done = edbb("export", folder / "plan.json", "--dialect", "krl", "-o", tmp_path / "p.dat")
    assert done.returncode == 2
    assert "another file of the program" in done.screen
    assert not (tmp_path / "p.dat").exists()


def test_a_name_that_fits_needs_no_word(folder, tmp_path, monkeypatch):
    let_speak_all(monkeypatch)
    files = export(folder / "plan.json", dialect="rapid", name="tour.mod").programs
    assert write_program_as(files, tmp_path / "tour.mod") == []
    assert (tmp_path / "tour.mod").read_text() == files[0].text


def test_repeats_that_a_continuous_session_does_not_drive_are_told(tmp_path):
    text = load_cell("kuka-kr6-r700/edbb").path.read_text()
    for measure, repeat, expected in (("continuous", 3, True), ("continuous", 0, False), ("static", 3, False)):
        path = tmp_path / f"{measure}{repeat}.toml"
        path.write_text(_with(text, measure, repeat))
        cell = read_cell(path, "cell")
        told = session_notes(cell)
        assert any(n.startswith(f"plan.repeat = {repeat} is for poses at rest") for n in told) == expected


@pytest.mark.parametrize(
    ("home", "meant"),
    [
        ("[0, -1.2, 1.4, 0, 0.9, 0]", "[0.0, -68.8, 80.2, 0.0, 51.6, 0.0]"),
        ("[0, -1.2, 90, 0, 0.9, 0]", None),  # 90 rad are many turns
        ("[0, -5, 3, 0, 4, 0]", None),  # whole numbers are degrees
        ("[0, 0, 0, 0, 0.4, 0]", None),  # a trim
        ("[0, -90, 90, 0, 45, 0]", None),
    ],
)
def test_angles_of_home_that_look_like_radians_are_told(tmp_path, home, meant):
    text = load_cell("kuka-kr6-r700/edbb").path.read_text()
    path = tmp_path / "cell.toml"
    path.write_text(text.replace("home_deg = [0, -90, 90, 0, 45, 0]", f"home_deg = {home}"))
    told = [n for n in session_notes(read_cell(path, "cell")) if n.startswith("home_deg")]
    assert bool(told) == (meant is not None)
    assert all(meant in n for n in told)


def test_notes_that_programs_share_are_said_once():
    cell = load_cell("ur10/edbb")
    q = round_angles(np.array([cell.home, cell.home + 0.1, cell.home]))
    way = Waypoints(q, np.array([-1, 1, -1]), np.zeros(3))
    courses = [time_course(cell, FIRST_MOUNTING, way, way)]
    programs = assemble_programs(("krl", "rapid", "pdl2"), lambda form: session_program(cell, courses, "0" * 12, form))
    told = shared_notes(programs)
    assert sum("sync_output" in n for n in told) == sum("gauge_input" in n for n in told) == 1
    assert all(n.startswith("krl, rapid, pdl2: ") for n in told if "controller." in n)


def test_poses_nearer_to_the_bars_ends_than_its_place_is_known_are_told():
    cell = load_cell("kuka-kr6-r700/edbb")
    q = np.array([cell.home])
    visits = tuple(
        Visit(k, q[0], length, FIRST_MOUNTING, "calibrate", (0,) * 6) for k, length in enumerate((0.304, 0.4, 0.518))
    )
    drive = Drive(course=_course(cell), visits=visits, tour=None, path=None, limits=None)
    (note,) = bar_notes(cell, [drive])
    assert note.startswith("2 of 3 poses at fixture A come within 5.1 mm")
    sure = replace(cell, fixtures=tuple(replace(f, prior=1e-3) for f in cell.fixtures))
    assert not bar_notes(sure, [drive])


def _with(text, measure, repeat):
    kept = [line for line in text.splitlines() if not line.startswith(("measure =", "repeat =", "read_by ="))]
    kept.insert(kept.index("[motion]") + 1, f'measure = "{measure}"')
    if "[plan]" not in kept:
        kept.append("[plan]")
    kept.insert(kept.index("[plan]") + 1, f"repeat = {repeat}")
    return "\n".join(kept) + "\n"


@pytest.mark.parametrize("name", {load_dialect(n).speed.kind: n for n in dialect_names()}.values())  # one of each kind
def test_speeds_as_written_are_held_against_those_of_tool_and_gauge(folder, name):
    session, dialect = load_session(folder / "plan.json", "exported"), load_dialect(name)
    program = session_program(session.cell, session.courses, session.plan_id, dialect.path_form)
    found = write_and_read_back(program, name, "a")[1]
    robot = session.cell.robot
    axes = AxisConvention.model_convention(name, robot.q_lower, robot.q_upper, robot.speed)
    check_emitted_speeds(session.cell, program, axes, dialect, found)
    slow = replace(session.cell, gauge=replace(session.cell.gauge, rate=1.0 * MM))
    with pytest.raises(NoSolutionError, match=r"drives the gauge at \d"):
        check_emitted_speeds(slow, program, axes, dialect, found)
    tight = [replace(m, tool_limit_mm_s=0.1) if hasattr(m, "tool_limit_mm_s") else m for m in program.instructions]
    with pytest.raises(NoSolutionError, match=r"drives the tool at \d"):
        check_emitted_speeds(session.cell, replace(program, instructions=tuple(tight)), axes, dialect, found)
