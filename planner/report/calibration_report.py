"""The report of a calibration: one page that needs nothing else."""

from collections.abc import Sequence
from typing import Any

import numpy as np

import planner.report.calibration_text as text
from planner.common.units import to_deg, to_mm
from planner.documents.calibration import Calibration, joint_zeros_text
from planner.model.identification_document import Estimate, Metrics, Stage, error_size
from planner.model.use_text import TARGET, use_head, use_rows
from planner.report.calibration_charts import draw_calibration_charts
from planner.report.calibration_data import CalibrationFacts
from planner.report.formatting import chance_text, decimals_of, in_mm
from planner.report.page import Report, Row


def report_calibration(calibration: Calibration) -> Report:
    """Return the page of a calibration: five things on its first screen, all else in sections that open on demand."""
    facts = CalibrationFacts(calibration)
    charts = draw_calibration_charts(facts)
    content = calibration_content(facts) | {"shown": charts, "picture": charts.picture[0]}
    return Report("calibration.html.j2", content, charts.every)


def calibration_content(facts: CalibrationFacts) -> dict[str, Any]:
    """Return the content of the page; tables are rows of texts."""
    outliers = 50  # that are listed
    c = facts.calibration
    trials = sorted(c.diagnosis.trials, key=lambda t: t.p_value)
    return {
        "c": c,
        "summary": facts.summary,
        "title": f"Calibration of {c.setup.robot.title}",
        "about": _about_text(c),
        "target": TARGET if facts.summary.figure else "",
        "problems": text.refusal_text(c),
        "proof": (*text.proof_text(facts), text.held_out_text(c), text.noise_text(c)),
        "use": _use(c),
        "stages": [*(_stage(s) for s in c.stages), *_release_row(c)],
        "declared": text.declared_effects_text(c),
        "findings": text.finding_texts(facts),
        "causes_about": text.causes_about(facts),
        "causes_more": len(facts.causes) - len(facts.summary.causes) if facts.summary.causes else 0,
        "limits": text.limit_table(c),
        "rejected": list(dict.fromkeys((r.name, r.because) for r in c.rejected))[:20],  # that are listed
        "joints": tuple(f"joint {j + 1}" for j in range(c.run.samples.q.shape[1])),
        "validated": any(s.validation is not None for s in c.stages),
        "read": c.setup.gauge.plural,
        "doubts": [text.partition(";")[0] for text in c.doubts],  # what helps stands with the warnings
        "warnings": (*c.run.warnings, *(w for w in c.warnings if w not in c.run.warnings)),
        "open_parts": text.open_parts_text(c),
        "trials": [(t.along, chance_text(t.p_value), in_mm(t.rms, 2)) for t in trials],
        "parameters": [_parameter(facts, e) for e in c.estimates if e.identifiable],
        "unseen": [_unseen_row(e) for e in c.estimates if not e.identifiable],
        "correlations": text.correlation_text(c.fit.model.names, facts.correlation) if len(c.fit.errors) > 1 else (),
        "outliers": [_outlier(c, int(k)) for k in c.outliers[:outliers]],
        "outliers_more": max(0, len(c.outliers) - outliers),
        "gauge": _gauge(facts),
        "zeros": joint_zeros_text(c),
        "computed": text.computed_text(c),
    }


def _about_text(c: Calibration) -> str:
    kind = "continuous" if c.run.continuous else "static"
    read = c.setup.gauge.plural
    if c.run.readings.ball is not None:
        read = "a point in balls or sockets"
    plan = f" · plan {c.run.plan_id}" if c.run.plan_id else ""
    return f"{'simulated' if c.simulated else 'measured'} run “{c.run.name}” · {kind}, {read}{plan}"


def _use(c: Calibration) -> dict[str, Any] | None:
    """What the robot is good for with each tool: head and rows of a table."""
    if (use := c.good_for) is None:
        return None
    repeats = "repeatability that is assumed" if use.repeatability_assumed else "repeatability in the robot's file"
    return {"head": use_head(use), "rows": use_rows(use), "repeats": repeats}


def _stage(s: Stage) -> Row:
    """Name, parameters, then rms, mean and largest on training and held-out samples and on the validation run."""
    spread = "" if s.held_out.spread is None else f" ± {in_mm(s.held_out.spread, 2)}"
    rms, mean, largest = _metrics(s.held_out)
    return (s.name, str(s.parameters), in_mm(s.train.rms), rms + spread, mean, largest, *_metrics(s.validation))


