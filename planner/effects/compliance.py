"""Compliance of joints, links, base and tool under weight, payload and the pull of the bar, and wrong masses."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from planner.cell.cell import MeasurementSetup
from planner.common.units import Array
from planner.effects.basis import BasisFunction, EffectVariable, Times
from planner.effects.catalogue import Background, Excitation, register
from planner.effects.context import Context
from planner.effects.effect import (
    Effect,
    Parameter,
    ParameterMove,
    Place,
    Role,
    joint_place,
    transform_move,
)
from planner.effects.sizes import LOAD_TURN, MASS_TURN

JOINT_COMPLIANCE = "joint compliance"
LINK_BENDING = "link bending"
LINK_MASSES = "link weights"  # group of what masses of links other than stated do through compliances
LEAST_LOAD = 1e-6  # [Nm] below which nothing is asked of it
TRICAL = "TriCal paper, Table 8; Nubiola & Bonev 2013, RCIM 29(1): 0.01 to 0.2e-3 deg/Nm for a 6 kg robot"
BENDING = "Meggiolaro, Dubowsky & Mavroidis 2005, Mech. Mach. Theory 40(7): elastic errors of links; size estimated"
MASSES = "estimated: a mass wrong by a third of a link or payload, at joints as soft as in the TriCal paper, Table 8"


class LoadTorque(BasisFunction, key="torque:JOINT", loads=True):
    """φ = torque [Nm] with which gravity, payload and the bar turn this joint, in the sense of its kinematic row.

    A parameter on the joint's own rotation with this φ is its compliance [rad/Nm] (TriCal paper, c2 … c6).
    """

    joint: int
    plot_label = "load on joint JOINT (Nm)"

    def __call__(self, c: Context) -> Array:
        """Return the load torque."""
        return c.load_torque[:, self.joint]


class LoadMoment(BasisFunction, key="moment:STATION:AXIS", loads=True):
    """φ = moment [Nm] of weights and the bar's pull about an axis (0, 1, 2) of a station, see ``Context``."""

    station: int
    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the moment."""
        return np.asarray(c.moments[self.station, self.axis])

    def plot_variable(self, c: Context) -> EffectVariable:
        """Draw against the moment."""
        return EffectVariable(f"moment of the weights about {'xyz'[self.axis]} (Nm)", self(c))


class TipMoment(BasisFunction, key="tip:AXIS", loads=True):
    """φ = moment [Nm/kg] about an axis of the flange of a unit mass in the measured point: a tool of unknown weight."""

    axis: int

    def __call__(self, c: Context) -> Array:
        """Return the moment."""
        moment = np.cross(c.motion.x - c.stations.p[-1], c.setup.gravity_B[:, None], axis=0)
        return np.asarray(np.einsum("in,in->n", c.stations.R[-1][:, self.axis], moment))


class StationTwist(BasisFunction, key="twist:STATION:AXIS:PART:PHI"):
    """φ = one of the six numbers by which a turn about an axis of a station moves the whole arm as seen at its base.

    Part 0, 1, 2 go with the base's shifts, 3, 4, 5 with its turns. All six together, times ``by``, turn everything
    beyond the station about its axis (a screw in Plücker coordinates: u and p × u).
    """

    station: int
    axis: int
    part: int
    by: BasisFunction

    def __call__(self, c: Context) -> Array:
        """Return the number."""
        u = c.stations.R[self.station, :, self.axis]
        if self.part >= 3:
            return np.asarray(u[self.part - 3] * self.by(c))
        p, k, m = c.stations.p[self.station], (self.part + 1) % 3, (self.part + 2) % 3
        return np.asarray((p[k] * u[m] - p[m] * u[k]) * self.by(c))


class WeightTorque(BasisFunction, key="weight:JOINT:LINK", loads=True):
    """φ = torque [Nm/kg] about a joint of a unit mass in the centre of a link or (link = N) of the payload."""

    joint: int
    link: int

    def __call__(self, c: Context) -> Array:
        """Return the torque."""
        k = c.joints[self.joint]
        lever = c.centres[self.link] - c.motion.p[k]
        return np.asarray(np.einsum("in,in->n", c.motion.u[k], np.cross(lever, c.setup.gravity_B[:, None], axis=0)))


class PayloadTorque(BasisFunction, key="payload:JOINT", loads=True, column="payload"):
    """φ = torque [Nm] of the logged payload alone about a joint."""

    joint: int
    plot_label = "torque of the payload about joint JOINT (Nm)"

    def __call__(self, c: Context) -> Array:
        """Return the torque."""
        return c.column("payload") * WeightTorque(self.joint, c.setup.robot.n_joints)(c)


class DriveTorque(BasisFunction, key="drive:JOINT", static=False, column="torque"):
    """φ = torque [Nm] against which a joint's drive holds, as logged, in the sense of the kinematic row."""

    joint: int
    plot_label = "measured torque of joint JOINT (Nm)"
    uncorrected = "giving way under measured drive torques"

    def __call__(self, c: Context) -> Array:
        """Return minus the logged torque."""
        sense = c.setup.robot.coupling_matrix[self.joint, self.joint]
        return np.asarray(-c.column("torque")[:, self.joint] * np.sign(sense))


