"""``trace()``: from the residual of the fitted geometry to its causes, a stage for each, with their rivals."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import chdtri, chndtrinc

from planner.common.progress import StageReport
from planner.common.system import give_back_memory
from planner.common.units import Array, display_unit, format_value
from planner.design.assumptions import LOG_LIKELIHOOD_EVIDENCE
from planner.effects.catalogue import catalogue
from planner.effects.effect import Effect, Role
from planner.effects.sessions import SESSION_STEP
from planner.effects.steps import SLIP, STEP, Steppable
from planner.inference.candidates import Candidate, CauseComparison, TracingResult, candidates_of_same_law
from planner.inference.stages import FitContext, FittedStage
from planner.model.finding import Finding, InnerNumber, inner_unit, log10_p, p_value
from planner.model.finding_groups import unit_of_change
from planner.model.identification_document import DetectionLimit
from planner.model.model import chunks
from planner.runs.run import Run
from planner.tracing.assumptions import (
    CHANCE_COST,
    DETECTION_POWER,
    DETECTION_QUANTILE,
    LEAST_GAIN,
    RIVAL_SHARE,
)
from planner.tracing.candidate_ranking import scores_beside, with_link_masses
from planner.tracing.change_points import change_sample, locate_step, score_steps, session_ends
from planner.tracing.effect_scores import LEAST_SHARE, EffectScore, ScoreTest, order_of
from planner.tracing.inner_values import variants
from planner.tracing.search import SearchResult, search
from planner.tracing.search_context import SearchContext
from planner.tracing.significance import LOG_SIGNIFICANCE, own_gains, variance_inflation, wald_log_p
from planner.tracing.state import FittedEffect, SearchState
from planner.tracing.stated_set_up import covariance_beside, stated_set_up
from planner.tracing.transmission_error import dominant_waves
from planner.tracing.wrong_rows import describe_wrong_row


@dataclass(frozen=True)
class Rivalry:
    """Effects that explain some of what a finding explains, the likeliest first, and names of those that do as well."""

    scores: tuple[EffectScore, ...]
    rivals: tuple[str, ...]


def find_rivals(context: SearchContext, state: SearchState, found: FittedEffect) -> Rivalry:
    """Look for the effects that would explain what a finding explains; steps, each at its best sample, are among them.

    Rivals do so within uncertainty beside the last stage's model; with some more the posterior has to deal.
    """
    test, bare = context.score_test(state), context.score_test_without(state, found)
    rest = tuple(f for f in state.effects if f.name != found.name)

    def merit(score: EffectScore) -> float:  # more parameters explain more by chance alone
        """Return a candidate's gain in noise variances, less what as many parameters gain by chance."""
        return score.gain / test.noise - CHANCE_COST * score.size - 2 * float(np.log(score.effect.scanned))

    best: dict[str, EffectScore] = {}
    # a step near the end of the run is nearly the same as what stood so all along
    may_step = test.problem.samples.number is not None and not found.has(Role.SET_UP)
    steps = [s for _, s in score_steps(bare, context.steppables)] if may_step else []
    for s in (*scores_beside(bare, context.dictionary, rest, CHANCE_COST), *steps):
        if s.effect.name != found.effect.family and (
            s.effect.name not in best or merit(s) > merit(best[s.effect.name])
        ):
            best[s.effect.name] = s
    own = with_link_masses(bare, [bare.score_one(found.effect, found.value)])[0]
    least = max(0.0, min(merit(own) - LOG_LIKELIHOOD_EVIDENCE, RIVAL_SHARE * own.gain / test.noise))
    ranked = sorted(best.values(), key=lambda s: order_of(merit(s)))
    rivals = tuple(s.effect.name for s in ranked if merit(s) > least)
    # 12: effects that are held against a finding whatever they explain
    return Rivalry(tuple(s for s in ranked[: max(12, len(rivals))] if merit(s) > 0), rivals)


