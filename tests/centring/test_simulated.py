"""The arm and head that `edbb centre --simulate` tries a session with."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.placement import Targets
from planner.cell.reading import load_cell
from planner.centring.procedure import centre_ball, check_free
from planner.centring.settings import CentringSettings, RestSettings
from planner.centring.simulated import SimulatedArm
from planner.centring.stop import StopRequest
from planner.design.candidates.balls import draw_ball_candidates
from planner.runs.run import Samples
from planner.simulation.truth import draw_expected_truth, draw_truth


@pytest.mark.slow
def test_balls_are_met_millimetres_off_and_centred_to_micrometres():
    whole = load_cell("kuka-kr6-r700/trical")
    cell = replace(whole, plan=replace(whole.plan, candidates=8))
    pool = draw_ball_candidates(cell, 8)
    truth = draw_expected_truth(cell, 1, Samples.at(pool.q))
    assert truth.effects  # gears and what plans expect of every robot, not geometry alone
    settings = CentringSettings(rest=RestSettings(settle_s=0.0))
    arm = SimulatedArm(cell, truth, settings, 1)
    model, errors = truth.complete_model()
    far = []
    for q, back, ball in zip(pool.q, pool.back, pool.ball, strict=True):
        arm.move(back)
        check_free(arm.read(), settings.head)
        arm.move(q)
        far.append(np.linalg.norm(arm.read()))
        centre_ball(arm, arm, settings, StopRequest())
        there = Samples.at((arm.joints()[0] + arm._off)[None])
        x = -model.residual(there, Targets.at_base(1), errors)[0]
        assert np.linalg.norm(x - cell.p_BS[ball]) < 6e-6  # three indicators below 3 µm each
        assert np.abs(arm.joints()[0] - q).max() > 1e-4  # the joints tell what the robot is off by
    assert min(far) > 0.3e-3
    assert max(far) < 5e-3


@pytest.mark.slow
def test_after_any_steps_the_arm_stands_as_well_as_it_repeats_to():
    cell = load_cell("kuka-kr6-r700/trical")
    truth = draw_truth(cell, 1)
    arm = SimulatedArm(cell, truth, CentringSettings(rest=RestSettings(settle_s=0.0)), 1)
    off = []
    for _ in range(80):
        arm.move(cell.home)
        for step in np.vstack([4e-3 * np.eye(3), -4e-3 * np.eye(3)]):
            arm.shift(step)
        off.append(arm._off / truth.model.joint_sigma)
    size = np.sqrt(np.mean(np.square(off)))
    assert 0.9 < size < 1.1  # 480 numbers: 3 standard deviations are 0.1
