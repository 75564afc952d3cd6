"""How well a fit knows the robot where it was not measured.

Held-out poses are like those that were measured. What these leave open, a rotation that no leg of theirs shows or the
part of a gear that no pose turns to, is open in the covariance of the parameters.
"""

from dataclasses import replace

import numpy as np

from planner.cell import Cell
from planner.identification.fit import Fit
from planner.identification.types import Metrics
from planner.run import Run, Samples
from planner.tool_error import STATES, ToolError, moves_robot, uniform
from planner.units import MM, Array

FAR = 3.0  # times the held-out error, from which on that one says little of the rest of the workspace
AXES = 3


def known_anywhere(cell: Cell, run: Run, found: Fit, covariance: Array) -> float:
    """Return the error of the tool [m] that the covariance lets expect, rms over the workspace.

    A new alignment of the base is left out. States are uniform over joint space; time, loads, temperature and
    directions in them are those of samples of the run, drawn at random.

    Args:
        cell, run, found: what was fitted to what.
        covariance: of the parameters, (P, P).
    """
    model = found.model
    effects = [p for p in model.parameters if p.group not in ("gauge", "geometry") and moves_robot(p, model.rig)]
    return ToolError.at(_states(cell, run), model.rig, effects).rms(model.names, covariance)


def known_worse(known: float, held_out: Metrics, width: int) -> list[str]:
    """Return what a reader of the held-out error must know where the rest of the workspace is known far worse.

    Args:
        known: error of the tool that is to be expected over the workspace [m].
        held_out: errors of the last stage on held-out samples.
        width: numbers in one reading.
    """
    there = held_out.rms * np.sqrt(AXES / min(width, AXES))  # a bar reads one of three axes
    if known <= FAR * there:
        return []
    return [
        f"held-out samples are like those measured; over the whole workspace the tool is known to {known / MM:.3f} mm "
        "(rms) by the covariance of the fit: measure more poses all over it, with a bar those of edbb plan --aim "
        "tracing or about a further fixture"
    ]


def _states(cell: Cell, run: Run) -> Samples:
    q = uniform(cell, STATES, 0)
    like = run.samples.take(np.random.default_rng(0).integers(len(run), size=len(q)))
    return replace(like, q=q, place=np.zeros(len(q), dtype=int), point=None)
