"""Weights that are not what the cell or the robot's file says: they show where joints give way under them."""

from collections.abc import Iterator

import numpy as np

from planner.catalogue.site import Site, entry
from planner.catalogue.types import Entry
from planner.catalogue.yielding import LEAST, TRICAL, YIELD, most, softness
from planner.effects.loads import PayloadTorque, WeightTorque
from planner.model import Parameter
from planner.model.parameters import transform

YIELDING = 2  # joints, those that the weight loads most, at which it may show
LARGEST = 2e-3  # [rad] under the largest such load
SOURCE = "estimated: a mass wrong by a third of a link or payload, at joints as soft as in the TriCal paper, Table 8"


def payload_compliance(site: Site) -> Iterator[Entry]:
    """A joint gives way under the payload alone: a counterweight or the controller takes care of the rest."""
    if not site.varies("payload"):
        return
    for i in range(site.n_joints):
        on = f"joint {i + 1}"
        parameter = softness(site, i, PayloadTorque(i), f"payload_compliance{i + 1}", f"yielding of {on} to payload")
        if parameter is not None:
            sentence = f"{on}: gives way under the payload, {{size}}"
            yield entry("payload compliance", on, [parameter], sentence, most([parameter]), TRICAL)


def wrong_mass(site: Site) -> Iterator[Entry]:
    """Payload or a link heavier or lighter than stated, as seen through the joints that it loads most."""
    for link in range(site.n_joints + 1):
        payload = link == site.n_joints
        on = "payload" if payload else f"link {link + 1}"
        kind = "payload mass" if payload else "link mass"
        parameters = _shown_at(site, link, "payload_mass" if payload else f"link_mass{link + 1}")
        if parameters:
            whose = "payload or tool" if payload else f"link {link + 1}"
            sentence = f"{whose}: weighs other than stated, or its centre lies elsewhere; its joints yield {{size}}"
            largest = max(p.prior for p in parameters) * LARGEST / YIELD
            yield entry(kind, on, parameters, sentence, largest, SOURCE)


def _shown_at(site: Site, link: int, label: str) -> list[Parameter]:
    phis = [WeightTorque(i, link) for i in range(min(link + 1, site.n_joints))]
    load = np.array([np.ptp(phi(site.context)) for phi in phis])
    out = []
    for i in sorted(np.argsort(-load, kind="stable")[:YIELDING]):
        size = site.largest(phis[i])
        if load[i] > max(LEAST, 1e-3 * size):
            what = f"turn of joint {i + 1} by the weight of a kilogram more"
            moves = transform(site.theta(int(i)), phis[i])
            out.append(Parameter(f"{label}_at{i + 1}", "rad/Nm", YIELD / size, what, moves))
    return out
