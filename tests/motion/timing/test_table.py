import csv
import io

import numpy as np
import pytest

from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import plan_trajectory, trajectory_csv, trajectory_table
from tests.motion.timing.arm import nj130

ARM = nj130()


@pytest.fixture(scope="module")
def trajectory():
    q = np.array([[0.0] * 6, [0.2, -0.1, 0.3, 0.0, 0.1, -0.4], [-0.1, 0.2, 0.1, 0.3, 0.0, 0.2]])
    limits = Limits(ARM.speed, ARM.acceleration, ARM.jerk)
    return plan_trajectory(
        q,
        stop=[True, False, True],
        blend_m=0.01,
        tool_position=ARM.position,
        tool_jacobian=ARM.jacobian,
        limits=limits,
        tool_speed=0.5,
        dwell=0.25,
    )


def length(q):
    return np.linalg.norm(ARM.position(q) - [0.3, 1.4, 0.7], axis=1)


def test_rows_are_the_trajectory_in_degrees_and_millimetres(trajectory):
    frame = trajectory_table(trajectory, 0.01, length)
    assert frame.columns == ["t_s", *(f"q{j}_deg" for j in range(1, 7)), "length_mm"]
    t = frame["t_s"].to_numpy()
    assert np.all(np.diff(t) > 0.0)
    assert t[0] == 0.0
    assert t[-1] == pytest.approx(trajectory.duration_s, abs=1e-6)
    state = trajectory.at(t)
    q = frame.select([f"q{j}_deg" for j in range(1, 7)]).to_numpy()
    assert np.abs(q - np.degrees(state.q)).max() <= 1e-3
    assert np.abs(frame["length_mm"].to_numpy() - 1000.0 * length(np.radians(q))).max() <= 1e-4


def test_text_has_six_decimals_throughout_and_no_negative_zero(trajectory):
    text = trajectory_csv(trajectory_table(trajectory, 0.05, length))
    rows = list(csv.reader(io.StringIO(text)))
    assert all(len(cell.split(".")[1]) == 6 for row in rows[1:] for cell in row)
    assert "-0.000000" not in text
    assert text == trajectory_csv(trajectory_table(trajectory, 0.05, length))
