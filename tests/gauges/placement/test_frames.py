"""Tracker stations and targets, with and without orientation, against made-up truths turned in any way."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.common.errors import InputError, NoSolutionError
from planner.gauges.placement.frames import FrameProblem, PlacementFrames, place_frames
from planner.gauges.placement.solver import FlangePoses
from planner.kinematics.geometry import exp3, log3, small_log3
from tests.gauges.placement.arms import ARMS, ball_in, poses, turned

ERROR = 3e-3


class Truth:
    def __init__(self, seed, error=ERROR, outliers=0.04, n=40):
        rng = np.random.default_rng(seed)
        S, T = int(rng.integers(1, 4)), int(rng.integers(1, 3))
        n *= max(S, T)
        self.p, self.R = poses(rng, ARMS[seed % 2], n)
        self.place, self.point = np.arange(n) % S, rng.permutation(n) % T
        self.stand = FlangePoses(self.p, self.R, self.place, self.point)
        self.m = np.array([ball_in(rng, 0.0, 0.4) for _ in range(T)])
        self.A, self.t, self.F = turned(rng, S), rng.normal(size=(S, 3)), turned(rng, T)
        x = np.einsum("nij,nj->ni", self.R, self.m[self.point]) + self.p + error * rng.normal(size=(n, 3))
        self.y = np.einsum("nji,nj->ni", self.A[self.place], x - self.t[self.place])
        jitter = Rotation.from_rotvec(error * rng.normal(size=(n, 3))).as_matrix()
        self.Y = np.einsum("nji,njk,nkl->nil", self.A[self.place], self.R @ jitter, self.F[self.point])
        self.bad = rng.random(n) < outliers
        self.y[self.bad] += rng.choice([-1, 1], (self.bad.sum(), 3)) * rng.uniform(0.2, 0.8, (self.bad.sum(), 3))
        self.Y[self.bad] = turned(rng, n)[self.bad]

    def off(self, found):
        """Largest error of frames [m, rad], those of a station judged where the robot is."""
        middle = self.p.mean(axis=0)
        gap = [
            a @ (np.transpose(b) @ (middle - t)) + u - middle
            for a, b, t, u in zip(found.R_BG, self.A, self.t, found.p_BG, strict=True)
        ]
        turn = np.linalg.norm(log3(found.R_BG @ self.A.swapaxes(1, 2)), axis=1).max()
        return max(np.linalg.norm(gap, axis=1).max(), turn, np.linalg.norm(found.p_FM - self.m, axis=1).max())


@pytest.mark.long
def test_two_hundred_stations_turned_in_any_way_are_found_from_points():
    wrong = []
    for seed in range(200):
        truth = Truth(seed)
        found = place_frames(truth.stand, truth.y)
        if truth.off(found) > 3 * ERROR or not np.array_equal(found.outlier, truth.bad):
            wrong.append((seed, truth.off(found)))
    assert len(wrong) <= 2, wrong


@pytest.mark.long
def test_fifty_stations_and_probes_are_found_from_poses():
    wrong = []
    for seed in range(50):
        truth = Truth(seed)
        found = place_frames(truth.stand, truth.y, R_GM=truth.Y)
        probe = np.linalg.norm(log3(found.R_FM @ truth.F.swapaxes(1, 2)), axis=1).max()
        if max(truth.off(found), probe) > 3 * ERROR or not np.array_equal(found.outlier, truth.bad):
            wrong.append((seed, truth.off(found), probe))
    assert not wrong


@pytest.mark.parametrize("seed", range(5))
def test_an_exact_robot_is_placed_exactly(seed):
    truth = Truth(seed, error=0.0)
    assert truth.off(place_frames(truth.stand, truth.y)) < 1e-9
    found = place_frames(truth.stand, truth.y, R_GM=truth.Y)
    assert truth.off(found) < 1e-9
    assert pytest.approx(truth.F, abs=1e-9) == found.R_FM


def test_known_tool_points_are_held():
    truth = Truth(4)
    found = place_frames(truth.stand, truth.y, truth.m, R_GM=truth.Y)
    assert np.array_equal(found.p_FM, truth.m)
    assert truth.off(found) < 3 * ERROR
    p, R = truth.p[:9], truth.R[:9]
    found = place_frames(FlangePoses.of_one(p, R), p @ truth.A[0], p_FM=np.zeros((1, 3)))
    assert found.R_BG[0] == pytest.approx(truth.A[0], abs=1e-9)


def test_derivatives_agree_with_differences():
    truth = Truth(11, error=0.0, outliers=0.0, n=5)
    s = truth.stand
    free = np.ones(6 * s.n_places + 6 * s.n_points, dtype=bool)
    problem = FrameProblem(s, truth.y, truth.Y, free)
    state = PlacementFrames(truth.A[None], truth.t[None], truth.m[None], truth.F[None]).pack()
    _, J = problem.evaluate(state)
    for column, step in enumerate(1e-6 * np.eye(free.sum())):
        ahead, behind = (problem.evaluate(problem.advance(state, sign * step[None]))[0] for sign in (1, -1))
        assert (ahead - behind)[0] / 2e-6 == pytest.approx(J[0, ..., column], abs=1e-8)


def test_rotation_vectors_agree_with_scipy_up_to_half_a_turn():
    rng = np.random.default_rng(0)
    w = np.array([ball_in(rng, 0.0, np.pi) for _ in range(50)] + [[np.pi, 0, 0], [0, 0, 0], [1e-9, 0, 0]])
    assert exp3(w) == pytest.approx(Rotation.from_rotvec(w).as_matrix(), abs=1e-14)
    assert log3(exp3(w)) == pytest.approx(w, abs=1e-12)
    assert small_log3(exp3(w.reshape(-1, 3))) == pytest.approx(w.reshape(-1, 3), abs=1e-12)
    assert small_log3(exp3(w.reshape(-1, 3) / 9)) == pytest.approx(w.reshape(-1, 3) / 9, abs=1e-15)


def test_what_the_poses_leave_open_is_named():
    truth = Truth(2)
    still = np.broadcast_to(np.eye(3), truth.R.shape)
    with pytest.raises(NoSolutionError, match=r"position of gauge frame 1 and tool point 1.*about no axis"):
        place_frames(FlangePoses.of_one(truth.p, still), truth.p)
    about_z = Rotation.from_rotvec(np.linspace(-2, 2, len(still))[:, None] * [0, 0, 1.0]).as_matrix()
    with pytest.raises(NoSolutionError, match="about one axis only"):
        place_frames(FlangePoses.of_one(truth.p, about_z), truth.p + about_z @ [0.1, 0, 0.1])
    line = np.linspace(0, 1, len(still))[:, None] * [1.0, 0, 0]
    with pytest.raises(NoSolutionError, match="rotation of gauge frame 1"):
        place_frames(FlangePoses.of_one(line, still), line, p_FM=np.zeros((1, 3)))
    with pytest.raises(InputError, match="2 readings"):
        place_frames(FlangePoses.of_one(truth.p[:2], truth.R[:2]), truth.y[:2])


@pytest.mark.parametrize("seed", range(4))
def test_readings_shifted_by_a_row_are_named_and_no_further_poses_asked_for(seed):
    truth = Truth(seed, error=1e-4, outliers=0.0)
    with pytest.raises(NoSolutionError, match=r"do not belong to these \d+ poses.*exchanged or shifted"):
        place_frames(truth.stand, np.roll(truth.y, 1, axis=0))
