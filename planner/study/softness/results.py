"""What the study of places says: JSON (schema edbb-places/1), a table of the places, and sentences."""

import json

import numpy as np
import polars as pl

from planner.loaded.sentences import share
from planner.study.softness.both import Both
from planner.study.softness.choice import Known, Places
from planner.units import to_deg, to_mm

GOOD = 0.15  # of the prior size: more places are said to be worth it until the worst joint is known so well


def places_content(found: Places, robot: str, both: Both | None = None) -> dict[str, object]:
    """Return the content of ``places.json``; ``both`` is what the chosen circles know with a plan without load."""
    return {
        "schema": "edbb-places/1",
        "robot": robot,
        "candidates": len(found.pool),
        "own_circle": _known(found, found.own),
        "sets": [
            {"places": [_place(found, int(i)) for i in chosen], **_known(found, known)}
            for chosen, known in zip(found.sets, found.known, strict=True)
        ],
        "with_unloaded_plan": None if both is None else [_row(r) for r in both.of("")],
        "sentences": list(sentences(found)),
    }


def places_text(found: Places, robot: str, both: Both | None = None) -> str:
    """Return ``places.json``."""
    return json.dumps(places_content(found, robot, both), indent=1, ensure_ascii=False) + "\n"


def places_csv(found: Places) -> str:
    """Return a row for every candidate: where it is, and how well its circle alone knows each compliance."""
    single = [_shares(np.asarray(block)) for block in found.information]
    centre = np.array([to_mm(c.centre) for c in found.pool])
    data: dict[str, object] = {
        "plane": [c.plane for c in found.pool],
        "side": [c.side for c in found.pool],
        **{f"centre_{a}_mm": np.round(centre[:, k], 1) for k, a in enumerate("xyz")},
        **{f"{n}_share_of_prior": [round(float(s[k]), 4) for s in single] for k, n in enumerate(found.names)},
    }
    return pl.DataFrame(data).write_csv()


def sentences(found: Places) -> tuple[str, ...]:
    """Say what the cell's own circle leaves open, and what more places would tell."""
    short = [n.replace("compliance", "c") for n in found.names]
    own = ", ".join(f"{n} {share(float(s))}" for n, s in zip(short, found.own.std, strict=True))
    out = [f"The cell's own circle would leave, of the prior sizes: {own}."]
    for chosen, known in zip(found.sets, found.known, strict=True):
        worst = short[int(np.argmax(known.std))]
        what = "The best single circle" if len(chosen) == 1 else f"The best {len(chosen)} circles together"
        out.append(f"{what} would leave {worst} with {share(known.worst)}, all others with less.")
    enough = [len(s) for s, k in zip(found.sets, found.known, strict=True) if k.worst < GOOD]
    if enough:
        out.append(f"{enough[0]} places know every joint to {100 * GOOD:.0f} % of its prior size or better.")
    return tuple(out)


def _shares(information: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(information + np.eye(len(information))))))


def _row(row: tuple[str, float, float, float]) -> dict[str, object]:
    name, unloaded, loaded, both = row
    shares = {"unloaded_alone": unloaded, "loaded_alone": loaded, "together": both}
    return {"name": name} | {k: float(f"{v:.4g}") for k, v in shares.items()}


def _known(found: Places, known: Known) -> dict[str, object]:
    return {
        "share_of_prior": {n: float(f"{s:.4g}") for n, s in zip(found.names, known.std, strict=True)},
        "share_of_prior_by_readings_alone": {
            n: float(f"{s:.4g}") for n, s in zip(found.names, known.alone, strict=True)
        },
    }


def _place(found: Places, i: int) -> dict[str, object]:
    c = found.pool[i]
    return {
        "plane": c.plane,
        "side": c.side,
        "centre_mm": np.round(to_mm(c.centre), 2).tolist(),
        "fixture_mm": np.round(to_mm(c.p_BX), 2).tolist(),
        "start_deg": np.round(to_deg(c.q[0]), 3).tolist(),
    }
