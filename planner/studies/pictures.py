"""The study's charts: what is seen, index curves, sensitivity and correlation, and how many fixtures it takes."""

from textwrap import fill

import numpy as np

from planner.common.units import MM, UM
from planner.design.observability.information import INDEX_RULES
from planner.report.chart import BLUE, GREY, ORANGE, RED, SKY, Chart, Heatmap, Panel, ReferenceLine, Series
from planner.studies.basis import BoundedCurve, StudyBasis
from planner.studies.summary import StudySummary, describe_fixtures, format_number
from planner.studies.tables import MDEG

LOUD = 0.9  # a correlation from which two parameters are hard to tell apart
ROW = 16  # [px] a parameter's line
WIDTH = 100  # letters of a title


def draw_identifiability(study: StudySummary) -> Chart:
    """Singular values with their gap, and each parameter's predicted standard deviation against its prior."""
    return Chart("identifiability", "What is seen", "", (_spectrum(study.basis), _prior_shares(study.basis)))


def _spectrum(basis: StudyBasis) -> Panel:
    mu, rank = basis.seen.spectrum / UM, basis.seen.rank
    mu = np.maximum(mu, mu[0] * 1e-17)
    order = np.arange(1.0, len(mu) + 1)
    parts = (("seen", slice(None, rank), BLUE), ("not seen", slice(rank, None), RED))
    series = tuple(Series(name, order[which], mu[which], colour, "points") for name, which, colour in parts)
    gap = f", a gap of {basis.seen.gap:.0e} to the rest" if rank < len(mu) and np.isfinite(basis.seen.gap) else ""
    noise = basis.noise / np.sqrt(basis.poses) / UM
    limit = ReferenceLine(noise, f"noise of a reading, mean of {basis.poses}: {format_number(noise)} µm", below=True)
    title = f"{rank} of {len(mu)} directions are seen{gap}"
    labels = "direction, strongest first", "rms change of a reading by one prior size (µm)"
    return Panel(title, *labels, series, (limit,), log_y=True, height=300)


def _prior_shares(basis: StudyBasis) -> Panel:
    names, carried = basis.whole.names, basis.absorbers
    why = {d.name: d.because.split(":")[0].removeprefix(f"{d.name} ") for d in basis.seen.dropped}
    std = dict(zip(basis.seen.names, basis.predicted.std.tolist(), strict=True))
    share = {p.name: 100 * std[p.name] / p.prior for p in basis.whole.parameters if p.name in std}
    texts = {
        p.name: " carries ".join([_format_in_unit(std[p.name], p.unit), *([", ".join(c)] if c else [])])
        for p in basis.whole.parameters
        if p.name in std
        for c in [carried[p.name]]
    }
    least, worst = min(share.values()), max(share, key=lambda n: share[n])
    series = [_bars("seen", [share[n] for n in texts], [names.index(n) for n in texts], BLUE, tuple(texts.values()))]
    if why:
        rows = [names.index(n) for n in why]
        series.append(_bars("not seen", [least / 3] * len(why), rows, RED, tuple(why.values())))
    return Panel(
        f"After {basis.poses} poses the least certain, {worst}, is known to {share[worst]:.0f} % of its prior",
        "predicted σ after one measurement (% of prior σ)",
        "",
        tuple(series),
        (ReferenceLine(100.0, "prior", upright=True),),
        log_x=True,
        x_range=(least / 4, max(200.0, 2 * share[worst])),
        y_names=names,
        height=ROW * len(names),
    )


def _bars(name: str, x: list[float], rows: list[int], colour: str, texts: tuple[str, ...] | None = None) -> Series:
    return Series(name, np.array(x), np.array(rows, dtype=float), colour, "bars", texts=texts or ("",) * len(x))


def _format_in_unit(value: float, unit: str) -> str:
    """A length in mm or an angle in thousandths of a degree, with two digits."""
    return f"{value / MM:.2g} mm" if unit == "m" else f"{value / MDEG:.2g} mdeg"


def draw_curves(study: StudySummary) -> Chart:
    """Small multiples: one index a row, raw on the left, unit-free on the right."""
    basis = study.basis
    curves = sorted(basis.curves, key=lambda c: (c.index, c.scaled))
    own = basis.curve
    gap = 100 * INDEX_RULES[own.index].gap(own.at_knee, own.limit_at_knee)
    any_set = "any number of poses" if own.index in ("O1", "O2") else f"any {own.knee} poses"
    title = f"{own.index} bends at {own.knee} poses, where it is within {gap:.0f} % of what {any_set} can reach"
    return Chart("index_curve", title, "", tuple(_curve(c) for c in curves), columns=2)


