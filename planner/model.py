"""Predicted reading and identification Jacobian of a cell: one list of parameters for planning and for fitting.

A parameter is a pair of what it moves (an elementary transform, the fixture, or the reading itself) and a basis
function of the sample; for a geometric error that function is 1, for a fixture it tells which fixture holds the bar.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from planner.cell import Cell
from planner.gauge import bar_state
from planner.units import MM, Array

CHUNK = 4096  # samples a pass: the working set stays in the processor's cache
PRIOR_LENGTH = 1.0 * MM  # an industrial robot misses by 1–4 mm before calibration
PRIOR_ANGLE = 1e-3  # [rad], about 1 mm at a metre
PRIOR_ZERO = 1.0 * MM


@dataclass(frozen=True)
class Parameter:
    """One error parameter.

    Attributes:
        name: for instance ``alpha2``, ``fixture_A_x``, ``map_z``, ``zero``.
        unit: ``m`` or ``rad``.
        prior: one-sigma size expected before any measurement [m or rad].
        on: what it moves.
        index: the transform, or fixture·3 + axis; 0 for the reading.
    """

    name: str
    unit: Literal["m", "rad"]
    prior: float
    on: Literal["transform", "fixture", "reading"]
    index: int = 0


@dataclass(frozen=True)
class Model:
    """The measurement model of one cell with the parameters that its ``[plan] free`` allows."""

    cell: Cell
    parameters: tuple[Parameter, ...]

    @classmethod
    def from_cell(cls, cell: Cell, free: frozenset[str] | None = None) -> "Model":
        """Build the model; parameters stand in the order in which they are preferred when some depend on others.

        What places the gauge comes first (it is known worst), the last joint's angle comes last: no length
        gauge on the last axis can see it.
        """
        free = cell.plan.free if free is None else free
        robot = [p for p in _robot_parameters(cell) if p.name != f"theta{cell.robot.n_joints}"]
        last = [p for p in _robot_parameters(cell) if p.name == f"theta{cell.robot.n_joints}"]
        parameters = [*_gauge_parameters(cell, free), *robot, *last]
        return cls(cell, tuple(parameters))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters in order."""
        return tuple(p.name for p in self.parameters)

    @property
    def prior(self) -> Array:
        """One-sigma prior sizes, (P,) [m or rad]."""
        return np.array([p.prior for p in self.parameters])

    def subset(self, kept: list[int]) -> "Model":
        """Return the model with only the parameters at the positions ``kept``."""
        return Model(self.cell, tuple(self.parameters[k] for k in kept))

    def _of(self, on: str) -> list[tuple[int, int]]:
        return [(j, p.index) for j, p in enumerate(self.parameters) if p.on == on]

    @cached_property
    def _fixtures(self) -> Array:
        return np.array([f.p_BX for f in self.cell.fixtures])

    def reading(self, q: Array, fixture: np.ndarray | int = 0, errors: Array | None = None) -> Array:
        """Predict the readings, (n, 1) [m].

        Args:
            q: controller angles, (n, N) [rad].
            fixture: which fixture holds the bar, (n,) or one number.
            errors: values of the parameters, (P,) [m or rad]; zero when not given.
        """
        errors = np.zeros(len(self.parameters)) if errors is None else errors
        chain, delta, place = self.cell.chain, np.zeros(len(self.cell.chain)), self._fixtures.copy()
        for j, k in self._of("transform"):
            delta[k] += errors[j]
        for j, k in self._of("fixture"):
            place[k // 3, k % 3] += errors[j]
        zero = sum(errors[j] for j, _ in self._of("reading"))
        which = np.broadcast_to(fixture, (len(q),))
        out = np.empty((len(q), 1))
        for part in _chunks(len(q)):
            x = chain.forward(self.cell.robot.theta(q[part]), delta).x.T
            out[part, 0] = bar_state(x, place[which[part]]).length + zero
        return out

    def jacobian(self, q: Array, fixture: np.ndarray | int = 0) -> Array:
        """Identification Jacobian at nominal parameters, (n, 1, P) [m/m, m/rad] (EDBB paper, eq. 4).

        Each column is the screw of what the parameter moves, projected on the bar's direction.
        """
        chain = self.cell.chain
        which = np.broadcast_to(fixture, (len(q),))
        out = np.zeros((len(q), 1, len(self.parameters)))
        moved = self._of("transform")
        columns, screws = [j for j, _ in moved], [k for _, k in moved]
        for part in _chunks(len(q)):
            motion = chain.forward(self.cell.robot.theta(q[part]))
            e = bar_state(motion.x.T, self._fixtures[which[part]]).direction
            rows = out[part, 0]
            rows[:, columns] = np.einsum("kin,ni->nk", motion.point_screws()[screws], e)
            for j, k in self._of("fixture"):
                rows[:, j] = -e[:, k % 3] * (which[part] == k // 3)
            for j, _ in self._of("reading"):
                rows[:, j] = 1.0
        return out

    def noise(self, q: Array, fixture: np.ndarray | int = 0) -> Array:
        """Standard deviation of one reading, (n,) [m]: gauge and the joints' repeatability, σ² = gauge² + J_q Σ_q J_qᵀ.

        The joints' repeatability is the same angle for each joint, such that the tool point's, at the arm's
        stretched reach, is the robot's published value.
        """
        out = np.empty(len(q))
        which = np.broadcast_to(fixture, (len(q),))
        for part in _chunks(len(q)):
            e = bar_state(self.cell.map_position(q[part]), self._fixtures[which[part]]).direction
            per_joint = np.einsum("ni,nij->nj", e, self.cell.map_jacobian(q[part]))
            sigma = self.joint_sigma
            out[part] = np.sqrt(self.cell.gauge.noise**2 + (sigma * per_joint**2 * sigma).sum(axis=1))
        return out

    @cached_property
    def joint_sigma(self) -> float:
        """Standard deviation of one joint's angle [rad] that explains the published repeatability."""
        lever = np.linalg.norm(self.cell.map_jacobian(self.cell.home[None]), axis=1)  # (1, N)
        return float(self.cell.robot.repeatability / 3.0 / np.sqrt((lever**2).sum()))


def _chunks(n: int) -> Iterator[slice]:
    for start in range(0, n, CHUNK):
        yield slice(start, min(start + CHUNK, n))


def _gauge_parameters(cell: Cell, free: frozenset[str]) -> list[Parameter]:
    out = []
    if "fixture" in free:
        for f, fixture in enumerate(cell.fixtures):
            out += [
                Parameter(f"fixture_{fixture.name}_{'xyz'[a]}", "m", fixture.prior, "fixture", 3 * f + a)
                for a in range(3)
            ]
    if "tool" in free:
        out += [
            Parameter(f"map_{'xyz'[a]}", "m", cell.tool.prior, "transform", cell.chain.index(f"map_{'xyz'[a]}"))
            for a in range(3)
        ]
    if "zero" in free:
        out.append(Parameter("zero", "m", PRIOR_ZERO, "reading"))
    return out


def _robot_parameters(cell: Cell) -> list[Parameter]:
    """Errors of the robot's own transforms; fixed turns that only align an axis are no errors of their own."""
    return [
        Parameter(t.name, "m", PRIOR_LENGTH, "transform", k)
        if t.kind == "translation"
        else Parameter(t.name, "rad", PRIOR_ANGLE, "transform", k)
        for k, t in enumerate(cell.robot.transforms)
        if not (t.name.startswith("aligned_") or t.name.endswith("_flange"))
    ]
