"""The streams of every shipped cell keep the acceleration of the joints and the tool's speed, as they are followed."""

import numpy as np
import pytest

from planner.cell.cell import Cell
from planner.cell.reading import shipped_cells
from planner.common.errors import InputError
from planner.common.units import MM
from planner.motion.timing.leg_times import tool_speed
from planner.programs.controller_axes import axis_convention
from planner.programs.dialect import dialects
from planner.session.neutral_program import session_program, write_session
from planner.session.plan_types import Waypoints, time_course
from tests.programs.test_streams import STEP, follow, largest_share
from tests.shipped import shipped_cell

STREAMS = {d.name: d for d in dialects() if d.speed.stream}
CENTRED = ("kuka-kr6-r700/trical",)  # a routine of the controller centres its ball, which no stream can call


def _speaks(cell: str, dialect: str) -> bool:
    try:
        axis_convention(shipped_cell(cell).robot, STREAMS[dialect])
    except InputError:
        return False
    return cell not in CENTRED


PAIRS = [(cell, name) for cell in shipped_cells() for name in STREAMS if _speaks(cell, name)]


def test_the_cells_of_streaming_robots_are_among_them() -> None:
    assert {("panda/tracker", "ros2-trajectory"), ("so101/wire", "lerobot"), ("so101/sockets", "lerobot")} <= set(PAIRS)
    assert len(PAIRS) > 12


def _way(cell: Cell, seed: int) -> Waypoints:
    """To poses near home and back to the same point before each, by long legs and short ones."""
    rng = np.random.default_rng(seed)
    q = cell.home + rng.uniform(-1.0, 1.0, (4, cell.robot.n_joints)) * rng.choice([0.1, 0.4], (4, 1))
    beside = q + rng.uniform(-1.0, 1.0, q.shape) * rng.choice([0.02, 0.05], (4, 1))
    path = np.stack([beside, q, beside], axis=1).reshape(-1, q.shape[1])
    low, high = np.maximum(cell.robot.q_lower, -np.pi), np.minimum(cell.robot.q_upper, np.pi)
    blend = np.full(len(path), 5.0 * MM if cell.motion.is_continuous else 0.0)
    blend[[0, -1]] = 0.0
    visit = np.where(np.arange(len(path)) % 3 == 1, np.arange(len(path)) // 3, -1)
    return Waypoints(np.clip(path, low + 0.01, high - 0.01), visit, blend)


QUICK = (("panda/tracker", "ros2-trajectory"), ("so101/wire", "lerobot"))  # one of each language, a light arm


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "dialect"),
    [pytest.param(*pair, marks=() if pair in QUICK else pytest.mark.long) for pair in PAIRS],
)
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_followed_within_the_limits(name: str, dialect: str, seed: int) -> None:
    cell = shipped_cell(name)
    mounting = cell.mountings[0]
    measuring = _way(cell, seed)
    travel = Waypoints(np.vstack([cell.home, measuring.q[0]]), np.array([-1, -1]), np.zeros(2))
    course = time_course(cell, mounting, travel, measuring)
    program = session_program(cell, [course], "0123456789ab", STREAMS[dialect].path_form)
    files = write_session(cell, program, dialect, "s")
    limit = np.rad2deg(cell.robot.acceleration)
    assert largest_share(dialect, files, program.home_deg, limit) <= 1.0
    allowed, at = tool_speed(cell, bar=True), cell.at(mounting)
    for q in list(follow(dialect, files, program.home_deg))[1:-1]:
        speed = np.linalg.norm(np.diff(at.map_position(np.deg2rad(q)), axis=0), axis=1) / STEP[dialect]
        assert speed.max() <= 1.02 * allowed
