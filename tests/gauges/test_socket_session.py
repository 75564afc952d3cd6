"""A plate with sockets: candidates in the cones, led in by a person along the socket's axis, and back from the seat."""

from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.identification.pipeline import identify
from planner.runs.run import Samples
from planner.session.options import PlanOptions
from planner.simulation.simulated_run import simulate_run
from planner.simulation.truth import draw_truth
from planner.workflow.planning import plan_cell
from tests.programs.reading import read_back
from tests.quick_search import quick_search

APPROACH, WAIT = 0.060, 0.015  # [m] of the shipped cell


@pytest.fixture(scope="module")
def planned():
    cell = load_cell("ur5e/sockets")
    quick = replace(cell, plan=replace(cell.plan, candidates=150, poses=12, repeat=0, validate=0))
    with quick_search():
        return plan_cell(quick, PlanOptions(), Stages(lambda *_: None))


def poses_of(planned):
    """Angles (n, N) at the seats, and from where they are come to; socket of each."""
    path = planned.drives[0].course.measuring
    ball = {v.id: v.ball for v in planned.drives[0].visits}
    at = np.flatnonzero(path.visit >= 0)
    return path.q[at], path.q[at - 1], path.q[at + 1], np.array([ball[int(v)] for v in path.visit[at]])


@pytest.mark.slow
def test_every_seat_is_come_to_and_left_along_the_sockets_own_axis(planned):
    cell = planned.cell
    seat, before, after, socket = poses_of(planned)
    out = np.array([[0, 0, 1], [0, 0, 1], [-0.5, 0, 0.866025]])[socket]  # the plate stands square
    np.testing.assert_allclose(cell.map_position(seat), cell.p_BS[socket], atol=1e-7)
    np.testing.assert_allclose(cell.map_position(before), cell.p_BS[socket] + APPROACH * out, atol=1e-6)
    np.testing.assert_array_equal(before, after)
    tilt = np.rad2deg(np.arccos(-(cell.map_axis(seat) * out).sum(axis=1)))
    assert tilt.max() < 70
    assert tilt.max() > 45  # the cone is used
    assert np.bincount(socket[[v.role == "calibrate" for v in planned.drives[0].visits[1:-1]]]).tolist() == [4, 4, 4]


@pytest.mark.slow
def test_the_program_never_drives_into_a_socket_and_asks_at_each_pose(planned):
    ((_, files),) = planned.programs
    cell, found = planned.cell, read_back("urscript", files)
    driven = [found.joint_path_deg, *(np.array([m.angles_deg for m in way]) for _, way in found.entries)]
    x = cell.map_position(np.deg2rad(np.vstack([d for d in driven if len(d)])))
    far = np.linalg.norm(x[:, None] - cell.p_BS[None], axis=2).min(axis=1)
    assert far.min() == pytest.approx(WAIT, abs=2e-3)  # the straight joint motion bends a little
    assert files[0].text.count("lead the ball into socket") == 12


@pytest.mark.long
def test_geometry_is_found_and_chance_is_called_chance(planned):
    """The noise is in the angles of the arm that was led: no curve over them may be a curve of that noise."""
    cell, q = planned.cell, planned.pool.q[::2]
    samples = Samples(q=q, place=np.zeros(len(q), dtype=int), pose=np.arange(len(q)))
    drawn = draw_truth(cell, 3)
    stiff = replace(drawn, errors=drawn.errors * [p.unit != "rad/Nm" for p in drawn.model.parameters])
    found = identify(simulate_run(cell, "0" * 12, samples, stiff, 3), cell)
    assert found.problems == ()
    assert found.stages[0].held_out.rms > 20 * found.stages[-1].held_out.rms
    assert found.diagnosis.found == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("wait_mm = 15", "wait_mm = 60", "less than gauge.approach_mm = 60"),
        ("axis = [-0.5, 0, 0.866025]", "axis = [0, 0, 0]", "balls.3.axis"),
        ('name = "3"', 'name = "1"', "share a name"),
    ],
)
def test_wrong_keys_are_told(tmp_path, old, new, told):
    text = load_cell("ur5e/sockets").path.read_text()
    assert old in text
    (tmp_path / "cell.toml").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=told):
        load_cell(str(tmp_path / "cell.toml"))
