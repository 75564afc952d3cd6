"""Figures of a validation, the tracker's frame from its nests, and the precision test, against known truth."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.accuracy.precision import judge_repeated_centrings, repeat_groups, repeat_precision
from planner.accuracy.reference_frame import NestFrame, nest_frame, position_errors, register_tracker
from planner.accuracy.validation import error_figures
from planner.cell.parts import Nest
from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.runs.run import Readings, Run, Samples

R_WG = Rotation.from_euler("xyz", [3.0, -2.0, 175.0], degrees=True).as_matrix()
P_WG = np.array([2.4, 0.1, 0.35])


@pytest.fixture(scope="module")
def tracked():
    cell = load_cell("kuka-kr6-r700/tracker")
    return replace(cell, nests=tuple(Nest(n.name, n.p_WN, (n.p_WN - P_WG) @ R_WG) for n in cell.nests))


def run_of(cell, q, extra=0.0):
    seen = (cell.map_position(q) + extra - nest_frame(cell).p_BW - P_WG) @ R_WG  # the artifact stands square
    return Run("made", Samples(q, np.zeros(len(q), dtype=int)), Readings(position=seen))


def drawn(cell, n=500):
    return np.random.default_rng(0).uniform(cell.robot.q_lower, cell.robot.q_upper, (n, 6))


def test_figures_are_those_of_the_definitions():
    error = np.random.default_rng(1).standard_normal((500, 3)) * 1e-3
    found, size = error_figures(error), np.sqrt((error**2).sum(axis=1))
    assert found.mean == pytest.approx(sum(size) / 500)
    assert found.largest == max(size)
    assert found.std == pytest.approx((sum((size - sum(size) / 500) ** 2) / 499) ** 0.5)
    for share, value in found.percentiles:
        assert abs((size <= value).mean() - share / 100) < 0.004
    assert error_figures(size).mean == found.mean
    assert "500 poses: mean" in found.text()
    with pytest.raises(InputError, match="two poses"):
        error_figures(error[:1])


def test_the_frame_comes_back_from_the_nests(tracked):
    found = register_tracker(tracked)
    assert np.allclose(found.R_WG, R_WG, atol=1e-9)
    assert np.allclose(found.p_WG, P_WG, atol=1e-9)
    assert found.misses.max() < 1e-9


def test_a_true_robot_has_no_error_and_a_known_shift_is_seen_whole(tracked):
    q, frame = drawn(tracked), register_tracker(tracked)
    stand = nest_frame(tracked)
    error = position_errors(tracked.robot, tracked.tool.p_FM, stand, frame, run_of(tracked, q))
    assert np.abs(error).max() < 1e-9
    shift = np.array([0.3e-3, -0.1e-3, 0.2e-3])  # a frame fitted to these poses would hide it
    error = position_errors(tracked.robot, tracked.tool.p_FM, stand, frame, run_of(tracked, q, shift))
    assert np.allclose(error, shift, atol=1e-9)
    assert error_figures(error).mean == pytest.approx(np.linalg.norm(shift))
    moved = NestFrame(np.eye(3), stand.p_BW - shift)  # the nests' frame as a calibration found it
    assert (
        np.abs(position_errors(tracked.robot, tracked.tool.p_FM, moved, frame, run_of(tracked, q, shift))).max() < 1e-9
    )


def test_bad_nests_are_named(tracked):
    shipped = load_cell("kuka-kr6-r700/tracker")
    with pytest.raises(InputError, match="read_mm is missing for N1, N2, N3"):
        register_tracker(shipped)
    a, b, c = tracked.nests
    with pytest.raises(InputError, match=r"the nests miss their places by up to 0\.\d+ mm"):
        register_tracker(replace(tracked, nests=(a, b, replace(c, p_GN=c.p_GN + np.array([0.0, 0.0, 1e-3]) + 1e-3))))
    line = tuple(Nest(n, np.array([x, 0, 0]), np.array([x, 0, 0])) for n, x in (("a", 0.0), ("b", 0.3), ("c", 0.6)))
    with pytest.raises(InputError, match="nearly on one line"):
        register_tracker(replace(tracked, nests=line))
    frame, none = register_tracker(tracked), np.zeros(3, dtype=int)
    ball = Run("made", Samples(drawn(tracked, 3), none), Readings(ball=none))
    with pytest.raises(InputError, match="x_mm, y_mm, z_mm"):
        position_errors(tracked.robot, tracked.tool.p_FM, nest_frame(tracked), frame, ball)


def test_precision_by_hand():
    """Table 3 of the TriCal paper: three centrings against the master ball; and the same without a reference."""
    x = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 0], [5, 5, 5]]) * 2e-6
    found = repeat_precision(x, np.array([4, 4, 4, 9]))
    assert (found.poses, found.centrings) == (1, 3)
    assert found.largest == pytest.approx(2e-6)
    assert found.apart == pytest.approx(4e-6)
    assert found.rms == pytest.approx(2e-6 * np.sqrt(2 / 3))
    assert found.axis_std == pytest.approx([2e-6, 0, 0])
    master = repeat_precision(x[:3], np.array([4, 4, 4]), reference=np.array([0, 0, 1e-6]))
    assert master.largest == pytest.approx(np.hypot(2e-6, 1e-6))
    with pytest.raises(InputError, match="no pose was centred more than once"):
        repeat_precision(x, np.arange(4))


@pytest.mark.slow
def test_precision_of_a_run_is_what_was_put_in(cell, pool, tmp_path):
    """Noisy centrings of 40 poses: the spread comes back per axis; offsets of the last reading are taken off."""
    rng = np.random.default_rng(3)
    q, sigma = np.repeat(pool.q[:40], 3, axis=0), 2e-6
    J = cell.map_jacobian(q)
    noise = rng.standard_normal((len(q), 3)) * sigma
    q = q + np.einsum("nji,nj->ni", np.linalg.pinv(J).transpose(0, 2, 1), noise)
    offset = rng.standard_normal((len(q), 3)) * 1e-3
    q = q + np.einsum("nij,nj->ni", np.linalg.pinv(J), offset)
    shown = cell.map_position(q) - cell.map_position(np.repeat(pool.q[:40], 3, axis=0)) - noise
    pose = np.arange(120)
    plan = tmp_path / "plan.json"
    poses = [
        {"id": int(k), "q_deg": [0.0] * 6, "role": "repeat" if k % 3 else "calibrate"}
        | ({"repeats": int(k - k % 3)} if k % 3 else {})
        for k in pose
    ]
    plan.write_text(json.dumps({"schema": "edbb-plan/1", "plan_id": "0123456789ab", "poses": poses}))
    run = Run(
        "made",
        Samples(q, np.zeros(120, dtype=int), pose=pose),
        Readings(ball=pose // 30, offset=shown),
        balls=tuple("1234"),
    )
    found = judge_repeated_centrings(cell, run, repeat_groups(plan)).summary
    assert (found.poses, found.centrings) == (40, 120)
    assert np.all(np.abs(found.axis_std / sigma - 1) < 0.3)
    exact = replace(cell, gauge=replace(cell.gauge, noise=sigma), robot=replace(cell.robot, repeatability=1e-12))
    quiet = judge_repeated_centrings(exact, run, repeat_groups(plan))
    assert quiet.expected == pytest.approx(sigma * np.sqrt(3 * 2 / 3))  # a mean of three takes a third of the scatter
    assert quiet.summary.rms == pytest.approx(quiet.expected, rel=0.2)
    assert quiet.off.shape == (120, 3)
    assert np.abs(quiet.off.reshape(40, 3, 3).sum(axis=1)).max() < 1e-12
    with pytest.raises(InputError, match="'pose' is missing"):
        judge_repeated_centrings(cell, Run("made", Samples(q, run.samples.place), run.readings), {})
