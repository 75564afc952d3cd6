"""The lazy graph against plain searches of the true graph; OMPL is silent, seeded and does as it is told."""

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from planner.common.progress import UNLIMITED
from planner.common.units import Array
from planner.motion.path.connection import cut_corners, pull_supports
from planner.motion.path.constraints import Constraints
from planner.motion.path.ompl_planners import join_by_prm, rrt_connect
from planner.motion.path.roadmap import LazyGraph, Roadmap, leg_time
from planner.motion.tolerances import SUPPORT_COST
from tests.motion.path.poses import cell_and_world, dense, valid_poses
from tests.processors import with_threads


class Discs:
    """Stands in for the constraints of a robot: straight motions in the plane that pass through no disc."""

    cell = SimpleNamespace(robot=SimpleNamespace(speed=np.ones(2), q_lower=-np.ones(2), q_upper=2 * np.ones(2)))
    limit = UNLIMITED

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.centre, self.radius, self.proven = rng.random((30, 2)), 0.06, 0

    def driven_times(self, q_from: Array, q_to: Array) -> Array:
        return np.asarray(np.abs(q_to - q_from).max(axis=1))

    def valid(self, q: Array) -> np.ndarray:
        return np.asarray(np.linalg.norm(q[:, None] - self.centre, axis=2).min(axis=1) > self.radius)

    def prove(self, q_from: Array, q_to: Array) -> SimpleNamespace:
        self.proven += len(q_from)
        step = q_to - q_from
        s = (
            np.einsum("cmi,mi->mc", self.centre[:, None] - q_from, step)
            / np.maximum((step**2).sum(axis=1), 1e-12)[:, None]
        )
        foot = q_from[:, None] + np.clip(s, 0, 1)[..., None] * step[:, None]
        return SimpleNamespace(proven=np.linalg.norm(foot - self.centre, axis=2).min(axis=1) > self.radius)


def disc_graph(seed: int) -> tuple[Discs, LazyGraph, csr_array]:
    """A lazy graph and the true one, all edges proven."""
    discs = Discs()
    q = np.random.default_rng(seed).random((300, 2))
    q = q[discs.valid(q)]
    edges = cKDTree(q).query_pairs(0.15, output_type="ndarray")
    graph = LazyGraph(discs, q, edges)  # type: ignore[arg-type]
    a, b = graph.edges.T
    good = discs.prove(q[a], q[b]).proven
    discs.proven = 0
    return discs, graph, csr_array((graph.cost[good], (a[good], b[good])), shape=(len(q),) * 2)


def test_lazy_ways_are_the_shortest_of_the_true_graph() -> None:
    for seed in range(5):
        discs, graph, truth = disc_graph(seed)
        wanted = np.random.default_rng(seed).integers(len(graph.q), size=(12, 2))
        wanted = wanted[wanted[:, 0] != wanted[:, 1]]
        length = dijkstra(truth, directed=False, indices=wanted[:, 0])[np.arange(len(wanted)), wanted[:, 1]]
        for way, want, best in zip(graph.paths(wanted, 1000), wanted, length, strict=True):
            if way is None:
                assert np.isinf(best)
            else:
                assert [way[0], way[-1]] == want.tolist()
                cost = leg_time(graph.constraints, graph.q[way[:-1]], graph.q[way[1:]]) + SUPPORT_COST
                np.testing.assert_allclose(cost.sum(), best, rtol=1e-12)
        assert discs.proven < len(graph.edges)


def test_parts_are_those_of_the_true_graph() -> None:
    for seed in range(5):
        discs, graph, truth = disc_graph(seed)
        part, true = graph.parts(), connected_components(truth, directed=False)[1]
        assert len(set(zip(part.tolist(), true.tolist(), strict=True))) == part.max() + 1 == true.max() + 1
        assert (np.diff(np.bincount(part)) <= 0).all()
        assert discs.proven < 0.7 * len(graph.edges)


def test_roadmap_joins_every_state_to_its_nearest_earlier_ones() -> None:
    points = np.random.default_rng(1).random((200, 3))
    edges = join_by_prm(points, 5)
    joined = {frozenset(e) for e in edges.tolist()}
    for k in range(10, 200):
        nearest = np.argsort(np.linalg.norm(points[:k] - points[k], axis=1))[:5]
        assert {frozenset((k, int(n))) for n in nearest} <= joined


def test_rrt_connect_goes_round_discs_and_stops_when_told() -> None:
    discs = Discs()
    q = np.random.default_rng(4).random((40, 2))
    q = q[discs.valid(q)]
    for a, b in zip(q[0:10:2], q[1:10:2], strict=True):
        way = rrt_connect(discs, a, b, np.zeros(2), np.ones(2), 2000, seed=1)  # type: ignore[arg-type]
        assert way is not None
        np.testing.assert_allclose(way[[0, -1]], [a, b], atol=1e-12)
        assert discs.prove(way[:-1], way[1:]).proven.all()
    blocked = SimpleNamespace(cell=Discs.cell, valid=lambda states: np.zeros(len(states), bool))
    assert rrt_connect(blocked, q[0], q[1], np.zeros(2), np.ones(2), 50, seed=1) is None  # type: ignore[arg-type]


