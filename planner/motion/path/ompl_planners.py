"""OMPL's planners over the planner's own checks: PRM joins milestones, RRT-Connect bridges parts of a roadmap."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from planner.common.units import Array
from planner.motion.path.constraints import Constraints
from planner.motion.planning_packages import ob, og, ou


def join_by_prm(points: Array, count: int) -> np.ndarray:
    """Join points (V, N) by OMPL's PRM, each to the nearest ``count`` of those before it; edges (E, 2), ascending.

    The points are the milestones, in their order. Motions are not checked here: they are proven when a path uses them
    (Bohlin and Kavraki 2000).
    """
    if len(points) < 2:  # a PRM of one milestone has no edge
        return np.zeros((0, 2), dtype=int)
    space = _box(points.min(axis=0), points.max(axis=0))
    space.setLongestValidSegmentFraction(0.999)  # OMPL looks at the end of a motion alone, which counts as valid
    info = ob.SpaceInformation(space)
    info.setValidStateSamplerAllocator(lambda i: _given_states(i, points))
    info.setup()
    prm = og.PRM(info)
    prm.setProblemDefinition(ob.ProblemDefinition(info))
    prm.setMaxNearestNeighbors(count)
    prm.setup()
    prm.growRoadmapPtc(ob.PlannerTerminationCondition(lambda: bool(prm.milestoneCount() >= len(points))))
    data = ob.PlannerData(info)
    prm.getPlannerData(data)
    numbers = range(data.numVertices())
    found = np.array([[data.getVertex(k).getState()[i] for i in range(points.shape[1])] for k in numbers])
    own = cKDTree(points).query(found)[1]  # OMPL numbers its milestones as it likes
    edges = np.array([(k, m) for k in numbers for m in data.getEdges(k)], dtype=int).reshape(-1, 2)
    return np.asarray(np.unique(np.sort(own[edges], axis=1), axis=0))


def _given_states(info: Any, states: Array) -> Any:
    """Return a sampler that hands OMPL the states (V, N), one after the other."""
    left = iter(states.tolist())

    class GivenStates(ob.ValidStateSampler):  # type: ignore[misc]
        """Hands out states that are known to be valid."""

        def sample(self, state: Any) -> bool:
            """Fill the state with the next one; tell whether there was one."""
            values = next(left, None)
            for i, value in enumerate(values or ()):
                state[i] = value
            return values is not None

    return GivenStates(info)


def rrt_connect(
    constraints: Constraints, q_from: Array, q_to: Array, low: Array, high: Array, iterations: int, seed: int
) -> Array | None:
    """Return a proven path (k, N) [rad] found by RRT-Connect between two states (N,), both included, or ``None``.

    Args:
        constraints: what states and motions must keep.
        q_from, q_to: the states to join [rad].
        low, high: box to draw from, (N,) [rad].
        iterations: draws at most.
        seed: of OMPL's generator.
    """
    speed = constraints.cell.robot.speed
    low, high = np.minimum(low, np.minimum(q_from, q_to)), np.maximum(high, np.maximum(q_from, q_to))
    info = _space(low / speed, high / speed, seed)
    validator = _motion_validator(info, lambda a, b: _is_proven(constraints, a * speed, b * speed), len(speed))
    info.setMotionValidator(validator)
    info.setup()
    problem = ob.ProblemDefinition(info)
    problem.setStartAndGoalStates(_state(info, q_from / speed), _state(info, q_to / speed))
    planner = og.RRTConnect(info)
    planner.setRange(1.0)  # [s] longest motion
    planner.setProblemDefinition(problem)
    planner.setup()
    draws = iter(range(iterations))
    planner.solve(ob.PlannerTerminationCondition(lambda: next(draws, None) is None))
    if not problem.hasExactSolution():
        return None
    states = problem.getSolutionPath().getStates()
    return np.array([[s[i] for i in range(len(speed))] for s in states]) * speed


def _is_proven(constraints: Constraints, a: Array, b: Array) -> bool:
    """Look at states in steps, which refuses most bad motions at once; prove what is left."""
    count = max(2, int(np.ceil(np.abs(b - a).max() / 0.12)))  # [rad] of the fastest joint between two states
    looks_clear = constraints.valid(a + np.outer(np.arange(1, count + 1) / count, b - a)).all()
    return bool(looks_clear and constraints.prove(a[None], b[None]).proven[0])


def _space(low: Array, high: Array, seed: int) -> Any:
    """Return the space information of a box in which every state counts as valid: motions are what is checked."""
    ou.RNG.setSeed(seed + 1)
    info = ob.SpaceInformation(_box(low, high))
    info.setStateValidityChecker(lambda _: True)
    return info


def _box(low: Array, high: Array) -> Any:
    """Return the space of the states between ``low`` and ``high`` (N,)."""
    ou.noOutputHandler()
    bounds = ob.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, max(b, a + 1e-9))
    space = ob.RealVectorStateSpace(len(low))
    space.setBounds(bounds)
    return space


def _state(info: Any, values: Array) -> Any:
    state = info.allocState()
    for i, value in enumerate(values.tolist()):
        state[i] = value
    return state


def _motion_validator(info: Any, good: Callable[[Array, Array], bool], n: int) -> Any:
    """Return a validator that judges motions by a function of both ends (N,)."""

    class Validator(ob.MotionValidator):  # type: ignore[misc]
        """Judges motions as OMPL asks for it."""

        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
            """Tell whether the motion between two states of OMPL is good."""
            return good(np.array([a[i] for i in range(n)]), np.array([b[i] for i in range(n)]))

    return Validator(info)
