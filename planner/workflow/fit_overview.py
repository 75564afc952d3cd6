"""What the screen says of an identification: errors before and after, causes, what moved, what the run cannot show."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from planner.common.numbers import number_of
from planner.common.summary import Aside, Fact, Summary, name_first, under_key
from planner.common.units import MM, format_value, to_mm
from planner.documents.calibration import Calibration, other_zeros_text, zeros_text
from planner.documents.calibration_summary import GEOMETRY, summarize
from planner.documents.gauge_unit_errors import own_errors_text
from planner.model.calibration_summary import CalibrationSummary, CauseLine
from planner.model.finding import Finding, percent
from planner.model.identification_document import ErrorParts, Estimate, Metrics, Release
from planner.model.use_text import taught_sentence, tolerance_sentence, use_sentence
from planner.release.error_parts import drift_counts, misfit_counts
from planner.workflow.calibration_tables import border_unit

NAMED = 3  # rivals, and parameters, that are listed by name
UNSEEN = "what more readings at these poses cannot show (scale, tool, other postures)"
BEYOND = 3.0  # times the expected size from which on a parameter is told to be beyond it


def fit_overview(found: Calibration) -> Summary:
    """Return the overview of an identification: a title and five lines at most, all else with ``--verbose``."""
    failed = bool(found.reason_not_to_use)
    release = None if failed else found.release
    said = "NOT calibrated" if failed else "calibrated"
    fitted, samples = len(found.last_fit), number_of(len(found.run), "sample")
    asides = {*found.asides, *(w for w in found.run.warnings if isinstance(w, Aside))}
    notes = [Aside(w) if w in asides else w for w in found.warnings]
    title = f"{found.run.name}: {found.robot} {said}; {fitted} parameters, {samples}"
    summary = found.summary or summarize(found)
    causes = [_cause_fact(line) for line in summary.causes]
    steps = [("better", f"{step.what}{f': {step.brings}' if step.brings else ''}") for step in summary.next_steps]
    more = [
        ("", summary.because),
        *_verdict_facts(found, release),
        _held_out_fact(found, release),
        *_cure_facts(found, release),
    ]
    more += [*([] if failed else _parameter_facts(found)), *_structure_facts(found)]
    facts = [*_summary_facts(summary), *steps[:1], *causes, *steps[1:]]
    beyond = next((fact for fact in causes if not fact[1].startswith(GEOMETRY)), None)
    # where lines are cut, the first cause beside the geometry stays: why the robot erred is asked for most
    return Summary(title, facts, [*more, *_details(found, release)], notes, beyond)


def _summary_facts(summary: CalibrationSummary) -> Iterator[Fact]:
    """Say the verdict, the one figure with its meaning, and why it is not what the plan expected."""
    yield "verdict", summary.headline
    if summary.figure and summary.tolerance is None:  # the headline has the figure
        yield "tool", summary.meaning
    elif summary.figure:
        yield "within", summary.line
    if summary.planned and not summary.as_planned:
        yield "planned", summary.planned


def _cause_fact(line: CauseLine) -> Fact:
    """Say a cause: how it is called by its probability, what and how large it is, and how sure that is."""
    grade, _, sure = line.how_sure.partition(", ")
    return grade, f"{line.what}: {line.size}{f' ({sure})' if sure else ''}"


def is_hardly_better(found: Calibration) -> bool:
    """Tell whether correcting programs by the robot that is written leaves most of the tool's error."""
    much = (
        0.8  # share of the nominal robot's error: a fall by a fifth is less than what the stated error is uncertain by
    )
    return found.release is not None and found.workspace_error > much * found.release.nominal_anywhere


def _mm(value: float) -> str:
    return f"{float(to_mm(value)):.3f}"


def _verdict_facts(found: Calibration, release: Release | None) -> Iterator[Fact]:
    """Say what the robot is good enough for, and how good its tool is expected to be: misfit first where it is most."""
    if release is None:
        return
    if (use := found.good_for) is not None:
        yield ("good for", use_sentence(use)) if use.tolerance is None else ("tolerance", tolerance_sentence(use))
    misfit, parts = list(_misfit_facts(found, release)), release.parts
    leads = bool(misfit) and parts is not None and parts.misfit > max(parts.seen, parts.unseen, parts.drift)
    yield from misfit if leads else ()
    anywhere, at_most = _mm(found.workspace_error), _mm(release.at_most)
    near = "" if (m := release.where_measured) is None else f"; {_mm(m)} mm at poses like those measured"
    yield (
        "tool error",
        f"{_mm(release.nominal_anywhere)} → {anywhere} mm  rms over the workspace; 95 % sure below {at_most} mm{near}",
    )
    yield from () if leads else misfit
    if (own := release.work_tool) is not None:
        yield "own tool", f"{_mm(own.nominal_anywhere)} → {_mm(own.anywhere)} mm  with the tool that it works with"
    # 2: times misfit from which on what no poses show has a line beside it: the screen is to have room for causes
    if parts is not None and not leads and (not misfit or drift_counts(parts) or parts.unseen > 2 * parts.misfit):
        yield from _part_facts(parts, bool(release.not_shown))
    yield from (("unseen", u.text(release.at_most)) for u in release.not_shown[:1])


