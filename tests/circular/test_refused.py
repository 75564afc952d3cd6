"""What cannot be is refused in one sentence that says where and what would help."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.circular.document import read_circular_plan
from planner.circular.plan import circles_of
from planner.circular.planning import plan_arc, plan_circles
from planner.common.errors import InputError, NoSolutionError
from planner.session.options import PlanOptions
from tests.circular.conftest import ARC, cell_file, quiet
from tests.command import edbb

ROUND = "\n[[circles]]\nradius_mm = 350\n"


def load(folder, circles, *changes):
    return load_cell(str(cell_file(folder, circles, *changes)))


@pytest.mark.parametrize(
    ("circles", "says"),
    [
        ("\n[[circles]]\nradius_mm = 0.35\n", "looks like metres"),
        ("\n[[circles]]\nradius = 350\n", "radius_mm"),
        ('\n[[circles]]\nplane = "ZX"\n', "plane"),
        ("\n[[circles]]\nsweep_deg = 6.28\n", "greater than or equal to 30"),
        ('\n[[circles]]\ndirections = ["cw", "cw"]\n', "each once"),
        ('\n[[circles]]\nfixture = "B"\n', "fixture 'B'"),
        ("\n[[circles]]\ntool_axis = [0, 0, 0]\n", "no direction"),
        ("\n[[circles]]\nloads_N = [125]\n", "ldbb"),
        ('\n[[circles]]\nname = "a"\n\n[[circles]]\nname = "a"\n', "share a name"),
        ("\n[[circles]]\ncentre_mm = [258, 1468, 1308]\n", "600.0 mm beside its fixture's plane"),
    ],
)
def test_the_cell_file(tmp_path, circles, says):
    with pytest.raises(InputError, match=says):
        load(tmp_path, circles)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--separate", "i.json"], "no poses to be chosen; leave out --separate"),
        (["--poses", "30", "--index", "O1"], "leave out --poses, --index"),
        (["--fixtures", "2", "--aim", "tracing"], "leave out --fixtures, --aim"),
        (["--method", "pruning", "--order", "slowest-axis"], "leave out --method, --order"),
    ],
)
def test_what_only_a_choice_of_poses_can_give(tmp_path, words, says):
    done = edbb("plan", "comau-nj130/circular", "-o", tmp_path / "out", *words)
    assert done.returncode == 2
    assert says in done.screen
    assert not (tmp_path / "out").exists()


def test_defaults(tmp_path):
    cell = load(tmp_path, '\n[[circles]]\n\n[[circles]]\nplane = "XZ"\nsweep_deg = 180\ncentre_mm = [258, 1348, 708]\n')
    full, half = circles_of(cell)
    assert full.radius == pytest.approx(0.410)
    assert np.allclose(full.p_BC, cell.fixtures[0].p_BX)
    assert np.rad2deg(full.overshoot) == pytest.approx(45)
    assert full.speed == pytest.approx(1 / 60)
    assert half.radius == pytest.approx(np.sqrt(0.410**2 - 0.120**2))
    assert half.directions == ("ccw", "cw")
    assert full.name == "XY"
    assert np.allclose(half.normal, [0, -1, 0])


@pytest.mark.parametrize(
    ("circles", "says"),
    [
        ("\n[[circles]]\nradius_mm = 560\n", "needs a bar of 560.0 mm"),
        ("\n[[circles]]\nradius_mm = 301\n", "needs a bar of 301.0 mm"),
        ("\n[[circles]]\nradius_mm = 450\ncentre_mm = [358, 1468, 708]\n", "needs a bar of 550.0 mm at 0°"),
    ],
)
def test_a_bar_that_does_not_reach(tmp_path, circles, says):
    cell = load(tmp_path, circles)
    with pytest.raises(InputError, match=says):
        plan_arc(cell, circles_of(cell)[0])


@pytest.mark.slow
def test_a_robot_that_does_not_reach(tmp_path):
    far = load(tmp_path, ROUND, ("position_mm = [258, 1468, 708]", "position_mm = [258, 1968, 708]"))
    with pytest.raises(NoSolutionError, match=r"circle XY: none of \d+ configurations .* to -?\d+°, where"):
        plan_arc(far, replace(circles_of(far)[0], start=-np.pi / 2))
    further = load(tmp_path, ROUND, ("position_mm = [258, 1468, 708]", "position_mm = [258, 3468, 708]"))
    with pytest.raises(NoSolutionError, match="does not reach its beginning at -45°: none of 48 tool orientations"):
        plan_arc(further, circles_of(further)[0])


def test_a_joint_that_does_not_turn_far_enough(tmp_path):
    cell = load(tmp_path, ROUND)
    lower, upper = cell.robot.q_lower.copy(), cell.robot.q_upper.copy()
    lower[4], upper[4] = -0.2, 0.2  # the hand hardly bends
    stiff = replace(cell, home=np.zeros(6), robot=replace(cell.robot, q_lower=lower, q_upper=upper))
    with pytest.raises(NoSolutionError, match=r"in the nearest that of joint 5 by \d+\.\d°"):
        plan_arc(stiff, circles_of(stiff)[0])


@pytest.mark.slow
def test_a_limit_that_is_in_the_way(tmp_path):
    cell = load(tmp_path, ROUND, ("cone_deg = { fixture = 105, map = 105 }", "cone_deg = { fixture = 85, map = 105 }"))
    with pytest.raises(NoSolutionError, match="tilt at the fixture is exceeded"):
        plan_arc(cell, circles_of(cell)[0])


@pytest.mark.slow
def test_something_in_the_way(tmp_path):
    post = '[[obstacles]]\nname = "post"\nkind = "sphere"\nat_mm = [608, 1468, 708]\nradius_mm = 60\n\n[[circles]]'
    cell = load(tmp_path, ROUND, ("[[circles]]", post))
    with pytest.raises(NoSolutionError, match=r"each collides somewhere.*post"):
        plan_arc(cell, circles_of(cell)[0])


def test_no_circle_to_plan(tmp_path):
    with pytest.raises(InputError, match="at least one"):
        plan_circles(load(tmp_path, ""), PlanOptions(), quiet())


def test_a_plan_of_another_kind(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text('{"schema": "edbb-plan/1", "plan_id": "0123456789ab", "drives": []}')
    with pytest.raises(InputError, match="kind"):
        read_circular_plan(path)


@pytest.mark.slow
def test_the_given_tool_axis_is_kept(tmp_path):
    cell = load(tmp_path, ARC + "tool_axis = [0, 1, -1]\nspeed_mm_s = 200\n")
    arc = plan_arc(cell, circles_of(cell)[0])
    wanted = np.array([0.0, 1.0, -1.0]) / np.sqrt(2)
    assert np.abs(cell.map_axis(arc.q) - wanted).max() < 1e-8


@pytest.mark.slow
def test_a_tool_that_follows_the_bar(tmp_path):
    cell = load(tmp_path, ARC + 'orientation = "follow"\nspeed_mm_s = 200\n')
    arc = plan_arc(cell, circles_of(cell)[0])
    bar = (cell.map_position(arc.q) - cell.fixtures[0].p_BX) / 0.350
    tilt = np.einsum("ni,ni->n", bar, cell.map_axis(arc.q))
    assert np.ptp(tilt) < 1e-8
    assert np.ptp(cell.map_axis(arc.q), axis=0).max() > 0.1 or np.abs(tilt[0]) < 1e-6
