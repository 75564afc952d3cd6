"""How errors move tool points over the workspace and at poses of a run, a new alignment of the base left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup
from planner.cell.placement import N_BASE_TRANSFORMS
from planner.common.determinism import even_positions
from planner.common.units import Array, read_only
from planner.effects.compliance import StationTwist
from planner.effects.effect import Parameter
from planner.effects.phi_keys import columns_of
from planner.fit.assumptions import OTHER_TOOL
from planner.fit.least_squares import Fit
from planner.inference.posterior_background import acts_on_robot
from planner.inference.posterior_fit import PosteriorFit
from planner.model.tool_error import aligned_rows, samples_like, tool_position, uniform_states
from planner.runs.run import Run


@dataclass(frozen=True, eq=False)
class ToolMap:
    """The tool's motion at states of the workspace, a new alignment of the base left out.

    Attributes:
        q: states, (n, N) [rad].
        p_FM: the tool's point in the flange frame, (3,) [m].
        position: of the point in the base frame, (n, 3) [m].
        names: of the parameters that move the tool.
        rows: of every parameter, (n, 3, P) [m per unit].
    """

    q: Array
    p_FM: Array
    position: Array
    names: tuple[str, ...]
    rows: Array

    @property
    def flat_rows(self) -> Array:
        """The rows of all states one below the other, (3 n, P)."""
        return self.rows.reshape(-1, len(self.names))

    @cached_property
    def from_middle_square(self) -> Array:
        """Squared distance of the point from the middle of its workspace at every state, (n,) [m²]."""
        return np.asarray(((self.position - self.position.mean(axis=0)) ** 2).sum(axis=1))

    @cached_property
    def gram(self) -> Array:
        """Products of the rows of all states, (P, P)."""
        return np.asarray(self.flat_rows.T @ self.flat_rows)

    def square(self, values: Array, which: slice | np.ndarray = slice(None)) -> Array:
        """Return the squared motion of every state [m²], (n,), by columns of errors (P, k), summed over the columns.

        ``which``: parameters (P,) bool that count; all if not given.
        """
        moved = self.flat_rows[:, which] @ values[which]
        return np.asarray((moved**2).reshape(len(self.q), -1).sum(axis=1))


class ToolMaps(NamedTuple):
    """Motion of the tool points of which an error is stated; see :class:`ReleasedRobot`."""

    tool: ToolMap
    further_points: tuple[ToolMap, ...]
    other_tools: tuple[ToolMap, ...]
    work_tool: ToolMap | None
    measured: ToolMap


def tool_maps(cell: Cell, run: Run, fit: Fit) -> ToolMaps:
    """Return the motion over the workspace of measured, other and working tool points, and at poses of the run."""
    setup = fit.setup
    effects = moving_effects(fit)
    q = uniform_states(cell, 1000, 0)  # joint states at which the tool is looked at
    around = [OTHER_TOOL * sign * np.eye(3)[k] for k in range(3) for sign in (1.0, -1.0)]
    few = q[:: len(around)]
    work = cell.tool.work
    return ToolMaps(
        tool_map(q, run, setup, effects, with_point=True),
        tuple(
            tool_map(few, run, _at_point(setup, p_FM, name), effects, with_point=True)
            for name, p_FM in list(zip(setup.point_names, setup.p_FM, strict=True))[1:]
        ),
        tuple(tool_map(few, run, _at_point(setup, p), effects, with_point=False) for p in around),
        None if work is None else tool_map(q, run, _at_point(setup, work), effects, with_point=False),
        # 200: poses of the run, for a mean over it that is known to some per cent
        tool_map(run.samples.q[even_positions(len(run), 200)], run, setup, effects, with_point=True),
    )


def drift_of(cell: Cell, run: Run, posterior: PosteriorFit) -> Array:
    """Return how far each robot drawn from a posterior moves the tool in the time of a run, (n,) [m].

    What moves base or gauge alone is left out: every cell aligns its work pieces.
    """
    fit, count = posterior.fit, posterior.drawn.shape[1]
    setup = fit.setup
    slow = tuple(p for p in fit.model.parameters if p.is_effect and moves_in_time(p) and _moves_arm(p, setup))
    if not slow:
        return np.zeros(count)
    # of 300 states each stands for a moment of the run: the mean over both is known to some per cent
    moved = tool_map(uniform_states(cell, 300, 0), run, setup, slow, with_point=False)
    here, there = ([names.index(p.name) for p in slow] for names in (moved.names, fit.model.names))
    drawn, gram = posterior.drawn[there], moved.gram[np.ix_(here, here)]
    return np.asarray(np.sqrt((drawn * (gram @ drawn)).sum(axis=0) / len(moved.q)))


def moves_in_time(parameter: Parameter) -> bool:
    """Tell whether a parameter acts by the clock of the run."""
    return any("t" in columns_of(m.phi.key) for m in parameter.moves)


def _moves_arm(parameter: Parameter, setup: MeasurementSetup) -> bool:
    """Tell whether a parameter moves parts of the robot, be it in axes of a station of its own, and not all of it."""
    first, end = N_BASE_TRANSFORMS, N_BASE_TRANSFORMS + len(setup.robot.transforms)
    return all(
        m.on == "transform" and (first <= m.index < end or isinstance(m.phi, StationTwist)) for m in parameter.moves
    )


def moving_effects(fit: Fit) -> tuple[Parameter, ...]:
    """Return the parameters of a fit, beside geometry, that the robot's file can hold."""
    setup = fit.setup
    return tuple(p for p in fit.model.parameters if p.is_effect and acts_on_robot(p, setup))


def _at_point(setup: MeasurementSetup, p_FM: Array, name: str = "") -> MeasurementSetup:
    return replace(setup, p_FM=read_only(p_FM[None]), R_FM=setup.R_FM[:1], point_names=(name,))


def tool_map(q: Array, run: Run, setup: MeasurementSetup, effects: Sequence[Parameter], with_point: bool) -> ToolMap:
    """Return the motion at states q (n, N) [rad] of the first tool point of a set-up, loaded as in the run."""
    samples = samples_like(run, q)
    names, rows = aligned_rows(samples, setup, effects)
    kept = [k for k, n in enumerate(names) if with_point or not n.startswith("map_")]
    moved = rows[:, kept].reshape(len(q), 3, -1)
    return ToolMap(q, setup.p_FM[0], tool_position(samples, setup), tuple(names[k] for k in kept), moved)
