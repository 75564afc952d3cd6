"""OMPL as this planner uses it: RRT-Connect for single legs.

States are controller angles divided by the axis speeds [s], so that OMPL's distances are times. OMPL is silenced,
seeded, and stopped by counting, never by the clock.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from planner.common.units import Array
from planner.motion.path.constraints import Constraints

SPACING = 0.12  # [rad] of the fastest joint between the states that RRT-Connect looks at along a motion
RANGE = 1.0  # [s] longest motion of RRT-Connect


def rrt_connect(
    constraints: Constraints, q_from: Array, q_to: Array, low: Array, high: Array, iterations: int, seed: int
) -> Array | None:
    """Return a proven way (k, N) [rad] found by RRT-Connect between two states (N,), both included, or ``None``.

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
    validator = _Validator(info, lambda a, b: _is_proven(constraints, a * speed, b * speed), len(speed))
    info.setMotionValidator(validator)
    info.setup()
    problem = ob.ProblemDefinition(info)
    problem.setStartAndGoalStates(_state(info, q_from / speed), _state(info, q_to / speed))
    planner = og.RRTConnect(info)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(ob.PlannerTerminationCondition(_countdown(iterations)))
    if not problem.hasExactSolution():
        return None
    states = problem.getSolutionPath().getStates()
    return np.array([[s[i] for i in range(len(speed))] for s in states]) * speed


def _is_proven(constraints: Constraints, a: Array, b: Array) -> bool:
    """Look at states in steps, which refuses most bad motions at once; prove what is left."""
    count = max(2, int(np.ceil(np.abs(b - a).max() / SPACING)))
    looks_clear = constraints.valid(a + np.outer(np.arange(1, count + 1) / count, b - a)).all()
    return bool(looks_clear and constraints.prove(a[None], b[None]).proven[0])


def _countdown(count: int) -> Callable[[], bool]:
    left = [count]

    def stop() -> bool:
        left[0] -= 1
        return left[0] < 0

    return stop


def _space(low: Array, high: Array, seed: int) -> Any:
    """Return the space information of a box in which every state counts as valid: motions are what is checked."""
    ou.noOutputHandler()
    ou.RNG.setSeed(seed + 1)
    bounds = ob.RealVectorBounds(len(low))
    for i, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(i, a)
        bounds.setHigh(i, max(b, a + 1e-9))
    space = ob.RealVectorStateSpace(len(low))
    space.setBounds(bounds)
    info = ob.SpaceInformation(space)
    info.setStateValidityChecker(_always_valid)
    return info


def _always_valid(_: Any) -> bool:
    return True


def _state(info: Any, values: Array) -> Any:
    state = info.allocState()
    for i, value in enumerate(values.tolist()):
        state[i] = value
    return state


class _Validator(ob.MotionValidator):  # type: ignore[misc]
    """Motions judged by a function of both ends (N,)."""

    def __init__(self, info: Any, good: Callable[[Array, Array], bool], n: int) -> None:
        super().__init__(info)
        self._good, self._range = good, range(n)

    def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
        """Tell whether the motion from state a to state b is good."""
        return self._good(np.array([a[i] for i in self._range]), np.array([b[i] for i in self._range]))
