"""Sentences of a calibration's report: every number in them is one of the calibration's."""

from collections.abc import Mapping

import numpy as np

from planner.common.units import Array, display_unit, file_unit, si_unit
from planner.documents.calibration import Calibration
from planner.documents.calibration_summary import GEOMETRY
from planner.documents.gauge_unit_errors import own_errors_text
from planner.model.finding import Finding, inner_unit, percent
from planner.model.identification_document import DetectionLimit, Estimate
from planner.release.error_parts import drift_counts
from planner.report.calibration_data import CalibrationFacts
from planner.report.effect_evidence import FindingStep, ToldFinding, told_findings
from planner.report.formatting import count_text, decimals_of, digits, in_mm
from planner.report.page import Row


def estimate_unit(e: Estimate) -> tuple[str, float]:
    """Return the unit a parameter is shown in, and the factor from SI: mm or deg for geometry, else a small one."""
    if e.group in ("gauge", "geometry"):
        unit = file_unit(e.unit)
        return display_unit(e.unit, e.std or 0.0) if e.unit == "s" else (unit, 1 / si_unit(unit)[1])
    return display_unit(e.unit, max(abs(e.value), e.std or 0.0))


def declared_effects_text(c: Calibration) -> tuple[str, ...]:
    """Say one sentence for each effect of the last stage that no tracing brought, with its values as written."""
    traced = {f.name for cause in c.findings for f in cause.each} | {r.name for r in c.rejected}
    return tuple(_sentence(c, kind) for kind in c.stages[-1].effects if kind not in traced and ", " not in kind)


def _sentence(c: Calibration, kind: str) -> str:
    written = [e for e in c.estimates if e.group == kind and e.identifiable]
    own = written or [e for e in c.last_fit if e.group == kind]
    listed_at_most = 8  # parameters of one effect
    listed = ", ".join(_value(e) for e in own[:listed_at_most])
    more = f" and {len(own) - listed_at_most} more" if len(own) > listed_at_most else ""
    where = "" if written else "; the robot as written does not hold it"
    return f"Fitted beside the geometry: {kind} ({listed}{more}){where}."


def _value(e: Estimate) -> str:
    unit, factor = estimate_unit(e)
    return f"{e.name} {digits(e.value * factor)} ± {digits((e.std or 0.0) * factor, 2)} {unit}"


GROUP_NAMES = {
    "pose": ("poses", "whole poses, each with all its repeats"),
    "placement": ("placements", "whole placements of the gauge"),
    "session": ("sessions", "whole sessions"),
    "block": ("blocks", "whole blocks of the run in its order"),
    "stretch": ("sections", "whole sections of the drive, never single rows of it"),
}


def proof_text(facts: CalibrationFacts) -> tuple[str, ...]:
    """Say what readings that no fit saw show: the error before and after."""
    c, groups = facts.calibration, GROUP_NAMES[facts.calibration.split.by][0]
    unit, read = c.reading_unit, c.setup.gauge.plural
    before, after = facts.placed_stage.held_out, facts.written_errors.held_out
    if c.problems:
        return (f"The fit leaves a held-out error of {in_mm(after.mean)} {unit}, mean, on {groups} that it never saw.",)
    was, now = (f"{in_mm(m.mean)} {unit}" for m in (before, after))
    a, b = (f"{in_mm(m.largest)} {unit}" for m in (before, after))
    out = [f"Held-out error of {read}, mean {was} → {now}, largest {a} → {b}: on {groups} that no fit saw."]
    if before.mean <= after.mean:
        out.append("The calibration brought nothing.")
    checks = [s.validation for s in (facts.placed_stage, facts.written_errors) if s.validation is not None]
    if len(checks) == 2:
        out.append(f"On the separate validation run: {in_mm(checks[0].mean)} {unit} → {in_mm(checks[1].mean)} {unit}.")
    own = own_errors_text(c)
    out += [f"{_capital(own)}."] if own else []
    if c.release is not None and not c.problems:
        out.append(
            "All this is at poses like those measured. The figure above is of the whole workspace, which is more."
        )
    return tuple(out)


