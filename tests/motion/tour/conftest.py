"""Poses to tour, tours by brute force, and a stand-in for Concorde."""

import itertools
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

SPEED = np.deg2rad([156.0, 156.0, 156.0, 330.0, 330.0, 420.0])  # [rad/s]


def slowest_axis_cost(q: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Costs (n, n) [s] of the legs between poses (n, N) when the slowest axis sets the pace (EDBB paper, eq. 7)."""
    return (np.abs(q[:, None] - q[None, :]) / speed).max(axis=2)


def leg_costs(n: int, seed: int, clusters: int = 0) -> np.ndarray:
    """Costs (n, n) [s] of uniform poses, or of poses in clusters a few degrees wide."""
    rng = np.random.default_rng(seed)
    low, high = np.deg2rad([-170, -120, -60, -180, -120, -180]), np.deg2rad([170, 60, 150, 180, 120, 180])
    q = rng.uniform(low, high, (n, 6))
    if clusters:
        q = q[rng.integers(clusters, size=n)] + rng.normal(0.0, np.deg2rad(6.0), (n, 6))
    return slowest_axis_cost(q, SPEED)


def driven(cost: np.ndarray, order: np.ndarray) -> float:
    """Cost of a closed order, leg by leg."""
    return float(sum(cost[a, b] for a, b in itertools.pairwise([*order, order[0]])))


def brute_force(cost, forbidden=()) -> float:
    """Cost of the best closed order of all, infinite if the forbidden legs leave none."""
    banned = {frozenset(leg) for leg in forbidden}
    best = np.inf
    for rest in itertools.permutations(range(1, len(cost))):
        legs = list(itertools.pairwise([0, *rest, 0]))
        if not any(frozenset(leg) in banned for leg in legs):
            best = min(best, sum(cost[leg] for leg in legs))
    return best


_STUB = """#!{python}
import signal, sys, time
if len(sys.argv) == 1:
    print("Usage: concorde [-see below-] [dat_file]")
    print("   -C #  maximum chunk size in localcuts (default 16)", file=sys.stderr)
    sys.exit(1)
assert sys.argv[1] == "-s" and sys.argv[3] == "-o" and len(sys.argv) == 6, sys.argv
text = open(sys.argv[5]).read()
rows = text.split("EDGE_WEIGHT_SECTION")[1].split("EOF")[0].strip().splitlines()
cost = [[int(word) for word in row.split()] for row in rows]
n = len(cost)
assert "DIMENSION: %d" % n in text and n >= 4 and max(map(max, cost)) < 2**31
{behaviour}
"""

_WRITE = """
open(sys.argv[4], "w").write("%d\\n" % n + " ".join(map(str, tour)))
length = sum(cost[a][b] for a, b in zip(tour, tour[1:] + tour[:1]))
print("Optimal Solution: %.2f" % length)
"""

BEHAVIOURS = {
    "crash": "sys.exit(139)",
    "sleeping crash": "print('FATAL ERROR - received signal SIGSEGV (11)', flush=True)\ntime.sleep(3600)",
    "hang": "signal.signal(signal.SIGTERM, lambda *_: time.sleep(3600))\ntime.sleep(3600)",
    "hanging child": "import subprocess\nsubprocess.Popen(['sleep', '3600'])\nsignal.pause()",
    "no solution": "print('Optimal Solution: 1.00')",
    "rubbish": "open(sys.argv[4], 'wb').write(bytes(range(256)))\nprint('Optimal Solution: 1.00')",
    "not a permutation": "tour = [0] * n" + _WRITE,
    "another cost": "tour = list(range(n))" + _WRITE.replace("% length", "% (length + 7)"),
    "a poor tour": "tour = list(range(n))" + _WRITE,
}


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Put a stand-in for Concorde where EDBB_CONCORDE points to."""

    def place(behaviour: str, identity: bool = True) -> Path:
        program = tmp_path / "concorde"
        text = _STUB.replace("{python}", sys.executable).replace("{behaviour}", behaviour)
        program.write_text(text if identity else text.replace("localcuts", "pages"))
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("EDBB_CONCORDE", str(program))
        return program

    return place


def solving(order: list[int]) -> str:
    """Behaviour of a stand-in that knows the optimal cycle."""
    return f"tour = {list(map(int, order))!r}" + _WRITE
