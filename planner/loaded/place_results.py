"""Results of the study of places for loaded circles and of the common fit: JSON, table and sentences."""

from collections.abc import Sequence

import numpy as np
import polars as pl

from planner.common.units import round_finite, to_deg, to_mm
from planner.loaded.assumptions import DRIVABLE
from planner.loaded.circle_candidates import (
    CirclePlace,
    CirclePlaceChoice,
    PredictedCompliance,
    predict_compliance,
)
from planner.loaded.common_fit import CommonFit
from planner.loaded.results import share_text


def places_content(found: CirclePlaceChoice, robot: str, both: CommonFit | None = None) -> dict[str, object]:
    """Return the content of ``places.json``; ``both`` is what the chosen circles know with a plan without load."""

    def shares(known: PredictedCompliance) -> dict[str, object]:
        """Return what is left of each prior, and by the readings alone."""
        std, alone = (dict(zip(found.names, map(round_finite, s), strict=True)) for s in (known.std, known.alone))
        return {"share_of_prior": std, "share_of_prior_by_readings_alone": alone}

    names = {"unloaded": "unloaded_alone", "loaded": "loaded_alone", "together": "together"}
    return {
        "schema": "edbb-places/1",
        "robot": robot,
        "candidates": len(found.pool),
        "own_circle": shares(found.own),
        "sets": [
            {"places": [_place_content(found.pool[i]) for i in chosen], **shares(known)}
            for chosen, known in zip(found.sets, found.known, strict=True)
        ],
        "with_unloaded_plan": None
        if both is None
        else [
            {"name": n, **{names[k]: round_finite(v[j]) for k, v in both.parts.items()}}
            for j, n in enumerate(both.names)
        ],
        "sentences": list(describe_places(found)),
    }


def _place_content(c: CirclePlace) -> dict[str, object]:
    places = {
        "centre_mm": (to_mm(c.circle.p_BC), 2),
        "fixture_mm": (to_mm(c.p_BX), 2),
        "start_deg": (to_deg(c.q[0]), 3),
    }
    return {"plane": c.circle.plane, "side": c.side} | {k: np.round(v, n).tolist() for k, (v, n) in places.items()}


def places_csv(found: CirclePlaceChoice) -> str:
    """Return a row for every candidate: where it is, and how well its circle alone knows each compliance."""
    single = np.array([predict_compliance(block).std for block in found.information])
    centre = np.array([to_mm(c.circle.p_BC) for c in found.pool])
    data: dict[str, object] = {
        "plane": [c.circle.plane for c in found.pool],
        "side": [c.side for c in found.pool],
        **{f"centre_{a}_mm": np.round(centre[:, k], 1) for k, a in enumerate("xyz")},
        **{f"{n}_share_of_prior": np.round(single[:, k], 4) for k, n in enumerate(found.names)},
    }
    return pl.DataFrame(data).write_csv()


def describe_places(found: CirclePlaceChoice) -> tuple[str, ...]:
    """Say what the cell's own circle leaves open, and what more places would tell."""
    short = [n.replace("compliance", "c") for n in found.names]
    own = ", ".join(f"{n} {share_text(float(s))}" for n, s in zip(short, found.own.std, strict=True))
    out = [f"The cell's own circle would leave, of the prior sigmas: {own}."]
    for chosen, known in zip(found.sets, found.known, strict=True):
        worst = short[int(np.argmax(known.std))]
        what = "The best single circle" if len(chosen) == 1 else f"The best {len(chosen)} circles together"
        out.append(f"{what} would leave {worst} with {share_text(known.worst_share)}, all others with less.")
    most = DRIVABLE.worst_joint_share
    enough = [len(s) for s, k in zip(found.sets, found.known, strict=True) if k.worst_share < most]
    if enough:
        out.append(
            f"{enough[0]} places know every joint to {100 * DRIVABLE.worst_joint_share:.0f} % of its prior sigma or "
            "better."
        )
    return tuple(out)


UNITS = {"m": ("mm", 1e3), "rad": ("mdeg", 180e3 / np.pi), "rad/Nm": ("urad_Nm", 1e6)}  # of a key, and its factor


def common_fit_content(
    known: CommonFit, robot: str, poses: int, circles: Sequence[str], session: Sequence[str]
) -> dict[str, object]:
    """Return the content of ``both.json``; ``session`` says in which order things are done."""
    return {
        "schema": "edbb-both/1",
        "robot": robot,
        "poses": poses,
        "circles": list(circles),
        "session": list(session),
        "parameters": [_parameter_row(known, k) for k in range(len(known.names))],
        "sentences": list(describe_common_fit(known)),
    }


def describe_common_fit(known: CommonFit) -> tuple[str, ...]:
    """Say what one fit of both knows beside each alone: the compliances, and the geometry on the whole."""
    soft = np.array([n.startswith("compliance") for n in known.names])
    out = []
    for what, which in (("Compliance", soft), ("Geometry", ~soft)):
        sizes = [np.exp(np.mean(np.log(s[which]))) for s in known.parts.values()]
        worst = int(np.argmax(np.where(which, known.both, 0.0)))
        out.append(
            f"{what}, {int(which.sum())} parameters: on average each would be known to {share_text(sizes[0])} of its"
            f" prior sigma by the poses without load, to {share_text(sizes[1])} by the circles, to"
            f" {share_text(sizes[2])} in one fit. The worst there is {known.names[worst]} with"
            f" {share_text(known.both[worst])}."
        )
    return tuple(out)


def _parameter_row(known: CommonFit, k: int) -> dict[str, object]:
    unit, factor = UNITS[known.units[k]]
    prior = float(known.prior[k]) * factor
    row: dict[str, object] = {"name": known.names[k], f"prior_{unit}": round_finite(prior)}
    row |= {f"std_{name}_{unit}": round_finite(part[k] * prior) for name, part in known.parts.items()}
    return row | {f"share_{name}": round_finite(part[k]) for name, part in known.parts.items()}