def open_parts_text(c: Calibration) -> tuple[str, ...]:
    """Say how good the tool is over the workspace, of what that error is made, and where it is largest."""
    r = c.release
    if r is None or c.problems:
        return ()
    out = [
        f"Rms over the workspace: {in_mm(r.nominal_anywhere)} mm → {in_mm(c.workspace_error)} mm (95 % sure below "
        f"{in_mm(r.at_most)} mm); with a tool that was not measured {in_mm(r.other_tool)} mm."
    ]
    if (p := r.parts) is not None:
        out.append(
            f"Of the {in_mm(c.workspace_error)} mm, {in_mm(p.seen)} mm come from noise. More readings at these poses "
            f"cannot show {in_mm(p.unseen)} mm: scale, tool, other postures. {in_mm(p.misfit)} mm are misfit: no named "
            "cause explains them."
        )
        if drift_counts(p):
            out.append(f"The arm moved by {in_mm(p.drift)} mm in the time of the run; it is written as on average.")
    if r.where_measured is not None:
        out.append(f"At poses like those measured {in_mm(r.where_measured)} mm are expected.")
    out += [f"No pose has shown {u.text(r.at_most)}." for u in r.not_shown]
    out.append(f"All this holds {r.warmth_text}.")
    if (place := r.misfit_place) is not None:
        like = "" if place.like is None else f"; it acts like {place.like}"
        out.append(f"The misfit is {place.text(unit=' mm')}{like}.")
    return tuple(out)


def computed_text(c: Calibration) -> tuple[str, ...]:
    """Say what was fitted and what was written."""
    every = len({e.name for e in (*c.estimates, *c.last_fit)})
    condition = digits(c.condition_number or np.inf)
    return (
        f"{count_text(len(c.run))} readings; {len(c.fit.errors)} of {every} parameters fitted. The condition number of "
        f"the identification Jacobian, scaled by the prior sigmas, is {condition}.",
        f"The robot as written is {released_text(c)}. ± is the root of the expected squared error of a parameter. What "
        "the run says little of is drawn towards its nominal value.",
        "The error over the workspace is judged with robots drawn from the posterior, the base aligned anew.",
    )


def causes_about(facts: CalibrationFacts) -> str:
    """Say how many causes were found, counted as on the first screen."""
    c = facts.calibration
    sure = sum(not line.how_sure.startswith("doubtful") for line in facts.causes)
    doubtful = sum(f.is_doubtful for f in c.findings)
    rest = "none looked for beyond the geometry" if c.tried is None else f"{doubtful} doubtful"
    return f"{sure} found or likely, {rest}"


def released_text(c: Calibration) -> str:
    """Say what the robot's file holds."""
    r = c.release
    if r is None:
        return "the last stage"
    if r.basis == "geometry":
        return "geometry alone"
    mean = "the posterior mean of geometry and all effects"
    if r.share == 1.0:
        return mean
    return f"{r.share:.0%} of the step from geometry alone to {mean}; a larger step may make some robots worse"


def held_out_text(c: Calibration) -> str:
    """Say how samples were kept from the fit that predicts them."""
    several, whole = GROUP_NAMES[c.split.by]
    folds = round(1 / c.split.hold_out)
    out = (
        f"Held out were {whole}: {count_text(c.n_groups)} {several} in {folds} parts; each part "
        f"was predicted by a fit to the other {folds - 1}. The spread is that of the rms over the parts."
    )
    if c.split.within is not None:
        out += (
            f" With single poses held out instead, what each of the {several} has of its own being known, the mean "
            f"error is {in_mm(c.split.within.held_out.mean)} {c.reading_unit}."
        )
    return out


def noise_text(c: Calibration) -> str:
    """Say how large the noise is, as estimated and as repeated readings show it."""
    C = c.fit.problem.whitener.covariance()
    width = min(3, C.shape[1])
    sigma = float(np.sqrt(np.einsum("nii->n", C[:, :width, :width]).mean()))
    axis = " of each axis" if width > 1 else ""
    out = f"One reading scatters by {in_mm(sigma)} {c.reading_unit} (standard deviation{axis}, estimated)"
    if c.noise_floor is not None:
        out += f"; readings repeated at the same pose scatter by {in_mm(c.noise_floor)} {c.reading_unit}"
    if c.correlation_time > 1.05:
        out += f"; along the drive {digits(c.correlation_time, 2)} samples are worth one"
    return out + "."


