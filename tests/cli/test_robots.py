"""A shipped robot, or a table of rows, as the start of one's own: the copy is the robot, and is never written over."""

from xml.etree import ElementTree

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.programs.dialect import load_dialect
from planner.report.robot_drawing import draw_robot, lengths
from planner.session.planning import check_cell
from planner.workflow.robot_copy import copy_robot
from tests.command import edbb
from tests.not_everywhere import require_planning

ROWS = """# convention: mdh
alpha_deg,a_mm,theta_deg,d_mm,lower_deg,upper_deg,speed_deg_s
180,0,0,-400,-170,170,300
90,25,0,0,-190,45,225
0,560,-90,0,-120,156,225
90,35,0,-515,-185,185,381
-90,0,0,0,-120,120,311
90,0,0,-80,-350,350,492
"""


def same_robot(one, other):
    assert [(t.name, t.nominal) for t in one.transforms] == [(t.name, t.nominal) for t in other.transforms]
    assert (one.q_lower == other.q_lower).all()
    assert (one.speed == other.speed).all()
    assert len(one.bodies) == len(other.bodies)
    assert [c.controller for c in one.conventions] == [c.controller for c in other.conventions]


@pytest.mark.parametrize("name", list_robots())
def test_a_copied_robot_is_the_robot_with_its_cells(tmp_path, name):
    done = edbb("robots", name, "-o", tmp_path / "mine")
    assert done.returncode == 0
    assert "no bodies" not in done.screen
    same_robot(load_robot(tmp_path / "mine/robot.toml"), load_robot(name))
    cells = sorted(p.stem for p in (tmp_path / "mine").glob("*.toml") if p.name != "robot.toml")
    assert [f"{name}/{cell}" for cell in cells] == [c for c in shipped_cells() if c.startswith(f"{name}/")]
    for cell in cells:
        mine, shipped = load_cell(tmp_path / f"mine/{cell}.toml"), load_cell(f"{name}/{cell}")
        assert mine.robot.path == tmp_path / "mine/robot.toml"
        assert (mine.home == shipped.home).all()


@pytest.mark.parametrize("name", list_robots())
def test_a_copy_cites_no_source_as_its_own(tmp_path, name):
    """A program's head and a calibrated robot cite the sources: of a copy that was changed they would be untrue."""
    copy_robot(name, tmp_path)
    shipped, mine = load_robot(name), load_robot(tmp_path / "robot.toml")
    said = f"copied from {name}, renew: "
    estimated = {topic for topic, text in shipped.sources if text.startswith("estimated: 0.25 s to full speed")}
    assert dict(mine.sources).keys() == dict(shipped.sources).keys()
    for topic, text in shipped.sources:
        assert dict(mine.sources)[topic] in ((said + text, text) if topic in estimated else (said + text,))
    of_urdf = {c.controller for c in shipped.conventions if c.source.startswith("the joints of") and shipped.tip}
    for own, other in zip(mine.conventions, shipped.conventions, strict=True):
        assert own.source == said + other.source or own.controller in of_urdf
    require_planning()
    for cell in sorted(p for p in tmp_path.glob("*.toml") if p.name != "robot.toml")[:1]:
        languages = [load_dialect(c.controller) for c in mine.conventions]
        able = [language.name for language in languages if language.max_joints >= mine.n_joints]
        check_cell(load_cell(str(cell)), able)  # such lines fit into programs


def test_a_table_of_rows_becomes_a_file_with_room_for_the_controller(tmp_path):
    (tmp_path / "kr10.csv").write_text(ROWS)
    done = edbb("robots", tmp_path / "kr10.csv", "-o", tmp_path / "kr10")
    assert done.returncode == 0
    screen = " ".join(done.screen.split())
    assert "no collision check would see this arm: add [[bodies]] to" in screen
    assert "and the cell into yours" not in screen
    assert "change robot.toml into yours" in screen
    file = tmp_path / "kr10/robot.toml"
    same_robot(load_robot(file), load_robot(tmp_path / "kr10.csv"))
    text = file.read_text()
    assert "# [controllers.krl]" in text
    file.write_text(text + '\n[controllers.krl]\nsame = true\nsource = "jogged at the robot on 2026-03-02"\n')
    assert load_robot(file).axes_of("krl").is_same


def test_what_a_person_has_changed_is_not_written_over(tmp_path):
    words = ("robots", "ur10", "-o", tmp_path / "mine")
    assert edbb(*words).returncode == edbb(*words).returncode == 0
    file = tmp_path / "mine/robot.toml"
    file.write_text(file.read_text() + "\n# mine\n")
    done = edbb(*words)
    assert done.returncode == 2
    assert "is there already and says otherwise; name another folder, or add --force" in done.screen
    assert "# mine" in file.read_text()
    assert edbb(*words, "--force").returncode == 0
    assert "# mine" not in file.read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("-o", "x"), "-o copies one robot: name it"),
        (("ur11",), 'did you mean "ur10"'),
        (("ur1O", "-o", "x"), 'neither a shipped robot nor a table of DH rows (.csv); did you mean "ur10"?'),
    ],
)
def test_what_cannot_be_copied_is_said(words, said):
    done = edbb("robots", *words)
    assert done.returncode == 2
    assert said in done.screen


KR6 = [(25, 400), (0, 315), (0, 35), (365, 0), (80, 0)]
"""KUKA's data sheet of the KR 6 R700 sixx: steps from base to flange, forward and up [mm]."""


def test_a_drawing_shows_the_lengths_of_the_data_sheet(tmp_path):
    assert np.allclose(lengths(load_robot("kuka-kr6-r700")), KR6, atol=1e-6)
    done = edbb("robots", "kuka-kr6-r700", "--draw", tmp_path / "arm.svg")
    assert done.returncode == 0, done.stderr
    assert "25 forward and 400 up, 315 up, 35 up, 365 forward, 80 forward [mm]" in done.stdout
    drawn = ElementTree.parse(tmp_path / "arm.svg").getroot()
    written = [t.text for t in drawn.iter("{http://www.w3.org/2000/svg}text") if t.get("class") == "number"]
    assert sorted(map(float, written)) == sorted(v for step in KR6 for v in step if v)


def test_a_length_that_was_forgotten_is_in_the_drawing(tmp_path):
    edbb("robots", "kuka-kr6-r700", "-o", tmp_path)
    file = tmp_path / "robot.toml"
    file.write_text(file.read_text().replace("a_mm = 315.0", "a_mm = 560.0"))
    assert lengths(load_robot(file))[1] == pytest.approx((0, 560), abs=1e-6)


@pytest.mark.parametrize("name", list_robots())
def test_every_robot_is_drawn(name):
    ElementTree.fromstring(draw_robot(load_robot(name)))
