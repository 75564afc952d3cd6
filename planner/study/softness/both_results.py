"""What a session with both bars would know, as JSON (schema edbb-both/1), and in a few words."""

from collections.abc import Sequence

import numpy as np

from planner.loaded.sentences import share
from planner.study.softness.both import Both

UNITS = {"m": ("mm", 1e3), "rad": ("mdeg", 180e3 / np.pi), "rad/Nm": ("urad_Nm", 1e6)}  # of a key, and its factor


def both_content(
    known: Both, robot: str, poses: int, circles: Sequence[str], session: Sequence[str]
) -> dict[str, object]:
    """Return the content of ``both.json``; ``session`` says in which order things are done."""
    return {
        "schema": "edbb-both/1",
        "robot": robot,
        "poses": poses,
        "circles": list(circles),
        "session": list(session),
        "parameters": [_row(known, k) for k in range(len(known.names))],
        "sentences": list(both_sentences(known)),
    }


def both_sentences(known: Both) -> tuple[str, ...]:
    """Say what one fit of both knows beside each alone: the compliances, and the geometry on the whole."""
    soft = np.array([n.startswith("compliance") for n in known.names])
    out = []
    for what, which in (("Compliance", soft), ("Geometry", ~soft)):
        sizes = [np.exp(np.mean(np.log(s[which]))) for s in (known.unloaded, known.loaded, known.both)]
        worst = int(np.argmax(np.where(which, known.both, 0.0)))
        out.append(
            f"{what}, {int(which.sum())} parameters: on average each would be known to {share(sizes[0])} of its prior "
            f"size by the poses without load, to {share(sizes[1])} by the circles, to {share(sizes[2])} in one fit; "
            f"the worst there is {known.names[worst]} with {share(known.both[worst])}."
        )
    return tuple(out)


def _row(known: Both, k: int) -> dict[str, object]:
    unit, factor = UNITS[known.units[k]]
    prior = float(known.prior[k]) * factor
    parts = {"unloaded": known.unloaded[k], "loaded": known.loaded[k], "together": known.both[k]}
    return {
        "name": known.names[k],
        f"prior_{unit}": float(f"{prior:.4g}"),
        **{f"std_{name}_{unit}": float(f"{part * prior:.4g}") for name, part in parts.items()},
        **{f"share_{name}": float(f"{part:.4g}") for name, part in parts.items()},
    }
