"""Time of planned tours against bounds that nothing can beat: ``python -m tests.motion.timing.bench_trajectory``.

T / speed: against ∫ ds / (largest ds/dt) under joint and tool speeds. T / acceleration: against the quickest motion
along the same path without a limit of jerk. stop-all: the same polyline with a stop at every point.
"""

import itertools
import time

import numpy as np

from planner.motion.timing.curve import Limits
from planner.motion.timing.trajectory import check_limits, plan_trajectory
from tests.motion.timing.arm import nj130
from tests.motion.timing.bound import acceleration_bound, largest_share, speed_bound

CASES = [(35, 1.0, 0.3, False), (35, 0.2, 0.3, False), (100, 0.05, 1.0, False), (200, 0.5, 1.0, True)]


def tour(rng, poses, reach, supports):
    """Return random poses (m, 6) about one posture, some legs with a support pose."""
    centre = np.array([0.3, 0.5, -0.3, 0.2, 1.2, 0.0])
    q = centre + reach * rng.uniform(-1, 1, (poses, 6)) * np.array([0.6, 0.4, 0.4, 1.2, 0.8, 1.5])
    out = [q[0]]
    for a, b in itertools.pairwise(q):
        if rng.random() < supports:
            out.append((a + b) / 2 + rng.normal(0, 0.15, 6) * reach)
        out.append(b)
    return np.array(out)


def main():
    arm = nj130()
    limits = Limits(arm.speed, arm.acceleration, arm.jerk)
    print("points reach  mm/min     T [s]  T/speed  T/accel  stop-all  CPU [s] use")
    for poses, reach, supports, back in CASES:
        q = tour(np.random.default_rng(1), poses, reach, supports)
        q = np.concatenate([q, q[::-1][1:]]) if back else q
        for tool_speed in (1 / 60, 0.25, np.inf):
            ask = {"blend_m": 0.01, "tool_speed": tool_speed, "limits": limits}
            ask |= {"tool_position": arm.position, "tool_jacobian": arm.jacobian}
            begin = time.process_time()
            mine = plan_trajectory(q, stop=np.zeros(len(q), dtype=bool), **ask)
            spent = time.process_time() - begin
            stopping = plan_trajectory(q, stop=np.ones(len(q), dtype=bool), **ask).duration_s
            by_speed = mine.duration_s / speed_bound(mine, arm, 100)
            by_acceleration = mine.duration_s / acceleration_bound(mine, arm, 40)
            use = largest_share(check_limits(mine, limits, 0.5))
            print(
                f"{len(q):6d} {reach:5.2f} {tool_speed * 6e4:7.0f} {mine.duration_s:9.2f} {by_speed:8.3f}"
                f" {by_acceleration:8.3f} {stopping:9.2f} {spent:8.2f} {use:.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
