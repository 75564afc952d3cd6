"""Speeds against the derivative of a known path; rests against the poses that a simulated arm was told to hold."""

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.joint_motion import average_rests, find_rests, joint_speeds
from planner.runs.loader import load_run
from planner.runs.run import Readings, Run, Samples
from planner.runs.writer import save_run
from tests.runs.made import sine_path, write

HOLDS = np.deg2rad([[0, 40], [30, 10], [-20, 10], [-20, -50], [10, 25]])
POSE = [4, 0, 7, 7, 2]


def path_samples(t, session=None):
    q, _ = sine_path(t)
    return Samples(q=q, place=np.zeros(len(t), dtype=int), t=t, session=session)


def log_of_holds(noise=0.0, hold=2.0, dt=0.01, seed=5):
    """Drive from hold to hold within 1 s on a smooth ramp, and rest there; return run, true rows at rest and sum."""
    rng = np.random.default_rng(seed)
    q, pose = [HOLDS[:1].repeat(int(hold / dt), axis=0)], [np.full(int(hold / dt), POSE[0])]
    for before, after, number in zip(HOLDS[:-1], HOLDS[1:], POSE[1:], strict=True):
        s = np.linspace(0, 1, int(1.0 / dt))[:, None]
        q += [before + (after - before) * (3 * s**2 - 2 * s**3), after[None].repeat(int(hold / dt), axis=0)]
        pose += [np.full(len(s), -1), np.full(int(hold / dt), number)]
    angles, pose = np.concatenate(q), np.concatenate(pose)
    n = len(angles)
    length = 0.4 + 0.1 * np.sin(angles).sum(axis=1)
    samples = Samples(
        q=angles + rng.normal(0, noise, angles.shape),
        place=np.zeros(n, dtype=int),
        t=5.0 + dt * np.arange(n),
        pose=pose,
    )
    return Run("log", samples, Readings(length=length + rng.normal(0, 1e-6, n)), continuous=True)


def test_speeds_follow_the_path():
    t = np.cumsum(np.random.default_rng(1).uniform(0.001, 0.003, 4000))
    _, truth = sine_path(t)
    found = joint_speeds(path_samples(t))
    assert np.abs(found[1:-1] - truth[1:-1]).max() < 5e-7  # (0.003 s)² · 0.47³ / 6, and some
    assert np.abs(found - truth).max() < 5e-4  # one-sided at the ends


def test_speeds_of_a_parabola_are_exact_at_any_spacing():
    t = np.array([0.0, 0.1, 0.4, 0.5, 1.3])
    samples = Samples(q=np.column_stack([3 * t**2, 2 - t]), place=np.zeros(5, dtype=int), t=t)
    np.testing.assert_allclose(joint_speeds(samples)[1:-1], np.column_stack([6 * t, -np.ones(5)])[1:-1], atol=1e-12)


def test_speeds_do_not_reach_over_sessions():
    t = np.array([0.0, 1.0, 2.0, 0.0, 1.0, 5.0])
    q = np.array([0.0, 1.0, 2.0, 50.0, 48.0, 7.0])[:, None]
    samples = Samples(q=q, place=np.zeros(6, dtype=int), t=t, session=np.array([0, 0, 0, 1, 1, 2]))
    np.testing.assert_allclose(joint_speeds(samples)[:, 0], [1, 1, 1, -2, -2, 0])


def test_speeds_need_a_clock():
    with pytest.raises(InputError, match="no column t_s"):
        joint_speeds(Samples(q=np.zeros((2, 1)), place=np.zeros(2, dtype=int)))
    with pytest.raises(InputError, match="have the same time"):
        joint_speeds(path_samples(np.array([0.0, 1.0, 1.0])))


@pytest.mark.parametrize("noise", [0.0, 2e-5])
def test_each_hold_becomes_one_sample(noise):
    run = log_of_holds(noise)
    found = average_rests(run)
    assert len(found) == 5
    assert not found.continuous
    np.testing.assert_allclose(found.samples.q, HOLDS, atol=3 * noise / np.sqrt(100) + 1e-12)
    np.testing.assert_allclose(found.readings.length, 0.4 + 0.1 * np.sin(HOLDS).sum(axis=1), atol=5e-7)
    assert found.samples.pose.tolist() == POSE
    assert "5 rests were found in 1400 samples; each is the mean of 1" in found.warnings[0]


