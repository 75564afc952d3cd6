"""The search: add the effect that explains most while held-out samples gain, then correct early choices.

Forward steps, each with backward pruning; when no step is left, effects are swapped for others that the run is
likelier under; and at the very end corrections without a name are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from planner.effects.effect import Effect, Role
from planner.effects.excitation import Excitation
from planner.effects.nonparametric import nonparametric_effects
from planner.effects.steps import Steppable, steppables
from planner.identification.stages import FitContext
from planner.tracing.change_points import rank_changes, relocate_steps
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.ranking import rank_candidates
from planner.tracing.score_test import ScoreTest
from planner.tracing.search_context import Progress, SearchContext
from planner.tracing.search_steps import SWAP_EVIDENCE, add_series, best_step, swap_effects
from planner.tracing.significance import LOG_SIGNIFICANCE
from planner.tracing.state import FittedEffect, SearchState
from planner.tracing.transmission_error import all_gear_curves

MOST_TRIES = 6  # of the most surprising candidates that are refitted before the search gives up
MOST_EFFECTS = 25
NONPARAMETRIC_MARGIN = 20.0  # noise variances by which what has no name must be ahead of an effect to take its place
SWAP_ROUNDS = 2


@dataclass(frozen=True)
class SearchResult:
    """Where the search ended.

    Attributes:
        path: states in order, the first without any effect.
        dictionary: effects and values that each step looked at.
        rejected: names of what was refitted and not kept, each with the reason.
        things: what may step at an unknown sample.
    """

    path: tuple[SearchState, ...]
    dictionary: EffectDictionary
    rejected: tuple[tuple[str, str], ...]
    things: tuple[Steppable, ...]

    @property
    def tried(self) -> int:
        """Number of effects and values that each step looked at."""
        return len(self.dictionary.items)

    @property
    def last(self) -> SearchState:
        """The final state."""
        return self.path[-1]


def search(start: SearchState, effects: Sequence[Effect], bench: FitContext, say: Progress) -> SearchResult:
    """Trace the residual of ``start`` to effects of the catalogue."""
    test = ScoreTest.of(start.fit)
    dictionary = test.lay_out([(e, value) for e in effects for value in e.grid])
    things = tuple(steppables(Excitation(start.base.setup, test.problem.samples)))
    context = SearchContext(tuple(effects), dictionary, bench, say, things)
    path = _forward_selection(context, [start])
    compliant = _all_compliances(context, start)
    if compliant is not None:
        path = _start_from_compliances(context, start, compliant, path)
    path = _try_gear_curves(context, compliant, path)
    for _ in range(SWAP_ROUNDS):
        other = swap_effects(context, path[-1])
        if other is None:
            break
        path = _forward_selection(context, [*path, other])
    pruned = context.prune(path[-1])
    if pruned.names != path[-1].names:
        path = _forward_selection(context, [*path, pruned])
    nameless = [(e, None) for e in nonparametric_effects(start.base.setup, test.problem.samples.q)]
    last_context = replace(context, dictionary=test.lay_out(nameless))
    path = _forward_selection(last_context, path)
    # a name that explains much less than no name would was forced
    other = swap_effects(last_context, path[-1], NONPARAMETRIC_MARGIN)
    path = path if other is None else [*path, other]
    gone = tuple((n, why) for n, why in context.rejected.why.items() if n not in path[-1].names)
    return SearchResult(tuple(path), dictionary, gone, things)


def _forward_selection(context: SearchContext, path: list[SearchState]) -> list[SearchState]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path = list(path)
    context.barred.clear()
    while len(path[-1].effects) < MOST_EFFECTS:
        state = path[-1]
        test = context.score_test(state)
        changes = rank_changes(test, context.things, state.effects, context.bench.run.continuous)
        likely = [
            c
            for c in sorted(
                [*changes, *rank_candidates(test, context.dictionary, state.effects)], key=lambda c: -c.merit
            )
            if c.log_p < LOG_SIGNIFICANCE
            and c.effect.name not in context.barred
            and context.rejected.may_try(c, test.scatter)
        ]
        if not likely:
            break
        context.say(f"trying {likely[0].effect.name}")
        after = add_series(context, state, test, likely[0]) if likely[0].effect.has(Role.CHANGE) else None
        after = after or best_step(context, state, test, likely[: MOST_TRIES + len(changes)])
        if after is None:
            break
        added = after.effects[-1]
        after = relocate_steps(context, context.prune(after), context.things)
        if any(after.structure == s.structure for s in path) or _is_worse(context, state, after):
            context.barred.add(added.name)  # it drives out what brought it in, or what is worth more: others first
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


def _all_compliances(context: SearchContext, start: SearchState) -> SearchState | None:
    """Return the model in which all joints give way and nothing else; ``None`` where the run cannot tell."""
    compliances = tuple(FittedEffect(e) for e in context.effects if e.has(Role.COMPLIANCE))
    readings = len(start.fit.problem) * start.fit.model.width
    if not compliances or readings < len(start.fit.errors) + 2 * len(compliances):
        return None
    return context.try_refit(start, compliances)


def _start_from_compliances(
    context: SearchContext, start: SearchState, compliant: SearchState, path: list[SearchState]
) -> list[SearchState]:
    """Begin with all joints that give way at once, where that alone is likelier than where single steps ended.

    In a short run of a soft arm no joint's compliance gains while the others' are missing.
    """
    if context.evidence_fall(path[-1], compliant, at=start) < SWAP_EVIDENCE:
        return path
    kept = _keep_if_significant(context, compliant)
    return path if kept is None else _forward_selection(context, [start, kept])


def _try_gear_curves(
    context: SearchContext, compliant: SearchState | None, path: list[SearchState]
) -> list[SearchState]:
    """Go on with the curves of all gears at once, where the run is likelier so."""
    curves = all_gear_curves(context, path[-1], compliant)
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