def _contests(
    last: SearchState,
    found: Sequence[FittedEffect],
    rivals: Sequence[Rivalry],
    offered: Sequence[Effect],
    steppables: Sequence[Steppable],
) -> Iterator[CauseComparison]:
    """Yield the findings of each name as the comparison for what they explain."""
    same_law = candidates_of_same_law(offered)
    for name in dict.fromkeys(f.effect.family for f in found):
        own = [k for k, f in enumerate(found) if f.effect.family == name]
        parameters = tuple(p for p in last.fit.model.parameters if p.group == name)
        scores = {s.effect.family: s for k in own for s in rivals[k].scores}
        others = {n: Candidate(n, s.effect.make(s.value), _handicap(s.effect)) for n, s in scores.items()}
        others |= {c.name: c for c in other_series(steppables, [found[k] for k in own])}
        handicap = sum(_handicap(found[k].effect) for k in own)
        yield CauseComparison(Candidate(name, parameters, handicap), tuple(others.values()), same_law)


def other_series(steppables: Sequence[Steppable], found: Sequence[FittedEffect]) -> Iterator[Candidate]:
    """Yield every other thing that may have stepped at the times at which one thing stepped more than once.

    One step of another thing explains only a part of a series: all of its steps together are the rival.

    Args:
        steppables: what may step.
        found: the findings of one name.
    """
    if len(found) < 2 or any(f.effect.kind != STEP for f in found):
        return
    handicap = sum(_handicap(f.effect) for f in found)
    for thing in steppables:
        if thing.place != found[0].effect.place:
            steps = [thing.step(sample, f.effect.scanned) for f in found if (sample := change_sample(f)) is not None]
            yield Candidate(steps[0].family, tuple(p for step in steps for p in step.make()), handicap)


def _handicap(effect: Effect) -> float:
    """Logarithm of how many values and places an effect was chosen from."""
    return float(np.log(len(effect.grid) * effect.scanned))


def detection_limits(test: ScoreTest, effects: Sequence[Effect], tried: int) -> Iterator[DetectionLimit]:
    """Yield the detection limit of every effect that the readings show at all, at the worst phase and value."""
    least = (np.sqrt(LEAST_GAIN * test.dof) + DETECTION_QUANTILE) ** 2
    worst: dict[str, float] = {}
    # 32: effects that are laid out at a time
    for s in (s for part in chunks(len(effects), 32) for s in _scores_of(test, effects[part])):
        prior = np.array([p.prior for p in s.effect.make(s.value)])
        mu = np.linalg.eigvalsh(s.information / np.outer(prior, prior))  # per unit of size
        seen = mu[mu > LEAST_SHARE * mu[-1]] if mu[-1] > 0 else mu[:0]
        size = np.inf
        if len(seen):
            needed = max(least, _noncentrality(len(seen), tried))
            size = float(np.sqrt(needed * test.scatter / test.dof / seen[0]))
        worst[s.effect.name] = max(worst.get(s.effect.name, 0.0), size)
    for e in effects:
        if worst.get(e.name, np.inf) <= e.largest:  # beyond that no arm has it: the run says nothing of it
            yield DetectionLimit(effect=e.kind, on=str(e.place), size=worst[e.name], unit=e.unit)


def _scores_of(test: ScoreTest, effects: Sequence[Effect]) -> Iterator[EffectScore]:
    yield from test.score(test.lay_out([(e, v) for e in effects for v in _sample_values(e)]))


def _sample_values(effect: Effect) -> list[float | None]:
    """A few nonlinear values over the grid."""
    grid = effect.grid
    # 7: values of a nonlinear parameter, over its grid
    return [grid[k] for k in np.unique(np.linspace(0, len(grid) - 1, 7).astype(int))]


@cache
def _noncentrality(size: int, tried: int) -> float:
    """Noncentrality at which a test of ``size`` parameters at the search's level has its power."""
    needed = float(chdtri(size, np.exp(LOG_SIGNIFICANCE) / tried))
    return float(chndtrinc(needed, size, 1.0 - DETECTION_POWER))