def test_bridges_of_rrt_connect_join_parts_of_the_roadmap() -> None:
    discs = Discs()
    rng = np.random.default_rng(6)
    left, right = rng.random((30, 2)) * [0.25, 1.0], rng.random((30, 2)) * [0.25, 1.0] + [0.75, 0.0]
    left, right = left[discs.valid(left)], right[discs.valid(right)]
    q = np.stack([left[0], right[0]])
    edges = np.vstack([join_by_prm(left, 4), len(left) + join_by_prm(right, 4)])
    graph = LazyGraph(discs, np.concatenate([left, right]), edges)  # type: ignore[arg-type]
    roadmap = Roadmap(discs, graph, np.array([0, len(left)]), seed=5)  # type: ignore[arg-type]
    assert roadmap.parts()[0] != roadmap.parts()[1]
    way = roadmap.paths(np.array([[0, 1]]))[0]
    assert way is not None
    np.testing.assert_array_equal(way[[0, -1]], q)
    assert discs.prove(way[:-1], way[1:]).proven.all()
    assert roadmap.parts()[0] == roadmap.parts()[1]


def test_shortening_keeps_the_ends_and_the_proof() -> None:
    discs, graph, _ = disc_graph(1)
    wanted = np.array([[0, 150], [3, 120], [20, 200]])
    ways = [graph.q[w] for w in graph.paths(wanted, 1000) if w]
    assert len(ways) >= 2

    def cost(way: Array) -> float:
        return float((leg_time(graph.constraints, way[:-1], way[1:]) + SUPPORT_COST).sum())

    short = cut_corners(graph.constraints, ways)
    pulled = pull_supports(graph.constraints, short, np.random.default_rng(0), 6)
    for before, between, after in zip(ways, short, pulled, strict=True):
        np.testing.assert_array_equal(before[[0, -1]], after[[0, -1]])
        assert discs.prove(after[:-1], after[1:]).proven.all()
        assert cost(after) <= cost(between) <= cost(before)
    assert sum(map(cost, pulled)) < 0.99 * sum(map(cost, ways))


SCRIPT = """
import hashlib
import numpy as np
from planner.motion.path.connection import connect_poses
from planner.motion.path.constraints import Constraints
from planner.motion.path.roadmap import Roadmap
from planner.motion.path.verdict import PathGaps
from tests.motion.path.poses import cell_and_world, valid_poses
cell, world = cell_and_world()
q = valid_poses(250)
constraints = Constraints(cell, scene=world.scene)
found = connect_poses(constraints, q[:8], [*range(8), 0], seed=3, pool=q[8:])
text = repr(found) if isinstance(found, PathGaps) else ""
states = b"" if text else found.q.tobytes()
roadmap = Roadmap.grow(constraints, q[:2], q[8:], 1)
roadmap._rrt(q[0], q[1])
with open({path!r}, "w") as out:
    out.write(text + hashlib.sha256(states).hexdigest() + hashlib.sha256(roadmap.parts().tobytes()).hexdigest())
"""


@pytest.mark.long
def test_joining_is_silent_and_the_same_on_any_number_of_threads(tmp_path: os.PathLike[str]) -> None:
    answers = []
    for threads in "12":
        path = os.path.join(tmp_path, threads)
        script = [sys.executable, "-c", SCRIPT.format(path=path)]
        run = subprocess.run(script, capture_output=True, check=False, **with_threads(threads))
        assert (run.returncode, run.stdout, run.stderr) == (0, b"", b"")
        with open(path) as answer:
            answers.append(answer.read())
    assert answers[0] == answers[1]


@pytest.mark.slow
def test_an_error_inside_a_callback_leaves_ompl_silent() -> None:
    code = (
        "import numpy as np\n"
        "from types import SimpleNamespace\n"
        "from planner.motion.path.ompl_planners import rrt_connect\n"
        "def broken(q):\n    raise ZeroDivisionError\n"
        "stub = SimpleNamespace(cell=SimpleNamespace(robot=SimpleNamespace(speed=np.ones(2))), valid=broken)\n"
        "try:\n    rrt_connect(stub, np.zeros(2), np.ones(2), np.zeros(2), np.ones(2), 9, 1)\n"
        "except ZeroDivisionError:\n    print('caught')\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "caught\n", "")


@pytest.mark.slow
def test_what_rrt_connect_finds_for_the_robot_is_proven() -> None:
    cell, world = cell_and_world()
    constraints = Constraints(cell, scene=world.scene)
    q = valid_poses(500)
    ways = [rrt_connect(constraints, q[k], q[k + 1], q.min(axis=0), q.max(axis=0), 60, 2) for k in range(0, 60, 2)]
    found = [w for w in ways if w is not None]
    assert found
    for way in found:
        assert constraints.prove(way[:-1], way[1:]).proven.all()
        assert constraints.valid(dense(way[:-1], way[1:], 50)).all()
