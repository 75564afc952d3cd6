"""What a loaded run says: which compliances it knows, how well the loads agree, what the centre is off."""

from collections.abc import Sequence

import numpy as np

from planner.loaded.types import KNOWN, OPEN, Combination, Compliances, Evaluated
from planner.units import MM, UM, to_deg


def sentences_of(circles: Sequence[Evaluated], found: Compliances) -> tuple[str, ...]:
    """Return the findings, the compliances first."""
    out = [compliance_sentence(found, len(circles))]
    for c in circles:
        name = f"fixture '{c.curves.circle.name}'" if c.curves.circle.name else "the fixture"
        loads = c.curves.loads
        deflection = np.abs(c.curves.deflection[:, -1])
        out.append(
            f"At {name} the arm yields by {deflection.min() / UM:.0f} to {deflection.max() / UM:.0f} um along the bar "
            f"between {abs(loads[0]):.0f} and {abs(loads[-1]):.0f} N; without that the loads' curves agree within "
            f"{c.spread / UM:.0f} um ({c.bent / UM:.0f} um if the yielding at each angle may be any straight line)."
        )
        out.append(
            f"The circle's centre is {np.linalg.norm(c.centre_offset) / MM:.3f} mm off its ball (once a turn: "
            f"{c.offset.amplitude / MM:.3f} mm, phase {float(to_deg(c.offset.phase)):.2f} degrees); what is left, "
            f"up to {np.abs(c.kinematic).max() / UM:.0f} um, is the kinematic error."
        )
        if c.tracker is not None:
            out.append(
                f"A tracker sees the same kinematic error within {c.tracker.mean / UM:.0f} um on average "
                f"({c.tracker.largest / UM:.0f} um at most)."
            )
    return tuple(out)


def compliance_sentence(found: Compliances, circles: int) -> str:
    """Say which combinations of the joints' compliances are known, and which are not."""
    total, known, unknown = len(found.names), found.known, found.unknown
    hardly = [c for c in found.combinations if KNOWN <= c.std <= OPEN]
    what = "One circle knows" if circles == 1 else f"{circles} circles together know"
    text = f"{what} {len(known)} of {total} combinations of the joints' compliances c1 … c{total} to a third of their "
    text += "prior size or better"
    text += f" ({_listed(known)})" if known else ""
    if hardly:
        text += f"; hardly known: {_listed(hardly)}"
    if unknown:
        text += f"; less than was known before it is said of {_listed(unknown)}"
    return text + ". An error of 1 % in force_N is one of 1 % in all of them, beside these."


def _listed(those: Sequence[Combination]) -> str:
    return "; ".join(f"{c.text} to {_share(c.std)}" for c in those)


def _share(std: float) -> str:
    return f"{100 * std:.2g} %" if std < 10 else f"{std:.0f} times"
