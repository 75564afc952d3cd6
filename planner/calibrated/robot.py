"""Where the flange of a calibrated robot really stands: corrected rows, and its effects at the joint angles."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from planner.calibrated.uncorrected import uncorrected
from planner.effects import Context, Phi
from planner.effects.keys import is_static, needs_loads, phi_of
from planner.errors import InputError
from planner.rig import HEAD, STANDARD_GRAVITY, Rig
from planner.robot import Loads, Robot, RobotEffect
from planner.run import Samples
from planner.units import Array

CHUNK = 8192  # poses a pass
NO_LOADS = Loads(0.0, np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class CalibratedRobot:
    """A robot with the effects of its file, as far as joint angles and loads alone decide them.

    Torques are those of the nominal geometry, as in the fit that found the compliances; on the corrected geometry the
    deflections would differ by about a thousandth of their size.

    Raises:
        InputError: an effect has a basis function that is unknown or does not fit, or loads are missing.
    """

    robot: Robot

    def __post_init__(self) -> None:
        """Check every effect, used or not."""
        _ = self._acting

    @property
    def left_out(self) -> tuple[RobotEffect, ...]:
        """Effects that need more than joint angles and loads: speed, time, temperature, the place of the gauge."""
        return tuple(e for e in self.robot.effects if not e.static)

    @property
    def sentence(self) -> str | None:
        """Say what is left out, or ``None``."""
        return uncorrected(self.left_out)

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Return p_BF (n, 3) [m] and R_BF (n, 3, 3) at controller angles q (n, N) [rad]."""
        p, R = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
        for start in range(0, len(q), CHUNK):
            part = slice(start, start + CHUNK)
            theta = self.robot.theta(q[part])
            motion = self._rig.chain.forward(theta, self._delta(q[part]))
            p[part], R[part] = motion.x.T, np.moveaxis(motion.R, 2, 0)
        return p, R

    def _delta(self, q: Array) -> list[float | Array]:
        """What the effects add to every transform of the rig's chain [m, rad]."""
        rig = self._nominal_rig
        context = Context(rig, Samples(q, np.zeros(len(q), dtype=int), payload=np.zeros(len(q))))
        known: dict[Phi, Array] = {}
        out: list[float | Array] = [0.0] * len(self._rig.chain)
        for k, phi, value in self._acting:
            if phi not in known:
                known[phi] = phi(context)
            out[k] = out[k] + value * known[phi]
        return out

    @cached_property
    def _rig(self) -> Rig:
        return _rig(self.robot, self.robot.loads or NO_LOADS)

    @cached_property
    def _nominal_rig(self) -> Rig:
        return _rig(self.robot.nominal, self.robot.loads or NO_LOADS)

    @cached_property
    def _acting(self) -> tuple[tuple[int, Phi, float], ...]:
        """Transform, basis function and value of every effect that is used."""
        return tuple(self._checked())

    def _checked(self) -> Iterator[tuple[int, Phi, float]]:
        names = [t.name for t in self._rig.chain.transforms[: HEAD + len(self.robot.transforms)]]
        for e in self.robot.effects:
            where = f"{self.robot.path}: effect '{e.name}'"
            try:
                phi = phi_of(e.phi, self.robot.n_joints)
            except InputError as err:
                raise InputError(f"{where}: {err}") from err
            if e.static:
                self._check_static(where, e)
                yield names.index(e.on), phi, e.value

    def _check_static(self, where: str, e: RobotEffect) -> None:
        if not is_static(e.phi):
            raise InputError(
                f"{where}: '{e.phi}' depends on more than joint angles and loads, so it needs static = false"
            )
        if needs_loads(e.phi) and self.robot.loads is None:
            raise InputError(
                f"{where}: '{e.phi}' depends on the loads, but the file has no [loads] "
                "(payload_kg, com_mm, base_rpy_deg)"
            )


def _rig(robot: Robot, loads: Loads) -> Rig:
    """Return the robot with its loads, measured at the flange in its own base frame."""
    R_WB = Rotation.from_euler("xyz", loads.base_rpy).as_matrix()
    return Rig(
        robot=robot,
        kind="position",
        p_BX=np.zeros((0, 3)),
        R_BG=np.eye(3)[None],
        p_BG=np.zeros((1, 3)),
        p_FM=np.zeros((1, 3)),
        R_FM=np.eye(3)[None],
        p_GS=np.zeros((0, 3)),
        place_names=("",),
        point_names=("",),
        place_prior=np.zeros(1),
        tool_prior=0.0,
        turn_prior=0.0,
        noise=0.0,
        noise_angle=0.0,
        joint_sigma=0.0,
        gravity_B=R_WB.T @ np.array([0.0, 0.0, -STANDARD_GRAVITY]),
        tool_mass=loads.payload,
        com_F=loads.com_F,
    )
