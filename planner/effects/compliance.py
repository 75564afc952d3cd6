"""Compliance of joints, links, base and tool under weight, payload and the pull of the bar, and masses other than
stated."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.effects.basis import LoadTorque, Phi
from planner.effects.effect import Effect, Excitation, effect_of, twist_moves
from planner.effects.load_functions import DriveTorque, LoadMoment, PayloadTorque, TipMoment, WeightTorque
from planner.effects.parameters import Parameter, transform_move

USUAL_TURN, LARGEST_TURN = 3e-4, 1e-2  # [rad] under the run's largest load: one sigma, and the most that is plausible
LEAST_LOAD = 1e-6  # [Nm] load below which nothing is asked of it
SOURCE_COMPLIANCE = "TriCal paper, Table 8; Nubiola & Bonev 2013, RCIM 29(1): 0.01 to 0.2e-3 deg/Nm for a 6 kg robot"
SOURCE_BENDING = (
    "Meggiolaro, Dubowsky & Mavroidis 2005, Mech. Mach. Theory 40(7): elastic errors of links; size estimated"
)


def joint_compliance(site: Excitation) -> Iterator[Effect]:
    """A joint gives way under weight, payload and the bar's pull; links of unknown mass have a share of their own."""
    unknown = [k for k, m in enumerate(site.setup.robot.masses) if m is None]
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        loads: list[tuple[str, Phi]] = [(f"compliance{i + 1}", LoadTorque(i))]
        loads += [(f"compliance{i + 1}_link{k + 1}", WeightTorque(i, k)) for k in unknown if k >= i]
        parameters = [
            p for label, phi in loads if (p := compliance_parameter(site, i, phi, label, f"compliance of {on}"))
        ]
        if parameters:
            sentence = f"{on}: gives way under load"
            sentence += ", {size}" if len(parameters) == 1 else "; how much a newton metre only the links' masses tell"
            yield effect_of(
                "joint compliance", on, parameters, sentence, largest_compliance(parameters), SOURCE_COMPLIANCE
            )


def drive_compliance(site: Excitation) -> Iterator[Effect]:
    """A joint gives way under the torque that its drive reports."""
    if not site.varies("torque"):
        return
    kind = "compliance under drive torque"
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        parameter = compliance_parameter(site, i, DriveTorque(i), f"drive_compliance{i + 1}", f"{kind} of {on}")
        if parameter is not None:
            sentence = f"{on}: gives way under the torque that its drive reports, {{size}}"
            yield effect_of(kind, on, [parameter], sentence, largest_compliance([parameter]), SOURCE_COMPLIANCE)


def link_bending(site: Excitation) -> Iterator[Effect]:
    """A link, or the bearing at its end, bends about the two axes across the next joint's."""
    for link in range(1, site.n_joints):
        sentence = f"link {link}: bends under load at the bearing of joint {link + 1}, {{size}}"
        parameters = _transverse_tilts(site, link + 1, f"bending{link}", f"link {link}")
        if parameters:
            yield effect_of(
                "link bending", f"link {link}", parameters, sentence, largest_compliance(parameters), SOURCE_BENDING
            )


def base_compliance(site: Excitation) -> Iterator[Effect]:
    """Floor, pedestal or bolts give way: the base tips over, about either axis by a stiffness of its own."""
    parameters = []
    for axis in (0, 1):
        load = site.largest(LoadMoment(0, axis))
        if load > LEAST_LOAD:
            what = f"tipping of the base about {'xy'[axis]}"
            moves = transform_move(3 + axis, LoadMoment(0, axis))
            parameters.append(Parameter(f"soft_base_r{'xy'[axis]}", "rad/Nm", USUAL_TURN / load, what, moves))
    if parameters:
        sentence = "the base tips on its floor or pedestal under the arm's weight, {size}"
        yield effect_of("soft base", "base", parameters, sentence, largest_compliance(parameters), "estimated")


def tool_compliance(site: Excitation) -> Iterator[Effect]:
    """Flange, adapter or tool bends under what it carries; of unknown weight, that hangs at the measured point."""
    station = site.n_joints + 1
    parameters = _transverse_tilts(site, station, "tool_bending", "tool") or [
        p for axis in (0, 1) if (p := _tilt(site, station, axis, TipMoment(axis), "tool_bending", "tool"))
    ]
    if parameters:
        sentence = "flange, adapter or tool bends under its load, {size}"
        yield effect_of("tool compliance", "tool", parameters, sentence, largest_compliance(parameters), "estimated")


