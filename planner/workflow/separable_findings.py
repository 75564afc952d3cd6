"""Which findings poses of a further session may tell from their rivals."""

from dataclasses import replace

from planner.documents.calibration import Calibration
from planner.effects.catalogue import catalogue
from planner.effects.effect import Role
from planner.inference.candidates import HUNDRED_TO_ONE


def can_be_told_apart(found: Calibration) -> bool:
    """Tell whether poses of a bar or wire may decide between a finding and a rival that the readings leave open.

    Both must be causes that poses show by themselves: not what needs a thermometer or another payload, no change in the
    middle of a run, and none without a name.
    """
    if found.run.readings.length is None:
        return False
    logged = found.run.samples
    planned = replace(logged, temperature=None, torque=None, payload=None, q_cmd=None, q_read=None, session=None)
    offered = [e for e in catalogue(found.setup, planned) if not e.has(Role.UNTRACED)]
    shown, with_inner = {e.name for e in offered}, {e.name for e in offered if e.nonlinear is not None}
    return any(
        f.name in shown and rival in shown and (chance is None or chance >= HUNDRED_TO_ONE)
        for cause in found.findings
        for f in cause.each
        if not (f.beside_stages and f.name in with_inner)  # a band, of which no one number is known
        for rival, chance in zip(f.rivals, f.rival_probabilities or [None] * len(f.rivals), strict=True)
    )
