"""What basis functions may look at: the samples, and what follows from them on the nominal robot."""

from collections.abc import Callable, Hashable, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.cell.placement import RobotSetup
from planner.common.units import Array
from planner.kinematics.chain import Chain, ForwardPass, Transform
from planner.kinematics.geometry import BarState, bar_state
from planner.runs.run import Samples


@dataclass(frozen=True)
class StationFrames:
    """Some frames of the chain in the base frame: orientations R (S, 3, 3, n) and origins p (S, 3, n) [m]."""

    R: Array
    p: Array


def station_frames(chain: Chain, theta: Array, ends: Sequence[int]) -> StationFrames:
    """Return the frames that stand after the first ``ends`` transforms (rising) of a chain; theta (n, N) [rad]."""
    n = len(theta)
    R, p = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, n)), np.zeros((3, n))
    R_all, p_all = np.empty((len(ends), 3, 3, n)), np.empty((len(ends), 3, n))
    for s, (start, end) in enumerate(pairwise((0, *ends))):
        if end > start:
            part = Chain(chain.transforms[start:end]).forward(theta)
            p = p + np.einsum("ijn,jn->in", R, part.x)
            R = np.einsum("ijn,jkn->ikn", R, part.R)
        R_all[s], p_all[s] = R, p
    return StationFrames(R_all, p_all)


