"""Fixtures that the robot itself sets up: they stand where an independent arm with the same errors truly comes."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell, read_cell
from planner.common.errors import InputError
from planner.simulation.assumptions import CUP_SIGMA
from planner.simulation.set_up import place_fixtures_by_robot, solve_fixture_pose
from planner.simulation.truth import draw_truth
from tests.simulation.generator.arm import Arm

CELLS = ("comau-nj130/edbb", "comau-nj130/paper", "abb-irb6700/edbb", "kuka-kr6-r700/edbb")


def errors_of(truth):
    return dict(zip(truth.model.names, truth.errors.tolist(), strict=True))


@pytest.mark.parametrize("name", CELLS)
def test_the_fixture_stands_where_an_independent_arm_comes(name):
    cell = load_cell(name)
    robot, _, _ = name.partition("/")
    arm = Arm.from_toml(robot)
    (q,) = solve_fixture_pose(cell, cell.fixtures[0].p_BX)
    R, p = arm.flange(q[None])
    assert np.linalg.norm((p + R @ cell.tool.p_FM)[0] - cell.fixtures[0].p_BX) < 1e-9  # told by the nominal robot
    for seed in range(5):
        truth = draw_truth(cell, seed)
        model = truth.model
        stiff = np.where([n.startswith(("compliance", "fixture", "zero")) for n in model.names], 0.0, truth.errors)
        drawn = dict(zip(model.names, place_fixtures_by_robot(cell, model, stiff).tolist(), strict=True))
        R, p = arm.flange(
            q[None], {n: v for n, v in drawn.items() if not n.startswith(("fix", "map", "zero", "compl"))}
        )
        tool = cell.tool.p_FM + [drawn[f"map_{a}"] for a in "xyz"]
        fixture = cell.fixtures[0].p_BX + [drawn[f"fixture_{cell.fixtures[0].name}_{a}"] for a in "xyz"]
        assert np.linalg.norm((p + R @ tool)[0] - fixture) < 1e-7


@pytest.mark.long
def test_a_hand_adjusts_it_and_sets_the_zero_there():
    cell = load_cell("comau-nj130/edbb")
    known = load_cell("comau-nj130/paper")
    off, zero, sure = [], [], []
    for seed in range(60):
        truth = draw_truth(cell, seed)
        names = truth.model.names
        bare = np.where([n.startswith(("fixture", "zero")) for n in names], 0.0, truth.errors)
        by_robot = place_fixtures_by_robot(cell, truth.model, bare)
        off += [truth.errors[k] - by_robot[k] for k, n in enumerate(names) if n.startswith("fixture")]
        zero.append(errors_of(truth)["zero"])
        sure.append(errors_of(draw_truth(known, seed))["zero"])
    assert np.std(off) == pytest.approx(CUP_SIGMA, rel=0.2)  # 180 draws: 5 % is one sigma
    assert np.std(zero) == pytest.approx(CUP_SIGMA, rel=0.4)
    assert np.std(sure) == pytest.approx(known.gauge.noise, rel=0.4)  # 'known': set as well as the bar reads


def test_what_is_measured_from_the_base_stands_there(tmp_path):
    """The same cell, its fixture measured: what the robot errs has nothing to do with it."""
    text = load_cell("kuka-kr6-r700/edbb").path.read_text()
    measured = text.replace("[[fixtures]]\n", '[[fixtures]]\nset_up = "measured"\nprior_mm = 0.2\n')
    (tmp_path / "cell.toml").write_text(measured)
    cell = read_cell(tmp_path / "cell.toml", "cell")
    assert cell.fixtures[0].set_up == "measured"
    off = [[v for n, v in errors_of(draw_truth(cell, s)).items() if n.startswith("fixture")] for s in range(60)]
    assert np.std(off) == pytest.approx(0.2e-3, rel=0.2)
    (tmp_path / "cell.toml").write_text(text.replace("[[fixtures]]\n", '[[fixtures]]\nset_up = "by hand"\n'))
    with pytest.raises(InputError, match=r"set_up"):
        read_cell(tmp_path / "cell.toml", "cell")


def test_a_wire_is_measured_and_a_bar_is_set_up_by_the_robot():
    assert {f.set_up for f in load_cell("so101/wire").fixtures} == {"measured"}
    assert {f.set_up for f in load_cell("ur5e/edbb").fixtures} == {"robot"}


@pytest.mark.long
def test_a_fixture_out_of_the_robots_reach_is_measured():
    cell = load_cell("kuka-kr6-r700/edbb")
    far = replace(cell.fixtures[0], p_BX=np.array([2.0, 0.0, 0.5]))
    assert solve_fixture_pose(cell, far.p_BX) is None
    cell = replace(cell, fixtures=(far,))
    drawn = [errors_of(draw_truth(cell, s))["fixture_A_x"] for s in range(60)]
    assert np.std(drawn) == pytest.approx(far.prior, rel=0.4)


@pytest.mark.slow
def test_what_the_robot_sets_up_is_known_no_better_than_the_robot(tmp_path):
    """A cup said to stand within 0.1 mm is where an arm came that errs by millimetres, as it is drawn too."""
    text = load_cell("comau-nj130/paper").path.read_text()
    priors = {}
    for how in ("robot", "measured"):
        stated = f'[[fixtures]]\nset_up = "{how}"\nprior_mm = 0.1\n'
        (tmp_path / "cell.toml").write_text(text.replace("[[fixtures]]\n", stated))
        cell = read_cell(tmp_path / "cell.toml", "cell")
        priors[how] = float(setup_of(cell).place_prior[0])
    assert priors["measured"] == pytest.approx(0.1e-3)
    drawn = [errors_of(draw_truth(cell, seed)) for seed in range(3)]
    assert max(abs(v) for e in drawn for n, v in e.items() if n.startswith("fixture")) < 0.5e-3  # as measured
    robot = [errors_of(draw_truth(load_cell("comau-nj130/paper"), seed)) for seed in range(60)]
    own = np.sqrt(np.mean([v**2 for e in robot for n, v in e.items() if n.startswith("fixture")]))
    assert 0.4 * own < priors["robot"] < own  # what the joints give way by comes on top
