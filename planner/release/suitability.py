"""What a calibrated robot is good enough for: how far off it is at its targets, with the measured and other tools.

Robots are drawn from the posterior, as for every stated error. Of each the errors at states of the workspace are those
of targets that programs may name there. What is said of them is what 95 of 100 targets stay within, of 95 of 100 such
robots.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from planner.common.units import Array
from planner.fit.assumptions import POSITION_AXES
from planner.fit.least_squares import Fit
from planner.model.use_statement import ToolUse, Use, UseAnswer
from planner.release.released_robot import ReleasedRobot
from planner.release.tool_map import ToolMap

ENOUGH = 0.95  # share of targets within a tolerance that a use asks for, and of robots that an answer must hold for
ALL_OF: Final = "inverted_cdf"  # of quantiles: the least value that so many stay within


def judge_use(
    released: ReleasedRobot, repeatability: float, tolerance: float | None = None, assumed: bool = False
) -> Use:
    """Judge for which uses the released robot is good enough, and whether it holds a tolerance [m].

    Args:
        released: the robot, with its posterior and the tools that are judged.
        repeatability: of the arm [m]: poses that are led to by hand come back so well, calibrated or not.
        tolerance: distance from where a program wants the tool that is allowed [m].
        assumed: whether the robot's file does not say its repeatability.
    """
    own = () if released.work_tool is None else (("own", (released.work_tool,)),)
    tools = (("measured", (released.tool,)), *own, ("another", released.other_tools))
    return Use(
        tolerance=tolerance,
        repeatability=repeatability,
        repeatability_assumed=assumed or None,
        tools=tuple(_judge_tool(released, name, maps, repeatability, tolerance) for name, maps in tools),
    )


def _judge_tool(
    released: ReleasedRobot, name: str, tools: Sequence[ToolMap], repeatability: float, tolerance: float | None
) -> ToolUse:
    before, after = (
        np.concatenate([target_errors(released, fit, tool) for tool in tools]) for fit in (None, released.fit)
    )
    of = {"tool": name, "targets_within_before": _sure_limit(before), "targets_within": _sure_limit(after)}
    if tolerance is not None:
        shares = (after <= tolerance).mean(axis=0)
        of |= {
            "share_before": float(np.median((before <= tolerance).mean(axis=0))),
            "share": float(np.median(shares)),
            "answer": judge_shares(shares) if tolerance >= repeatability else "no",
        }
    return ToolUse.model_validate(of)


def target_errors(released: ReleasedRobot, fit: Fit | None, tool: ToolMap) -> Array:
    """Return the error of the tool at every state against every robot drawn from the posterior [m], (n, d).

    Over the states its root mean square is :meth:`ReleasedRobot.drawn_errors`. ``fit``: whose values are written;
    ``None``: of the nominal robot.
    """
    known = released.posterior
    here = {name: k for k, name in enumerate(known.fit.model.names)}
    at = [k for k, name in enumerate(tool.names) if name in here and known.drawn[here[name]].any()]
    which = [here[tool.names[k]] for k in at]
    off = released.drawn_offsets[which] - released.offset([tool.names[k] for k in at], fit)[:, None]
    moved = (tool.flat_rows[:, at] @ off).reshape(len(tool.q), POSITION_AXES, -1)
    return np.asarray(np.sqrt((moved**2).sum(axis=1) + released.drawn_beside(tool.from_middle_square)))


def _sure_limit(errors: Array) -> float:
    """Return the error [m] that the stated share of targets (n, d) stays below, for the stated share of robots."""
    return float(np.quantile(np.quantile(errors, ENOUGH, axis=0, method=ALL_OF), ENOUGH, method=ALL_OF))


def judge_shares(shares: Array) -> UseAnswer:
    """Return whether enough targets are within a tolerance, by their shares of each robot drawn (d,)."""
    enough = float((shares >= ENOUGH).mean())
    return "yes" if enough >= ENOUGH else "no" if enough <= 1 - ENOUGH else "not known"
