"""What the page of a calibration says, ready to be set: every number is a text with its unit, tables are rows."""

from dataclasses import dataclass

import numpy as np

from planner.identification import Calibration, Estimate, Metrics, error_size
from planner.identification.shown import shown_estimates
from planner.report.calibration.data import Told
from planner.report.calibration.loop import Found, LimitTable, findings, in_short, limit_table, rejected
from planner.report.calibration.sentences import (
    GROUPS,
    headline,
    how_held_out,
    of_noise,
    refused,
    strongest_pairs,
)
from planner.report.calibration.units import unit_of_estimate
from planner.report.words import count, sized
from planner.units import to_deg, to_mm

Row = tuple[str, ...]
MOST_MOVED = 5  # parameters on the first sheet
OUTLIERS = 50  # that are listed
SHORT = 6  # stages up to which the first sheet lists all of them
STAGES = {"nominal": "data sheet", "frames": "gauge placed", "geometry": "geometry fitted"}


@dataclass(frozen=True)
class Page:
    """The report without its drawings; tables are rows of texts."""

    title: str
    about: str
    problems: tuple[str, ...]
    headline: tuple[str, ...]
    facts: tuple[Row, ...]
    stages: tuple[Row, ...]
    first_stages: tuple[Row, ...]
    found: tuple[str, ...]
    loop: tuple[Found, ...]
    limits: LimitTable
    rejected: tuple[Row, ...]
    traced: bool
    validated: bool
    warnings: tuple[str, ...]
    held_out: str
    noise: str
    left: str
    trials: tuple[Row, ...]
    moved: tuple[Row, ...]
    parameters: tuple[Row, ...]
    unseen: tuple[Row, ...]
    pairs: tuple[str, ...]
    outliers: tuple[Row, ...]
    outliers_more: int
    gauge: tuple[Row, ...]


def build_page(told: Told) -> Page:
    """Set all texts of the report."""
    c = told.calibration
    stages = tuple(_stage(told, k) for k in range(len(c.stages)))
    estimates = shown_estimates(c)
    return Page(
        title=f"Calibration of {c.fit.model.rig.robot.title}",
        about=_about(c),
        problems=refused(c),
        headline=headline(told),
        facts=_facts(told),
        stages=stages,
        first_stages=stages if len(stages) <= SHORT else (*stages[:3], ("all effects", *stages[-1][1:])),
        found=in_short(told),
        loop=findings(told),
        limits=limit_table(told),
        rejected=rejected(told),
        traced=c.traced is not None,
        validated=any(s.validation is not None for s in c.stages),
        warnings=(*c.run.warnings, *(w for w in c.warnings if w not in c.run.warnings)),
        held_out=how_held_out(c),
        noise=of_noise(told),
        left=told.left.sentence,
        trials=tuple(
            (t.along, _chance(t.p_value), _mm(t.rms, 2)) for t in sorted(told.left.trials, key=lambda t: t.p_value)
        ),
        moved=_most_moved(told),
        parameters=tuple(_parameter(told, e) for e in estimates if e.identifiable),
        unseen=tuple((e.name, e.what, _nominal(e), e.because or "") for e in estimates if not e.identifiable),
        pairs=strongest_pairs(c.fit.model.names, told.correlation) if len(c.fit.errors) > 1 else (),
        outliers=tuple(_outlier(c, int(k)) for k in c.fit.outliers[:OUTLIERS]),
        outliers_more=max(0, len(c.fit.outliers) - OUTLIERS),
        gauge=_gauge(told),
    )


def _about(c: Calibration) -> str:
    kind = "continuous" if c.run.continuous else "static"
    read = {"length": "lengths", "position": "positions", "pose": "positions and orientations"}[c.fit.model.rig.kind]
    if c.run.readings.ball is not None:
        read = "a point in balls or sockets"
    plan = f" · plan {c.run.plan_id}" if c.run.plan_id else ""
    return f"measured run “{c.run.name}” · {kind}, {read}{plan}"


def _facts(told: Told) -> tuple[Row, ...]:
    """The handful of numbers that a person asks for first: (what, value, remark)."""
    c, before, after = told.calibration, told.before.held_out, told.after.held_out
    several = GROUPS[c.split_by][0]
    floor = "no repeats" if c.noise_floor is None else f"repeats scatter {_mm(c.noise_floor)} mm"
    return (
        ("before, mean", f"{_mm(before.mean)} mm", f"largest {_mm(before.largest)} mm"),
        ("calibrated, mean", f"{_mm(after.mean)} mm", f"largest {_mm(after.largest)} mm"),
        ("anywhere, rms", f"{_mm(c.known_anywhere)} mm", "expected by the covariance"),
        ("readings", count(len(c.run)), f"in {count(c.n_groups)} {several}"),
        ("parameters", f"{len(c.fit.errors)} of {len(c.estimates)}", "seen and fitted"),
        ("condition", sized(c.condition_number), "of the rows, scaled"),
        ("outliers", count(len(c.fit.outliers)), floor),
    )