def locate_change(state: SearchState, found: FittedEffect, finding: Finding, run: Run) -> Finding:
    """Return the finding of a change with when it was; its note tells so far what changed and by how much."""
    sample = change_sample(found)
    number = run.samples.number
    assert sample is not None
    assert number is not None
    if found.effect.kind != STEP:
        k = int(np.searchsorted(number, sample))
        note = describe_wrong_row(state, found, finding.note, run, k)
        return finding.model_copy(update={"note": note, "row": int(number[k]) + 1})
    when = locate_step(state, found)
    last = int(np.searchsorted(number, sample)) - 1  # the last one before
    if last in session_ends(run.samples):
        sessions = _files_about(run, last)
        note = finding.note.replace(f"after sample {sample} ", f"between {sessions[0]} and {sessions[1]} ", 1)
        update = {"note": note, "after_sample": sample, "between_sessions": sessions}
        return finding.model_copy(update=update)
    where = f" ({run.where(last)})" if run.samples.file is not None else ""
    note = finding.note.replace(f"after sample {sample} ", f"after sample {sample}{where} ", 1)
    if when.last - when.first > 1:
        note += f"; it was surely between samples {when.first} and {when.last + 1}"
    within = (when.first, when.last + 1)
    return finding.model_copy(update={"note": note, "after_sample": sample, "surely_within": within})


def locate_session_step(sizes: Array, finding: Finding, run: Run) -> Finding:
    """Return the finding of a step from session to session, of sizes (p,), with the files between which it was."""
    ends = session_ends(run.samples)
    if not len(ends) or len(sizes) % len(ends):
        return finding
    steps = np.diff(sizes.reshape(len(ends), -1), axis=0, prepend=0.0)
    moved = np.linalg.norm(steps, axis=1)
    clear = [int(k) for k in np.flatnonzero(moved > 3.0 * finding.std)] or [int(np.argmax(moved))]
    between = [_files_about(run, int(ends[k])) for k in clear]
    words = ", and ".join(f"between {before} and {after}" for before, after in between)
    note = finding.note.replace("from session to session", words, 1)
    largest = between[int(np.argmax(moved[clear]))]
    return finding.model_copy(update={"note": note, "between_sessions": largest})


def _files_about(run: Run, last: int) -> tuple[str, str]:
    """Return what the session that ends with a sample is called, and the one after it: by their files, or numbers."""
    s = run.samples
    if s.file is not None and s.file[last] != s.file[last + 1]:
        return run.files[s.file[last]], run.files[s.file[last + 1]]
    before, after = (f"session {s.session_numbers[k] + 1}" for k in (last, last + 1))
    return before, after


def trace(
    geometry: FittedStage, fit_context: FitContext, report: StageReport
) -> tuple[list[FittedStage], TracingResult]:
    """Trace what the geometry leaves, and the effects that stand beside it; return the stages that came, and findings.

    A kind of effect that is in the model already is not looked for again.
    """
    offered = catalogue(geometry.fit.setup, fit_context.run.samples)
    stated = stated_set_up(offered, geometry.fit.model)
    there = {*geometry.stage.effects, *(f.name for f in stated)}
    effects = [e for e in offered if not e.has(Role.UNTRACED) and not there & {e.kind, e.name}]
    tried = fit_context.for_trials()
    result = search(SearchState(geometry.fit.model, (), geometry), effects, tried, report)
    if result.given_up:
        return [], TracingResult(tried=result.tried_number)
    last = result.last
    test = result.context.score_test(last)
    report("rivals")
    give_back_memory()
    beside = {f.name: covariance_beside(last, f, fit_context.unseen) for f in stated}
    off = [f for f in stated if wald_log_p(last, f, len(stated), beside=beside[f.name]) < LOG_SIGNIFICANCE]
    gains = own_gains(last, tried, (*off, *last.effects))
    kept = [
        (f, own)
        for f, own in zip((*off, *last.effects), gains, strict=True)
        if f in last.effects or own.share > max(own.error, LEAST_GAIN)
    ]
    rivals = [find_rivals(result.context, last, f) for f, _ in kept]
    findings = tuple(
        _finding(result, f, own.fall, r.rivals, fit_context.run, beside.get(f.name))
        for (f, own), r in zip(kept, rivals, strict=True)
    )
    elsewhere = tuple(variants(result.context, last))
    stages = [fit_context.validate(s.fitted) for s in told_path(result.path)]
    for state in result.path:  # of each its stage is kept, and nothing that can be computed anew
        state.fit.problem.memory.forget()
    steppables = result.context.steppables
    # what is stated acts for certain; a wrong row counts for little in the posterior, which judges no more of it
    searched = [k for k, (f, _) in enumerate(kept) if f not in off and f.effect.kind != SLIP]
    comparisons = tuple(
        _contests(last, [kept[k][0] for k in searched], [rivals[k] for k in searched], offered, steppables)
    )
    report("detection limits")
    silent = tuple(detection_limits(test, [e for e in effects if e.name not in last.names], result.tried_number))
    return stages, TracingResult(findings, silent, result.rejected, result.tried_number, comparisons, elsewhere)


