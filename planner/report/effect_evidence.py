"""What each identified effect explains: residuals before and after it was added, and their charts."""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.determinism import even_positions
from planner.common.units import Array, to_mm
from planner.effects.basis import ONE, EffectVariable
from planner.effects.context import Context
from planner.effects.effect import Parameter
from planner.effects.steps import BeforeSample, extend_over_run
from planner.model.finding import Finding, Member
from planner.model.identification_document import Stage
from planner.model.model import Model
from planner.report.calibration_data import PANEL_POINTS, CalibrationFacts
from planner.report.chart import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    Chart,
    Panel,
    Series,
    golden_steps,
    list_panel,
    weighted_means,
    zero_line,
)

SIZES = {"rad": "µrad", "m": "µm"}
MEAN_POINTS = 24  # of the line through the residuals; more for an effect of many waves


@dataclass(frozen=True)
class FindingStep:
    """One finding and the stages before and after it was added.

    Attributes:
        what: as its stage and its parameters' group are called.
        replaced: whether it took the place of something, which the stage before then still has.
    """

    finding: Member
    what: str
    before: Stage
    after: Stage
    replaced: bool

    @property
    def inner(self) -> str:
        """Name of the parameter that moves the effect's inner number."""
        return f"{self.what}, {self.finding.inner.name}" if self.finding.inner else ""


@dataclass(frozen=True)
class Evidence:
    """An effect in the residual, before and after it was in the model.

    Attributes:
        against: what it is drawn against.
        unit: ``rad`` or ``m``, of ``before``, ``after`` and ``fitted``.
        before, after: what the residual says of it, sample by sample, (m,).
        weight: how much each sample says, (m,).
        fitted: what the effect adds as fitted, (m,).
        means: points of the line through the residuals.
        marks: where something stepped.
        of_axis: whether it is drawn as the error of the axis that the effect turns, else along what the effect moves.
    """

    against: EffectVariable
    unit: str
    before: Array
    after: Array
    weight: Array
    fitted: Array
    means: int = MEAN_POINTS
    marks: tuple[float, ...] = ()
    of_axis: bool = False


def finding_steps(facts: CalibrationFacts) -> tuple[FindingStep, ...]:
    """Return each finding with the stages before and after it, in the order in which they came.

    None of what has no stage: what is off of the set-up, and what the posterior holds besides.
    """
    c = facts.calibration
    out = list[tuple[int, FindingStep]]()
    each = [f for cause in c.findings for f in cause.each if not f.beside_stages]
    for f in (f for f in each if any(f.name in s.effects for s in c.stages)):
        without = [k for k, s in enumerate(c.stages) if f.name not in s.effects]
        first = min(without[-1] + 1, len(c.stages) - 1)  # one of that name may have come before, and gone
        before = c.stages[max(first - 1, 0)]
        replaced = not set(before.effects) <= set(c.stages[-1].effects)
        came = [s for s in c.stages[first:] if s.name.startswith(f.name)] if f.after_sample is not None else []
        after = came[-1] if came else c.stages[first]  # of what stepped again and again, with all of its steps
        out.append((first, FindingStep(f, f.name, before, after, replaced)))
    return tuple(step for _, step in sorted(out, key=lambda pair: pair[0]))


@dataclass(frozen=True)
class ToldFinding:
    """A cause of the document and the steps by which it came, one for each name, none of what has no stage.

    ``name`` is that of its picture.
    """

    name: str
    finding: Finding
    steps: tuple[FindingStep, ...]


def told_findings(facts: CalibrationFacts) -> tuple[ToldFinding, ...]:
    """Return the document's causes in their order, each with its steps."""
    steps = {id(s.finding): s for s in finding_steps(facts)}
    out = list[ToldFinding]()
    for k, cause in enumerate(facts.calibration.findings, start=1):
        own = {s.what: s for f in cause.each if (s := steps.get(id(f))) is not None}
        out.append(ToldFinding(f"found_{k}", cause, tuple(own.values())))
    return tuple(out)


