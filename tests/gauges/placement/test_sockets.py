"""Plates of sockets and the point that sits in them, against made-up truths."""

import numpy as np
import pytest

from planner.gauges.placement.frames import place_sockets
from planner.gauges.placement.solver import FlangePoses
from tests.gauges.placement.arms import ARMS, ball_in, poses, turned

ERROR = 3e-3
PLATE = np.array([[0.0, 0, 0], [0.3, 0, 0], [0.1, 0.25, 0], [0.05, 0.1, 0.2]])


class Truth:
    def __init__(self, seed, plate, S=2, n=60, error=ERROR, offsets=0.0):
        rng = np.random.default_rng(seed)
        self.plate = plate
        self.place, self.ball = np.arange(n * S) // n, np.arange(n * S) % len(plate)
        self.point = np.zeros(n * S, int)
        self.m, self.A = ball_in(rng, 0.05, 0.3), turned(rng, S)
        self.t = np.array([ball_in(rng, 0.4, 0.6) for _ in range(S)])
        self.offset = rng.normal(size=(n * S, 3)) * offsets
        self.X = np.einsum("sij,kj->ski", self.A, plate) + self.t[:, None]
        _, self.R = poses(rng, ARMS[seed % 2], n * S)
        x = self.X[self.place, self.ball] + np.einsum("nij,nj->ni", self.A[self.place], self.offset)
        self.p = x - self.R @ self.m + error * rng.normal(size=(n * S, 3))
        self.rng = rng

    def rows(self):
        return FlangePoses(self.p, self.R, self.place, self.point), self.ball

    def off(self, found):
        X = np.einsum("sij,kj->ski", found.R_BP, self.plate) + found.p_BP[:, None]
        return max(np.abs(X - self.X).max(), np.abs(found.p_FM[0] - self.m).max())


@pytest.mark.long
@pytest.mark.parametrize("balls", [1, 2, 4])
def test_plates_are_found_in_two_hundred_runs(balls):
    wrong = []
    for seed in range(70):
        truth = Truth(seed, PLATE[:balls])
        bad = truth.rng.choice(len(truth.p), 4, replace=False)
        truth.p[bad] += 0.3
        found = place_sockets(*truth.rows(), p_PS=PLATE[:balls])
        if truth.off(found) > 2 * ERROR:
            wrong.append((seed, truth.off(found)))
    assert not wrong


def test_the_turn_that_two_sockets_leave_open_is_the_least():
    truth = Truth(1, PLATE[:2], error=0.0)
    found = place_sockets(*truth.rows(), p_PS=PLATE[:2])
    for R, A in zip(found.R_BP, truth.A, strict=True):
        assert R[:, 0] == pytest.approx(A[:, 0], abs=1e-9)
        least = np.arccos(A[0, 0])  # from the plate's x axis to where it points, no turn about it
        assert np.arccos((np.trace(R) - 1) / 2) == pytest.approx(least, abs=1e-6)
    one = place_sockets(*Truth(1, PLATE[:1], error=0.0).rows(), p_PS=PLATE[:1])
    assert pytest.approx(np.broadcast_to(np.eye(3), (2, 3, 3)), abs=1e-9) == one.R_BP


def test_offsets_are_in_the_plates_axes():
    truth = Truth(3, PLATE, error=0.0, offsets=2e-3)
    assert truth.off(place_sockets(*truth.rows(), p_PS=PLATE, offset=truth.offset)) < 1e-9
    assert truth.off(place_sockets(*truth.rows(), p_PS=PLATE)) > 1e-5


def test_a_wrist_that_never_turned_gives_the_shortest_tool():
    truth = Truth(4, PLATE, S=1, error=0.0)
    R = np.broadcast_to(np.eye(3), truth.R.shape)
    p = truth.X[truth.place, truth.ball] - truth.m
    found = place_sockets(FlangePoses(p, R, truth.place, truth.point), truth.ball, p_PS=PLATE)
    assert found.p_FM[0] == pytest.approx(0.0, abs=1e-9)


def test_a_known_tool_is_held():
    truth = Truth(5, PLATE)
    found = place_sockets(*truth.rows(), p_PS=PLATE, p_FM=truth.m[None])
    assert np.array_equal(found.p_FM[0], truth.m)
    assert truth.off(found) < 2 * ERROR