def told_path(path: Sequence[SearchState]) -> list[SearchState]:
    """Return the states that are told as stages: each leaves less on held-out samples than the one before.

    The search goes ways that it leaves again; where it ended, and what was on the way there, is what causes took away.
    """
    last, least, out = path[-1], path[0].stage.held_out.rms, list[SearchState]()
    for state in path[1:-1]:
        if last.stage.held_out.rms < state.stage.held_out.rms < least:
            out.append(state)
            least = state.stage.held_out.rms
    return [*out, *path[max(len(path) - 1, 1) :]]


def _finding(
    result: SearchResult, found: FittedEffect, gain: float, others: tuple[str, ...], run: Run, beside: Array | None
) -> Finding:
    """Return the finding for an effect; ``beside`` is the covariance of its sizes from what the model leaves out."""
    last, nonlinear = result.last, found.effect.nonlinear
    which = last.positions(found)
    root = last.fit.solution.root(last.fit.problem.prior)
    sizes, own = last.fit.errors[which], root[which]
    inflation = variance_inflation(last, found)
    value = float(np.linalg.norm(sizes))
    # of the effect as a whole, its shape held: how the parameters share what the geometry can take up too is not size
    std = value * np.sqrt(inflation / max(float(sizes @ np.linalg.solve(own @ own.T, sizes)), 1e-300))
    if found.has(Role.SET_UP):  # where something stands is measured from where the geometry has the robot
        spread = own @ own.T * inflation + (0.0 if beside is None else beside)
        std = float(np.sqrt(sizes @ spread @ sizes)) / max(value, 1e-300)
    signed = value if len(which) > 1 else float(sizes[0])
    inner_std = None
    if found.sensitivity_name in last.fit.model.names:
        row = root[last.fit.model.names.index(found.sensitivity_name)]
        inner_std = float(np.linalg.norm(row) * np.sqrt(inflation))
    inner = None
    if found.value is not None and nonlinear is not None:
        inner = InnerNumber(name=nonlinear.name, value=found.value, std=inner_std, unit=nonlinear.unit)
    log_p = wald_log_p(last, found, result.tried_number, inflation, beside)
    finding = Finding(
        effect=found.effect.kind,
        on=str(found.effect.place),
        value=signed,
        std=std,
        unit=found.effect.unit,
        inner=inner,
        p_value=p_value(log_p),
        log10_p=log10_p(log_p),
        gain=gain,
        rivals=others,
        note=describe_effect(found, signed, std, inner_std, sizes),
    )
    if found.effect.kind == SESSION_STEP:
        return locate_session_step(sizes, finding, run)
    return locate_change(last, found, finding, run) if found.has(Role.CHANGE) else finding


def describe_effect(found: FittedEffect, value: float, std: float, inner_std: float | None, sizes: Array) -> str:
    """Fill the effect's sentence with its size, its nonlinear value, and the periods of a curve."""
    effect, nonlinear = found.effect, found.effect.nonlinear
    unit = (unit_of_change if effect.has(Role.CHANGE | Role.SET_UP) else display_unit)(effect.unit, value)
    size = format_value(abs(value), std, *unit)
    inner = ""
    if found.value is not None and nonlinear is not None:
        inner = format_value(found.value, inner_std, *inner_unit(nonlinear.unit, found.value))
    words = {"more": "more", "grow": "grow"} if value > 0 else {"more": "less", "grow": "shrink"}
    sentence = effect.sentence.format(size=size, inner=inner, **words)
    if found.has(Role.GEAR_CURVE):
        *others, last = [f"{f:.0f}" for f in dominant_waves(found, sizes)]
        sentence += f", mostly repeating {', '.join(others)}{' and ' if others else ''}{last} times a turn"
    return sentence
