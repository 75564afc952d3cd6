"""Who makes the support poses: ``python -m tests.benchmarks.supports [CELL …] [--seeds 2] [--poses 30]``.

On every shipped cell of a bar, a wire or sockets the same poses in the same order are joined over

- own: the planner's roadmap, whose edges are proven when a way uses them, and RRT-Connect where it falls apart;
- LazyPRM: the same with milestones and edges from OMPL's PRM, grown without proofs;
- PRM: OMPL's PRM with a tenth of the milestones, each edge proven by our proof as it grows;
- RRT-Connect: OMPL's, leg by leg.

What comes after (leaving supports out, pulling them in, both judges, blends, timing) is the same. Printed are the legs
that are not straight, processor seconds of joining, supports, driven seconds, and both ratios to the own roadmap; last
the sums, and the lines of code that make the roadmap. OMPL 2.0.1's Python binding has no LazyPRM, and ``PRM.solve``
looks for ways in a second thread against the clock: here the PRM is grown by a count of milestones.
"""

import argparse
import ast
import inspect
import textwrap
import time
from dataclasses import dataclass, replace
from functools import partial
from unittest import mock

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from scipy.spatial import cKDTree

import planner.motion.path.connection as connection
import planner.motion.path.roadmap as roadmap_module
from planner.cell.reading import load_cell, shipped_cells
from planner.common.progress import UNLIMITED, Stages
from planner.motion.path.roadmap import BOX_MARGIN, MILESTONES, NEIGHBOURS, LazyGraph, Roadmap, rrt_connect
from planner.motion.path.verdict import ProvenPath
from planner.motion.tour.solve import solve_tour
from planner.session.course import time_measuring
from planner.session.options import PlanOptions
from planner.session.release import add_blends
from planner.session.tour_cost import tour_costs
from planner.workflow.planning import pose_session

CANDIDATES, PROOF_NODES = 10_000, 1_000
GAUGES = ("edbb", "draw-wire", "ball-socket")
EAGER_MILESTONES = (
    200  # every edge costs a proof of its own: with 2 000 a cell took 111 s where the own roadmap took 0.9
)
RRT_ITERATIONS = 300


class GivenStates(ob.ValidStateSampler):
    """Hands OMPL the poses and the states of the pool, one after the other."""

    def __init__(self, info, states):
        super().__init__(info)
        self.states = iter(states.tolist())

    def sample(self, state):
        """Fill the state with the next one."""
        values = next(self.states, None)
        if values is None:
            return False
        for i, value in enumerate(values):
            state[i] = value
        return True


def grow_prm(constraints, states, seed, good):
    """States (V, N) [rad] and edges (E, 2) of OMPL's PRM, where ``good`` judges a motion between two states."""
    speed = constraints.cell.robot.speed
    info = roadmap_module._space(states.min(axis=0) / speed, states.max(axis=0) / speed, seed)
    validator = roadmap_module._motion_validator(info, lambda a, b: good(a * speed, b * speed), len(speed))
    info.setMotionValidator(validator)
    info.setValidStateSamplerAllocator(lambda i: GivenStates(i, states / speed))
    info.setup()
    prm = og.PRM(info)
    prm.setProblemDefinition(ob.ProblemDefinition(info))
    prm.setMaxNearestNeighbors(NEIGHBOURS)
    prm.setup()
    prm.growRoadmapPtc(ob.PlannerTerminationCondition(lambda: bool(prm.milestoneCount() >= len(states))))
    data = ob.PlannerData(info)
    prm.getPlannerData(data)
    count = range(data.numVertices())
    found = np.array([[data.getVertex(k).getState()[i] for i in range(len(speed))] for k in count]) * speed
    edges = np.array([(k, m) for k in count for m in data.getEdges(k)], dtype=int).reshape(-1, 2)
    own = cKDTree(found / speed).query(states / speed)[1]  # OMPL numbers its milestones as it likes
    found[own] = states
    return found, edges, own


@dataclass
class LazyPrm(Roadmap):
    """OMPL's PRM grown without proofs; its edges are proven when a way uses them, as a LazyPRM does."""

    @classmethod
    def grow(cls, constraints, q, pool, seed):
        states, place = draw_milestones(q, pool, seed, MILESTONES)
        found, edges, own = grow_prm(constraints, states, seed, lambda a, b: True)
        return cls(constraints, LazyGraph(constraints, found, edges), own[place], seed)


@dataclass
class EagerPrm(Roadmap):
    """OMPL's PRM, every edge proven as it grows."""

    @classmethod
    def grow(cls, constraints, q, pool, seed):
        states, place = draw_milestones(q, pool, seed, EAGER_MILESTONES)
        good = partial(roadmap_module._is_proven, constraints)
        found, edges, own = grow_prm(constraints, states, seed, good)
        graph = LazyGraph(constraints, found, edges)
        graph.known[:] = roadmap_module.Known.PROVEN
        return cls(constraints, graph, own[place], seed)


def draw_milestones(q, pool, seed, most):
    """Poses and at most so many states of the pool, and which of them the poses are."""
    rows = np.random.default_rng(seed).permutation(len(pool))[:most]
    states, place = np.unique(np.concatenate([q, pool[rows]]), axis=0, return_inverse=True)
    return states, place[: len(q)]