def _curve(curve: BoundedCurve) -> Panel:
    best = "higher" if INDEX_RULES[curve.index].maximise else "lower"
    sizes = curve.sizes.astype(float)
    series = (
        Series("proven limit", sizes, curve.bounds, ORANGE, dashed=True),
        Series("selected", sizes, curve.values, BLUE),
        Series("bend", np.array([float(curve.knee)]), np.array([curve.at_knee]), RED, "points", size=9.0),
    )
    title, label = f"{curve.index} {curve.scaling}", f"poses; {best} is better, bends at {curve.knee}"
    return Panel(title, label, "", series, log_x=True, height=170)


def draw_sensitivity(study: StudySummary) -> Chart:
    """Sorted bars of each parameter's effect on the reading, and the correlations at the chosen poses."""
    return Chart("sensitivity", "Sensitivity", "", (_effects(study.basis), _correlation(study.basis)))


def _effects(basis: StudyBasis) -> Panel:
    rms, most = (v / UM for v in basis.effects)
    order = np.lexsort((np.arange(len(rms)), -np.round(rms, 6)))
    names = tuple(basis.whole.names[k] for k in order)
    seen = [n in basis.seen.names for n in names]
    series = [
        _bars(name, [rms[k] for k, s in zip(order, seen, strict=True) if s == kept], _rows(seen, kept), colour)
        for name, kept, colour in (("rms, identified", True, BLUE), ("rms, held at its nominal value", False, GREY))
        if kept in seen
    ]
    largest = Series("largest of all candidates", most[order], np.arange(float(len(order))), ORANGE, "points")
    label = f"change of the reading by one prior size (µm); most by {names[0]}, {rms[order[0]]:.0f} µm"
    reach = (0.0, 1.05 * float(most.max()))
    return Panel("", label, "", (*series, largest), x_range=reach, y_names=names, height=ROW * len(names))


def _rows(flags: list[bool], wanted: bool) -> list[int]:
    return [k for k, flag in enumerate(flags) if flag == wanted]


def _correlation(basis: StudyBasis) -> Panel:
    rho, names = basis.predicted.correlation, basis.seen.names
    pairs = int(np.sum(np.abs(np.triu(rho, 1)) >= LOUD))
    says = "No two parameters are" if not pairs else f"{pairs} pair{'s are' if pairs > 1 else ' is'}"
    title = f"{says} correlated by {LOUD:g} or more at the {basis.poses} chosen poses"
    return Panel(title, "", "", (), y_names=names, height=ROW * len(names), cells=Heatmap(rho, names))


def draw_fixtures(study: StudySummary) -> Chart:
    """What each number of fixtures sees, and which remedy shows each parameter that stays unseen."""
    fixtures = study.fixtures
    unseen = tuple(d.name for d in fixtures.steps[0].dropped)
    columns, shown = [], set[str]()
    for step in fixtures.steps[1:]:
        shown = shown | set(step.becomes)
        columns.append((f"{step.fixtures} fixtures", shown))
    columns += [(r.name, set(r.shows)) for r in fixtures.remedies]
    values = np.array([[1.0 if n in shown else 0.0 for _, shown in columns] for n in unseen]).reshape(-1, len(columns))
    never = {d.name for d in fixtures.never}
    values[[n in never for n in unseen]] = -0.3
    hope = len(unseen) - len(never)
    title = f"{hope} of the {len(unseen)} unseen parameters can be shown in some way (blue); red: in none"
    cells = Heatmap(values, tuple(fill(head, 30) for head, _ in columns))
    remedies = Panel(title, "", "", (), y_names=unseen, height=60 + ROW * len(unseen), cells=cells)
    panels = (_fixture_steps(study), *([remedies] if unseen else []))
    return Chart("fixtures_needed", "How many fixtures", "", panels)


def _fixture_steps(study: StudySummary) -> Panel:
    steps, index = study.fixtures.steps, study.basis.index
    rows = list(range(len(steps)))
    texts = tuple(
        f"{s.robot_seen} of the robot, {s.seen} of all {s.parameters}; {index} {format_number(s.value)}" for s in steps
    )
    series = (
        _bars("with fixtures, tool and zero", [float(s.seen) for s in steps], rows, SKY, texts),
        _bars("the robot's own", [float(s.robot_seen) for s in steps], rows, BLUE),
    )
    names = tuple(f"{s.fixtures} fixture{'s' * (s.fixtures > 1)}" for s in steps)
    label = fill(f"parameters seen; {describe_fixtures(study.fixtures, index)[0]}", WIDTH)
    reach = (0.0, 1.8 * max(s.parameters for s in steps))
    return Panel("", label, "", series, x_range=reach, y_names=names, height=150)