def correlation_text(names: tuple[str, ...], correlation: Array) -> tuple[str, ...]:
    """Say which parameters the run can hardly tell apart."""
    i, j = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(correlation[i, j]), kind="stable")
    out = []
    for k in order[:6]:  # sentences
        a, b, rho = names[i[k]], names[j[k]], float(correlation[i[k], j[k]])
        if abs(rho) < 0.9:  # correlation worth a sentence
            break
        better = "difference" if rho > 0 else "sum"
        out.append(
            f"{a} and {b} ({rho:+.3f}): counted in their own standard deviations, the run knows their {better} "
            f"{digits(1 / np.sqrt(max(1 - abs(rho), 1e-12)), 2)} times better than if they were independent."
        )
    if not out and len(order):
        k = order[0]
        rho = float(correlation[i[k], j[k]])
        out.append(
            f"No two parameters hang closely together; the closest are {names[i[k]]} and {names[j[k]]} ({rho:+.2f})."
        )
    return tuple(out)


def refusal_text(c: Calibration) -> tuple[str, ...]:
    """Return the reasons not to use the result: one sentence, or one that announces them and one for each."""
    if len(c.problems) < 2:
        return tuple(f"Not to be used, because {p}." for p in c.problems)
    return (f"Not to be used, for {len(c.problems)} reasons:", *(f"{p}." for p in c.problems))


def finding_texts(facts: CalibrationFacts) -> list[tuple[str, str, tuple[str, ...]]]:
    """Say what was found, in the order of the document: heading, name of the chart if there is one, evidence."""
    out, seen = list[tuple[str, str, tuple[str, ...]]](), dict[tuple[str, str], int]()
    for line in facts.causes:
        if line.what.startswith(GEOMETRY):
            size = (
                f"They make {line.size} of what 95 of 100 targets were within before. The section Parameters has each."
            )
            out.append((line.what, "", (size,)))
    for number, told in enumerate(told_findings(facts), len(out) + 1):
        out.append((_capital(told.finding.note), told.name if told.steps else "", _evidence(facts, told, seen)))
        for step in told.steps:
            seen.setdefault((step.before.name, step.after.name), number)
    return out


def _evidence(facts: CalibrationFacts, told: ToldFinding, seen: Mapping[tuple[str, str], int]) -> tuple[str, ...]:
    """Return what speaks for a cause; ``seen``: sections that have told a fall of the errors, by its two stages."""
    unit, cause = facts.calibration.reading_unit, told.finding
    one = cause.members is None
    without = f"Without {'it' if one else 'the one that brings most, alone'}"
    if cause.beside_stages:
        size = f"Size {_size(cause)}. " if one else "Each has a size of its own. "
        return (
            f"{size}The posterior holds it, beside all that has a stage: it is too faint for one of its own.",
            f"{without}, all else fitted anew, errors would be {in_mm(cause.gain, 2)} {unit} larger (rms).",
            _rivals(cause),
        )
    size = (
        f"Size {_size(cause)}{_written_size(facts.calibration, cause)}. Chance"
        if one
        else "Each has a size of its own. Largest chance"
    )
    return (
        f"{size} of so large an effect where there is none, corrected for the "
        f"{count_text(facts.calibration.tried or 0)} alternatives that were tried: {_chance(cause.log_p)}.",
        *(_fall_text(step, unit, len(told.steps) > 1, seen) for step in told.steps),
        f"{without}, all else fitted anew, held-out errors are {in_mm(cause.gain, 2)} {unit} larger (rms).",
        _rivals(cause),
    )


def _fall_text(step: FindingStep, unit: str, is_one_of_many: bool, seen: Mapping[tuple[str, str], int]) -> str:
    """Say how the errors fell when an effect was added, or under which number that stands, once for one stage."""
    before, after = step.before, step.after
    if (number := seen.get((before.name, after.name))) is not None:
        return f"It was added together with cause {number}: the fall of the errors stands there."
    others = [e for e in after.effects if e not in before.effects and e != step.what]
    along = f" (with {', '.join(others)})" if others else ""
    held, fitted = (
        f"{in_mm(a.rms)} {unit} → {in_mm(b.rms)} {unit}"
        for a, b in ((before.held_out, after.held_out), (before.train, after.train))
    )
    what = step.finding.on if is_one_of_many else "it"
    return f"Held-out error {held} (rms) when {what} was added{along}; fitted samples {fitted}."


