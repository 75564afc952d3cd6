"""Surroundings that cannot be meant are refused before anything is planned, and nothing that collides is left out."""

import re

import numpy as np
import pytest

from planner.cell.reading import load_cell, shipped_cells
from planner.common.errors import InputError
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.surroundings import check_surroundings, left_out_pairs
from planner.motion.path.constraints import Constraints
from planner.session.first_checks import check_cell
from planner.session.mount import check_home
from tests.motion.collision.test_meshes import stl

NJ = "comau-nj130/edbb"


def _cell(tmp_path, text, base="[base]"):
    path = tmp_path / "cell.toml"
    path.write_text(load_cell(NJ).path.read_text() + "\n" + text)
    return load_cell(str(path))


def test_a_mesh_in_millimetres_that_is_read_in_metres_is_refused(tmp_path):
    stl(tmp_path / "box.stl", 1000.0)
    obstacle = "[[obstacles]]\nkind = 'mesh'\nfile = 'box.stl'\nat_mm = [700, 1200, 1300]\n"
    with pytest.raises(InputError, match=r'nothing can reach.*unit = "mm"'):
        check_surroundings(_cell(tmp_path, obstacle))
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


def test_only_links_next_but_one_and_the_floor_are_left_out():
    for name in shipped_cells():
        cell = load_cell(name)
        world = CollisionWorld.from_cell(cell)
        pairs = {tuple(sorted((world.scene.pieces[a].link, world.scene.pieces[b].link))) for a, b in world.scene.pairs}
        n = cell.robot.n_joints
        if cell.robot.bodies:
            assert {(0, n)} <= pairs | {(0, n)}
        check_cell(cell, cell.controller.dialects)
    assert left_out_pairs(load_cell("ur10/edbb"))[0].endswith("link1_2 and floor")


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
