"""What yields under weight, payload, the bar's pull and the drives: joints, links, base and tool."""

from collections.abc import Iterator, Sequence

import numpy as np

from planner.catalogue.site import Site, entry, twisting
from planner.catalogue.types import Entry
from planner.effects.basis import LoadTorque, Phi
from planner.effects.loads import DriveTorque, LoadMoment, TipMoment, WeightTorque
from planner.model import Parameter
from planner.model.parameters import transform

YIELD, LARGEST_YIELD = 3e-4, 1e-2  # [rad] under the run's largest load: one sigma, and the most that is plausible
LEAST = 1e-6  # [Nm] load below which nothing is asked of it
TRICAL = "TriCal paper, Table 8; Nubiola & Bonev 2013, RCIM 29(1): 0.01 to 0.2e-3 deg/Nm for a 6 kg robot"
BENDING = "Meggiolaro, Dubowsky & Mavroidis 2005, Mech. Mach. Theory 40(7): elastic errors of links; size estimated"


def joint_compliance(site: Site) -> Iterator[Entry]:
    """A joint gives way under weight, payload and the bar's pull; links of unknown mass have a share of their own."""
    unknown = [k for k, m in enumerate(site.rig.robot.masses) if m is None]
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        loads: list[tuple[str, Phi]] = [(f"compliance{i + 1}", LoadTorque(i))]
        loads += [(f"compliance{i + 1}_link{k + 1}", WeightTorque(i, k)) for k in unknown if k >= i]
        parameters = [p for label, phi in loads if (p := softness(site, i, phi, label, f"compliance of {on}"))]
        if parameters:
            sentence = f"{on}: gives way under load"
            sentence += ", {size}" if len(parameters) == 1 else "; how much a newton metre only the links' masses tell"
            yield entry("joint compliance", on, parameters, sentence, most(parameters), TRICAL)


def drive_compliance(site: Site) -> Iterator[Entry]:
    """A joint gives way under the torque that its drive reports."""
    if not site.varies("torque"):
        return
    kind = "compliance under drive torque"
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        parameter = softness(site, i, DriveTorque(i), f"drive_compliance{i + 1}", f"{kind} of {on}")
        if parameter is not None:
            sentence = f"{on}: gives way under the torque that its drive reports, {{size}}"
            yield entry(kind, on, [parameter], sentence, most([parameter]), TRICAL)


def link_bending(site: Site) -> Iterator[Entry]:
    """A link, or the bearing at its end, bends about the two axes across the next joint's."""
    for link in range(1, site.n_joints):
        sentence = f"link {link}: bends under load at the bearing of joint {link + 1}, {{size}}"
        parameters = _tilts(site, link + 1, f"bending{link}", f"link {link}")
        if parameters:
            yield entry("link bending", f"link {link}", parameters, sentence, most(parameters), BENDING)


def soft_base(site: Site) -> Iterator[Entry]:
    """Floor, pedestal or bolts give way: the base tips over, about either axis by a stiffness of its own."""
    parameters = []
    for axis in (0, 1):
        load = site.largest(LoadMoment(0, axis))
        if load > LEAST:
            what = f"tipping of the base about {'xy'[axis]}"
            moves = transform(3 + axis, LoadMoment(0, axis))
            parameters.append(Parameter(f"soft_base_r{'xy'[axis]}", "rad/Nm", YIELD / load, what, moves))
    if parameters:
        sentence = "the base tips on its floor or pedestal under the arm's weight, {size}"
        yield entry("soft base", "base", parameters, sentence, most(parameters), "estimated")


def tool_compliance(site: Site) -> Iterator[Entry]:
    """Flange, adapter or tool bends under what it carries; of unknown weight, that hangs at the measured point."""
    station = site.n_joints + 1
    parameters = _tilts(site, station, "tool_bending", "tool") or [
        p for axis in (0, 1) if (p := _tilt(site, station, axis, TipMoment(axis), "tool_bending", "tool"))
    ]
    if parameters:
        sentence = "flange, adapter or tool bends under its load, {size}"
        yield entry("tool compliance", "tool", parameters, sentence, most(parameters), "estimated")


def softness(site: Site, joint: int, phi: Phi, label: str, what: str) -> Parameter | None:
    """Turn of a joint by a load, where there is one that varies."""
    load = phi(site.context)
    size = float(np.abs(load).max())
    if size < LEAST or float(np.ptp(load)) < 1e-3 * size:
        return None
    return Parameter(label, "rad/Nm", YIELD / size, what, transform(site.theta(joint), phi))


def most(parameters: Sequence[Parameter]) -> float:
    """Largest plausible compliance of some parameters [rad/Nm]."""
    return max(p.prior for p in parameters) * LARGEST_YIELD / YIELD


def _tilts(site: Site, station: int, label: str, what: str) -> list[Parameter]:
    """Turns of a station about its two transverse axes, each by its load moment."""
    turn = 2 if station > site.n_joints else site.rig.chain.transforms[site.theta(station - 1)].axis
    tilts = (_tilt(site, station, k, LoadMoment(station, k), label, what) for k in range(3) if k != turn)
    return [p for p in tilts if p is not None]


def _tilt(site: Site, station: int, axis: int, phi: Phi, label: str, what: str) -> Parameter | None:
    """Turn of a station about one of its axes by a load, where there is one."""
    load = site.largest(phi)
    if load < LEAST:
        return None
    what = f"bending of {what} about {'xyz'[axis]}"
    return Parameter(f"{label}_{'xyz'[axis]}", "rad/Nm", YIELD / load, what, twisting(station, axis, phi))
