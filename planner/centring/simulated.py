"""An arm with drawn errors, a head and its indicators, for trying a centring session where no robot is."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell
from planner.cell.placement import Targets
from planner.centring.settings import CentringSettings
from planner.centring.stop import LinkError
from planner.common.units import UM, Array, read_only
from planner.kinematics.inverse_kinematics import solve_pose_ik, tool_pose
from planner.runs.run import Samples
from planner.simulation.truth import Truth


class SimulatedArm:
    """Robot and indicators at once: a :class:`RobotLink` and :class:`Indicators` of one cell.

    The controller believes in the nominal robot. Where the tool point truly is, and what the indicators then show, the
    errors of ``truth`` say, with the robot's repeatability anew after each move between poses.
    """

    def __init__(self, cell: Cell, truth: Truth, settings: CentringSettings, seed: int) -> None:
        self._cell, self._settings = cell, settings
        self._model, self._errors = truth.complete_model()
        self._rng = np.random.default_rng([seed, 4])
        self._q = self._off = read_only(np.zeros(cell.robot.n_joints))
        axes = cell.gauge.indicators.axes_F
        along = settings.head.tool_frame == "head"
        self._R_FT = Rotation.align_vectors(axes, np.eye(3))[0].as_matrix() if along else np.eye(3)
        self._to_readings = np.linalg.inv(settings.to_tool)
        self.move(cell.home)

    def move(self, q: Array, slow: bool = False) -> None:
        """Stand at the controller angles q (N,) [rad], as well as the robot repeats to."""
        self._q = read_only(q)
        self._off = read_only(self._model.joint_sigma * self._rng.standard_normal(len(q)))

    def shift(self, step: Array) -> None:
        """Move the tool by ``step`` (3,) [m] in its own frame, as the nominal robot does."""
        forgotten = float(np.deg2rad(1.0))  # [rad] travel of a joint over which it forgets by how much it stood off
        steps = 20  # of Newton: from a neighbouring pose it takes a few
        chain, robot = self._cell.chain, self._cell.robot
        x, R, _ = tool_pose(chain, robot, self._q[None])
        q, held = solve_pose_ik(chain, robot, self._q[None], x + self.orientation() @ step, R, steps)
        if not held[0]:
            raise LinkError("the arm cannot move the tool on this line")
        change = q[0] - self._q
        self._q = read_only(q[0])  # where a move came to rest stays as it is: small steps are far finer than that
        kept = np.exp(-np.abs(change) / forgotten)  # so that it stands as well as it repeats to after any steps
        fresh = self._model.joint_sigma * self._rng.standard_normal(len(change))
        self._off = read_only(kept * self._off + np.sqrt(1.0 - kept**2) * fresh)

    def joints(self) -> tuple[Array, Array]:
        """Return the controller angles, as read and as commanded, both (N,) [rad]."""
        return self._q, self._q

    def orientation(self) -> Array:
        """Return R_BT (3, 3)."""
        return np.asarray(tool_pose(self._cell.chain, self._cell.robot, self._q[None])[1][0] @ self._R_FT)

    def read(self) -> Array:
        """Return the readings of the three indicators, (3,) [m]; free ends where the disks touch no ball."""
        cell, head = self._cell, self._cell.gauge.indicators
        samples = replace(Samples.at(self._q[None]), q=read_only((self._q + self._off)[None]))
        x = -self._model.residual(samples, Targets.at_base(1), self._errors)[0]
        apart = cell.p_BS - x
        away = apart[int(np.argmin(np.linalg.norm(apart, axis=1)))]
        shown = self._to_readings @ self.orientation().T @ away
        across = np.sqrt(np.maximum(away @ away - shown**2, 0.0))
        touches = (np.abs(shown) < head.range / 2) & (across < head.tip / 2)
        # 1.2: times the usable range: a plunger with nothing before it stands out
        free = -1.2 * self._settings.head.usable_mm * 1e-3
        return np.asarray(np.where(touches, shown + (0.5 * UM) * self._rng.standard_normal(3), free))  # of an indicator

    def arrive(self) -> int:
        """No program drives a simulated arm."""
        raise LinkError("a simulated arm has no program of its own: leave out --follow")

    def release(self) -> None:
        """Do nothing: no motion waits for a release here."""

    def stop(self) -> None:
        """Do nothing: the simulated arm stands still between moves."""

    def close(self) -> None:
        """Do nothing: no connection is held."""
