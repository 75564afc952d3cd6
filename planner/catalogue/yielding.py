"""What yields under weight, payload, the bar's pull and the drives: joints, links, base and tool."""

from collections.abc import Iterator

import numpy as np

from planner.catalogue.site import Site, entry
from planner.catalogue.types import Entry
from planner.effects.basis import LoadTorque, Phi
from planner.effects.loads import DriveTorque, LoadMoment, Twist
from planner.model import Move, Parameter
from planner.model.parameters import transform

YIELD, LARGEST_YIELD = 3e-4, 1e-2  # [rad] under the run's largest load: one sigma, and the most that is plausible
LEAST = 1e-6  # [Nm] load below which nothing is asked of it
TRICAL = "TriCal paper, Table 8; Nubiola & Bonev 2013, RCIM 29(1): 0.01 to 0.2e-3 deg/Nm for a 6 kg robot"
BENDING = "Meggiolaro, Dubowsky & Mavroidis 2005, Mech. Mach. Theory 40(7): elastic errors of links; size estimated"


def joint_compliance(site: Site) -> Iterator[Entry]:
    """A joint gives way under weight, payload and the bar's pull."""
    for i in range(site.n_joints):
        sentence = f"joint {i + 1}: gives way under load, {{size}}"
        yield from yielding(site, "joint compliance", i, LoadTorque(i), f"compliance{i + 1}", sentence, TRICAL)


def drive_compliance(site: Site) -> Iterator[Entry]:
    """A joint gives way under the torque that its drive reports."""
    if not site.varies("torque"):
        return
    for i in range(site.n_joints):
        sentence = f"joint {i + 1}: gives way under the torque that its drive reports, {{size}}"
        label = f"drive_compliance{i + 1}"
        yield from yielding(site, "compliance under drive torque", i, DriveTorque(i), label, sentence, TRICAL)


def link_bending(site: Site) -> Iterator[Entry]:
    """A link, or the bearing at its end, bends about the two axes across the next joint's."""
    for link in range(1, site.n_joints):
        sentence = f"link {link}: bends under load at the bearing of joint {link + 1}, {{size}}"
        parameters = _tilts(site, link + 1, f"bending{link}", f"link {link}")
        if parameters:
            largest = max(p.prior for p in parameters) * LARGEST_YIELD / YIELD
            yield entry("link bending", f"link {link}", parameters, sentence, largest, BENDING)


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
        largest = max(p.prior for p in parameters) * LARGEST_YIELD / YIELD
        sentence = "the base tips on its floor or pedestal under the arm's weight, {size}"
        yield entry("soft base", "base", parameters, sentence, largest, "estimated")


def tool_compliance(site: Site) -> Iterator[Entry]:
    """Flange, adapter or tool bends under what it carries."""
    parameters = _tilts(site, site.n_joints + 1, "tool_bending", "tool")
    if parameters:
        largest = max(p.prior for p in parameters) * LARGEST_YIELD / YIELD
        sentence = "flange, adapter or tool bends under its load, {size}"
        yield entry("tool compliance", "tool", parameters, sentence, largest, "estimated")


def yielding(site: Site, kind: str, joint: int, phi: Phi, label: str, sentence: str, source: str) -> Iterator[Entry]:
    """An entry of one joint that turns by a load, where there is one that varies."""
    load = phi(site.context)
    size = float(np.abs(load).max())
    if size < LEAST or float(np.ptp(load)) < 1e-3 * size:
        return
    on = f"joint {joint + 1}"
    parameter = Parameter(label, "rad/Nm", YIELD / size, f"{kind} of {on}", transform(site.theta(joint), phi))
    yield entry(kind, on, [parameter], sentence, LARGEST_YIELD / size, source)


def _tilts(site: Site, station: int, label: str, what: str) -> list[Parameter]:
    """Turns of a station about its two transverse axes, each by its load moment, as seen at the base."""
    turn = 2 if station > site.n_joints else site.rig.chain.transforms[site.theta(station - 1)].axis
    out = []
    for axis in (k for k in range(3) if k != turn):
        phi = LoadMoment(station, axis)
        load = site.largest(phi)
        if load > LEAST:
            moves = tuple(Move("transform", part, Twist(station, axis, part, phi)) for part in range(6))
            name = f"{label}_{'xyz'[axis]}"
            out.append(Parameter(name, "rad/Nm", YIELD / load, f"bending of {what} about {'xyz'[axis]}", moves))
    return out
