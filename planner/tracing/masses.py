"""Weights that are not what the files say, as far as joints that yield show them.

A joint of compliance c turns by c Σ m w, with the torques w of the links' unit masses. A link that is heavier by a part
δ adds c m w δ at every joint below it: one number a link, shared by all joints whose compliance is in the model. These
numbers enter with the first joint that yields and are named no effect of their own, for they show through it only.
"""

from collections.abc import Sequence

from planner.effects.combined import Times
from planner.effects.loads import WeightTorque
from planner.model import Model, Move, Parameter

KIND = "joint compliance"
PART = 0.15  # one sigma of a link's mass over its stated one
FAR_OFF = 0.3  # one sigma of the weights as a run has them, above which it is not the weights that the run shows
GROUP = "link weights"


def weights(base: Model, compliance: Sequence[tuple[int, float]]) -> list[Parameter]:
    """Return the parts by which links and tool weigh more than stated; ``compliance``: joints (from 0) and [rad/Nm]."""
    rig = base.rig
    if not compliance:
        return []
    joints = [t for t in range(len(rig.chain.transforms)) if rig.chain.transforms[t].joint is not None]
    where = {rig.chain.transforms[k].joint: k for k in joints}
    masses = [None if m is None else m.mass for m in rig.robot.masses]
    n = len(masses)
    out = []
    for link, mass in enumerate([*masses, rig.tool_mass]):
        bearing = [(i, c) for i, c in compliance if i <= link]
        if not mass or not bearing:
            continue
        moves = tuple(Move("transform", where[i], Times(WeightTorque(i, link), float(c * mass))) for i, c in bearing)
        what = "tool" if link == n else f"link {link + 1}"
        name = "weight_tool" if link == n else f"weight{link + 1}"
        out.append(Parameter(name, "1", PART, f"part by which {what} weighs more than stated", moves, GROUP))
    return out


def believed(model: Model) -> float:
    """How far the weights of a fitted model are believed to be off, one sigma; 0 where there are none."""
    return max((p.prior for p in model.parameters if p.group == GROUP), default=0.0)