@dataclass
class RrtOnly(Roadmap):
    """OMPL's RRT-Connect for every leg by itself."""

    @classmethod
    def grow(cls, constraints, q, pool, seed):
        return cls(
            constraints,
            LazyGraph(constraints, np.concatenate([q, pool]), np.zeros((0, 2), int)),
            np.arange(len(q)),
            seed,
        )

    def parts(self):
        return np.zeros(len(self.place), int)

    def paths(self, legs):
        robot = self.constraints.cell.robot
        low = np.maximum(self.graph.q.min(axis=0) - BOX_MARGIN, robot.q_lower)
        high = np.minimum(self.graph.q.max(axis=0) + BOX_MARGIN, robot.q_upper)
        q = self.graph.q
        connect = roadmap_module.rrt_connect
        return [connect(self.constraints, q[a], q[b], low, high, RRT_ITERATIONS, self.seed) for a, b in legs]


KINDS = {"own": Roadmap, "LazyPRM": LazyPrm, "PRM": EagerPrm, "RRT-Connect": RrtOnly}


def is_meant(cell):
    """Tell whether poses of a bar, a wire or sockets are planned there."""
    return cell.gauge.kind in GAUGES and not cell.is_under_load


def prepare(name, poses, seed):
    """Places of a cell with their nodes and the order of the tour."""
    cell = load_cell(name)
    cell = replace(cell, plan=replace(cell.plan, candidates=CANDIDATES, refine=False))
    session = pose_session(cell, PlanOptions(poses=poses, seed=seed, aim="index"))
    session.draw(Stages())
    chosen = session.select(Stages())
    with chosen.curve:
        choice = session.refine(chosen, Stages())
    for place in session.places(UNLIMITED):
        mine = np.flatnonzero(choice.samples.at_mounting(place.mounting))
        nodes = np.array([place.mount, *(session.stop(choice, int(k)).node for k in mine)])
        tour = solve_tour(tour_costs(place.cell, place.mounting, nodes), nodes=PROOF_NODES)
        yield place, nodes, [*(int(k) for k in tour.order), 0]


@dataclass(frozen=True)
class Joined:
    """How one tour was joined."""

    seconds: float
    bridges: int
    bent: int = 0
    supports: int = 0
    driven: float = np.nan
    lost: int = 0


def join(place, nodes, order, kind, seed):
    """Join one tour by one kind."""
    place.measuring._proofs.clear()
    begun = time.process_time()
    with (
        mock.patch.object(connection, "Roadmap", kind),
        mock.patch.object(roadmap_module, "rrt_connect", wraps=rrt_connect) as bridging,
    ):
        pool = place.detours.graph.q if isinstance(place.detours, Roadmap) else place.detours
        path = connection.connect_poses(place.measuring, nodes, order, seed=seed, pool=pool)
    seconds, bridges = time.process_time() - begun, bridging.call_count
    if not isinstance(path, ProvenPath):
        return Joined(seconds, bridges, lost=len(path.failed))
    bent, supports = sum(not leg.direct for leg in path.legs), int((path.node < 0).sum())
    cell = place.cell
    rests = path.node == 0 if cell.motion.is_continuous else path.node >= 0
    ids = np.where(path.node >= 0, np.arange(len(path.node)), -1)
    points = add_blends(place.measuring, path, rests, ids)
    driven = time_measuring(cell, points, place.mounting).trajectory.duration_s
    return Joined(seconds, bridges, bent, supports, driven)


def count_lines(*parts):
    """Lines of code of functions and classes, without blank ones, comments and docstrings."""
    total = 0
    for part in parts:
        tree = ast.parse(textwrap.dedent(inspect.getsource(part)))
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node) is not None:
                node.body = node.body[1:] or [ast.Pass()]
        total += len(ast.unparse(tree).splitlines())
    return total


def print_sums(rows):
    """Sums over all rows that every kind but RRT-Connect has joined, and lines of code."""
    lines = {
        "own": count_lines(Roadmap.grow, roadmap_module.join_to_earlier),
        "LazyPRM": count_lines(LazyPrm.grow, draw_milestones, GivenStates, grow_prm),
        "PRM": count_lines(EagerPrm.grow, draw_milestones, GivenStates, grow_prm),
    }
    for kind, got in rows.items():
        done = [(mine, own) for mine, own in zip(got, rows["own"], strict=True) if not mine.lost and not own.lost]
        mine, own = (
            np.sum([(g.seconds, g.driven, g.supports) for g in each], axis=0) for each in zip(*done, strict=True)
        )
        print(
            f"{kind}: {len(done)} of {len(got)} tours joined, in {mine[0] / own[0]:.2f} times the own roadmap's "
            f"seconds, driven in {mine[1] / own[1]:.2f} times, {mine[2]:.0f} supports against {own[2]:.0f}, "
            f"{sum(g.bridges for g in got)} calls of RRT-Connect" + (f", {lines[kind]} lines" if kind in lines else "")
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", nargs="*")
    parser.add_argument("--poses", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS), help="the own roadmap first")
    asked = parser.parse_args()
    names = asked.cells or [n for n in shipped_cells() if is_meant(load_cell(n))]
    print(
        "| cell | seed | kind | legs not straight | joined in (s) | ratio | supports | RRT calls | driven (s) | ratio |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    rows = {kind: [] for kind in asked.kinds}
    for name in names:
        for seed in range(asked.seeds):
            for place, nodes, order in prepare(name, asked.poses, seed):
                own = None
                for kind in asked.kinds:
                    got = join(place, nodes, order, KINDS[kind], seed)
                    own = own or got
                    rows[kind].append(got)
                    end = f"{got.driven:.0f} | {got.driven / own.driven:.2f}"
                    end = f"{got.lost} legs without a way | –" if got.lost else end
                    head = (
                        f"| {name} | {seed} | {kind} | {got.bent} | {got.seconds:.2f} | {got.seconds / own.seconds:.2f}"
                    )
                    print(f"{head} | {got.supports} | {got.bridges} | {end} |", flush=True)
    print_sums(rows)


if __name__ == "__main__":
    main()
