"""The predicted first contact against drawn robots."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.placement import Targets
from planner.common.errors import NoSolutionError
from planner.design.candidates.balls import BallFunnel, FirstContact, draw_ball_candidates, length_quantile
from planner.model.model import Model
from planner.runs.run import Samples


def test_the_quantile_holds_for_drawn_vectors():
    rng = np.random.default_rng(0)
    for scale in ((1, 1, 1), (1, 0.5, 0.2), (1, 0.05, 0.01)):
        A = rng.standard_normal((3, 3)) * scale
        x = rng.standard_normal((400_000, 3)) @ A.T
        share = (np.linalg.norm(x, axis=1) < length_quantile((A @ A.T)[None])[0]).mean()
        assert 0.94 < share < 0.96


@pytest.mark.long
def test_drawn_robots_meet_the_ball_as_predicted(cell, pool):
    """Robots with errors drawn from the priors, scaled as the cell says, by the exact model."""
    contact = FirstContact(cell)
    q = pool.q[::200]
    model = Model.from_cell(cell, frozenset({"fixture", "tool"}))
    robot = np.array([p.group != "gauge" for p in model.parameters])
    scale = np.where(robot, np.sqrt(contact._scale), 1.0)
    rng = np.random.default_rng(2)
    samples = Samples(q, np.zeros(len(q), dtype=int))
    seen = Targets(position=cell.map_position(q))
    off = [
        np.linalg.norm(model.residual(samples, seen, rng.standard_normal(len(scale)) * scale * model.prior), axis=1)
        for _ in range(3000)
    ]
    share = (np.array(off) < contact.at(q)).mean(axis=0)
    assert np.all((share > 0.93) & (share < 0.97))


def test_no_pose_of_the_robot_alone_exceeds_what_the_cell_says(cell, pool):
    sure = replace(cell, fixtures=(replace(cell.fixtures[0], prior=1e-9, turn=1e-9),))
    rng = np.random.default_rng(0)
    q = rng.uniform(cell.robot.q_lower, cell.robot.q_upper, (2000, 6))
    assert FirstContact(sure).at(q).max() == pytest.approx(cell.gauge.head.uncalibrated, rel=1e-6)
    assert FirstContact(cell).at(pool.q).max() < cell.gauge.head.usable


@pytest.mark.slow
def test_a_smaller_head_loses_poses_and_a_hopeless_robot_all(cell, pool, impatient):
    middle = float(np.median(FirstContact(cell).at(pool.q[pool.ball == 3])))
    worse = replace(cell, gauge=replace(cell.gauge, head=replace(cell.gauge.head, usable=middle)))
    fewer = draw_ball_candidates(worse, 60)
    assert isinstance(fewer.funnel, BallFunnel)
    assert 0.1 < fewer.funnel.contact / fewer.funnel.approach < 0.99
    assert FirstContact(cell).at(fewer.q).max() < middle
    hopeless = replace(cell, gauge=replace(cell.gauge, head=replace(cell.gauge.head, uncalibrated=8e-3)))
    with pytest.raises(NoSolutionError, match=r"At ball 1 the uncalibrated robot would meet it \d+\.\d mm or more off"):
        draw_ball_candidates(hopeless, 60)
