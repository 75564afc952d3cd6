"""Circle against error-sensitive path (EDBB paper, section 4.1): how much of the bar each uses, how much it shows.

Both are driven by the same simulated robots. As in the paper's set-up the fixture stands where the robot itself put it:
the measured point is driven there, so whatever the robot errs there is in the fixture's place.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from planner.cell.cell import Cell
from planner.cell.placement import Targets
from planner.circular.plan import CircularPlan, circle_samples
from planner.common.units import Array
from planner.kinematics.geometry import bar_state
from planner.model.model import Model
from planner.runs.run import Samples
from planner.session.plan_types import Plan
from planner.simulation.simulated_run import SAMPLE_RATE
from planner.simulation.truth import draw_truth


@dataclass(frozen=True)
class Ranges:
    """Of one run: range of the bar's length, and of its difference to the nominal robot's at the joint angles [m]."""

    length: float
    deviation: float


@dataclass(frozen=True)
class CircleAndPath:
    """One simulated robot on both."""

    circle: Ranges
    path: Ranges


def compare_circle_and_path(circles: CircularPlan, path: Plan, seeds: Iterable[int]) -> tuple[CircleAndPath, ...]:
    """Drive a circular test and an error-sensitive path with one simulated robot a seed.

    The two plans must be of the same robot, tool and fixture; lengths are without the gauge's noise.
    """
    on_path = sample_plan(path)
    return compare_samples(circles.cell, circle_samples(circles, SAMPLE_RATE, ways=False), on_path, seeds)


def compare_samples(cell: Cell, circle: Samples, path: Samples, seeds: Iterable[int]) -> tuple[CircleAndPath, ...]:
    """Do the same for any two sets of samples about the cell's fixtures."""
    out = []
    for seed in seeds:
        truth = draw_truth(cell, seed)
        out.append(CircleAndPath(*(_ranges(cell, truth.model, samples, truth.errors) for samples in (circle, path))))
    return tuple(out)


def sample_plan(plan: Plan) -> Samples:
    """The joint angles of an error-sensitive plan as it is driven, ``RATE`` times a second."""
    motions = [d.trajectory.sample(1.0 / SAMPLE_RATE) for d in plan.drives]
    return Samples.concatenate([Samples.at(m.q, d.mounting) for m, d in zip(motions, plan.drives, strict=True)])


def _ranges(cell: Cell, model: Model, samples: Samples, errors: Array) -> Ranges:
    length = -model.residual(samples, Targets(length=np.zeros(len(samples))), errors)[:, 0]
    p_BX = np.array([f.p_BX for f in cell.fixtures])[samples.place]
    nominal = bar_state(cell.map_position(samples.q), p_BX).length
    return Ranges(float(np.ptp(length)), float(np.ptp(length - nominal)))