def collect_evidence(facts: CalibrationFacts, step: FindingStep) -> Evidence:
    """Draw out of the residuals what they say of a step's effect.

    An effect that moves one transform is drawn as that transform's error, each reading's share of it (its residual
    along the transform's screw, over the screw's length) against the quantity it depends on. Others are drawn as the
    part of the residual along what the effect adds, against just that: a line of slope one before, a flat one after.
    Of a step it is the part along what stepped, as it would act all along, against the sample of the run.
    What the effect adds is always less what the model before could take up (an added-variable plot; Cook and Weisberg
    1982, section 2.3.2).
    """
    fit, (which, rows) = facts.calibration.fit, facts.few_rows
    context = Context(fit.setup, facts.calibration.run.samples.take(which))
    residuals = [s.held_residual[which][:, :3] for s in (step.before, step.after)]
    added = _effect_readings(facts, step)
    if step.replaced:  # the stage before had something else in its place: what is left with the effect taken out again
        residuals[0] = residuals[1] + added
    own = [p for p in fit.model.parameters if p.group == step.what and p.name != step.inner]
    first = own[0]
    changed = isinstance(first.main_move.phi, BeforeSample)
    looked = first.main_move.phi.plot_variable(context) if changed or _move_one(own) else None
    if looked is None:
        return _residual_along(added, residuals, "rad" if facts.calibration.angle_unit else "m")
    bare = (
        tuple(map(extend_over_run, own)) if changed else (replace(first, moves=(replace(first.main_move, phi=ONE),)),)
    )
    size = np.array([fit.errors[fit.model.names.index(p.name)] for p in own]) if changed else np.ones(1)
    screws = Model(fit.setup, bare).linearize_in(context, None).rows[:, : rows.shape[1]]
    screw = screws @ (size / np.linalg.norm(size))
    power = (screw**2).sum(axis=1)
    # 0.3: part of its usual leverage below which a reading says nothing of an effect
    safe = np.maximum(power, (0.3**2) * max(float(np.median(power)), 1e-300))
    before, after, fitted = (np.einsum("nr,nr->n", r, screw) / safe for r in (*residuals, added))
    turns = first.main_move.on == "transform" and fit.setup.chain.transforms[first.main_move.index].kind == "rotation"
    means = int(np.clip(3 * len(own), MEAN_POINTS, len(power) // 10 + MEAN_POINTS))
    marks = tuple(sorted({m.phi.sample + 0.5 for p in own for m in p.moves if isinstance(m.phi, BeforeSample)}))
    return Evidence(looked, "rad" if turns else "m", before, after, power, fitted, means, marks, turns)


def _effect_readings(facts: CalibrationFacts, step: FindingStep) -> Array:
    """What an effect adds to the readings (m, r) beyond what the parameters of the stage before could take up."""
    fit, rows = facts.calibration.fit, facts.few_rows[1]
    groups = [p.group for p in fit.model.parameters]
    own = [k for k, p in enumerate(fit.model.parameters) if p.group == step.what and p.name != step.inner]
    known_then = (step.after if step.replaced else step.before).effects
    rest = [k for k, group in enumerate(groups) if group in ("gauge", "geometry", *known_then)]
    added = rows[:, :, own] @ fit.errors[own]
    known = rows[:, :, [k for k in rest if k not in own]].reshape(added.size, -1)
    known = known / np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    taken = np.linalg.lstsq(known, added.ravel(), rcond=1e-6)[0]
    return np.asarray(added - (known @ taken).reshape(added.shape))


def _move_one(parameters: list[Parameter]) -> bool:
    """Tell whether all parameters move one and the same transform or number."""
    places = {(m.on, m.index) for p in parameters for m in p.moves}
    return len(places) == 1 and all(len(p.moves) == 1 for p in parameters)


def _residual_along(added: Array, residuals: list[Array], unit: str) -> Evidence:
    """Residuals (m, r) along what an effect adds (m, r), against that, both in ``unit``: ``m`` or ``rad``."""
    size = np.linalg.norm(added, axis=1)
    along = added / np.maximum(size, 1e-300)[:, None]
    if added.shape[1] == 1:
        size, along = added[:, 0], np.ones_like(along)
    before, after = (np.einsum("nr,nr->n", r, along) for r in residuals)
    against = EffectVariable(f"what the effect adds to the reading ({SIZES[unit]})", 1e6 * size)
    return Evidence(against, unit, before, after, size**0, size)


def stage_chart(facts: CalibrationFacts) -> Chart:
    """Error of every stage, fitted and held out."""
    stages = facts.calibration.stages
    names, places = [s.name for s in stages], np.arange(len(stages), dtype=float)
    held, train = (to_mm(np.array(rms)) for rms in zip(*((s.held_out.rms, s.train.rms) for s in stages), strict=True))
    spread = to_mm(np.array([s.held_out.spread or 0.0 for s in stages]))
    series = [
        Series("", np.array([max(h - d, 0.3 * h), h + d]), np.array([k, k]), ORANGE, width=5.0, opacity=0.4)
        for k, (h, d) in enumerate(zip(held, spread, strict=True))
        if d > 0
    ]
    series += [
        Series("fitted samples", train, places, GREY, "points", size=7.0),
        Series("held out, with the spread over the parts", held, places, ORANGE, "points", size=9.0),
    ]
    checked = [(k, s.validation.rms) for k, s in enumerate(stages) if s.validation is not None]
    if checked:
        at, rms = np.array(checked).T
        series.append(Series("validation run", to_mm(rms), at, BLUE, "points", size=7.0))
    rest, unit = max(40, 150 - 26 * len(names)), facts.calibration.reading_unit
    panel = list_panel("", f"rms error ({unit}, logarithmic)", names, series, rest=rest, log_x=True)
    caption = (
        "From top to bottom the model grows by one effect at a time, in the order in which the search found them. The "
        "held-out error counts."
    )
    return Chart("by_stage", "The error stage by stage", caption, (panel,))


def finding_chart(facts: CalibrationFacts, told: ToldFinding) -> Chart:
    """What the residual says of a finding before (left) and after (right) it was added; of many, at every joint."""
    panels, of_axis = list[Panel](), False
    for step in told.steps:
        e = collect_evidence(facts, step)
        # 0.98: part of the points that the panel's height is made for
        most, fitted = (float(np.quantile(np.abs(v), 0.98)) for v in (e.before, e.fitted))
        span = 1e6 * max(most, 1.15 * fitted, 1e-12)
        where = f"{step.finding.on}, " if len(told.steps) > 1 else ""
        panels += [_panel(e, e.before, f"{where}before", True, span), _panel(e, e.after, f"{where}after", False, span)]
        of_axis = e.of_axis
    what = "each as the error of the effect's own axis" if of_axis else "along what the effect moves"
    comma = "," if of_axis else ""
    caption = (
        f"Held-out residuals{comma} {what}. Points: readings; black: their mean; orange: the effect as fitted in the "
        "end, less what the model before it could take up."
    )
    return Chart(told.name, told.finding.note, caption, tuple(panels), columns=2)


def _panel(e: Evidence, values: Array, title: str, fitted: bool, span: float) -> Panel:
    x, y = e.against.folded_values, 1e6 * values
    heavy = np.flatnonzero(e.weight >= 0.09 * np.median(e.weight))
    shown = heavy[even_positions(len(heavy), PANEL_POINTS)]
    inside = shown[np.abs(y[shown]) <= span]
    series = [zero_line(x), Series("", _move_apart(x)[inside], y[inside], BLUE, "points", size=3.5, opacity=0.35)]
    if fitted:
        series.append(Series("as fitted", *weighted_means(x, 1e6 * e.fitted, e.weight, e.means), RED, width=3.0))
    at, mean = weighted_means(x, y, e.weight, e.means)
    series.append(Series("mean", at, mean, BLACK, width=1.8))
    for k, mark in enumerate(e.marks):
        series.append(Series("" if k else "step", np.full(2, mark), np.array([-span, span]), GREEN, width=1.5))
    return Panel(f"{title} ({SIZES[e.unit]})", e.against.label, "", tuple(series), y_range=(-span, span), height=210)


def _move_apart(x: Array) -> Array:
    """Move points of a quantity with few values side by side, by golden steps: they do not lie on each other then."""
    values = np.unique(x)
    if len(values) > 8 or len(values) < 2:
        return x
    return np.asarray(x + 0.3 * float(np.diff(values).min()) * golden_steps(len(x)))
