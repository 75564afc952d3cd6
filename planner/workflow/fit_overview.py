"""What the screen says of an identification: errors before and after, causes, what moved, what the run cannot show."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from planner.common.numbers import number_of
from planner.common.summary import Aside, Fact, Summary, name_first
from planner.common.units import DEG, MM, format_value, to_mm
from planner.identification.calibration import Calibration, other_zeros_text, zeros_text
from planner.identification.error_parts import drift_counts
from planner.identification.own_errors import own_errors_text
from planner.model.finding_groups import FindingGroup, group_findings, percent
from planner.model.identification_document import Estimate, Metrics, Release
from planner.model.use_statement import Use
from planner.model.use_text import taught_sentence, tolerance_sentence, use_sentence
from planner.workflow.calibration_tables import border_unit

NAMED = 3  # rivals, and parameters, that are listed by name
BEYOND = 3.0  # times the expected size from which on a parameter is told to be beyond it


def fit_overview(found: Calibration) -> Summary:
    """Return what is said of an identification."""
    release = None if found.problems else found.release
    said = "calibrated" if not found.problems else "NOT calibrated, the fit failed its own checks"
    fitted, samples = len(found.last_fit), number_of(len(found.run), "sample")
    use = found.good_for
    facts = [
        *([] if release is None or use is None else _use_facts(use)),
        *([] if release is None else _leading_facts(release, found.workspace_error, found.fit.model.width)),
        *([] if found.more is None else [("", found.more.sentence)]),
        *_reading_facts(found, release),
        *([("in pixels", own)] if (own := own_errors_text(found)) else []),
        *_cause_facts(found),
        *_parameter_facts(found),
        ("rest", found.diagnosis.sentence),
        *([] if release is None else _zero_facts(found)),
    ]
    asides = {w for w in found.run.warnings if isinstance(w, Aside)}  # a document keeps texts alone
    notes = [Aside(w) if w in asides else w for w in found.warnings]
    title = f"{found.run.name}: {found.robot} {said}; {fitted} parameters, {samples}"
    return Summary(title, facts, list(_details(found, release)), notes)


def _mm(value: float) -> str:
    return f"{float(to_mm(value)):.3f}"


def _leading_facts(r: Release, anywhere: float, width: int) -> list[Fact]:
    """Say how good the tool is expected to be, and what no named cause explains: first what is most of it."""
    misfit, tool = list(_misfit_facts(r, width)), list(_tool_facts(r, anywhere))
    most = r.parts is not None and r.parts.misfit > max(r.parts.seen, r.parts.unseen, r.parts.drift)
    return [*misfit, *tool] if most else [*tool, *misfit]


def _tool_facts(r: Release, anywhere: float) -> Iterator[Fact]:
    """Say how good the tool is expected to be anywhere: the figure that leads."""
    yield (
        "tool error",
        f"{_mm(r.nominal_anywhere)} → {_mm(anywhere)} mm  rms over the workspace; 95 % below {_mm(r.at_most)} mm",
    )
    if (own := r.work_tool) is not None:
        yield (
            "own tool",
            f"{_mm(own.nominal_anywhere)} → {_mm(own.anywhere)} mm  with the tool that it works with",
        )
    if r.parts is not None and drift_counts(r.parts):
        yield "drift", f"{_mm(r.parts.drift)} mm of it: so far the arm moved in the time of the run"
        yield "", "it is written as it was on average; measure once it is warm, or log temperature_degC"


def _use_facts(use: Use) -> Iterator[Fact]:
    """Say what the robot is good enough for."""
    yield "good for", use_sentence(use)
    if use.tolerance is not None:
        yield "tolerance", tolerance_sentence(use)


def _reading_facts(found: Calibration, release: Release | None) -> Iterator[Fact]:
    """Say what is left of readings that no fit saw."""
    first, last = found.placed_stage, found.stages[-1]
    held_out = last.held_out if release is None else release.held_out
    where = f"on {found.n_groups} {found.split.groups} that no fit saw"
    yield "held out", f"{_change_text(first.held_out, held_out, _unit(found))} {where}"
    validation = last.validation if release is None else release.validation
    if first.validation is not None and validation is not None:
        yield "validation", f"{_change_text(first.validation, validation, _unit(found))} on poses kept apart"


def _change_text(before: Metrics, after: Metrics, unit: str) -> str:
    largest = f"largest {_mm(before.largest)} → {_mm(after.largest)} {unit}"
    return f"{_mm(before.mean)} → {_mm(after.mean)} {unit}  mean, {largest},"


def _unit(found: Calibration) -> str:
    """Return what a thousandth of a reading is called: mm, or mrad where it is an angle."""
    return found.fit.model.setup.gauge.unit


def _cause_facts(found: Calibration) -> Iterator[Fact]:
    """Say which causes were found, those first that bring most; of doubtful ones the first where none is sure."""
    most_found = 3  # causes that are listed one by one
    if found.tried is None:
        return
    groups = _sorted_causes(found)
    sure = sum(not g.is_doubtful for g in groups)
    shown = groups[: min(max(sure, 1), most_found)]
    for group in shown:
        yield "doubtful" if group.is_doubtful else "found", _cause_text(group)
    if more := groups[len(shown) :]:
        doubtful = sum(g.is_doubtful for g in more)
        which = f", {'all' if doubtful == len(more) else doubtful} of them doubtful" if doubtful else ""
        yield "", f"and {number_of(len(more), 'cause')} more{which} (report.html)"
    if not groups:
        yield "found", "no cause beyond the geometry"


def _sorted_causes(found: Calibration) -> list[FindingGroup]:
    """Return the causes, those first that are surer than not, among them those that bring most."""
    return sorted(group_findings(found.findings), key=lambda g: (g.is_doubtful, -g.gain))


def _rival_facts(found: Calibration) -> Iterator[Fact]:
    """Say of every cause what it is, and what else explains the same."""
    for group in _sorted_causes(found):
        yield "doubtful" if group.is_doubtful else "found", group.note
        if rivals := _rival_text(group):
            yield "", rivals


def _cause_text(group: FindingGroup) -> str:
    """Say a cause in a line: its size, how sure it is, and how many others explain the same."""
    said = group.note.partition(" (root mean square")[0]  # of many joints: each one's size stands below
    surely = [] if group.probability is None else [percent(group.probability)]
    if (others := len(group.rival_texts)) > 0:
        surely.append(f"or {number_of(others, 'other cause')}: see -v")
    elif group.is_doubtful:
        surely.append("or nothing")
    return f"{said} ({', '.join(surely)})" if surely else said


def _rival_text(group: FindingGroup) -> str:
    """Say what else it may be; empty where nothing else explains the same."""
    names = group.rival_texts
    if not names:
        return ""
    more = f" or {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"or {', or '.join(names[:NAMED])}{more}: this run cannot tell which"


def _parameter_facts(found: Calibration) -> Iterator[Fact]:
    """Say what moved most, what is beyond its expected size, and what has no deviation of its own, and why."""
    seen = [e for e in found.estimates if e.identifiable and e.group == "geometry" and e.std]
    moved = sorted(seen, key=lambda e: -abs(e.value - e.nominal) / (e.std or 1.0))
    if moved:
        yield "moved most", ", ".join(_shift_text(e) for e in moved[:NAMED])
    prior = {p.name: p.prior for p in found.fit.model.parameters}
    far = [e for e in seen if abs(e.value - e.nominal) > BEYOND * prior.get(e.name, np.inf)]
    if far:
        yield "at a limit", f"{_names(far)}: more than {BEYOND:g} times the size that is expected"
    if unseen := [e for e in found.estimates if not e.identifiable]:
        one = f": {unseen[0].because}" if len(unseen) == 1 and unseen[0].because else ", this run cannot show them"
        yield "no sigma", f"{_names(unseen)}{one}"


def _names(estimates: Sequence[Estimate]) -> str:
    return name_first([e.name for e in estimates])


def _shift_text(e: Estimate) -> str:
    return f"{e.name} {format_value(e.value - e.nominal, e.std, *border_unit(e))}"


def _misfit_facts(r: Release, width: int) -> Iterator[Fact]:
    """Say what no named cause explains: how much, where, what to measure next."""
    if (m := r.unexplained) is None:
        return
    where, there = "alike everywhere", "all over the workspace"
    if m.range is not None and m.there is not None:
        low, high = (f"{v / DEG:.0f}" for v in m.range)
        there = f"with joint {m.joint} from {low} to {high}{m.unit.replace('°', ' deg')}"
        where = f"most {there} ({_mm(m.there)} mm)"
    how = " (edbb plan --aim tracing, or about a further fixture)" if width == 1 else ""
    size = m.anywhere if r.parts is None else r.parts.misfit
    yield "misfit", f"{_mm(size)} mm of the tool error has no named cause, {where}"
    yield "", f"measure next: more poses {there}{how}"


def _zero_facts(found: Calibration) -> Iterator[Fact]:
    """Say what the controller's zeros are off, whose angles they are, and that to use them once is enough."""
    values, remarks = zeros_text(found)
    if values:
        yield "zeros", values
        yield from (("", text) for text in (remarks[0], remarks[-1]))