def compliance_parameter(site: Excitation, joint: int, phi: Phi, label: str, what: str) -> Parameter | None:
    """Turn of a joint by a load, where there is one that varies."""
    load = phi(site.context)
    size = float(np.abs(load).max())
    if size < LEAST_LOAD or float(np.ptp(load)) < 1e-3 * size:
        return None
    return Parameter(label, "rad/Nm", USUAL_TURN / size, what, transform_move(site.theta(joint), phi))


def largest_compliance(parameters: Sequence[Parameter]) -> float:
    """Largest plausible compliance of some parameters [rad/Nm]."""
    return max(p.prior for p in parameters) * LARGEST_TURN / USUAL_TURN


def _transverse_tilts(site: Excitation, station: int, label: str, what: str) -> list[Parameter]:
    """Turns of a station about its two transverse axes, each by its load moment."""
    turn = 2 if station > site.n_joints else site.setup.chain.transforms[site.theta(station - 1)].axis
    tilts = (_tilt(site, station, k, LoadMoment(station, k), label, what) for k in range(3) if k != turn)
    return [p for p in tilts if p is not None]


def _tilt(site: Excitation, station: int, axis: int, phi: Phi, label: str, what: str) -> Parameter | None:
    """Turn of a station about one of its axes by a load, where there is one."""
    load = site.largest(phi)
    if load < LEAST_LOAD:
        return None
    what = f"bending of {what} about {'xyz'[axis]}"
    return Parameter(f"{label}_{'xyz'[axis]}", "rad/Nm", USUAL_TURN / load, what, twist_moves(station, axis, phi))


JOINTS_SHOWN = 2  # joints, those that the weight loads most, at which it may show
LARGEST_MASS_TURN = 2e-3  # [rad] under the largest such load
SOURCE_MASS = (
    "estimated: a mass wrong by a third of a link or payload, at joints as soft as in the TriCal paper, Table 8"
)


def payload_compliance(site: Excitation) -> Iterator[Effect]:
    """A joint gives way under the payload alone: a counterweight or the controller takes care of the rest."""
    if not site.varies("payload"):
        return
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        parameter = compliance_parameter(
            site, i, PayloadTorque(i), f"payload_compliance{i + 1}", f"yielding of {on} to payload"
        )
        if parameter is not None:
            sentence = f"{on}: gives way under the payload, {{size}}"
            yield effect_of(
                "payload compliance", on, [parameter], sentence, largest_compliance([parameter]), SOURCE_COMPLIANCE
            )


def wrong_mass(site: Excitation) -> Iterator[Effect]:
    """Payload or a link heavier or lighter than stated, as seen through the joints that it loads most."""
    for link in range(site.n_joints + 1):
        payload = link == site.n_joints
        on = "payload" if payload else f"link {link + 1}"
        kind = "payload mass" if payload else "link mass"
        parameters = _mass_parameters(site, link, "payload_mass" if payload else f"link_mass{link + 1}")
        if parameters:
            whose = "payload or tool" if payload else f"link {link + 1}"
            sentence = f"{whose}: weighs other than stated, or its centre lies elsewhere; its joints yield {{size}}"
            largest = max(p.prior for p in parameters) * LARGEST_MASS_TURN / USUAL_TURN
            yield effect_of(kind, on, parameters, sentence, largest, SOURCE_MASS)


def _mass_parameters(site: Excitation, link: int, label: str) -> list[Parameter]:
    phis = [WeightTorque(i, link) for i in range(min(link + 1, site.n_joints))]
    load = np.array([np.ptp(phi(site.context)) for phi in phis])
    out = []
    for i in sorted(np.argsort(-load, kind="stable")[:JOINTS_SHOWN]):
        size = site.largest(phis[i])
        if load[i] > max(LEAST_LOAD, 1e-3 * size):
            what = f"turn of joint {i + 1} by the weight of a kilogram more"
            moves = transform_move(site.theta(int(i)), phis[i])
            out.append(Parameter(f"{label}_at{i + 1}", "rad/Nm", USUAL_TURN / size, what, moves))
    return out
