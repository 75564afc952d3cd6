"""Surroundings that cannot be meant are refused before anything is planned, and nothing that collides is left out."""

import re
from itertools import combinations

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.motion.collision.scene import build_scene
from planner.motion.collision.surroundings import check_surroundings, unchecked_links_text
from planner.motion.path.constraints import Constraints
from planner.session.mount import check_home
from planner.session.planning import check_cell
from tests.motion.collision.test_meshes import stl

NJ = "comau-nj130/edbb"


def _cell(tmp_path, text, base="[base]"):
    path = tmp_path / "cell.toml"
    path.write_text(load_cell(NJ).path.read_text() + "\n" + text)
    return load_cell(str(path))


def test_a_mesh_in_millimetres_that_is_read_in_metres_is_refused(tmp_path):
    stl(tmp_path / "box.stl", 1000.0)
    obstacle = "[[obstacles]]\nkind = 'mesh'\nfile = 'box.stl'\nat_mm = [700, 1200, 1300]\n"
    for place in ("[700, 1200, 1300]", "[-500700, 1200, 1300]"):  # far away; from far away into the cell
        with pytest.raises(InputError, match=r'e\+05 mm long .*unit = "mm"'):
            check_surroundings(_cell(tmp_path, obstacle.replace("[700, 1200, 1300]", place)))
    right = _cell(tmp_path, obstacle + "unit = 'mm'\n")
    check_surroundings(right)
    assert right.obstacles[-1].scale == (1e-3,) * 3


def test_a_mesh_of_half_a_millimetre_is_refused(tmp_path):
    stl(tmp_path / "box.stl")
    obstacle = "[[obstacles]]\nkind = 'mesh'\nfile = 'box.stl'\nat_mm = [700, 1200, 1300]\nunit = 'mm'\n"
    with pytest.raises(InputError, match=r"0\.5 mm long"):
        check_surroundings(_cell(tmp_path, obstacle))


@pytest.mark.parametrize("scale", ["[0, 0, 0]", "[1, 1, -1]", "[1, 1, 1e9]"])
def test_a_scale_that_leaves_nothing_is_refused(tmp_path, scale):
    stl(tmp_path / "box.stl")
    with pytest.raises(InputError, match="scale"):
        _cell(tmp_path, f"[[obstacles]]\nkind = 'mesh'\nfile = 'box.stl'\nscale = {scale}\n")


def test_an_obstacle_that_nothing_can_reach_is_refused(tmp_path):
    with pytest.raises(InputError, match="nothing can reach the obstacle 'wall'"):
        check_surroundings(
            _cell(tmp_path, "[[obstacles]]\nname='wall'\nkind='box'\nat_mm=[99000,0,0]\nsize_mm=[10,10,10]\n")
        )


def test_a_box_around_the_whole_cell_is_a_collision_at_home(tmp_path):
    cell = _cell(tmp_path, "[[obstacles]]\nname='all'\nkind='box'\nat_mm=[0,0,0]\nsize_mm=[9000,9000,9000]\n")
    with pytest.raises(InputError, match=r"home_deg cannot be the start pose: .*all"):
        check_home(cell, Constraints(cell, bar=False))


def test_a_floor_above_the_arm_is_refused(tmp_path):
    text = load_cell(NJ).path.read_text()
    assert "[base]" not in text
    with pytest.raises(InputError, match=r"floor.*stands above link"):
        check_surroundings(_cell(tmp_path, "[base]\nfloor_mm = 3000\n"))


@pytest.mark.parametrize("name", shipped_cells())
def test_nothing_but_neighbours_and_what_the_robot_names_is_left_out(name):
    cell = load_cell(name)
    check_cell(cell, cell.controller.dialects)
    scene = build_scene(cell)
    checked = {frozenset(pair) for pair in scene.pairs}
    for a, b in combinations(range(len(scene.pieces)), 2):
        one, other = scene.pieces[a], scene.pieces[b]
        if one.of_robot and other.of_robot and {a, b} not in checked:
            links = sorted((one.link, other.link))
            assert links[1] - links[0] <= 1 or tuple(links) in cell.robot.never_meet, scene.pieces
        elif "world" in (one.carrier, other.carrier) and one.carrier != other.carrier and not one.of_bar:
            assert {a, b} in checked or 0 in (one.link + other.link,)
    told = " ".join(unchecked_links_text(cell))
    assert all(f"{a} and {b}" in told for a, b in cell.robot.never_meet)
    assert cell.robot.never_meet_reason in told
    assert "0 and 1" in told or not cell.robot.bodies


BAD_SHAPES = {
    "next but one": ("link = 3", "link = 5", r"never_meet = \[\[3, 5\]\]"),
    "farther": ("link = 2", "link = 5", r"mend their shapes"),
}


@pytest.mark.parametrize("case", BAD_SHAPES)
def test_links_that_always_touch_are_an_error_that_names_them(tmp_path, case):
    first, second, said = BAD_SHAPES[case]
    made = "".join(
        f"\n[[bodies]]\n{link}\nkind = 'sphere'\nat_mm = [0, 0, 0]\nradius_mm = {radius}\n"
        for link, radius in ((first, 2000), (second, 2000))
    )
    robot = load_cell(NJ).robot.path.read_text()
    (tmp_path / "robot.toml").write_text(re.sub(r"(?s)\n\[\[bodies\]\].*?(?=\n\[\[(?!bodies)|\Z)", "\n", robot) + made)
    text = re.sub(r"(?m)^floor_mm.*$", "", load_cell(NJ).path.read_text())
    text = re.sub(r"(?m)^robot = .*$", 'robot = "robot.toml"', text)
    (tmp_path / "cell.toml").write_text(text)
    with pytest.raises(InputError, match=rf"wherever the robot stands: link.* and link.*{said}"):
        check_surroundings(load_cell(str(tmp_path / "cell.toml")))


@pytest.mark.parametrize(("pair", "said"), [([1, 5], "next but one"), ([4, 6], "never_meet_reason")])
def test_a_robot_says_why_links_are_left_out_and_leaves_out_no_others(tmp_path, pair, said):
    robot = load_cell(NJ).robot.path.read_text()
    robot = re.sub(r"never_meet = .*", f"never_meet = {pair}".replace("[", "[[").replace("]", "]]"), robot)
    (tmp_path / "robot.toml").write_text(re.sub(r"never_meet_reason = .*", "", robot))
    with pytest.raises(InputError, match=said):
        load_robot(tmp_path / "robot.toml")


def test_keys_of_the_controller_are_told_before_planning(tmp_path):
    for line, found in (("tool = 99999", "tool"), ("sync_output = 123456", "sync_output"), ("load = -1", "load")):
        path = tmp_path / "cell.toml"
        text = re.sub(rf"(?m)^{found} = .*$", "", load_cell(NJ).path.read_text())
        path.write_text(text.replace("[controller]", f"[controller]\n{line}"))
        with pytest.raises(InputError, match=rf"controller\.{found}"):
            load_cell(str(path))
    with pytest.raises(InputError, match="rapid"):
        check_cell(load_cell("kuka-kr6-r700/trical"), ("rapid",))
    assert np.isfinite(load_cell(NJ).home).all()