def _rotate(w: list[Array], axis: int, angle: Array, sign: float) -> list[Array]:
    """Rotate the vector w (three arrays) about ``axis`` by ``sign``·angle."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = np.cos(angle), sign * np.sin(angle)
    out = list(w)
    out[b], out[c] = cos * w[b] - sin * w[c], sin * w[b] + cos * w[c]
    return out


def gravity_torque(
    chain: Chain, theta: Array, gravity_B: Array, loads: tuple[tuple[int, Array | float, Array], ...]
) -> Array:
    """Return the torque of gravity about each joint's axis, (n, N) [Nm], in the sense of the kinematic rows.

    Of a joint that slides it is the force along its axis [N].

    It is minus the static torque that Newton–Euler gives the motors (virtual work).

    Args:
        chain: base to flange.
        theta: angles of the kinematic rows, (n, N) [rad].
        gravity_B: acceleration of gravity in the base frame, (3,) [m/s²].
        loads: (end, mass, com): masses [kg], one number or (n,), with centres of mass (3,) [m] in the frame that
            stands after the first ``end`` transforms.
    """
    values = chain.values(theta)
    gravity = _gravity_at_joints(chain.transforms, values, gravity_B)
    out = np.zeros_like(theta)
    mass: Array = np.zeros(1)
    moment = [np.zeros(1), np.zeros(1), np.zeros(1)]
    for k in range(len(chain.transforms), -1, -1):
        for end, m, com in loads:
            if end == k:
                mass = mass + np.atleast_1d(m)
                moment = [w + m * float(c) for w, c in zip(moment, com, strict=True)]
        if k == 0:
            break
        t, value = chain.transforms[k - 1], values[k - 1]
        if t.joint is not None:
            g, b, c = gravity[t.joint], (t.axis + 1) % 3, (t.axis + 2) % 3
            slides = t.kind == "translation"
            out[:, t.joint] += mass * g[t.axis] if slides else moment[b] * g[c] - moment[c] * g[b]
        if t.kind == "translation":
            moment[t.axis] = moment[t.axis] + mass * value
        else:
            moment = _rotate(moment, t.axis, value, 1.0)
    return out


def _gravity_at_joints(
    transforms: tuple[Transform, ...], values: list[Array], gravity_B: Array
) -> dict[int, list[Array]]:
    """Gravity in the frame just after each joint."""
    g: list[Array] = [np.full(1, float(v)) for v in gravity_B]
    out: dict[int, list[Array]] = {}
    for t, value in zip(transforms, values, strict=True):
        if t.kind == "rotation":
            g = _rotate(g, t.axis, value, -1.0)
        if t.joint is not None:
            out[t.joint] = g
    return out


Stack = tuple[tuple[Callable[["Context"], Array], ...], ...]
"""Functions of each row of a stack, which are added up."""


@dataclass(frozen=True)
class Context:
    """Some samples of a setup; derived quantities are computed once, when first asked for.

    Frames of the robot are counted by stations: 0 is the base, i the frame in which joint i (from 1) turns, N + 1 the
    flange.
    """

    setup: RobotSetup
    samples: Samples
    _known: dict[Hashable, Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    _several: dict[int, tuple[object, list[Array]]] = field(default_factory=dict, init=False, repr=False, compare=False)
    _stacks: "dict[Stack, Array]" = field(default_factory=dict, init=False, repr=False, compare=False)
    _whole: "tuple[Context, np.ndarray] | None" = field(default=None, repr=False, compare=False)

    def take(self, which: np.ndarray) -> "Context":
        """Return the context of some of the samples; what looks at each sample alone is not computed anew."""
        return Context(self.setup, self.samples.take(which), (self, which))

    def value(self, phi: "Callable[[Context], Array]") -> Array:
        """Value of a basis function, (n,) or (1,), remembered for as long as the context lives."""
        if phi not in self._known:
            alone = self._whole is not None and getattr(phi, "looks_at_samples_alone", False)
            self._known[phi] = self._take_value(phi) if alone else phi(self)
        return self._known[phi]

    def _take_value(self, phi: "Callable[[Context], Array]") -> Array:
        assert self._whole is not None
        whole, which = self._whole
        value = whole.value(phi)
        return value if len(value) == 1 else value[which]

    def values(self, functions: "tuple[Callable[[Context], Array], ...]") -> list[Array]:
        """Values of several basis functions, remembered for the same tuple without a look at each function."""
        known = self._several.get(id(functions))
        if known is None:
            known = self._several[id(functions)] = functions, [self.value(f) for f in functions]
        return known[1]

    def stacks(self, several: "tuple[Stack, ...]") -> list[Array]:
        """Values (m, n) of the sums of functions of several stacks, read-only: alike stacks of models are one array."""
        known = self._several.get(id(several))
        if known is None:
            known = self._several[id(several)] = several, [self._stack(rows) for rows in several]
        return known[1]

    def known_stacks(self, several: "tuple[Stack, ...]") -> list[Array] | None:
        """Return the same if they were asked for before."""
        known = self._several.get(id(several))
        return None if known is None else known[1]

    def _stack(self, rows: "Stack") -> Array:
        if rows not in self._stacks:
            out = np.empty((len(rows), len(self.samples)))
            for own, functions in zip(out, rows, strict=True):
                own[:] = self.value(functions[0])
                for more in functions[1:]:
                    own += self.value(more)
            out.flags.writeable = False
            self._stacks[rows] = out
        return self._stacks[rows]

    def forget_values(self, kept: "Set[Hashable]" = frozenset()) -> None:
        """Let go of the values of basis functions but some: of many models they take more memory than all else."""
        self._several.clear()
        for rows in [rows for rows in self._stacks if any(phi not in kept for own in rows for phi in own)]:
            del self._stacks[rows]
        for phi in [f for f in self._known if f not in kept]:
            del self._known[phi]

    def column(self, name: str) -> Array:
        """A column of the samples that a basis function is asked for only where it was logged."""
        values: Array | None = getattr(self.samples, name)
        assert values is not None, name
        return values

    @property
    def measurement_setup(self) -> MeasurementSetup:
        """The setup with the gauge that took the samples."""
        assert isinstance(self.setup, MeasurementSetup)
        return self.setup

    @cached_property
    def theta(self) -> Array:
        """Angles of the kinematic rows, (n, N) [rad]."""
        return self.setup.robot.theta(self.samples.q)

    @cached_property
    def motion(self) -> ForwardPass:
        """Forward pass of the nominal setup."""
        return self.setup.chain.forward(self.theta, self.setup.offsets(self.samples))

    @cached_property
    def bar(self) -> BarState:
        """Length and direction of the bar on the nominal setup."""
        return bar_state(self.motion.x.T, self.measurement_setup.p_BX[self.samples.place])

    @property
    def length(self) -> Array:
        """Length (n,) [m] as the gauge showed it where the samples carry it, else that of the nominal setup."""
        return self.bar.length if self.samples.length is None else self.samples.length

    @cached_property
    def ray(self) -> Array:
        """From the origin of the gauge's frame to the measured point, in the base frame, (n, 3) [m]."""
        return np.asarray(self.motion.x.T - self.measurement_setup.p_BG[self.samples.place])

    @cached_property
    def velocity(self) -> Array:
        """Velocity of the measured point in the base frame, (n, 3) [m/s], from the joints' speeds."""
        rate = self.column("speed") @ self.setup.robot.coupling_matrix.T
        return np.asarray(np.einsum("jkn,nj->nk", self.motion.point_screws(self.joints), rate))

    @cached_property
    def joints(self) -> np.ndarray:
        """Position of each joint's rotation in the setup's chain, (N,)."""
        return self.setup.chain.joint_places

    @cached_property
    def load_torque(self) -> Array:
        """Torque of gravity, payload and the bar's pull about each joint, (n, N) [Nm; N along one that slides]."""
        robot = self.setup.robot
        links = [(end, m) for end, m in zip(robot.link_end[1:], robot.masses, strict=True) if m is not None]
        loads: list[tuple[int, Array | float, Array]] = [(end, m.mass, m.com) for end, m in links]
        loads.append((len(robot.transforms), self._flange_mass, self.setup.com_F))
        torque = gravity_torque(robot.chain, self.theta, self.setup.gravity_B, tuple(loads))
        if self.pull is None:
            return torque
        return np.asarray(torque + np.einsum("jkn,kn->nj", self.motion.point_screws(self.joints), self.pull))

    @property
    def _flange_mass(self) -> Array | float:
        """Mass on the flange, one number or (n,) [kg]."""
        return self.setup.tool_mass if self.samples.payload is None else self.setup.tool_mass + self.samples.payload

    @cached_property
    def pull(self) -> Array | None:
        """Force of the bar on the tool point, towards the fixture, (3, n) [N] in the base frame, where logged."""
        force = self.samples.force
        if force is None:
            return None
        setup = self.measurement_setup
        along = setup.gauge.pull_direction(setup, self.samples, self.motion)
        return None if along is None else -force * along.T

    @cached_property
    def _ends(self) -> tuple[int, ...]:
        """Number of the robot's transforms before each station."""
        robot = self.setup.robot
        return (0, *robot.chain.joint_places.tolist(), len(robot.transforms))

    @cached_property
    def stations(self) -> StationFrames:
        """Frames of the stations."""
        return station_frames(self.setup.robot.chain, self.theta, self._ends)

    @cached_property
    def centres(self) -> Array:
        """Centres of mass of the links (unknown: the origin) and of what the flange carries, (N + 1, 3, n) [m]."""
        robot, n = self.setup.robot, len(self.samples)
        own = [np.zeros(3) if m is None else m.com for m in robot.masses]
        at = station_frames(robot.chain, self.theta, (*robot.link_end[1:], len(robot.transforms)))
        com = np.array([*own, self.setup.com_F])
        return np.asarray(at.p + np.einsum("sijn,sj->sin", at.R, com)).reshape(-1, 3, n)

    @cached_property
    def moments(self) -> Array:
        """Moments of weights and of the bar's pull about each station's own axes, (N + 2, 3, n) [Nm].

        The flange bends under what it carries alone.
        """
        robot, at = self.setup.robot, self.stations
        flange, shape = len(robot.transforms), at.p.shape[1:]
        loads: list[tuple[int, Array | float, Array]] = [  # frame on which a weight hangs, mass [kg], centre (3, n) [m]
            (min(end, flange - 1), m.mass, centre)
            for end, m, centre in zip(robot.link_end[1:], robot.masses, self.centres, strict=False)
            if m is not None
        ]
        loads.append((flange + 1, self._flange_mass, self.centres[-1]))
        gravity, out = np.broadcast_to(self.setup.gravity_B[:, None], shape), np.zeros(at.p.shape)
        for s, first in enumerate(self._ends):
            moment = np.zeros(shape)
            for end, mass, centre in loads:
                if end >= first:  # it hangs at the station or beyond
                    moment = moment + mass * np.cross(centre - at.p[s], gravity, axis=0)
            if self.pull is not None:
                moment = moment + np.cross(self.motion.x - at.p[s], self.pull, axis=0)
            out[s] = np.einsum("ijn,in->jn", at.R[s], moment)
        return out