def _part_facts(parts: ErrorParts, said: bool) -> Iterator[Fact]:
    """Say of what the tool error is made where drift counts, or where most of it is what the poses measured hide.

    ``said``: a line of its own says what they hide.
    """
    if drift_counts(parts):
        cure = "measure once it is warm, or log temperature_degC"
        yield "drift", f"{_mm(parts.drift)} mm of it: so far the arm moved in the time of the run; {cure}"
    elif parts.unseen > max(parts.seen, parts.misfit) and not said:
        yield "unseen", f"{_mm(parts.unseen)} mm of it: {UNSEEN}"


def _misfit_facts(found: Calibration, r: Release) -> Iterator[Fact]:
    """Say what no named cause explains, where, and what to measure, where that counts in the tool error."""
    parts, place = r.parts, r.misfit_place
    if place is None or parts is None or not misfit_counts(parts):
        return
    where = "" if found.more is None else " by edbb plan --after"
    if place.ranges:
        cure = f"measure there{where}"
    elif found.noise_floor is None:  # even, it may be noise
        cure = "20 poses twice ([plan] repeat) tell it from noise"
    else:
        cure = f"measure more{where or ' all over the workspace'}"
    like = "" if place.like is None else f", like {place.like}"
    yield "misfit", f"{_mm(parts.misfit)} mm by unnamed causes, {place.text(1)}{like}: {cure}"


def _held_out_fact(found: Calibration, release: Release | None) -> Fact:
    """Say what is left of readings that no fit saw: of validation poses where there are such, else of the held-out."""
    first, last = found.placed_stage, found.stages[-1] if release is None else release
    if first.validation is not None and last.validation is not None:
        change = _change_text(first.validation, last.validation, found.reading_unit)
        return "validation", f"{change} on poses kept apart"
    return "held out", _held_out_text(found, last.held_out)


def _held_out_text(found: Calibration, last: Metrics) -> str:
    where = f"on {found.n_groups} {found.split.groups} that no fit saw"
    return f"{_change_text(found.placed_stage.held_out, last, found.reading_unit)} {where}"


def _cure_facts(found: Calibration, release: Release | None) -> Iterator[Fact]:
    """Say what more poses would bring."""
    if release is not None and found.more is not None:
        yield "for less", found.more.sentence


def _change_text(before: Metrics, after: Metrics, unit: str) -> str:
    largest = f"largest {_mm(before.largest)} → {_mm(after.largest)} {unit}"
    return f"{_mm(before.mean)} → {_mm(after.mean)} {unit}  mean, {largest},"


def _rival_facts(found: Calibration) -> Iterator[Fact]:
    """Say of every cause what it is, and what else explains the same."""
    if found.tried is not None and not found.findings:
        yield "found", "no cause beyond the geometry"
    for cause in found.findings:
        surely = "" if cause.probability is None else f" ({percent(cause.probability)})"
        yield cause.grade, f"{cause.note}{surely}"
        if rivals := _rival_text(cause):
            yield "", rivals


def _rival_text(cause: Finding) -> str:
    """Say what else it may be; empty where nothing else explains the same."""
    names = cause.rival_texts
    if not names:
        return ""
    more = f" or {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"or {', or '.join(names[:NAMED])}{more}: this run cannot tell which"


def _parameter_facts(found: Calibration) -> Iterator[Fact]:
    """Say what moved most, first what is beyond its expected size, and what has no deviation of its own, and why."""
    far = _far_estimates(found)
    ranked = sorted(_seen_geometry(found), key=lambda e: (e not in far, -abs(e.value - e.nominal) / (e.std or 1.0)))
    if moved := ranked[:NAMED]:
        beyond = f" (over {BEYOND:g} times what is expected)"
        yield "moved most", ", ".join(f"{_shift_text(e)}{beyond if e in far else ''}" for e in moved)
    if unseen := [e for e in found.estimates if not e.identifiable]:
        one = f": {unseen[0].because}" if len(unseen) == 1 and unseen[0].because else ", this run cannot show them"
        yield "no sigma", f"{_names(unseen)}{one}"


def _seen_geometry(found: Calibration) -> list[Estimate]:
    """Return the lengths and angles that the run shows, with a standard deviation of their own."""
    return [e for e in found.estimates if e.identifiable and e.group == "geometry" and e.std]


