"""Circle against error-sensitive path (EDBB paper, section 4.1): how much of the bar each uses, how much it shows.

Both are driven by the same simulated robots. As in the paper's set-up the fixture stands where the robot itself put it:
the measured point is driven there, so whatever the robot errs there is in the fixture's place.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.setup import Targets
from planner.common.errors import NoSolutionError
from planner.common.units import MM, Array
from planner.gauges.frame_gauge import ToolPosition
from planner.instruments.circular.plan import CircularPlan, circle_samples
from planner.instruments.simulation import SAMPLE_RATE
from planner.instruments.truth import draw_truth
from planner.kinematics.geometry import bar_state
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
from planner.model.model import Model
from planner.runs.run import Samples
from planner.session.plan_types import Plan

ROUNDS = 60
APART = ("fixture_", "zero")  # errors that are the set-up's, not the robot's or the tool's


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


PAPER = CircleAndPath(Ranges(2.45 * MM, 2.36 * MM), Ranges(156.32 * MM, 8.28 * MM))
"""Published: one Comau NJ-130, with the error of following the path in the lengths."""


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
        errors = place_fixtures_by_robot(cell, truth.model, np.array(truth.errors))
        out.append(CircleAndPath(*(_ranges(cell, truth.model, samples, errors) for samples in (circle, path))))
    return tuple(out)


def sample_plan(plan: Plan) -> Samples:
    """The joint angles of an error-sensitive plan as it is driven, ``RATE`` times a second."""
    motions = [d.trajectory.sample(1.0 / SAMPLE_RATE) for d in plan.drives]
    return Samples.concatenate([Samples.at(m.q, d.mounting) for m, d in zip(motions, plan.drives, strict=True)])


def place_fixtures_by_robot(cell: Cell, model: Model, errors: Array) -> Array:
    """Return errors (P,) with every fixture where the robot's measured point truly comes when told to go there."""
    own = [k for k, p in enumerate(model.parameters) if not p.name.startswith(APART)]
    position = replace(model.subset(own), setup=replace(model.setup, gauge=ToolPosition(noise=0.0)))
    out = errors.copy()
    out[[k for k, p in enumerate(model.parameters) if p.name.startswith(APART)]] = 0.0
    for fixture in cell.fixtures:
        q = solve_fixture_pose(cell, fixture.p_BX)
        true = -position.residual(Samples(q, np.zeros(1, dtype=int)), Targets(position=np.zeros((1, 3))), errors[own])[
            0
        ]
        for axis, value in zip("xyz", true - fixture.p_BX, strict=True):
            out[model.names.index(f"fixture_{fixture.name}_{axis}")] = value
    return out


def solve_fixture_pose(cell: Cell, p_BX: Array) -> Array:
    """A state (1, N) [rad] with the measured point on the fixture, the tool turned as at home or as little off it."""
    _, R, _ = tool_pose(cell.chain, cell.robot, cell.home[None])
    for turn in np.deg2rad([0, 90, -90, 180]):
        for tilt in np.deg2rad([0, 20, -20, 40, -40]):
            wanted = Rotation.from_euler("xz", [tilt, turn]).as_matrix() @ R
            q, good = solve_pose_ik(cell.chain, cell.robot, cell.home[None], p_BX[None], wanted, ROUNDS)
            if good[0]:
                return q
    raise NoSolutionError(
        f"the robot does not reach the fixture at {np.round(p_BX / MM, 1)} mm with its tool as at home"
    )


def _ranges(cell: Cell, model: Model, samples: Samples, errors: Array) -> Ranges:
    length = -model.residual(samples, Targets(length=np.zeros(len(samples))), errors)[:, 0]
    p_BX = np.array([f.p_BX for f in cell.fixtures])[samples.place]
    nominal = bar_state(cell.map_position(samples.q), p_BX).length
    return Ranges(float(np.ptp(length)), float(np.ptp(length - nominal)))