def twist_moves(station: int, axis: int, by: BasisFunction) -> tuple[ParameterMove, ...]:
    """Turn everything beyond a station about one of its axes, which need not be a transform of its own."""
    return tuple(ParameterMove("transform", part, StationTwist(station, axis, part, by)) for part in range(6))


def compliance_parameters(setup: MeasurementSetup) -> list[Parameter]:
    """Compliance of each joint under gravity, payload and the bar's pull, as far as the robot's file expects it."""
    priors = setup.robot.priors
    size = [priors.compliance * priors.factor(f"compliance, joint {i + 1}") for i in range(setup.robot.n_joints)]
    return [
        Parameter(name := f"compliance{i + 1}", "rad/Nm", priors.size(name, size[i]), f"compliance of joint {i + 1}",
                  transform_move(k, LoadTorque(i)), JOINT_COMPLIANCE)
        for i, k in enumerate(setup.chain.joint_places.tolist()) if not setup.robot.slides[i]
    ]  # fmt: skip


def is_joint_compliance(parameter: Parameter) -> bool:
    """Tell whether a parameter is the compliance of a joint under its load torque."""
    return isinstance(parameter.main_move.phi, LoadTorque)


@register(JOINT_COMPLIANCE, background=Background.COMMON)
def joint_compliance(run: Excitation) -> Iterator[Effect]:
    """A joint gives way under weight, payload and the bar's pull; links of unknown mass have a share of their own."""
    unknown = [k for k, m in enumerate(run.setup.robot.masses) if m is None]
    for i in run.turning:
        loads: list[tuple[str, BasisFunction]] = [(f"compliance{i + 1}", LoadTorque(i))]
        loads += [(f"compliance{i + 1}_link{k + 1}", WeightTorque(i, k)) for k in unknown if k >= i]
        what = f"compliance of joint {i + 1}"
        parameters = [p for name, phi in loads for p in _compliance(run, i, phi, name, what)]
        more = ""
        if any(k >= i for k in unknown):
            parameters = [_at_largest(run, p) for p in parameters]
            more = " under the run's largest load (how much a newton metre only the links' masses tell)"
        sentence = f"joint {i + 1}: gives way under load, {{size}}{more}"
        yield from _effect(
            JOINT_COMPLIANCE, joint_place(i), parameters, sentence, TRICAL, Role.COMPLIANCE | Role.YIELDING
        )


