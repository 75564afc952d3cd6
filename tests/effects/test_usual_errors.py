"""What every robot has in some size: columns against other ways, and that unseen loads leave no trace in a run."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.effects.catalogue import Excitation
from planner.effects.effect import BASE_TURNS
from planner.effects.phi_keys import phi_from_key
from planner.effects.sizes import BASE_TURN
from planner.effects.usual_errors import (
    BASE_BY_PLACE,
    BEYOND_LOADS,
    LOST_MOTION_OF,
    LoadBeyond,
    LoadSide,
    PlacePower,
    usual_errors,
)
from planner.model.model import Model
from planner.model.tool_error import tool_setup
from planner.runs.run import Samples
from tests.simulation.generator.arm import Arm


@pytest.fixture(scope="module")
def setup():
    return setup_of(load_cell("kuka-kr6-r700/edbb", planning=False))


def states(setup, count, seed=0):
    q = np.random.default_rng(seed).uniform(*setup.robot.one_turn, (count, setup.robot.n_joints))
    return Samples(q, np.zeros(count, dtype=int))


def one_signed(setup):
    """Poses whose joint 3 is loaded to one side alone, as about a single fixture."""
    some = states(setup, 400)
    load = Excitation.of(setup, some).context.load_torque[:, 2]
    return some.take(np.flatnonzero(load > 0.2 * load.max()))


def test_the_base_turns_with_the_place_that_another_forward_pass_finds(setup):
    some, arm = states(setup, 30), Arm.from_toml(setup.robot.name)
    run = Excitation.of(setup, some)
    R, p = arm.flange(some.q, {})
    for of, place in (("tool", p + R @ setup.p_FM[0]), ("flange", p)):
        x, y = place[:, 0] / 0.7, place[:, 1] / 0.7
        assert run.values(PlacePower(of, 0.7, 2, 1)) == pytest.approx(x**2 * y, abs=1e-12)


def test_a_base_that_tips_with_the_reach_is_of_the_family(setup):
    """A tilt towards the arm in proportion to its reach, of any robot whose base tips over."""
    some = states(setup, 200)
    run = Excitation.of(setup, some)
    own = [p for p in dict(usual_errors(run))[f"{BASE_BY_PLACE}tool"]]
    x = run.context.motion.x
    for move, wanted in zip(BASE_TURNS[:2], (-x[1], x[0]), strict=True):
        columns = np.stack([run.values(p.main_move.phi) for p in own if p.main_move.index == move.index], axis=1)
        left = wanted - columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
        assert np.abs(left).max() < 1e-9
        usual = sum((p.prior * run.values(p.main_move.phi)) ** 2 for p in own if p.main_move.index == move.index)
        assert 0.3 * BASE_TURN.usual < np.sqrt(np.max(usual)) < 2 * BASE_TURN.usual


@pytest.mark.parametrize("kind", [BASE_BY_PLACE, LOST_MOTION_OF, BEYOND_LOADS])
def test_columns_are_the_derivative_of_where_the_tool_is(setup, kind):
    some, alone = states(setup, 20), tool_setup(setup, setup.p_FM[0])
    run = Excitation.of(setup, one_signed(setup))
    for name, own in usual_errors(run):
        if not name.startswith(kind):
            continue
        model = replace(Model.of(alone, frozenset()), parameters=own)
        rows = model.rows(some)
        for k in range(len(own)):
            step = 1e-6 * np.eye(len(own))[k]
            slope = (model.reading(some, step) - model.reading(some, -step)) / 2e-6
            assert rows[..., k] == pytest.approx(slope, abs=1e-7)


def test_loads_that_no_pose_has_shown_leave_no_trace_in_the_run_and_move_the_tool_elsewhere(setup):
    seen, anywhere = (Excitation.of(setup, s) for s in (one_signed(setup), states(setup, 400, 1)))
    above, below = dict(usual_errors(seen))[f"{BEYOND_LOADS}3"]
    for p in (above, below):
        assert np.abs(seen.values(p.main_move.phi)).max() == pytest.approx(0.0, abs=1e-6)
    phi = below.main_move.phi
    assert isinstance(phi, LoadBeyond)
    there = anywhere.values(phi)
    assert there.max() > 0.9
    assert (there[anywhere.context.load_torque[:, 2] >= phi.end] == 0.0).all()


def test_lost_motion_seen_to_one_side_is_a_zero_of_the_joint_and_stays_open_to_the_other(setup):
    """As for a joint 3 that is never unloaded: constant where it was measured, two sides apart elsewhere."""
    (own,) = dict(usual_errors(Excitation.of(setup, one_signed(setup))))[f"{LOST_MOTION_OF}3"]
    seen = Excitation.of(setup, one_signed(setup)).values(own.main_move.phi)
    assert seen.min() > 0.9
    there = Excitation.of(setup, states(setup, 400)).values(own.main_move.phi)
    assert there.min() < -0.9


def test_sizes_follow_a_fleet_and_no_name_comes_twice(setup):
    families = dict(usual_errors(Excitation.of(setup, states(setup, 100))))
    names = [p.name for own in families.values() for p in own]
    assert len(names) == len(set(names))
    assert f"{LOST_MOTION_OF}1" not in families  # no weight turns an upright axis
    assert f"{LOST_MOTION_OF}2" not in families  # of a joint loaded both ways play by load has a name
    assert f"{BEYOND_LOADS}2" in families


def test_poses_that_are_planned_can_show_both_sides_of_every_loaded_joint(setup):
    """Whatever the candidates: each family of a loaded joint moves some pose with a large load, to either side."""
    run, anywhere = (Excitation.of(setup, s) for s in (states(setup, 100), states(setup, 400, 2)))
    families = dict(usual_errors(run, planned=True))
    (side,), (above, below) = families[f"{LOST_MOTION_OF}3"], families[f"{BEYOND_LOADS}3"]
    load = anywhere.context.load_torque[:, 2]
    for p, there in ((above, load > 0.8 * load.max()), (below, load < 0.8 * load.min())):
        assert anywhere.values(p.main_move.phi)[there].min() > 0.5
    assert np.sign(anywhere.values(side.main_move.phi)) == pytest.approx(np.sign(load))


def test_keys_lead_back_to_the_functions():
    for phi in (PlacePower("tool", 0.8, 1, 1), PlacePower("flange", 2.1, 0, 2), LoadSide(2, 15.0),
                LoadBeyond("above", 1, 30.5, 12.0), LoadBeyond("below", 4, -3.0, 1.5)):  # fmt: skip
        assert phi_from_key(phi.key, 6) == phi
