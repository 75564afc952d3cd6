"""The shipped TriCal cell, smaller pools of it, and its robot in pinocchio."""

from dataclasses import replace

import numpy as np
import pytest

import planner.design.candidates.balls as balls
from planner.cell.reading import load_cell
from planner.design.candidates.balls import draw_ball_candidates
from planner.motion.collision.engines import pin_model
from tests.not_everywhere import pin
from tests.quick_search import quick_search


@pytest.fixture(scope="package", autouse=True)
def quick():
    with quick_search():
        yield


@pytest.fixture(scope="session")
def cell():
    whole = load_cell("kuka-kr6-r700/trical")
    return replace(whole, plan=replace(whole.plan, candidates=800, poses=24, repeat=2, validate=4))


@pytest.fixture(scope="session")
def pool(cell):
    return draw_ball_candidates(cell, 800)


@pytest.fixture
def impatient(monkeypatch):
    """Let a search without any hope end after 5000 samples."""
    monkeypatch.setattr(balls, "HOPELESS_SAMPLES", 5000)


@pytest.fixture(scope="session")
def tool_pose(cell):
    """Where pinocchio puts the tool point, and its axes: q (N,) -> p (3,), R (3, 3)."""
    model, frames = pin_model(cell.robot)
    data = model.createData()
    joint, T = frames[-1]
    flange = T * pin.SE3(cell.robot.flange_frame())

    def pose(q):
        pin.forwardKinematics(model, data, cell.robot.theta(np.atleast_2d(q))[0])
        here = data.oMi[joint] * flange
        return here.act(np.array(cell.tool.p_FM)), np.array(here.rotation)

    return pose
