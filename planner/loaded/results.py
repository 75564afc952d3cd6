"""Output of ``edbb loaded``: sentences, ``loaded.json`` (schema edbb-loaded/1) and ``curves.csv``.

Results of the study of places for loaded circles and of the common fit: JSON, table and sentences.
"""

from collections.abc import Sequence

import numpy as np
import polars as pl

from planner.common.units import MM, UM, URAD, Array, in_units, round_finite, to_deg, to_mm
from planner.design.observability.identifiability import join_names
from planner.loaded.assumptions import DRIVABLE, TOLD
from planner.loaded.circle_candidates import CirclePlace, CirclePlaceChoice, PredictedCompliance, predict_compliance
from planner.loaded.common_fit import CommonFit
from planner.loaded.joint_fit import JointFit
from planner.loaded.types import (
    KNOWN,
    NOT_LEARNT,
    SENSES,
    Combination,
    EvaluatedCircle,
    JointCompliances,
    LoadedEvaluation,
)


def loaded_sentences(circles: Sequence[EvaluatedCircle], found: JointCompliances) -> tuple[str, ...]:
    """Return the findings, the compliances first."""
    out = list(compliance_sentences(found, len(circles)))
    for c in circles:
        name = f"fixture '{c.curves.circle.name}'" if c.curves.circle.name else "the fixture"
        loads = c.curves.loads
        deflection = np.abs(c.curves.deflection[:, -1])
        out.append(
            f"At {name} the arm yields by {deflection.min() / UM:.0f} to {deflection.max() / UM:.0f} µm along the bar "
            f"between {abs(loads[0]):.0f} and {abs(loads[-1]):.0f} N. Without that the loads' curves agree within "
            f"{c.spread / UM:.0f} µm. They do within {c.bent / UM:.0f} µm if the yielding at each angle may be any "
            "straight line."
        )
        out.append(
            f"The circle's centre is {np.linalg.norm(c.centre_offset) / MM:.3f} mm off its ball (once a turn: "
            f"{c.offset.amplitude / MM:.3f} mm, phase {float(to_deg(c.offset.phase)):.2f}°). What is left, "
            f"up to {np.abs(c.kinematic).max() / UM:.0f} µm, is the kinematic error."
        )
        if c.tracker is not None:
            out.append(
                f"A tracker sees the same kinematic error within {c.tracker.mean / UM:.0f} µm on average "
                f"({c.tracker.largest / UM:.0f} µm at most)."
            )
    return tuple(out)


def compliance_sentences(found: JointCompliances, circles: int) -> tuple[str, ...]:
    """Say which combinations of the joints' compliances are known, which are not, and what would help."""
    total, known, unknown = len(found.names), found.known_combinations, found.unknown_combinations
    hardly = [c for c in found.combinations if TOLD.known_share <= c.std <= TOLD.open_share]
    one = circles == 1
    alike = f"the ± {found.prior[0] / URAD:g} µrad/Nm that was expected before"
    before = "what was expected of them before" if np.ptp(found.prior) else alike
    out = [
        f"{'The circle knows' if one else f'The {circles} circles together know'} {len(known)} of {total} combinations "
        f"of the joints' compliances c1 … c{total} to a third of {before}, or better"
        + (f": {_list_combinations(known)} of it" if known else "")
        + ". An error of 1 % in force_N is one of 1 % in all of them, beside these."
    ]
    if hardly:
        out.append(f"Hardly better known than before: {_list_combinations(hardly)} of it.")
    if unknown:
        names = "; ".join(f"{c.text} ({_times_text(c.std)} as uncertain as before)" for c in unknown)
        out.append(f"By the circle{'s' * (not one)} alone more would be open than was open before of {names}.")
    untold = [n for n, well in zip(found.names, found.verdicts, strict=True) if well == NOT_LEARNT]
    if untold:
        out.append(
            f"So nothing is learnt of {join_names(untold)}; circles at other places would tell, see edbb loaded-places."
        )
    return tuple(out)


def compliance_text(found: JointCompliances, k: int) -> str:
    """Say of one compliance what it is worth, in a few words."""
    std, prior = found.std[k] / URAD, found.prior[k] / URAD
    if found.verdicts[k] == NOT_LEARNT:
        return f"nothing learnt: before ± {prior:g}, with this run ± {std:.2f} µrad/Nm"
    value = f"{found.value[k] / URAD:.3f} ± {std:.3f} µrad/Nm"
    return value if found.verdicts[k] == KNOWN else f"{value}, hardly known: before ± {prior:g}"


def share_text(std: float) -> str:
    """Write a standard deviation as a part of the prior sigma."""
    if std >= 10.0:
        return _times_text(std)
    # 0.095: of the prior sigma: finer parts are written with the digits that they need
    return f"{100 * std:.2g} %" if std < 0.095 else f"{100 * std:.0f} %"


def _list_combinations(those: Sequence[Combination]) -> str:
    return "; ".join(f"{c.text} to {share_text(c.std)}" for c in those)