@register(
    "compliance under drive torque",
    needs="the drives' torques in the run (torque1_Nm ...)",
    background=Background.OF_RUN,
)
def drive_compliance(run: Excitation) -> Iterator[Effect]:
    """A joint gives way under the torque that its drive reports."""
    kind = "compliance under drive torque"
    for i in run.turning if run.varies("torque") else ():
        what = f"{kind} of joint {i + 1}"
        parameters = _compliance(run, i, DriveTorque(i), f"drive_compliance{i + 1}", what)
        sentence = f"joint {i + 1}: gives way under the torque that its drive reports, {{size}}"
        yield from _effect(kind, joint_place(i), parameters, sentence, TRICAL, Role.YIELDING)


@register(
    "payload compliance",
    needs="the same poses with another payload (payload_kg in the run)",
    background=Background.BY_PLACE,
)
def payload_compliance(run: Excitation) -> Iterator[Effect]:
    """A joint gives way under the payload alone: a counterweight or the controller takes care of the rest."""
    for i in run.turning if run.varies("payload") else ():
        what = f"yielding of joint {i + 1} to payload"
        parameters = _compliance(run, i, PayloadTorque(i), f"payload_compliance{i + 1}", what)
        sentence = f"joint {i + 1}: gives way under the payload, {{size}}"
        yield from _effect("payload compliance", joint_place(i), parameters, sentence, TRICAL, Role.YIELDING)


@register(LINK_BENDING, background=Background.COMMON)
def link_bending(run: Excitation) -> Iterator[Effect]:
    """A link, or the bearing at its end, bends about the two axes across the next joint's."""
    for link in run.joints[:-1]:
        parameters = _transverse_tilts(run, link + 2, f"bending{link + 1}", f"link {link + 1}")
        sentence = f"link {link + 1}: bends under load at the bearing of joint {link + 2}, {{size}}"
        yield from _effect(LINK_BENDING, Place("link", link), parameters, sentence, BENDING)


@register("soft base")
def base_compliance(run: Excitation) -> Iterator[Effect]:
    """Floor, pedestal or bolts give way: the base tips over, about either axis by a stiffness of its own."""
    parameters = []
    for axis in (0, 1):
        load = run.largest(LoadMoment(0, axis))
        if load > LEAST_LOAD:
            moves = transform_move(3 + axis, LoadMoment(0, axis))
            what = f"tipping of the base about {'xy'[axis]}"
            parameters.append(Parameter(f"soft_base_r{'xy'[axis]}", "rad/Nm", LOAD_TURN.usual / load, what, moves))
    sentence = "the base tips on its floor or pedestal under the arm's weight, {size}"
    yield from _effect("soft base", Place("base"), parameters, sentence, "estimated")


@register("tool compliance")
def tool_compliance(run: Excitation) -> Iterator[Effect]:
    """Flange, adapter or tool bends under what it carries; of unknown weight, that hangs at the measured point."""
    station = run.setup.robot.n_joints + 1
    parameters = _transverse_tilts(run, station, "tool_bending", "tool") or [
        _at_largest(run, p)
        for axis in (0, 1)
        for p in _tilt(run, station, axis, TipMoment(axis), "tool_bending", "tool")
    ]
    sentence = "flange, adapter or tool bends under its load, {size}"
    yield from _effect("tool compliance", Place("tool"), parameters, sentence, "estimated")


@register("link mass", "payload mass", background=Background.NAMED_ONLY)
def mass_errors(run: Excitation) -> Iterator[Effect]:
    """Payload or a link heavier or lighter than stated, as seen through the joints that it loads most."""
    for i in run.joints:
        name = f"link {i + 1}"
        yield from _mass(run, i, "link mass", Place("link", i), f"link_mass{i + 1}", name, Role.UNTRACED)
    payload, name = run.setup.robot.n_joints, "payload or tool"
    yield from _mass(run, payload, "payload mass", Place("payload"), "payload_mass", name, Role.LIKE_COMPLIANCE)


def _mass(run: Excitation, link: int, kind: str, place: Place, label: str, name: str, role: Role) -> Iterator[Effect]:
    parameters = _mass_parameters(run, link, label)
    sentence = f"{name}: weighs other than stated, or its centre lies elsewhere; its joints yield {{size}} at most"
    yield from _effect(kind, place, parameters, sentence, MASSES, role, MASS_TURN.largest)


