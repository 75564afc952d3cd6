"""The robot that an identification releases, and the error of its tool to be expected anywhere.

Everything is expected by the posterior: of a robot with the values v the mean square error of the tool is
trace(W C) + (v − m)ᵀ W (v − m), with mean m and covariance C of the posterior and W the tool's motion per squared
errors. The posterior mean itself is best by that measure, and what is released by that error over the one that
geometry alone would have. The nominal robot and geometry alone are judged beside it.
Few directions, or an effect that is unlikely and large, often make up most of that square, and most robots are better:
what is stated over the workspace is the median over robots drawn from the posterior, and what 95 % of them stay below.
The robots drawn are as far from its mean as regions that it did not see say (``misfit``). It is the robot as it was on
average over the time of the run. How far it drifts from that meanwhile is an error at any other moment.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from planner.common.units import Array
from planner.effects.effect import tool_point_parameters
from planner.fit.assumptions import NEGLIGIBLE_SHARE, POSITION_AXES
from planner.fit.least_squares import Fit
from planner.inference.misfit import Misfit
from planner.inference.posterior_background import BACKGROUND
from planner.inference.posterior_fit import PosteriorFit
from planner.model.identification_document import Metrics
from planner.release.tool_map import ToolMap


def pick_rows(values: Array, names: Sequence[str], wanted: Sequence[str]) -> Array:
    """Return those of the rows (P, k) of parameters ``names`` that are ``wanted``, (K, k); of unknown ones zeros."""
    here = {name: k for k, name in enumerate(names)}
    out = np.zeros((len(wanted), values.shape[1]))
    for row, name in zip(out, wanted, strict=True):
        if name in here:
            row[:] = values[here[name]]
    return out


@dataclass(frozen=True)
class ReleasedRobot:
    """A calibrated robot and what is known of its errors.

    Attributes:
        fit: whose values are written; of geometry alone, or on the way from there to the compromise with the posterior.
        geometry: the fit of geometry alone.
        posterior: what the errors are judged by.
        misfit: how much farther off the drawn robots are than it says, by regions that it did not see.
        drift: how far each of them moves the tool in the time of the run, rms over it and the workspace, (n,) [m].
        factors: by which all lengths of each of them are too long, because the gauge's scale or unit is wrong, (n,).
        tool: motion of the measured tool point; further_points: of each further tool point that was measured, where
            the tool has several; other_tools: of points about the flange; work_tool: of the tool that the robot works
            with, where the cell names it; measured: of the measured point at poses of the run.
        held_out, validation: errors of the released robot.
        held_residual: of every sample, (n, r) [m, rad]; of a part of a long run.
        share: how much of that way, 0 to 1.
    """

    fit: Fit
    geometry: Fit
    posterior: PosteriorFit
    misfit: Misfit
    drift: Array
    factors: Array
    tool: ToolMap
    further_points: tuple[ToolMap, ...]
    other_tools: tuple[ToolMap, ...]
    work_tool: ToolMap | None
    measured: ToolMap
    held_out: Metrics
    validation: Metrics | None
    held_residual: Array
    share: float = 0.0

    @cached_property
    def effects(self) -> dict[str, float]:
        """Values of the parameters, by name, that the robot's file holds beyond geometry.

        What the background says of next to nothing is left out: the smallest parameters, as long as all of them
        together stay negligible, over the workspace and at poses like those measured, where the robot is known better.
        """
        values = self.fit.values
        kept = {p.name: values[p.name] for p in self.fit.model.parameters if p.is_effect}
        background = [p.name for p in self.fit.model.parameters if p.group == BACKGROUND]
        faint = [n for n in background if n in self.tool.names]
        size = np.array([values[n] for n in faint])
        columns = [self._rows_per_error(where, faint) * size for where in (self.tool, self.measured)]
        order = np.argsort(np.max([(c**2).sum(axis=0) for c in columns], axis=0), kind="stable")
        together = np.max([(np.cumsum(c[:, order], axis=1) ** 2).sum(axis=0) for c in columns], axis=0) ** 0.5
        left_out = int(np.searchsorted(np.maximum.accumulate(together), NEGLIGIBLE_SHARE))
        for name in (*(n for n in background if n not in self.tool.names), *(faint[k] for k in order[:left_out])):
            del kept[name]
        return kept

    def __repr__(self) -> str:
        """Name the robot that is written."""
        return f"ReleasedRobot('{self.fit.setup.robot.name}', parameters={len(self.fit.model.parameters)})"

    @property
    def measured_points(self) -> tuple[ToolMap, ...]:
        """The motion of every tool point that was measured, the first one first."""
        return (self.tool, *self.further_points)

    @property
    def moving_names(self) -> tuple[str, ...]:
        """Names of the parameters that move any of these points."""
        return tuple(dict.fromkeys(name for point in self.measured_points for name in point.names))

    @property
    def tool_points(self) -> dict[str, Array]:
        """The measured tool points in the flange of this robot, (3,) [m], by name; a lone one may have none."""
        maps = zip(self.fit.setup.point_names, self.measured_points, strict=True)
        return {name: np.asarray(m.p_FM + self.fit.at(tool_point_parameters(name))) for name, m in maps}

    def _rows_per_error(self, where: ToolMap, names: Sequence[str]) -> Array:
        """Return the motion (3 n, K) by each parameter over the root of n states times the error to be expected."""
        rows = where.flat_rows[:, [where.names.index(n) for n in names]]
        return np.asarray(rows / max(np.sqrt(len(where.q)) * self.likely_workspace_error(self.fit, where), 1e-300))

    def expected_errors(self, fit: Fit | None) -> Array:
        """Return the tool's expected error at every state [m], (n,), with the values of ``fit``; ``None``: nominal."""
        off = self.offset(self.tool.names, fit)
        return np.asarray(np.sqrt(self._spread_square + self.tool.square(off[:, None]) + self.beside_square))

    @cached_property
    def _spread_square(self) -> Array:
        """Mean square motion of the tool at every state by what the posterior leaves open [m²], (n,)."""
        return self.tool.square(self.spread(self.tool.names))

    @cached_property
    def drift_rms(self) -> float:
        """How far the tool moves in the time of the run, rms over it and the workspace [m]."""
        return float(np.sqrt((self.drift**2).mean()))

    @property
    def beside_square(self) -> float:
        """Mean square [m²] of the tool's motion that joint angles do not determine: the rest, and the drift in time."""
        return self.misfit.rest_square + self.drift_rms**2

    def likely_errors(self, fit: Fit | None) -> Array:
        """Return the tool's error at every state [m], (n,), shared out over them as the expected mean square is.

        Its rms is as likely exceeded as not: the figure that leads.
        """
        expected = self.expected_errors(fit)
        return np.asarray(self._share_of(expected, fit) * expected)

    def likely_share(self, fit: Fit | None) -> float:
        """Return the median rms error over the workspace, divided by the root of the expected mean square."""
        return self._share_of(self.expected_errors(fit), fit)

    def _share_of(self, expected: Array, fit: Fit | None) -> float:
        rms = float(np.sqrt((expected**2).mean()))
        return self.likely_workspace_error(fit) / rms if rms > 0 else 1.0

    def likely_workspace_error(self, fit: Fit | None, tool: ToolMap | None = None) -> float:
        """Return the error over the workspace, rms, that is as likely exceeded as not [m]."""
        return float(np.median(self.drawn_errors(fit, tool)))

    def drawn_errors(self, fit: Fit | None, tool: ToolMap | None = None, without: Collection[str] = ()) -> Array:
        """Return the error over the workspace, rms, against each robot drawn from the posterior [m], (n,).

        Parameters ``without`` count as known.
        """
        where = self.tool if tool is None else tool
        drawn = self._move(where, without) if without else self._motion_of(where)
        off = self.offset(drawn.names, fit)
        moved = drawn.gram @ off
        square = drawn.square - 2 * (moved @ self.drawn_offsets[drawn.rows]) + off @ moved
        beside = self.drawn_beside(where.from_middle_square.mean())
        return np.asarray(np.sqrt(np.maximum(square, 0.0) / len(where.q) + beside))

    def _motion_of(self, where: ToolMap) -> "_DrawnMotion":
        """Return how the drawn robots move a tool; computed once."""
        if where not in self._known_motions:
            self._known_motions[where] = self._move(where)
        return self._known_motions[where]

    @cached_property
    def _known_motions(self) -> dict[ToolMap, "_DrawnMotion"]:
        return {}

    def _move(self, where: ToolMap, without: Collection[str] = ()) -> "_DrawnMotion":
        known = self.posterior
        here = {name: k for k, name in enumerate(known.fit.model.names)}
        moving = {n for n in where.names if n in here and known.drawn[here[n]].any()}.difference(without)
        at = [k for k, n in enumerate(where.names) if n in moving]
        names = [where.names[k] for k in at]
        rows, gram = [here[n] for n in names], where.gram[np.ix_(at, at)]
        off = self.drawn_offsets[rows]
        return _DrawnMotion(names, rows, gram, (off * (gram @ off)).sum(axis=0))

    def drawn_beside(self, from_middle_square: Array | np.floating) -> Array:
        """Return the square [m²] of what no parameter of each drawn robot says of the tool, (..., d).

        That is the rest, the drift in time, and a factor on all lengths, which an alignment in the middle of the
        workspace leaves.

        Args:
            from_middle_square: squared distance of the tool from there at states, or its mean, (...) [m²].
        """
        rest = POSITION_AXES * self.misfit.rest**2 + self.drift**2
        return np.asarray(rest + np.multiply.outer(from_middle_square, self.factors**2))

    @cached_property
    def drawn_offsets(self) -> Array:
        """How far the values of the drawn robots are from the posterior's mean, (P, n) [m, rad, …], stretched."""
        known = self.posterior
        off = known.drawn - known.fit.errors[:, None]
        return np.asarray(off + (self.misfit.stretch - 1) * known.of_noise)

    def distance(self, fit: Fit, other: Fit) -> float:
        """Return how far the tools of two robots are apart over the workspace, rms [m]."""
        apart = self.offset(self.tool.names, fit) - self.offset(self.tool.names, other)
        return float(np.sqrt(self.tool.square(apart[:, None]).mean()))

    def length_along(self, fit: Fit) -> float:
        """Return how far a robot goes along the way from geometry alone (0) to the posterior's mean (1)."""
        mean = self.posterior.fit
        whole = self.distance(self.geometry, mean) ** 2
        if whole == 0.0:
            return 0.0
        return 0.5 * (1 + (self.distance(self.geometry, fit) ** 2 - self.distance(fit, mean) ** 2) / whole)

    @cached_property
    def anywhere(self) -> float:
        """Error of the released robot's tool over the workspace, rms, that is as likely exceeded as not [m]."""
        return self.likely_workspace_error(self.fit)

    @property
    def at_most(self) -> float:
        """What that error stays below with a probability of 95 % [m]."""
        return float(np.quantile(self.drawn_errors(self.fit), 0.95))

    def limit_without(self, names: Sequence[str]) -> float:
        """Return what it would stay below with a probability of 95 %, were the values of some parameters known [m]."""
        return float(np.quantile(self.drawn_errors(self.fit, without=names), 0.95))

    def scatter_by_draws(self, at: float) -> float:
        """Return how far other draws would move a quantile ``at`` of the error, one sigma, as a share of it.

        By its scatter between a few stretches of the draws, each long enough to forget where it began (batch means;
        Flegal and Jones 2010, Annals of Statistics 38(2)).
        """
        stretches = np.array_split(self.drawn_errors(self.fit), 6)
        own = np.array([np.quantile(part, at) for part in stretches])
        return float(own.std(ddof=1) / np.sqrt(len(own)) / max(own.mean(), 1e-300))

    @cached_property
    def other_tool_anywhere(self) -> float:
        """The same of a tool that was not measured: what went into the measured tool's mount stays an error."""
        return float(np.sqrt(np.mean([self.likely_workspace_error(self.fit, t) ** 2 for t in self.other_tools])))

    @cached_property
    def usual_robots(self) -> np.ndarray:
        """Which of the drawn robots are none of the tenth that errs most, (n,) bool.

        Few robots have much of what no pose has shown: they would make up most of a mean square, and are no measure of
        the others. What 95 % of robots stay below counts them.
        """
        errors = self.drawn_errors(self.posterior.fit)
        return np.asarray(errors <= np.quantile(errors, 0.9))

    def spread(self, names: Sequence[str]) -> Array:
        """Return a square root (K, k) of the covariance of parameters ``names`` over most of the drawn robots."""
        off = self.drawn_offsets[:, self.usual_robots]
        return pick_rows(off / np.sqrt(off.shape[1]), self.posterior.fit.model.names, names)

    def offset(self, names: Sequence[str], fit: Fit | None) -> Array:
        """Return how far the values (K,) of a fit, or of the nominal robot, are from the posterior mean."""
        known = self.posterior.fit
        mean = known.values
        own = {} if fit is None else fit.values
        placed = fit is None  # where the tool point sits is no error of the nominal robot
        return np.array(
            [0.0 if n not in mean or (placed and n.startswith("map")) else own.get(n, 0.0) - mean[n] for n in names]
        )


class _DrawnMotion(NamedTuple):
    """How robots drawn from the posterior, about its mean, move a tool.

    ``names`` of the parameters that do, ``rows`` in which they stand in the draws, ``gram`` of their motion (k, k), and
    its ``square`` summed over the states, (d,) [m²].
    """

    names: list[str]
    rows: list[int]
    gram: Array
    square: Array
