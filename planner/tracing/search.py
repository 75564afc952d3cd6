"""The search: add the effect that explains most while the run is likelier with it, then correct early choices.

Forward steps, each with backward pruning. When no step is left, effects are swapped for others that the run is
likelier under. And at the very end corrections without a name are tried.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from planner.common.progress import StageReport
from planner.effects.catalogue import Excitation
from planner.effects.effect import Effect, Role
from planner.effects.nonparametric import GEAR_CURVE, nonparametric_effects
from planner.effects.steps import steppables
from planner.fit.assumptions import LARGEST_HELD_OUT
from planner.inference.stages import FitContext
from planner.model.finding import RejectedEffect
from planner.tracing.assumptions import (
    COMPLIANCE_EVIDENCE,
    LEAST_GAIN,
    SWAP_EVIDENCE,
    SWAPPED_GAIN_SHARE,
    UNNAMED_EVIDENCE,
)
from planner.tracing.candidate_ranking import rank_candidates
from planner.tracing.change_points import rank_changes, relocate_steps, series_merit, step_series
from planner.tracing.effect_scores import EffectScore, ScoreTest
from planner.tracing.inner_values import choose_values
from planner.tracing.search_context import SearchContext, without_effects
from planner.tracing.significance import LOG_SIGNIFICANCE, held_out_gain, rejection_reason
from planner.tracing.state import SETTLED_SIGMAS, FittedEffect, SearchState, number_repeat
from planner.tracing.transmission_error import all_gear_curves, effects_beside_curve, likeliest_curve

Trial = tuple[FittedEffect, ...]


def best_step(
    context: SearchContext, state: SearchState, test: ScoreTest, likely: list[EffectScore]
) -> SearchState | None:
    """Refit the likely candidates, similar ones side by side, and return the first kind that holds."""
    doubtful = list[SearchState]()
    while likely:
        # 4: candidates are refitted side by side
        near = [c for c in likely if c.gain > SWAPPED_GAIN_SHARE * likely[0].gain][:4]
        likely = [c for c in likely if all(c is not n for n in near)]
        worth = [_with_candidate(test, c, state.effects) for c in near]
        trials = _refit_candidates(context, state, [*worth, *_curve_trials(context, state, test, near)])
        kept = [t for t in trials if _holds(context, state, t)]
        for t in trials:  # its columns are computed anew where they are looked at again: of a long run they are large
            t.fit.problem.memory.linear = None
        if kept:
            return context.choose_likeliest(kept, at=kept[0])
        context.rejected.add_shares(near, test.scatter)
        doubtful += trials
    return next((s for t in doubtful if (s := _add_pair(context, state, t)) is not None), None)


def _holds(context: SearchContext, state: SearchState, trial: SearchState) -> bool:
    """Tell whether the last effect of a trial is kept, and take note of why it is not."""
    reason = rejection_reason(state, trial, context.fit_context, context.tried_number)
    if reason is not None:
        context.rejected.why[trial.effects[-1].name] = reason
    return reason is None


def add_series(context: SearchContext, state: SearchState, test: ScoreTest, best: EffectScore) -> SearchState | None:
    """Refit with all steps of the thing that stepped again and again; ``None`` unless that is worth more than ``best``.

    A step stays only if it is significant while all others of the series are in the model.
    """
    series = [s for s in step_series(test, context.steppables) if _series_name(s) not in context.excluded]
    if not series or series_merit(test, series[0]) <= series_merit(test, [best]):
        return None
    context.report(f"trying {series[0][0].effect.name}, {len(series[0])} times")
    effects = state.effects
    for step in series[0]:
        effects = (*effects, FittedEffect(number_repeat(step.effect, effects)))
    trial = context.try_refit(state, effects)
    if trial is None:
        context.excluded.add(_series_name(series[0]))
        return None
    kept = context.prune(trial)
    fall, error = held_out_gain(state, kept, context.fit_context)
    fits = fall > max(error, LEAST_GAIN) and context.evidence_fall(state, kept) > 0
    if fits and len(kept.names - state.names) > 1:
        return kept
    context.excluded.add(_series_name(series[0]))
    return None


def _series_name(series: tuple[EffectScore, ...]) -> str:
    return f"{series[0].effect.name}, several times"


def swap_effects(context: SearchContext, state: SearchState, ahead: float = -SWAP_EVIDENCE) -> SearchState | None:
    """Put another effect in the place of each one where the run is likelier so; ``None`` if it nowhere is.

    ``ahead`` is by how much its merit must be above the effect's own to be tried.
    """
    swapped = None
    for found in state.effects:
        if found.has(Role.GEAR_CURVE):
            continue  # it took the place of the waves that would now be tried for it
        bare = context.score_test_without(state, found)
        rest = tuple(f for f in state.effects if f.name != found.name)
        own = rank_candidates(bare, bare.lay_out([(found.effect, found.value)]), rest)
        best = rank_candidates(bare, context.dictionary, rest)[:2]
        other = next((c for c in best if c.effect.name != found.name), None)
        if other is None or (own and other.merit < own[0].merit + ahead):
            continue
        context.report(f"trying {other.effect.name} for {found.name}")
        trial = context.try_refit(state, _with_candidate(bare, other, rest))
        least = COMPLIANCE_EVIDENCE if found.has(Role.COMPLIANCE) else SWAP_EVIDENCE
        if trial is None or context.evidence_fall(state, trial) <= least:
            continue
        if context.is_significant(trial, trial.effects[-1]):
            state = swapped = context.settle(state, trial)
    return swapped


def _with_candidate(test: ScoreTest, candidate: EffectScore, effects: Trial) -> Trial:
    """Return effects and a further one, its nonlinear value refined."""
    value = None if candidate.value is None else test.refine_value(candidate.effect, candidate.value)
    return (*effects, FittedEffect(number_repeat(candidate.effect, effects), value))


def _refit_candidates(context: SearchContext, state: SearchState, trials: list[Trial]) -> list[SearchState]:
    """Refit with each of some trials.

    A fit that does not come to rest is left out: what cannot be told from the geometry may run off with it.
    """
    with ThreadPoolExecutor(2) as pool:  # refits at a time: they are taken in order, so their number does not show
        return [s for s in pool.map(lambda effects: context.try_refit(state, effects), trials) if s is not None]


def _curve_trials(
    context: SearchContext, state: SearchState, test: ScoreTest, near: list[EffectScore]
) -> Iterator[Trial]:
    """Yield the effects with the whole curve of each joint that is to have one more wave, unless it has the same."""
    known = sorted((f.name, len(f.parameters)) for f in state.effects)
    for joint, kept in _joints(context, state, near):
        trial = _with_curve(state, test, joint, kept)
        if sorted((f.name, len(f.parameters)) for f in trial) != known:
            yield trial


def _joints(context: SearchContext, state: SearchState, near: list[EffectScore]) -> Iterator[tuple[int, Trial]]:
    """Joints that are to have one more wave, with the effects that would stay beside their whole curve."""
    seen = set[int]()
    for c in near:
        kept, joint = effects_beside_curve(state.effects, c.effect), c.effect.place.joint
        if kept is None or joint is None or joint in seen or f"{GEAR_CURVE}, {c.effect.place}" in context.excluded:
            continue
        seen.add(joint)
        yield joint, kept


def _with_curve(state: SearchState, test: ScoreTest, joint: int, kept: Trial) -> Trial:
    """Return the effects that are kept and the whole curve of a joint."""
    gone = state.without(*kept)
    return (*kept, FittedEffect(likeliest_curve(without_effects(test, gone) if gone else test, joint)))


def _add_pair(context: SearchContext, state: SearchState, trial: SearchState) -> SearchState | None:
    """Add an effect together with a second of its kind at its place, where one alone leaves too much to be sure of it.

    An arm that warms up in two ways leaves, less one of them, a residual so slow that neither would be believed.
    """
    first = trial.effects[-1]
    if not first.has(Role.REPEATABLE) or len(trial.effects) == len(state.effects):
        return None
    fall, error = held_out_gain(state, trial, context.fit_context)
    if fall <= error:
        return None
    test = context.score_test(trial)
    same = (c for c in rank_candidates(test, context.dictionary, trial.effects) if c.effect.name == first.effect.family)
    second = next((c for c in same if c.log_p < LOG_SIGNIFICANCE), None)
    if second is None:
        return None
    context.report(f"trying {first.name} in two ways")
    both = context.try_refit(trial, _with_candidate(test, second, trial.effects))
    if both is None or rejection_reason(trial, both, context.fit_context, context.tried_number):
        return None
    return both if context.is_significant(both, both.effects[-2]) else None


@dataclass(frozen=True)
class SearchResult:
    """Where the search ended.

    Attributes:
        context: of the search among the effects of the catalogue.
        path: states in order, the first without any effect.
        rejected: what was refitted and not kept.
        given_up: whether nothing was tried, since no one cause can make a robot of what the geometry leaves.
    """

    context: SearchContext
    path: tuple[SearchState, ...]
    rejected: tuple[RejectedEffect, ...]
    given_up: bool = False

    @property
    def tried_number(self) -> int:
        """Number of effects and values that each step looked at."""
        return self.context.tried_number

    @property
    def last(self) -> SearchState:
        """The state in which the search ended."""
        return self.path[-1]


def search(start: SearchState, effects: Sequence[Effect], fit_context: FitContext, report: StageReport) -> SearchResult:
    """Trace the residual of ``start`` to effects of the catalogue."""
    test = ScoreTest.of(start.fit)
    dictionary = test.lay_out([(e, value) for e in effects for value in e.grid])
    may_step = tuple(steppables(Excitation(start.base.setup, test.problem.samples)))
    context = SearchContext(tuple(effects), dictionary, fit_context, report, may_step)
    # 0.3: of errors that no calibrated robot leaves one cause explains at least so much (a gauge that was moved, a zero
    # that slipped): readings that belong to no pose are like none, and a search among them takes minutes
    if start.stage.held_out.rms > LARGEST_HELD_OUT and _largest_share(context, start) < 0.3:
        return SearchResult(context, (start,), (), given_up=True)
    path = _forward_selection(context, [start])
    together = _causes_together(context, start)
    for state in together:
        path = _start_from(context, start, state, path)
    path = _try_gear_curves(context, context.choose_likeliest(together, at=start) if together else None, path)
    for _ in range(2):  # rounds of swapping
        other = swap_effects(context, path[-1])
        if other is None:
            break
        path = _forward_selection(context, [*path, other])
    likelier = choose_values(context, path[-1])
    if likelier is not path[-1]:
        path = _forward_selection(context, [*path, likelier])
    pruned = context.prune(path[-1])
    if pruned.names != path[-1].names:
        path = _forward_selection(context, [*path, pruned])
    nameless = [(e, None) for e in nonparametric_effects(start.base.setup, test.problem.samples.q)]
    last_context = replace(context, dictionary=test.lay_out(nameless))
    path = _forward_selection(last_context, path)
    # a name that explains much less than no name would was forced
    other = swap_effects(last_context, path[-1], UNNAMED_EVIDENCE)
    path = path if other is None else [*path, other]
    last = context.settle(path[max(len(path) - 2, 0)], path[-1], SETTLED_SIGMAS)
    path, known = [*path[:-1], last], last.names
    gone = tuple(RejectedEffect(name=n, because=why) for n, why in context.rejected.why.items() if n not in known)
    return SearchResult(context, tuple(path), gone)


def _largest_share(context: SearchContext, state: SearchState) -> float:
    """Return how much of the residual one effect would explain, or all steps of one thing, beyond chance, 0 … 1."""
    test = context.change_test(state)
    changes = rank_changes(test, context.steppables, (), context.fit_context.run.continuous)
    causes = [[s] for s in (*changes, *rank_candidates(test, context.dictionary, ()))]
    causes += [list(series) for series in step_series(test, context.steppables)]
    shares = (sum(s.gain / test.scatter - s.size / test.dof for s in own) for own in causes)
    return max(shares, default=0.0)


def _forward_selection(context: SearchContext, path: list[SearchState]) -> list[SearchState]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path = list(path)
    context.excluded.clear()
    while len(path[-1].effects) < 25:  # effects at most
        state = path[-1]
        test = context.score_test(state)
        of_changes = context.change_test(state)
        changes = rank_changes(of_changes, context.steppables, state.effects, context.fit_context.run.continuous)
        likely = [
            c
            for c in sorted(
                [*changes, *rank_candidates(test, context.dictionary, state.effects)],
                key=lambda c: c.place_in_order,
            )
            if c.log_p < LOG_SIGNIFICANCE
            and number_repeat(c.effect, state.effects).name not in context.excluded
            and context.rejected.may_try(c, test.scatter)
        ]
        if not likely:
            break
        context.report(f"trying {likely[0].effect.name}")
        after = add_series(context, state, of_changes, likely[0]) if likely[0].effect.has(Role.CHANGE) else None
        # 6: of the most surprising candidates are refitted before the search gives up
        after = after or best_step(context, state, test, likely[: 6 + len(changes)])
        if after is None:
            break
        added = (after.names - state.names) or {after.effects[-1].name}
        after = context.settle(state, relocate_steps(context, context.prune(after), context.steppables))
        if any(after.structure == s.structure for s in path) or _is_worse(context, state, after):
            context.excluded.update(added)  # it drives out what brought it in, or what is worth more: others first
        else:
            path.append(after)
    return path


def _is_worse(context: SearchContext, before: SearchState, after: SearchState) -> bool:
    """Tell whether a step leaves the run less likely, for what it drove out.

    What has no name takes no compliance's place: every arm yields, and a smooth curve is easily bent to the same shape.
    """
    gone = any(f.has(Role.COMPLIANCE) and f.name not in after.names for f in before.effects)
    nameless = any(f.has(Role.NONPARAMETRIC) for f in after.effects)
    return context.evidence_fall(before, after) < 0 or (nameless and gone)


def _causes_together(context: SearchContext, start: SearchState) -> list[SearchState]:
    """Return the models with all causes of one role at once and nothing else, as far as the run can tell of them.

    All joints that give way; all of the set-up that the cell holds for known; and both.
    """
    out, seen = list[SearchState](), list[Trial]()
    readings = len(start.fit.problem) * start.fit.model.width
    for role in (Role.COMPLIANCE, Role.SET_UP, Role.COMPLIANCE | Role.SET_UP):
        effects = tuple(FittedEffect(e) for e in context.effects if e.has(role))
        size = sum(len(f.parameters) for f in effects)
        if not effects or effects in seen or readings < len(start.fit.errors) + 2 * size:
            continue
        seen.append(effects)
        state = context.try_refit(start, effects)
        out += [] if state is None else [state]
    return out


def _start_from(
    context: SearchContext, start: SearchState, together: SearchState, path: list[SearchState]
) -> list[SearchState]:
    """Begin with causes of a role at once, where that alone is likelier than where single steps ended.

    In a short run of a soft arm no joint's compliance gains while the others' are missing, nor does the place of a
    fixture while a zero is off as well.
    """
    if context.evidence_fall(path[-1], together, at=start) < SWAP_EVIDENCE:
        return path
    kept = _keep_if_significant(context, together)
    return path if kept is None else _forward_selection(context, [start, kept])


def _try_gear_curves(
    context: SearchContext, together: SearchState | None, path: list[SearchState]
) -> list[SearchState]:
    """Go on with the curves of all gears at once, where the run is likelier so."""
    curves = all_gear_curves(context, path[-1], together)
    kept = None if curves is None else _keep_if_significant(context, curves)
    if kept is None:
        return path
    other = _forward_selection(context, [*(path if path[-1].names <= kept.names else path[:1]), kept])
    return other if context.evidence_fall(path[-1], other[-1]) > 0 else path


def _keep_if_significant(context: SearchContext, state: SearchState) -> SearchState | None:
    """Prune a state; ``None`` unless all that stays is significant. What was refused before may then be tried again."""
    kept = context.prune(state)
    if not all(context.is_significant(kept, f) for f in kept.effects):
        return None
    context.rejected.share.clear()
    return kept