def _mass_parameters(run: Excitation, link: int, label: str) -> list[Parameter]:
    what = "turn of joint {} by the weight in question, where that turns it most in the run"
    return [
        Parameter(f"{label}_at{i + 1}", "rad", LOAD_TURN.usual, what.format(i + 1), moves)
        for i, moves in weight_turns(run, link, 1e-3)
    ]


def weight_turns(run: Excitation, link: int, least: float) -> Iterator[tuple[int, tuple[ParameterMove, ...]]]:
    """Yield the joints that a weight in a link (or, link = N, the payload) loads most, each turned by its torque.

    The torque is over its largest in the run; of that it must vary by the share ``least``.
    """
    phis = {i: WeightTorque(i, link) for i in run.turning if i <= link}
    load = {i: float(np.ptp(run.values(phi))) for i, phi in phis.items()}
    # 2: joints that a mass loads most, at which it may show
    for i in sorted(sorted(phis, key=lambda i: -load[i])[:2]):
        size = run.largest(phis[i])
        if load[i] > max(LEAST_LOAD, least * size):
            yield i, transform_move(run.rotation(i), Times(1 / size, phis[i]))


def _effect(
    kind: str, place: Place, parameters: Sequence[Parameter], sentence: str, literature: str,
    role: Role = Role.ORDINARY, turn: float = LOAD_TURN.largest,
) -> Iterator[Effect]:  # fmt: skip
    """Yield the effect if it has parameters; ``turn`` [rad] is the most that is plausible under the largest load."""
    if parameters:
        largest = max(p.prior for p in parameters) * turn / LOAD_TURN.usual
        yield Effect(kind, place, tuple(parameters), sentence, largest, literature, role=role)


def _compliance(run: Excitation, joint: int, phi: BasisFunction, name: str, what: str) -> list[Parameter]:
    """Turn of a joint by a load, where there is one that varies."""
    load = run.values(phi)
    size = float(np.abs(load).max())
    if size < LEAST_LOAD or float(np.ptp(load)) < 1e-3 * size:
        return []
    return [Parameter(name, "rad/Nm", LOAD_TURN.usual / size, what, transform_move(run.rotation(joint), phi))]


def _at_largest(run: Excitation, p: Parameter) -> Parameter:
    """Return the parameter as the turn [rad] under the run's largest load, where no mass makes newton metres of it."""
    moves = tuple(replace(m, phi=_by_size(m.phi, LOAD_TURN.usual / p.prior)) for m in p.moves)
    return replace(p, unit="rad", prior=LOAD_TURN.usual, moves=moves)


def _by_size(phi: BasisFunction, size: float) -> BasisFunction:
    return replace(phi, by=Times(1 / size, phi.by)) if isinstance(phi, StationTwist) else Times(1 / size, phi)


def _transverse_tilts(run: Excitation, station: int, label: str, what: str) -> list[Parameter]:
    """Turns of a station about its two transverse axes, each by its load moment."""
    chain, tool = run.setup.chain.transforms, station > run.setup.robot.n_joints
    turn = 2 if tool else chain[run.rotation(station - 1)].axis
    axes = [k for k in range(3) if k != turn]
    return [p for k in axes for p in _tilt(run, station, k, LoadMoment(station, k), label, what)]


def _tilt(run: Excitation, station: int, axis: int, phi: BasisFunction, label: str, what: str) -> list[Parameter]:
    """Turn of a station about one of its axes by a load, where there is one."""
    load = run.largest(phi)
    if load < LEAST_LOAD:
        return []
    what = f"bending of {what} about {'xyz'[axis]}"
    return [
        Parameter(f"{label}_{'xyz'[axis]}", "rad/Nm", LOAD_TURN.usual / load, what, twist_moves(station, axis, phi))
    ]
