"""What basis functions may look at: the samples, and what follows from them on the nominal robot."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from planner.effects.gravity import gravity_torque
from planner.gauge import bar_state
from planner.rig import Rig
from planner.run import Samples
from planner.units import Array


@dataclass(frozen=True)
class Context:
    """Some samples of a rig; derived quantities are computed once, when first asked for."""

    rig: Rig
    samples: Samples

    @cached_property
    def theta(self) -> Array:
        """Angles of the kinematic rows, (n, N) [rad]."""
        return self.rig.robot.theta(self.samples.q)

    @cached_property
    def load_torque(self) -> Array:
        """Torque of gravity, payload and the bar's pull about each joint, (n, N) [Nm], sense of the kinematic rows."""
        robot = self.rig.robot
        links = [(end, m) for end, m in zip(robot.link_end[1:], robot.masses, strict=True) if m is not None]
        loads: list[tuple[int, Array | float, Array]] = [(end, m.mass, m.com) for end, m in links]
        payload = self.samples.payload
        loads.append((len(robot.transforms), self.rig.tool_mass if payload is None else payload, self.rig.com_F))
        torque = gravity_torque(robot.chain, self.theta, self.rig.gravity_B, tuple(loads))
        return torque if self.samples.force is None else torque + self._pull(self.samples.force)

    def _pull(self, force: Array) -> Array:
        """Torque of the bar's pull on the tool point, towards the fixture, (n, N) [Nm]."""
        p_BX = self.rig.p_BX[self.samples.place]
        chain = self.rig.chain
        motion = chain.forward(self.theta, self.rig.offsets(self.samples))
        direction = bar_state(motion.x.T, p_BX).direction
        joints = [k for k, t in enumerate(chain.transforms) if t.joint is not None]
        order = np.argsort([int(chain.transforms[k].joint or 0) for k in joints])
        screws = motion.point_screws(np.array(joints)[order])
        return np.asarray(np.einsum("jkn,nk,n->nj", screws, -direction, force))