def _far_estimates(found: Calibration) -> list[Estimate]:
    """Return the lengths and angles that moved beyond what is expected of any robot."""
    prior = {p.name: p.prior for p in found.fit.model.parameters}
    return [e for e in _seen_geometry(found) if abs(e.value - e.nominal) > BEYOND * prior.get(e.name, np.inf)]


def _structure_facts(found: Calibration) -> Iterator[Fact]:
    """Say what the residual follows, where it is not chance."""
    if found.diagnosis.structured:
        yield "rest", found.diagnosis.sentence


def _names(estimates: Sequence[Estimate]) -> str:
    return name_first([e.name for e in estimates])


def _shift_text(e: Estimate) -> str:
    return f"{e.name} {format_value(e.value - e.nominal, e.std, *border_unit(e))}"


def _details(found: Calibration, release: Release | None) -> Iterator[Fact]:
    if release is not None and (use := found.good_for) is not None:
        if use.tolerance is not None:
            yield "good for", use_sentence(use)
        yield "good for", f"of 95 of 100 targets, 95 % sure; {taught_sentence(use)}"
    if own := own_errors_text(found):
        yield "in pixels", own
    yield from () if found.reason_not_to_use else _rival_facts(found)
    if far := _far_estimates(found):
        yield "at a limit", f"{_names(far)}: more than {BEYOND:g} times the size that is expected"
    if not found.diagnosis.structured:
        yield "rest", found.diagnosis.sentence
    if release is not None:
        values, remarks = zeros_text(found)
        yield from under_key("zeros", [values, *remarks] if values else [])
    yield from _stage_rows(found)
    yield "held out", f"{100 * found.split.hold_out:.0f} % of {found.n_groups} {found.split.groups} at a time"
    if release is not None:
        yield from _release_details(found, release)
    yield from _parameter_rows(found.estimates)


def _release_details(found: Calibration, release: Release) -> Iterator[Fact]:
    """Say what the robot that is written is made of, and what its expected error is made of."""
    if release.validation is not None:
        yield "held out", _held_out_text(found, release.held_out)
    if release.work_tool is None:
        yield "other tool", f"{_mm(release.other_tool)} mm  at a tool point that was not measured"
    if (m := release.unexplained) is not None:
        kept = "; the robot as written follows it where it was measured" if release.basis == "posterior" else ""
        yield "unnamed", f"motion that the run shows of causes without a name: {_mm(m.anywhere)} mm rms{kept}"
    what = "geometry and all effects, by their probability" if release.basis == "posterior" else "geometry alone"
    yield "written", f"{what}, held out {release.held_out.rms / MM:.4f} {found.reading_unit} rms"
    geometry = "; worse than the nominal robot" if release.geometry_anywhere > release.nominal_anywhere else ""
    yield "geometry", f"{_mm(release.geometry_anywhere)} mm  tool error with the geometry alone{geometry}"
    if (p := release.parts) is not None:
        yield "error from", f"{_mm(p.seen)} mm  noise and number of readings"
        yield "", f"{_mm(p.unseen)} mm  {UNSEEN}"
        yield "", f"{_mm(p.misfit)} mm  misfit"
        yield "", f"{_mm(p.drift)} mm  drift in the time of the run"
    yield from (("unseen", u.text(release.at_most)) for u in release.not_shown)
    yield "holds", release.warmth_text
    yield from (("zeros", text) for text in other_zeros_text(found))


def _stage_rows(found: Calibration) -> Iterator[Fact]:
    """Return the errors stage by stage in columns, effects in the order in which the search added them."""
    wide = max(26, *(len(s.name) for s in found.stages))
    checked = found.stages[-1].validation is not None
    title = f"held out, {found.reading_unit}"
    yield "stages", f"{title:<{wide}}{'rms':>10}{'mean':>10}{'largest':>10}{'validation' * checked:>12}"
    for s in found.stages:
        m = s.held_out
        row = "".join(f"{v / MM:10.4f}" for v in (m.rms, m.mean, m.largest))
        yield "", f"{s.name:<{wide}}{row}" + ("" if s.validation is None else f"{s.validation.mean / MM:12.4f}")


def _parameter_rows(estimates: Iterable[Estimate]) -> Iterator[Fact]:
    """Return every parameter as lmfit lists it: value, standard deviation, where it was, and why it has none."""
    yield "parameters", f"{'':<24}{'value':>14}{'sigma':>12}{'moved by':>12}"
    for e in estimates:
        unit, factor = border_unit(e)
        std = f"{(e.std or 0.0) * factor:12.5f}" if e.identifiable else f"{'none':>12}"
        row = f"{e.name:<24}{e.value * factor:14.5f}{std}{(e.value - e.nominal) * factor:12.5f} {unit}"
        yield "", row + (f"  {e.because}" if e.because else "")