def test_stretches_lie_within_the_holds():
    run = log_of_holds(2e-5)
    stretches = find_rests(run.samples)
    assert (np.diff(stretches, axis=1) >= 150).all()
    for first, end in stretches:
        assert len(set(run.samples.pose[first:end])) == 1
        assert run.samples.pose[first] >= 0


def test_rests_are_found_without_marks_too():
    run = log_of_holds(2e-5)
    bare = Run("log", Samples(q=run.samples.q, place=run.samples.place, t=run.samples.t), run.readings)
    found = average_rests(bare)
    assert len(found) == 5
    np.testing.assert_allclose(found.samples.q, HOLDS, atol=1e-5)


def test_last_directions_are_those_of_the_drive():
    moves = np.sign(np.diff(HOLDS, axis=0))  # (4, 2); a joint that stays keeps the sign of its move before
    expected = [[0, 0], moves[0], [moves[1][0], moves[0][1]], [moves[1][0], moves[2][1]], moves[3]]
    np.testing.assert_array_equal(average_rests(log_of_holds(2e-5)).samples.direction, expected)


def test_a_drive_never_rests():
    t = np.arange(0, 10, 0.01)
    run = Run("drive", path_samples(t), Readings(length=np.ones(len(t))))
    with pytest.raises(
        InputError, match=r"none of 1000 samples is at rest \(no joint moving by more than 0\.057 degrees"
    ):
        average_rests(run)


def test_a_pose_without_rest_is_named():
    run = log_of_holds()
    pose = run.samples.pose.copy()
    pose[250:260] = 33
    marked = Run("log", Samples(q=run.samples.q, place=run.samples.place, t=run.samples.t, pose=pose), run.readings)
    assert "did not rest at the poses 33;" in average_rests(marked).warnings[1]


def test_loading_finds_the_rests_where_the_file_calls_for_it(tmp_path):
    run = log_of_holds(2e-5)
    save_run(run, tmp_path / "log.csv")  # says "# measure: continuous"
    assert (len(load_run(tmp_path / "log.csv", 2)), load_run(tmp_path / "log.csv", 2).continuous) == (1400, True)
    text = (tmp_path / "log.csv").read_text().partition("\n")[2]
    marked = load_run(write(tmp_path / "marked.csv", text), 2)  # poses stand still
    assert (len(marked), marked.continuous) == (5, False)
    said = load_run(write(tmp_path / "said.csv", "# measure: static\n" + text.replace("pose", "note")), 2)
    assert (len(said), said.samples.pose) == (5, None)
    plain = load_run(write(tmp_path / "plain.csv", text.replace("pose", "note")), 2)
    assert (len(plain), plain.continuous) == (1400, True)


def test_a_rest_between_poses_is_no_measurement():
    run = log_of_holds()
    pose = np.where(run.samples.pose == 0, -1, run.samples.pose)  # the second hold: a pause on the way
    samples = Samples(q=run.samples.q, place=run.samples.place, t=run.samples.t, pose=pose)
    assert average_rests(Run("log", samples, run.readings)).samples.pose.tolist() == [4, 7, 7, 2]


def test_a_log_of_rests_may_begin_its_clock_anew(tmp_path):
    run = log_of_holds()
    t = run.samples.t.copy()
    t[620:] -= 9.0  # early in the hold at pose 7
    again = Run("log", Samples(q=run.samples.q, place=run.samples.place, t=t, pose=run.samples.pose), run.readings)
    save_run(again, tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text().partition("\n")[2]
    found = load_run(write(tmp_path / "again.csv", text), 2)
    assert found.samples.session.tolist() == [0, 0, 1, 1, 1]
    assert "a new session begins" in found.warnings[0]
    assert found.samples.pose.tolist() == POSE


def test_poses_in_passing_are_no_rests(tmp_path):
    t = np.arange(0, 20, 0.01)
    samples = path_samples(t)
    pose = np.where(np.arange(len(t)) % 200 < 20, np.arange(len(t)) // 200, -1)
    run = Run("p", Samples(q=samples.q, place=samples.place, t=t, pose=pose), Readings(length=np.ones(len(t))))
    save_run(run, tmp_path / "p.csv")
    text = (tmp_path / "p.csv").read_text().partition("\n")[2]
    back = load_run(write(tmp_path / "q.csv", text), 3)
    assert (len(back), back.continuous) == (2000, True)
