"""Poses come to from the side that is wanted, along motions that both engines prove."""

from dataclasses import replace

import numpy as np
import pytest

from planner.design.discrimination.findings import read_identification
from planner.design.discrimination.questions import approach_axes
from planner.design.discrimination.selection import select_discriminating_poses
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.verdict import ProvenPath
from planner.session.release import approach_from_sides
from tests.design.discrimination.test_refusals import file
from tests.design.discrimination.worlds import NJ, cell, pool, usual

PLAY = ("backlash", "joint 3", 0.01, "deg", ["backlash, joint 2"])


@pytest.fixture(scope="module")
def constraints():
    return Constraints(cell())


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """Poses for telling the plays of two axes apart."""
    found = read_identification(file(tmp_path_factory.mktemp("play"), PLAY), NJ, 6)
    return select_discriminating_poses(cell(), pool(), usual(), found, 0)


@pytest.fixture(scope="module")
def path(constraints):
    """A short tour about one pose, and back."""
    rng = np.random.default_rng(4)
    near = pool().q[0] + rng.normal(scale=0.05, size=(60, 6))
    near = near[constraints.valid(near)][:7]
    assert len(near) == 7
    found = connect_poses(constraints, near, [*range(7), 0])
    assert isinstance(found, ProvenPath)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("sign", [-1, 1])
def test_every_pose_is_come_to_from_the_wanted_side(constraints, path, sign):
    wanted = np.zeros((7, 6), dtype=int)
    wanted[1:, 2] = sign
    longer = approach_from_sides(constraints, path, wanted)
    at = np.flatnonzero(longer.node >= 0)
    np.testing.assert_array_equal(longer.q[at], path.q[path.node >= 0])
    last = np.sign(np.diff(longer.q, axis=0)[at[1:] - 1, 2])
    assert (last[:-1] != sign).sum() <= 2
    assert longer.clear
    assert [len(leg.supports) for leg in longer.legs] == (np.diff(at) - 1).tolist()
    assert constraints.prove(longer.q[:-1], longer.q[1:]).proven.all()


@pytest.mark.slow
def test_a_path_that_comes_from_the_wanted_sides_stays(constraints, path):
    natural = np.zeros((7, 6), dtype=int)
    natural[1:] = np.sign(np.diff(path.q[path.node >= 0], axis=0))[:6]
    longer = approach_from_sides(constraints, path, natural)
    assert longer.q.shape == path.q.shape


@pytest.mark.slow
def test_sides_are_chosen_for_the_axes_whose_play_is_in_question(done, tmp_path):
    found = read_identification(file(tmp_path, PLAY), NJ, 6)
    assert approach_axes(found, cell()) == (1, 2)
    assert approach_axes(found, cell("continuous")) == ()
    assert done.choice.approach.shape == done.choice.q.shape
    assert (done.choice.approach[:, [1, 2]] != 0).all()
    assert not done.choice.approach[:, [0, 3, 4, 5]].any()
    assert len(np.unique(done.choice.chosen)) == len(done.choice.chosen)


@pytest.mark.slow
def test_wanted_sides_tell_more_than_any(done):
    """As driven with the sides turned over at random, the same poses tell the two plays apart less surely."""
    chosen = done.choice.chosen
    t = np.arange(len(chosen)) * 10.0
    samples = replace(pool().samples.take(chosen), t=t, direction=done.choice.approach.astype(float))
    told = next(t for t in done.judge_driven_visits((samples,)).told if t.named)
    rng = np.random.default_rng(0)
    for _ in range(3):
        turned = samples.direction * rng.choice([-1.0, 1.0], (len(t), 1))
        other = done.judge_driven_visits((replace(samples, direction=turned),)).told
        assert next(t for t in other if t.named).noncentrality < told.noncentrality


@pytest.mark.slow
def test_the_same_seed_chooses_the_same_poses(done, tmp_path):
    again = select_discriminating_poses(cell(), pool(), usual(), read_identification(file(tmp_path, PLAY), NJ, 6), 0)
    assert again.separation == done.separation
    assert (again.choice.q == done.choice.q).all()
