"""The tracker's plan: every pose is seen, by plain geometry; random, in tour order, to validate unless asked else."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import NoSolutionError
from planner.common.progress import Stages
from planner.gauges.tracker import Tracker
from planner.kinematics.chain import Chain
from planner.session.options import PlanOptions
from planner.session.plan_record import plan_document
from planner.workflow.planning import plan_cell


@pytest.fixture(scope="module")
def cell():
    whole = load_cell("kuka-kr6-r700/tracker")
    return replace(whole, plan=replace(whole.plan, candidates=400, validate=25))


@pytest.fixture(scope="module")
def planned(cell):
    return plan_cell(cell, PlanOptions(), Stages(lambda *_: None))


@pytest.mark.slow
def test_five_hundred_validate_by_default_and_ten_where_others_calibrate(tmp_path, monkeypatch):
    shipped = load_cell("kuka-kr6-r700/tracker")
    assert shipped.plan.validate == shipped.gauge.validates_with == 500
    path = tmp_path / "cell.toml"
    path.write_text(shipped.path.read_text().replace("validate = 500\n", ""))
    cell = load_cell(str(path))
    assert cell.plan.validate == 10
    monkeypatch.setattr(Tracker, "validates_with", 30)  # quicker
    cell = replace(cell, plan=replace(cell.plan, candidates=300))
    roles = [v.role for v in plan_cell(cell, PlanOptions(), Stages(lambda *_: None)).drives[0].visits]
    assert (roles.count("validate"), roles.count("calibrate")) == (30, 0)


@pytest.mark.slow
def test_poses_only_validate_and_are_visited_once(planned):
    visits = planned.drives[0].visits
    assert [v.role for v in visits].count("validate") == 25
    assert {v.role for v in visits} == {"validate", "mount"}
    assert len({tuple(v.q) for v in visits}) == 26
    content = plan_document(planned).content()
    assert "ball" not in content["poses"][1]
    assert content["tour"]["cost_s"] < 0.7 * content["tour"]["unsorted_s"]


@pytest.mark.slow
def test_the_reflector_faces_the_tracker_and_nothing_stands_between(planned):
    """The beam sampled every millimetre against the robot's and the tool's capsules and spheres."""
    cell = planned.cell
    q = np.array([v.q for v in planned.drives[0].visits if v.role == "validate"])
    x, tracker = cell.map_position(q), cell.fixtures[0].p_BX
    way = tracker - x
    direction = way / np.linalg.norm(way, axis=1)[:, None]
    tilt = np.rad2deg(np.arccos((direction * cell.map_axis(q)).sum(axis=1)))
    assert tilt.max() < 30
    along = x[:, None] + np.arange(0.03, 1.5, 1e-3)[None, :, None] * direction[:, None]
    T = cell.robot.flange_frame()
    bodies = [(link, b.T, b) for link, b in cell.robot.bodies] + [(6, T @ b.T, b) for b in cell.tool.bodies]
    for link, place, body in bodies:
        if body.kind == "box":
            continue
        frame = Chain(cell.robot.transforms[: cell.robot.link_end[link]]).forward(cell.robot.theta(q))
        R, p = np.moveaxis(frame.R, 2, 0), frame.x.T
        half = body.size[1] / 2 if body.kind == "capsule" else 0.0
        local = np.einsum("nji,nkj->nki", R, along - np.broadcast_to(p[:, None], (len(q), 1, 3)))
        local = (local - place[:3, 3]) @ place[:3, :3]
        local[..., 2] -= np.clip(local[..., 2], -half, half)
        assert np.linalg.norm(local, axis=2).min() > body.size[0], body.name


@pytest.mark.slow
def test_poses_asked_for_are_chosen_and_calibrate(cell):
    one = plan_cell(cell, PlanOptions(poses=20), Stages(lambda *_: None))
    roles = [v.role for v in one.drives[0].visits]
    assert (roles.count("calibrate"), roles.count("validate")) == (20, 25)
    assert one.choice.value > 0.94 * one.choice.certificate.value
    assert len(one.choice.seen.names) == 31


@pytest.mark.slow
def test_more_than_there_are_is_refused(cell):
    with pytest.raises(NoSolutionError, match=r"candidate poses are left for 5000 to validate with"):
        plan_cell(replace(cell, plan=replace(cell.plan, validate=5000)), PlanOptions(), Stages(lambda *_: None))