def _times_text(std: float) -> str:
    return f"{std:.1f} times" if std < 10 else f"{std:.0f} times" if std < 1e4 else "many thousand times"


PARAMETER = ("name", "value", "nominal", "std", "unit", "identifiable", "absorbs")


def loaded_content(found: LoadedEvaluation, joint: JointFit | None = None) -> dict[str, object]:
    """Return the content of ``loaded.json``; ``joint`` is the fit together with unloaded runs."""
    return {
        "schema": "edbb-loaded/1",
        "robot": found.robot,
        "run": found.name,
        "compliances": _compliances(found.compliances),
        "combinations": [
            {
                "share_of_prior": round_finite(c.std),
                "known": c.std < TOLD.known_share,
                "told": c.verdict,
                "shares": {n: round(float(s), 4) for n, s in zip(c.names, c.shares, strict=True)},
            }
            for c in found.compliances.combinations
        ],
        "noise_um": round_finite(found.compliances.noise / UM),
        "misfit": round_finite(found.compliances.misfit),
        "circles": [_circle(c) for c in found.circles],
        "joint": None if joint is None else _joint(joint),
        "sentences": list(found.sentences),
        "problems": list(found.problems),
        "warnings": list(found.warnings),
    }


def _compliances(found: JointCompliances) -> list[dict[str, object]]:
    return [
        {
            "name": name,
            "value_urad_Nm": round_finite(value / URAD),
            "std_urad_Nm": round_finite(std / URAD),
            "prior_urad_Nm": round_finite(prior / URAD),
            "share_of_prior": round_finite(std / prior),
            "told": told,
        }
        for name, value, std, prior, told in zip(
            found.names, found.value, found.std, found.prior, found.verdicts, strict=True
        )
    ]


def _joint(joint: JointFit) -> dict[str, object]:
    """Every parameter of the joint fit in SI units."""
    return {
        "samples": len(joint.run),
        **in_units(2, rms_without_load_um=joint.rms[0], rms_with_load_um=joint.rms[1]),
        "parameters": [{key: getattr(e, key) for key in PARAMETER} for e in joint.estimates],
        "problems": list(joint.problems),
        "warnings": list(joint.run.warnings),
    }


def _circle(c: EvaluatedCircle) -> dict[str, object]:
    curves, circle = c.curves, c.curves.circle
    return {
        "fixture": circle.name,
        **in_units(4, centre_mm=circle.centre, radius_mm=circle.radius),
        "directions": [SENSES[d] for d in curves.directions],
        "loads_N": np.round(curves.loads, 2).tolist(),
        "repeats": curves.repeats.tolist(),
        "angles": len(curves.theta),
        "deflection_um": {
            f"{load:.0f} N": [round(float(v), 2) for v in (d.min() / UM, d.max() / UM)]
            for load, d in zip(curves.loads_beyond_base, np.moveaxis(curves.deflection, 1, 0), strict=True)
        },
        **in_units(2, spread_um=c.spread, spread_rms_um=c.spread_rms, spread_of_straight_lines_um=c.bent),
        **in_units(4, centre_offset_mm=c.centre_offset),
        "offset": {
            **in_units(5, amplitude_mm=c.offset.amplitude),
            "frequency": 1.0,
            **in_units(4, phase_deg=c.offset.phase),
            **in_units(2, rms_left_um=c.offset.rms),
        },
        "kinematic_error_um": {
            "rms": round(float(np.sqrt(np.mean(c.kinematic**2))) / UM, 2),
            "largest": round(float(np.abs(c.kinematic).max()) / UM, 2),
        },
        "tracker": None if c.tracker is None else in_units(2, mean_um=c.tracker.mean, largest_um=c.tracker.largest),
    }


def averaged_curves_csv(found: LoadedEvaluation) -> str:
    """Return every averaged curve, one row an angle, load and sense; deflections are from the base load (eq. 8)."""
    return pl.concat([_curve_table(c) for c in found.circles]).write_csv()


def _curve_table(c: EvaluatedCircle) -> pl.DataFrame:
    curves = c.curves
    D, K, B = curves.length.shape
    first = curves.length[:, :1]

    def column(values: Array, decimals: int) -> Array:
        """Return values as one rounded column of the table."""
        return np.round(np.broadcast_to(values, (D, K, B)).ravel(), decimals)

    predicted = np.concatenate([np.zeros((D, 1, B)), c.predicted], axis=1)
    data = {
        "fixture": np.repeat(curves.circle.name, D * K * B),
        "direction": np.repeat(np.array(curves.directions), K * B),
        "load_N": column(curves.loads[None, :, None], 2),
        "angle_deg": column(to_deg(curves.theta), 4),
        "length_mm": column(to_mm(curves.length), 6),
        "deflection_um": column((curves.length - first) / UM, 3),
        "predicted_um": column(predicted / UM, 3),
        "compensated_mm": column(to_mm(c.compensated), 6),
        "averaged_um": column(c.averaged[:, None] / UM, 3),
        "kinematic_um": column(c.kinematic[:, None] / UM, 3),
    }
    return pl.DataFrame(data)


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
