"""The robot that an identification releases, and the error of its tool to be expected anywhere.

Everything is expected by the posterior: of a robot with the values v the mean square error of the tool is
trace(W C) + (v − m)ᵀ W (v − m), with mean m and covariance C of the posterior and W the tool's motion per squared
errors. The posterior mean itself is best by that measure; the nominal robot and geometry alone are judged beside it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from planner.cell.cell import Cell
from planner.cell.setup import MeasurementSetup
from planner.common.units import Array, read_only
from planner.effects.parameters import Parameter
from planner.identification.least_squares import Fit
from planner.identification.posterior_background import BACKGROUND, acts_on_robot
from planner.identification.posterior_fit import PosteriorFit
from planner.model.identification_document import Metrics
from planner.model.tool_error import aligned_rows, uniform_states
from planner.runs.run import Run, Samples

STATES = 1000  # joint states at which the tool is looked at
OTHER_TOOL = 0.2  # [m] from the flange's centre to the tools that were not measured, in six directions
NEGLIGIBLE = 1e-6  # [m] rms over the workspace by which the written robot may differ from the posterior mean


@dataclass(frozen=True)
class ToolMap:
    """The tool's motion at states of the workspace, a new alignment of the base left out.

    Attributes:
        q: states, (n, N) [rad].
        names: of the parameters that move the tool.
        rows: of every parameter, (n, 3, P) [m per unit].
    """

    q: Array
    names: tuple[str, ...]
    rows: Array

    def square(self, values: Array) -> Array:
        """Return the squared motion of every state [m²], (n,), by columns of errors (P, k), summed over the columns."""
        return np.asarray(((self.rows.reshape(-1, len(self.names)) @ values) ** 2).reshape(len(self.q), -1).sum(axis=1))


@dataclass(frozen=True)
class ReleasedRobot:
    """A calibrated robot and what is known of its errors.

    Attributes:
        fit: whose values are written; of geometry alone, or the posterior mean.
        posterior: what the errors are judged by.
        tool: motion of the measured tool point; other_tools: of points about the flange.
        held_out, validation: errors of the released robot.
    """

    fit: Fit
    posterior: PosteriorFit
    tool: ToolMap
    other_tools: tuple[ToolMap, ...]
    held_out: Metrics
    validation: Metrics | None

    @cached_property
    def effects(self) -> dict[str, float]:
        """Values of the parameters, by name, that the robot's file holds beyond geometry.

        What the background says of next to nothing is left out: the smallest parameters, as long as all of them
        together stay negligible.
        """
        values = dict(zip(self.fit.model.names, map(float, self.fit.errors), strict=True))
        kept = {p.name: values[p.name] for p in self.fit.model.parameters if p.group not in ("gauge", "geometry")}
        faint = [p.name for p in self.fit.model.parameters if p.group == BACKGROUND and p.name in self.tool.names]
        for p in self.fit.model.parameters:
            if p.group == BACKGROUND and p.name not in self.tool.names:
                del kept[p.name]
        columns = self._rows_of(faint) * np.array([values[n] for n in faint])
        order = np.argsort((columns**2).sum(axis=0), kind="stable")
        size = np.sqrt((np.cumsum(columns[:, order], axis=1) ** 2).sum(axis=0) / len(self.tool.q))
        for k in order[: int(np.searchsorted(np.maximum.accumulate(size), NEGLIGIBLE))]:
            del kept[faint[k]]
        return kept

    def _rows_of(self, names: Sequence[str]) -> Array:
        rows = self.tool.rows.reshape(-1, len(self.tool.names))
        return np.asarray(rows[:, [self.tool.names.index(n) for n in names]])

    @cached_property
    def expected(self) -> Array:
        """Expected error of the tool at every state of the map [m], (n,)."""
        return self._error(self.tool, self.fit)

    @property
    def anywhere(self) -> float:
        """Expected error of the tool over the workspace [m], rms."""
        return _rms(self.expected)

    @cached_property
    def nominal_anywhere(self) -> float:
        """The same of the robot before it is calibrated."""
        return _rms(self._error(self.tool, None))

    @cached_property
    def other_tool_anywhere(self) -> float:
        """The same of a tool that was not measured: what went into the measured tool's mount stays an error."""
        return float(np.sqrt(np.mean([_rms(self._error(t, self.fit)) ** 2 for t in self.other_tools])))

    def anywhere_with(self, fit: Fit) -> float:
        """Return the same of a robot with the values of another fit."""
        return _rms(self._error(self.tool, fit))

    def _error(self, tool: ToolMap, fit: Fit | None) -> Array:
        """Expected error of every state [m], (n,), of a robot with the values of a fit; ``None`` is the nominal one."""
        known = self.posterior.fit
        own = {} if fit is None else dict(zip(fit.model.names, map(float, fit.errors), strict=True))
        here = {name: k for k, name in enumerate(known.model.names)}
        root = known.solution.root(known.problem.prior)
        at = [here.get(n) for n in tool.names]
        spread = np.stack([np.zeros(root.shape[1]) if k is None else root[k] for k in at])
        off = [
            0.0 if k is None else own.get(n, 0.0) - float(known.errors[k]) for n, k in zip(tool.names, at, strict=True)
        ]
        if fit is None:  # where the tool point sits is no error of the robot
            off = [0.0 if n.startswith("map") else v for n, v in zip(tool.names, off, strict=True)]
        return np.sqrt(tool.square(spread) + tool.square(np.array(off)[:, None]))


def _rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))


def tool_maps(cell: Cell, run: Run, fit: Fit) -> tuple[ToolMap, tuple[ToolMap, ...]]:
    """Return the motion of the measured tool point over the workspace, and of points about the flange."""
    setup = fit.model.setup
    effects = [p for p in fit.model.parameters if p.group not in ("gauge", "geometry") and acts_on_robot(p, setup)]
    q = uniform_states(cell, STATES, 0)
    around = [OTHER_TOOL * sign * np.eye(3)[k] for k in range(3) for sign in (1.0, -1.0)]
    others = [replace(setup, p_FM=read_only(p[None]), R_FM=setup.R_FM[:1]) for p in around]
    few = q[:: len(around)]
    return (
        _tool_map(q, run, setup, effects, with_point=True),
        tuple(_tool_map(few, run, other, effects, with_point=False) for other in others),
    )


def _tool_map(q: Array, run: Run, setup: MeasurementSetup, effects: Sequence[Parameter], with_point: bool) -> ToolMap:
    like = run.samples.take(np.random.default_rng(0).integers(len(run), size=len(q)))
    samples: Samples = replace(like, q=q, place=np.zeros(len(q), dtype=int), point=None)
    names, rows = aligned_rows(samples, setup, effects)
    kept = [k for k, n in enumerate(names) if with_point or not n.startswith("map_")]
    return ToolMap(q, tuple(names[k] for k in kept), rows[:, kept].reshape(len(q), 3, -1))