def _stage(told: Told, k: int) -> Row:
    """Name, parameters, then rms, mean and largest on training and held-out samples and on the validation run."""
    s = told.calibration.stages[k]
    spread = "" if s.held_out.spread is None else f" ± {_mm(s.held_out.spread, 2)}"
    check = ("", "", "") if s.validation is None else _metrics(s.validation)
    rms, mean, largest = _metrics(s.held_out)
    name = STAGES.get(s.name, s.name)
    return (name, str(s.parameters), _mm(s.train.rms), rms + spread, mean, largest, *check)


def _metrics(m: Metrics) -> Row:
    return (_mm(m.rms), _mm(m.mean), _mm(m.largest))


def _most_moved(told: Told) -> tuple[Row, ...]:
    """The fitted errors of the robot that move the reading most: name, what, change, unit, and by how much."""
    c = told.calibration
    by_name = {e.name: e for e in c.estimates}
    shown = [(by_name[n], float(m)) for n, m in zip(c.fit.model.names, told.moves, strict=True)]
    robot = sorted((x for x in shown if x[0].group != "gauge"), key=lambda x: (-x[1], x[0].name))
    return tuple(
        (e.name, e.what, f"{_fixed(e, e.value - e.nominal, '+')} ± {_size(e)}", unit_of_estimate(e)[0], _mm(m, 2))
        for e, m in robot[:MOST_MOVED]
    )


def _parameter(told: Told, e: Estimate) -> Row:
    """Name, what, unit, nominal, value, change, ±, change in standard deviations, effect on the reading, absorbed."""
    assert e.std is not None
    change = e.value - e.nominal
    moves = dict(zip(told.calibration.fit.model.names, told.moves, strict=True))
    unit = unit_of_estimate(e)[0]
    times = f"{abs(change) / e.std:.1f}" if e.std > 0 else "–"
    return (
        e.name,
        e.what,
        unit,
        _nominal(e),
        _fixed(e, e.value),
        _fixed(e, change, "+"),
        _size(e),
        times,
        _mm(float(moves[e.name]), 2),
        ", ".join(e.absorbs),
    )


def _nominal(e: Estimate) -> str:
    return f"{e.nominal * unit_of_estimate(e)[1]:.6g}"


def _fixed(e: Estimate, value: float, sign: str = "") -> str:
    """Write a value with as many decimals as its standard deviation has at two digits."""
    return f"{value * unit_of_estimate(e)[1]:{sign}.{_decimals(e)}f}"


def _size(e: Estimate) -> str:
    return "–" if e.std is None else f"{e.std * unit_of_estimate(e)[1]:.{_decimals(e)}f}"


def _decimals(e: Estimate) -> int:
    size = (e.std or 0.0) * unit_of_estimate(e)[1]
    return int(np.clip(1 - np.floor(np.log10(size)), 0, 8)) if size > 0 else 6


def _outlier(c: Calibration, k: int) -> Row:
    """Sample, pose, place, error with it in the fit, and when held out."""
    s, last = c.run.samples, c.stages[-1]
    pose = "" if s.pose is None else str(s.pose[k])
    error, held = (float(error_size(r[k : k + 1])[0]) for r in (last.residual, last.held_residual))
    return (str(k + 1), pose, c.run.places[s.place[k]], _mm(error), _mm(held))


def _gauge(told: Told) -> tuple[Row, ...]:
    """Where the gauge stands: (what, position or angles)."""
    f = told.frames
    several = len(f.points) > 1
    rows = [(f"fixture {n}".strip(), f"{_triple(to_mm(p))} mm in the base frame") for n, p in f.fixtures]
    for n, p, rpy in f.places:
        rows.append((f"frame of the gauge {n}".strip(), f"{_triple(to_mm(p))} mm in the base frame"))
        rows.append(("its roll, pitch, yaw", f"{_triple(to_deg(rpy), 4)} deg"))
    for n, p in f.points:
        rows.append((f"tool point {n}" if several else "tool point", f"{_triple(to_mm(p))} mm in the flange frame"))
    if f.zero is not None:
        rows.append(("zero of the bar", f"{float(to_mm(f.zero)):.4f} mm"))
    return tuple(rows)


def _chance(p: float) -> str:
    return "below 1 in a million" if p < 1e-6 else sized(p, 2)


def _triple(values: np.ndarray, decimals: int = 3) -> str:
    return ", ".join(f"{v:.{decimals}f}" for v in values)


def _mm(value: float, digits: int = 3) -> str:
    return sized(float(to_mm(value)), digits)