def _release_row(c: Calibration) -> list[Row]:
    """The same of the robot as it is written."""
    r = c.release
    return [] if r is None else [("calibrated", "", "", *_metrics(r.held_out), *_metrics(r.validation))]


def _metrics(m: Metrics | None) -> Row:
    return ("", "", "") if m is None else (in_mm(m.rms), in_mm(m.mean), in_mm(m.largest))


def _parameter(facts: CalibrationFacts, e: Estimate) -> Row:
    """Name, what, unit, nominal, value, change, ±, change in standard deviations, effect on the reading, absorbed."""
    assert e.std is not None
    change, unit = e.value - e.nominal, text.estimate_unit(e)[0]
    moves = float(facts.moves[facts.calibration.fit.model.names.index(e.name)])
    times = f"{abs(change) / e.std:.1f}" if e.std > 0 else "–"
    numbers = (_nominal_text(e), _format(e, e.value), _format(e, change, "+"), _format(e, e.std))
    return (e.name, e.what, unit, *numbers, times, in_mm(moves, 2), ", ".join(e.absorbs))


def _unseen_row(e: Estimate) -> Row:
    """Name, what, unit, nominal, value of the robot as it is written, ±, and why the run does not show it."""
    numbers = (_nominal_text(e), _nominal_text(e) if e.value == e.nominal else _format(e, e.value), _format(e, e.std))
    return (e.name, e.what, text.estimate_unit(e)[0], *numbers, e.because or "")


def _nominal_text(e: Estimate) -> str:
    value = e.nominal * text.estimate_unit(e)[1]
    return f"{round(value, 6) + 0.0:.9g}"  # decimals of mm and degrees: finer than any data sheet


def _format(e: Estimate, value: float | None, sign: str = "") -> str:
    """Write a value with as many decimals as its standard deviation has at two digits."""
    if value is None:
        return "–"
    factor = text.estimate_unit(e)[1]
    decimals = decimals_of((e.std or 0.0) * factor, 6)
    return f"{round(value * factor, decimals) + 0.0:{sign}.{decimals}f}"


def _outlier(c: Calibration, k: int) -> Row:
    """Sample, pose, place, error with it in the fit, and when held out, and by how much of a reading it counts."""
    s, last = c.run.samples, c.stages[-1]
    pose = "" if s.pose is None else str(s.pose[k])
    error, held = (float(error_size(r[k : k + 1])[0]) for r in (last.residual, last.held_residual))
    return (str(k + 1), pose, c.run.places[s.place[k]], in_mm(error), in_mm(held), f"{100 * c.row_weight[k]:.2g} %")


def _gauge(facts: CalibrationFacts) -> tuple[Row, ...]:
    """Where the gauge stands: (what, position or angles)."""
    f, unit = facts.calibration.frames, facts.calibration.reading_unit
    rows = [
        (f"fixture {x.name}".strip(), f"{_position(x.position, x.position_std)} mm in the base frame")
        for x in f.fixtures
    ]
    for place in f.places:
        what = f"frame of the gauge {place.name}".strip()
        rows.append((what, f"{_vector_text(to_mm(place.position))} mm in the base frame"))
        rows.append(("its roll, pitch, yaw", f"{_vector_text(to_deg(place.rpy), 4)} deg"))
    for point in f.tool:
        what = f"tool point {point.name}" if len(f.tool) > 1 else "tool point"
        rows.append((what, f"{_position(point.p_FM, point.position_std)} mm in the flange frame"))
    if f.zero is not None:
        std = "" if f.zero_std is None else f" ± {float(to_mm(f.zero_std)):.4f}"
        rows.append(("zero of the gauge", f"{float(to_mm(f.zero)):.4f}{std} {unit}"))
    return tuple(rows)


def _position(p: Sequence[float], std: Sequence[float] | None) -> str:
    """Return a position [m] in mm, each coordinate with its standard deviation where that is known."""
    if std is None:
        return _vector_text(to_mm(p))
    return ", ".join(f"{v:.3f} ± {s:.3f}" for v, s in zip(to_mm(p), to_mm(std), strict=True))


def _vector_text(values: np.ndarray, decimals: int = 3) -> str:
    return ", ".join(f"{v:.{decimals}f}" for v in values)
