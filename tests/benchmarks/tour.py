"""How long the proof of a tour takes: ``python -m tests.benchmarks.tour [--quick]``.

Random and clustered joint poses of a six-axis arm, slowest-axis cost, home at both ends. Beside each: what visiting
the nearest pose next costs, and what fast-tsp finds in a second where it is installed.
"""

import argparse
import time
from importlib import import_module
from importlib.util import find_spec

import numpy as np

from planner.common.units import Array
from planner.motion.tour.solve import Tour, solve_tour
from tests.motion.tour.conftest import slowest_axis_cost

SPEED = np.deg2rad([156.0, 156.0, 156.0, 330.0, 330.0, 420.0])  # [rad/s] of the KR 6 class, rounded
LOW, HIGH = np.deg2rad([-170, -120, -60, -180, -120, -180]), np.deg2rad([170, 60, 150, 180, 120, 180])
KINDS = ("random", "clustered", "one axis")


def leg_costs(kind: str, n: int, seed: int) -> Array:
    """Return (n, n) [s]; clusters hold about 20 poses within 6 deg (one sigma), "one axis" moves mostly the first."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(LOW, HIGH, (n, 6))
    if kind == "clustered":
        q = q[rng.integers(max(3, n // 20), size=n)] + rng.normal(0.0, np.deg2rad(6.0), (n, 6))
    elif kind == "one axis":
        q[:, 1:] *= 0.1
    return slowest_axis_cost(q, SPEED)


def closed_cost(cost: Array, order: list[int]) -> float:
    """Return the cost of a closed order [s]."""
    return float(cost[order, np.roll(order, -1)].sum())


def nearest_next(cost: Array) -> float:
    """Return the cost of always going to the nearest pose not yet visited [s]."""
    order, left = [0], np.ones(len(cost), dtype=bool)
    while len(order) < len(cost):
        left[order[-1]] = False
        order.append(int(np.where(left, cost[order[-1]], np.inf).argmin()))
    return closed_cost(cost, order)


def fast_tsp(cost: Array) -> str:
    """Return how far fast-tsp's tour of one second costs above nothing [s], or a dash."""
    if find_spec("fast_tsp") is None:
        return "-"
    whole = np.rint(cost / cost.max() * 60_000 / 4).astype(int)
    return f"{closed_cost(cost, import_module('fast_tsp').find_tour(whole.tolist(), 1.0)):.4f}"


def row(kind: str, n: int, seed: int) -> tuple[Tour, str]:
    """Solve one instance and return its line of the table."""
    cost = leg_costs(kind, n, seed)
    wall, cpu = time.perf_counter(), time.process_time()
    tour = solve_tour(cost, method="exact")
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    rivals = f"{nearest_next(cost):9.4f} {fast_tsp(cost):>9}"
    verdict = "proven" if tour.optimal else f"gap {100 * (tour.cost_s / tour.lower_bound_s - 1):.3f} %"
    line = f"{kind:10} {n:4d} {seed:4d} {wall:7.2f} {cpu:7.2f}  {verdict:12} {tour.unsorted_s:9.3f} "
    return tour, line + f"{tour.cost_s:9.4f} {tour.lower_bound_s:9.4f} {rivals}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="35 to 100 poses only")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--sizes", type=int, nargs="*")
    options = parser.parse_args()
    sizes = options.sizes or ([35, 80, 100] if options.quick else [35, 80, 100, 200, 500])
    print("poses         n seed  wall_s   cpu_s  verdict      unsorted_s    cost_s   bound_s nearest_s fast-tsp_s")
    for n in sizes:
        for kind in KINDS:
            for seed in range(options.seeds if n < 500 else 1):
                print(row(kind, n, seed)[1], flush=True)


if __name__ == "__main__":
    main()