def _size(f: Finding) -> str:
    unit, factor = display_unit(f.unit, f.value)
    out = f"{_pair(abs(f.value) * factor, f.std * factor)} {unit}"  # its sense is said in words, as in the note
    if f.inner is None:
        return out
    value, std = f.inner.value, f.inner.std
    unit, factor = inner_unit(f.inner.unit, value)
    inner = digits(value * factor, 4) if std is None else _pair(value * factor, std * factor)
    others = "".join(f" or {digits(o.value * factor, 4)} ({percent(o.probability)})" for o in f.inner.others)
    return f"{out}, {f.inner.name} {inner}{others} {unit}"


def _written_size(c: Calibration, f: Finding) -> str:
    """Say the size that the robot as written holds, beside that of the last fit, where it holds the cause by name."""
    inner = "" if f.inner is None else f"{f.name}, {f.inner.name}"
    own = [e.value - e.nominal for e in c.estimates if e.group == f.name and e.unit == f.unit and e.name != inner]
    if c.release is None or not own:
        return ""
    unit, factor = display_unit(f.unit, f.value)
    held = _pair(float(np.hypot.reduce(own)) * factor, f.std * factor).partition(" ± ")[0]
    return f" by the last fit, {held} {unit} in the robot as written (a cautious value)"


def _pair(value: float, std: float) -> str:
    """Write a value and its deviation with as many decimals as the deviation has at two digits."""
    places = decimals_of(std, 3)
    return f"{value:.{places}f} ± {std:.{places}f}"


def _rivals(cause: Finding) -> str:
    named = 4  # rivals that are listed by name
    names, known = cause.rival_texts, cause.probability
    this = "it is this cause" if cause.members is None else "the least certain of them is this cause"
    own = "" if known is None else f"That {this}: {percent(known)}. "
    if not names:
        none = {
            "found": "Nothing else that was tried explains the same, at a hundred to one.",
            "likely": "Perhaps nothing is there at all.",
            "doubtful": "Nothing at all is likelier.",
        }
        return f"{own}Rivals: none. {none[cause.grade]}"
    more = f" and {len(names) - named} more" if len(names) > named else ""
    return f"{own}Rivals that this run cannot tell from it: {', '.join(names[:named])}{more}."


def _chance(log_p: float) -> str:
    ten = log_p / np.log(10)
    if ten < -300:
        return "less than one in 10³⁰⁰"
    raised = f"{-ten:.0f}".translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"one in 10{raised}" if ten < -4 else digits(float(np.exp(log_p)), 2)


def limit_table(c: Calibration) -> list[Row]:
    """Set the detection limits: one row an effect, a column for each joint, and what is elsewhere in words."""
    joints = tuple(f"joint {j + 1}" for j in range(c.run.samples.q.shape[1]))
    rows: dict[str, list[tuple[str, DetectionLimit]]] = {}
    for limit in c.limits:
        place, _, by = limit.on.partition(" by ")
        rows.setdefault(f"{limit.effect} by {by}" if by else limit.effect, []).append((place, limit))
    return [_limits(effect, joints, own) for effect, own in rows.items()]


def _limits(effect: str, joints: Row, own: list[tuple[str, DetectionLimit]]) -> Row:
    seen = sorted(limit.size for _, limit in own if _would_show(limit)) or [0.0]
    middle = seen[len(seen) // 2]
    unit, factor = display_unit(own[0][1].unit, middle)
    at = {place: digits(limit.size * factor, 2) if _would_show(limit) else "–" for place, limit in own}
    elsewhere = ", ".join(f"{place} {size}" for place, size in at.items() if place not in joints)
    return (effect, unit, *(at.get(j, "") for j in joints), elsewhere)


def _would_show(limit: DetectionLimit) -> bool:
    """Tell whether the run would show a size of the effect that an arm may have."""
    # sizes that no arm has, by their unit: a run that shows only such ones does not see the effect
    blind = {"rad": 0.02, "m": 0.01, "rad/rad": 0.02, "rad/Nm": 1e-3, "1": 1.0, "s": 1.0}
    return limit.size < blind.get(limit.unit, np.inf)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
