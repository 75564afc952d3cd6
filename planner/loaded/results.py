"""Output of ``edbb loaded``: sentences, ``loaded.json`` (schema edbb-loaded/1) and ``curves.csv``."""

from collections.abc import Sequence

import numpy as np
import polars as pl

from planner.common.units import MM, UM, URAD, Array, in_units, round_finite, to_deg, to_mm
from planner.design.observability.identifiability import join_names
from planner.loaded.assumptions import TOLD
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
