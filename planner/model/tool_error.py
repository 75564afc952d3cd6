"""How far the tool of a robot is off anywhere in its workspace, for errors that are known by their covariance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.cell.cell import Cell, MeasurementSetup, setup_of
from planner.cell.placement import N_BASE_TRANSFORMS, RobotSetup
from planner.common.units import Array, read_only
from planner.effects.effect import Parameter
from planner.gauges.frame_gauge import ToolPosition
from planner.model.model import Model
from planner.runs.run import Run, Samples

WORKSPACE_STATES = 2000  # joint states at which the tool is looked at


@dataclass(frozen=True)
class ToolError:
    """Mean square error of the tool per squared parameter errors, (P, P), in the order of ``names``.

    Errors that a new alignment of the base takes away are left out: no gauge that stands where it likes sees them, and
    every cell aligns its work pieces.
    """

    names: tuple[str, ...]
    square: Array

    @classmethod
    def of(cls, cell: Cell, unknown: Sequence[Parameter] = (), seed: int = 0) -> "ToolError":
        """Look at the first tool point, at states uniform over joint space in which it is above the floor.

        Args:
            cell: the cell.
            unknown: effects beside the robot's geometry.
            seed: of the states.
        """
        q = uniform_states(cell, WORKSPACE_STATES, seed)
        return cls.at(Samples(q, np.zeros(len(q), dtype=int)), setup_of(cell), unknown)

    @classmethod
    def at(cls, samples: Samples, setup: MeasurementSetup, unknown: Sequence[Parameter]) -> "ToolError":
        """Look at the first tool point in the states ``samples``, with ``unknown`` effects beside the geometry."""
        names, left = aligned_rows(samples, setup, unknown)
        return cls(names, read_only(left.T @ left / len(samples)))

    def weight(self, names: Sequence[str]) -> Array:
        """Return the matrix for parameters ``names``, (K, K); what does not move the tool has zeros."""
        known = [n for n in self.names if n in names]
        here, there = [self.names.index(n) for n in known], [list(names).index(n) for n in known]
        out = np.zeros((len(names), len(names)))
        out[np.ix_(there, there)] = self.square[np.ix_(here, here)]
        return out

    def rms(self, names: Sequence[str], covariance: Array) -> float:
        """Return the root mean square error of the tool [m] under a covariance (K, K) of ``names`` [m, rad, …]."""
        return float(np.sqrt(max((self.weight(names) * covariance).sum(), 0.0)))


def aligned_rows(
    samples: Samples, setup: MeasurementSetup, unknown: Sequence[Parameter]
) -> tuple[tuple[str, ...], Array]:
    """Return names of tool point, geometry and ``unknown`` effects, and the tool's motion per each, (3 n, P) [m].

    What a new alignment of the base takes away is left out; three rows a sample.
    """
    names, base, own = tool_rows(samples, setup, unknown)
    frame = np.linalg.qr(base)[0]
    return names, np.asarray(own - frame @ (frame.T @ own))


def tool_rows(
    samples: Samples, setup: MeasurementSetup, unknown: Sequence[Parameter]
) -> tuple[tuple[str, ...], Array, Array]:
    """Return the names of parameters, and the tool's motion [m] per base pose (3 n, 6) and per parameter (3 n, P)."""
    frame_columns = 6  # the first ones only say where the base stands
    model = _tool_model(setup).plus(list(unknown))
    rows = model.rows(samples).reshape(-1, len(model.names))
    return model.names[frame_columns:], rows[:, :frame_columns], rows[:, frame_columns:]


def tool_position(samples: Samples, setup: MeasurementSetup) -> Array:
    """Return where the first tool point of the nominal robot is, (n, 3) [m] in the base frame."""
    return _tool_model(setup).reading(samples)


def tool_setup(robot: RobotSetup, p_FM: Array) -> MeasurementSetup:
    """Return a robot that no gauge looks at, with a tool point (3,) [m] in the flange frame."""
    nowhere, upright = np.zeros((1, 3)), np.eye(3)[None]
    return MeasurementSetup(
        robot.robot, robot.gravity_B, robot.tool_mass, robot.com_F, p_BX=nowhere, R_BG=upright, p_BG=nowhere,
        gauge=ToolPosition(noise=0.0), p_FM=p_FM[None], R_FM=upright, p_GS=nowhere[:0], place_names=("",),
        point_names=("",), place_prior=np.ones(1), tool_prior=1.0, turn_prior=1.0, joint_sigma=0.0,
    )  # fmt: skip


def _tool_model(setup: MeasurementSetup) -> Model:
    gauge = ToolPosition(noise=0.0)
    alone = replace(setup, gauge=gauge, place_names=setup.place_names[:1], point_names=setup.point_names[:1])
    return Model.of(alone, frozenset({"tool"}))


def uniform_states(cell: Cell, count: int, seed: int) -> Array:
    """Joint states (n, N) [rad] with the tool above the floor, within one turn about home and the joint limits."""
    q = np.random.default_rng(seed).uniform(*cell.joint_range, (count, cell.robot.n_joints))
    if cell.base.floor is None:
        return q
    return np.asarray(q[cell.map_position(q) @ cell.base.R_WB[2] > cell.base.floor])


def samples_like(run: Run, q: Array) -> Samples:
    """Return samples at joint states q (n, N) [rad]; time, loads and the like are those of random samples of a run."""
    like = run.samples.take(np.random.default_rng(0).integers(len(run), size=len(q)))
    return replace(like, q=q, place=np.zeros(len(q), dtype=int), point=None)


def moves_robot(parameter: Parameter, setup: MeasurementSetup) -> bool:
    """Tell whether a parameter belongs to the robot, and neither to where the gauge stands nor to its readings."""
    inside = range(N_BASE_TRANSFORMS, N_BASE_TRANSFORMS + len(setup.robot.transforms))
    return all(m.on == "transform" and m.index in inside for m in parameter.moves)
