"""What a loaded run says: which compliances it knows, how well the loads agree, what the centre is off."""

from collections.abc import Sequence

import numpy as np

from planner.loaded.told import KNOWN, OPEN, UNTOLD, WELL, Combination, Compliances
from planner.loaded.types import Evaluated
from planner.units import MM, UM, to_deg

URAD = 1e-6  # [rad]
PERCENT = 0.095  # of the prior size: finer parts are written with the digits that they need


def sentences_of(circles: Sequence[Evaluated], found: Compliances) -> tuple[str, ...]:
    """Return the findings, the compliances first."""
    out = list(compliance_sentences(found, len(circles)))
    for c in circles:
        name = f"fixture '{c.curves.circle.name}'" if c.curves.circle.name else "the fixture"
        loads = c.curves.loads
        deflection = np.abs(c.curves.deflection[:, -1])
        out.append(
            f"At {name} the arm yields by {deflection.min() / UM:.0f} to {deflection.max() / UM:.0f} µm along the bar "
            f"between {abs(loads[0]):.0f} and {abs(loads[-1]):.0f} N; without that the loads' curves agree within "
            f"{c.spread / UM:.0f} µm ({c.bent / UM:.0f} µm if the yielding at each angle may be any straight line)."
        )
        out.append(
            f"The circle's centre is {np.linalg.norm(c.centre_offset) / MM:.3f} mm off its ball (once a turn: "
            f"{c.offset.amplitude / MM:.3f} mm, phase {float(to_deg(c.offset.phase)):.2f}°); what is left, "
            f"up to {np.abs(c.kinematic).max() / UM:.0f} µm, is the kinematic error."
        )
        if c.tracker is not None:
            out.append(
                f"A tracker sees the same kinematic error within {c.tracker.mean / UM:.0f} µm on average "
                f"({c.tracker.largest / UM:.0f} µm at most)."
            )
    return tuple(out)


def compliance_sentences(found: Compliances, circles: int) -> tuple[str, ...]:
    """Say which combinations of the joints' compliances are known, which are not, and what would help."""
    total, known, unknown = len(found.names), found.known, found.unknown
    hardly = [c for c in found.combinations if KNOWN <= c.std <= OPEN]
    one = circles == 1
    before = "what was expected of them before" if np.ptp(found.prior) else f"the ± {found.prior[0] / URAD:g} µrad/Nm"
    before += "" if np.ptp(found.prior) else " that was expected before"
    out = [
        f"{'The circle knows' if one else f'The {circles} circles together know'} {len(known)} of {total} combinations "
        f"of the joints' compliances c1 … c{total} to a third of {before}, or better"
        + (f": {_listed(known)} of it" if known else "")
        + ". An error of 1 % in force_N is one of 1 % in all of them, beside these."
    ]
    if hardly:
        out.append(f"Hardly better known than before: {_listed(hardly)} of it.")
    if unknown:
        names = "; ".join(f"{c.text} ({_times(c.std)} as uncertain as before)" for c in unknown)
        out.append(f"By the circle{'s' * (not one)} alone more would be open than was open before of {names}.")
    untold = [n for n, well in zip(found.names, found.told, strict=True) if well == UNTOLD]
    if untold:
        out.append(
            f"So nothing is learnt of {_and(untold)}; circles at other places would tell, see edbb loaded-places."
        )
    return tuple(out)


def known_as(found: Compliances, k: int) -> str:
    """Say of one compliance what it is worth, in a few words."""
    std, prior = found.std[k] / URAD, found.prior[k] / URAD
    if found.told[k] == UNTOLD:
        return f"nothing learnt: before ± {prior:g}, with this run ± {std:.2f} µrad/Nm"
    value = f"{found.value[k] / URAD:.3f} ± {std:.3f} µrad/Nm"
    return value if found.told[k] == WELL else f"{value}, hardly known: before ± {prior:g}"


def share(std: float) -> str:
    """Write a standard deviation as a part of the prior size."""
    if std >= 10.0:
        return _times(std)
    return f"{100 * std:.2g} %" if std < PERCENT else f"{100 * std:.0f} %"


def _listed(those: Sequence[Combination]) -> str:
    return "; ".join(f"{c.text} to {share(c.std)}" for c in those)


def _times(std: float) -> str:
    return f"{std:.1f} times" if std < 10 else f"{std:.0f} times" if std < 1e4 else "many thousand times"


def _and(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + " and " + names[-1] if len(names) > 1 else names[0]