def _details(found: Calibration, release: Release | None) -> Iterator[Fact]:
    if release is not None and (use := found.good_for) is not None:
        yield "good for", f"of 95 of 100 targets, 95 % sure; {taught_sentence(use)}"
    if release is not None and release.work_tool is None:
        yield "other tool", f"{_mm(release.other_tool)} mm  at a tool point that was not measured"
    yield from _rival_facts(found)
    if release is not None and (m := release.unexplained) is not None:
        kept = "; the robot as written follows it where it was measured" if release.basis == "posterior" else ""
        yield "misfit", f"{_mm(m.anywhere)} mm rms over the workspace has no named cause{kept}"
    yield from (("zeros", text) for text in zeros_text(found)[1][1:-1])
    yield from _stage_rows(found)
    yield "held out", f"{100 * found.split.hold_out:.0f} % of {found.n_groups} {found.split.groups} at a time"
    if release is not None:
        what = "geometry and all effects, by their probability" if release.basis == "posterior" else "geometry alone"
        yield "written", f"{what}, held out {release.held_out.rms / MM:.4f} {_unit(found)} rms"
        geometry = "; worse than the nominal robot" if release.geometry_anywhere > release.nominal_anywhere else ""
        yield "geometry", f"{_mm(release.geometry_anywhere)} mm  tool error with the geometry alone{geometry}"
        if (p := release.parts) is not None:
            yield "error from", f"{_mm(p.seen)} mm  noise and number of readings"
            yield "", f"{_mm(p.unseen)} mm  what more readings at these poses cannot show (scale, tool, other postures)"
            yield "", f"{_mm(p.misfit)} mm  misfit"
            yield "", f"{_mm(p.drift)} mm  drift in the time of the run"
        yield from (("zeros", text) for text in other_zeros_text(found))
    yield from _parameter_rows(found.estimates)


def _stage_rows(found: Calibration) -> Iterator[Fact]:
    """Return the errors stage by stage in columns."""
    wide = max(26, *(len(s.name) for s in found.stages))
    checked = found.stages[-1].validation is not None
    yield (
        "stages",
        f"{'held out, ' + _unit(found):<{wide}}{'rms':>10}{'mean':>10}{'largest':>10}{'validation' * checked:>12}",
    )
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
