from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread

from planner.kinematics.bodies import Body, capsule_between
from planner.motion.collision.engines import pin_model
from planner.report.cell_view import Mesh, body_mesh, carrier_poses, sphere_cap
from planner.report.formatting import bound_text, digits, duration_text, percent_text
from planner.report.matplotlib_backend import chart_png
from planner.report.plan_data import sample_drive, tour_orders
from planner.report.plan_report import report_plan
from planner.runs.run import FIRST_MOUNTING
from planner.session.plan_types import Plan
from tests.not_everywhere import pin


def volume(mesh: Mesh) -> float:
    """Volume by the divergence theorem: positive only if every triangle faces outwards."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)


@pytest.mark.slow
def test_plots_are_not_blank_and_carry_no_date(plan: Plan) -> None:
    for chart in report_plan(plan).charts:
        data = chart_png(chart)
        ink = imread(BytesIO(data))[:, :, :3].min(axis=2) < 0.9
        assert 0.005 < ink.mean() < 0.6, chart.name
        assert np.ptp(np.flatnonzero(ink.any(axis=1))) > 0.8 * len(ink), chart.name
        assert not any(word in data for word in (b"tEXt", b"iTXt", b"tIME")), chart.name


@pytest.mark.parametrize("length", [0.0, 0.4])
def test_capsules_have_their_volume_and_surface(length: float) -> None:
    a, b, r = np.array([0.3, -0.2, 0.5]), np.array([0.3, -0.2, 0.5]) + length * np.array([0.6, 0.0, 0.8]), 0.1
    mesh = body_mesh(capsule_between("c", a, b, r))
    exact = np.pi * r**2 * length + 4 / 3 * np.pi * r**3
    assert 0.93 * exact < volume(mesh) < exact
    along = np.clip((mesh.vertices - a) @ (b - a) / max(length**2, 1e-12), 0, 1)
    assert np.allclose(np.linalg.norm(mesh.vertices - a - along[:, None] * (b - a), axis=1), r)


def test_box_has_its_volume() -> None:
    T = np.eye(4)
    T[:3, 3] = (1.0, 2.0, 3.0)
    assert volume(body_mesh(Body("b", "box", (0.1, 0.2, 0.3), T))) == pytest.approx(0.006)


def test_cap_stays_within_the_cone() -> None:
    centre, axis = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.6, 0.8])
    out = sphere_cap(centre, axis, 0.5, 1.2).vertices - centre
    assert np.allclose(np.linalg.norm(out, axis=1), 0.5)
    tilt = np.arccos(np.clip(out @ axis / 0.5, -1, 1))
    assert tilt.max() == pytest.approx(1.2)


def test_bodies_stand_where_pinocchio_puts_them(plan: Plan) -> None:
    cell, robot = plan.cell, plan.cell.robot
    q = plan.pool.q[::100]
    poses = carrier_poses(cell, FIRST_MOUNTING, q)
    model, frames = pin_model(robot)
    data = model.createData()
    for k, theta in enumerate(robot.theta(q)):
        pin.forwardKinematics(model, data, theta)
        for link, (joint, placement) in enumerate(frames):
            T = (data.oMi[joint] * placement).homogeneous
            T[:3, 3] *= 1000
            assert np.allclose(poses[k, link], T[:3], atol=1e-9)
    housing, rod = poses[:, -2], poses[:, -1]
    x = cell.map_position(q) * 1000
    length = np.linalg.norm(x - housing[:, :, 3], axis=1)
    assert np.allclose(rod[:, :, 3], x)
    assert np.allclose(housing[:, :, 3] + length[:, None] * housing[:, :, 2], x)
    assert np.allclose(housing[:, :, 3], cell.fixtures[0].p_BX * 1000)


def test_rounds_last_as_long_as_the_tour_says(plan: Plan) -> None:
    drive = plan.drives[0]
    both = tour_orders(plan.cell, drive)
    assert both.sorted_t[-1] == pytest.approx(drive.tour.cost_s)
    assert both.unsorted_t[-1] == pytest.approx(drive.tour.unsorted_s)
    assert {tuple(q) for q in both.sorted_q} == {tuple(q) for q in both.unsorted_q}


def test_the_way_there_ends_at_the_mount_pose(plan: Plan) -> None:
    drive = plan.drives[0]
    way = sample_drive(plan.cell, drive)
    assert way.returns
    assert way.ends < drive.trajectory.duration_s
    assert np.allclose(way.motion.q[[0, -1]], drive.visits[0].q, atol=1e-9)
    assert way.passed_length[[0, -1]] == pytest.approx([v.length for v in (drive.visits[0], drive.visits[-1])])
    assert (np.diff(way.passed) >= 0).all()  # a pose may stand where the bar is attached
    # a blended pose is passed within the blend, and the bar is no longer off than the tool point
    assert np.abs(way.passed_length - [v.length for v in drive.visits]).max() < plan.cell.motion.blend


@pytest.mark.parametrize("maximise", [False, True])
def test_a_bound_is_rounded_to_the_side_where_it_holds(maximise: bool) -> None:
    for bound in np.exp(np.random.default_rng(1).uniform(-9, 9, 500)):
        text = float(bound_text(float(bound), maximise))
        assert text == pytest.approx(bound, rel=2e-3)
        assert (text >= bound * (1 - 1e-12)) if maximise else (text <= bound * (1 + 1e-12))


def test_numbers_as_a_person_writes_them() -> None:
    assert [
        digits(0.0001234),
        digits(12.345),
        digits(123456.0),
        digits(0.0),
    ] == ["0.000123", "12.3", "123456", "0"]
    assert [duration_text(7.04), duration_text(719.6), duration_text(3600)] == ["7.0 s", "12 min 00 s", "60 min 00 s"]
    assert [percent_text(0.0581), percent_text(0.05), percent_text(0.0)] == ["5.9 %", "5.0 %", "0.0 %"]
