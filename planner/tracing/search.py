"""The search: add the effect that explains most while held-out samples gain, then mend what an early choice got wrong.

Forward steps, each with backward pruning; when no step is left, effects are swapped for others that the run is
likelier under; and at the very end corrections without a name are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.effects.effect import Effect
from planner.effects.nonparametric import NONPARAMETRIC as NAMELESS
from planner.effects.nonparametric import nonparametric_effects
from planner.identification.stages import FitContext
from planner.tracing.auxiliary_parameters import COMPLIANCE
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.ranking import rank_candidates
from planner.tracing.score_test import ScoreTest, grid_values
from planner.tracing.search_steps import (
    SWAP_EVIDENCE,
    Progress,
    RejectedEffects,
    SearchContext,
    best_step,
    swap_effects,
    try_refit,
)
from planner.tracing.significance import LOG_SIGNIFICANCE, wald_log_p
from planner.tracing.state import FittedEffect, SearchState, refit
from planner.tracing.transmission_error import all_gear_curves

MOST_TRIES = 6  # of the most surprising entries that are refitted before the search gives up
MOST_EFFECTS = 25  # effects
NONPARAMETRIC_MARGIN = 20.0  # noise variances by which what has no name must be ahead of an effect to take its place
SWAP_ROUNDS = 2  # rounds of swaps


@dataclass(frozen=True)
class SearchResult:
    """Where the search ended.

    Attributes:
        path: states in order, the first without any effect.
        dictionary: entries and inner values that each step looked at.
        rejected: names of what was refitted and not kept, each with the reason.
    """

    path: tuple[SearchState, ...]
    dictionary: EffectDictionary
    rejected: tuple[tuple[str, str], ...]

    @property
    def tried(self) -> int:
        """Number of entries and inner values that each step looked at."""
        return len(self.dictionary.items)

    @property
    def last(self) -> SearchState:
        """The final state."""
        return self.path[-1]


def search(start: SearchState, entries: Sequence[Effect], bench: FitContext, say: Progress) -> SearchResult:
    """Trace the residual of ``start`` to entries of the catalogue."""
    shade = ScoreTest.of(start.fit)
    hunt = SearchContext(
        shade.lay_out([pair for e in entries for pair in grid_values(e)]), bench, say, RejectedEffects()
    )
    path = _forward_selection(hunt, [start])
    together = _all_compliances(hunt, start, entries)
    if together is not None:
        path = _start_from_compliances(hunt, start, together, path)
    path = _try_transmission_errors(hunt, entries, together, path)
    for _ in range(SWAP_ROUNDS):
        other = swap_effects(hunt, path[-1])
        if other is None:
            break
        path = _forward_selection(hunt, [*path, other])
    pruned = _prune(hunt, path[-1])
    if pruned.names != path[-1].names:
        path = _forward_selection(hunt, [*path, pruned])
    nameless = shade.lay_out([(e, None) for e in nonparametric_effects(start.base.setup, shade.problem.samples.q)])
    unnaming = replace(hunt, dictionary=nameless)
    path = _forward_selection(unnaming, path)
    # a name that explains much less than no name would was forced
    other = swap_effects(unnaming, path[-1], NONPARAMETRIC_MARGIN)
    path = path if other is None else [*path, other]
    gone = tuple((n, why) for n, why in hunt.refused.why.items() if n not in path[-1].names)
    return SearchResult(tuple(path), hunt.dictionary, gone)


def _forward_selection(hunt: SearchContext, path: list[SearchState]) -> list[SearchState]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path = list(path)
    hunt.barred.clear()
    while len(path[-1].effects) < MOST_EFFECTS:
        state = path[-1]
        shade = hunt.shade(state)
        likely = [c for c in rank_candidates(shade, hunt.dictionary, state.effects) if c.log_p < LOG_SIGNIFICANCE]
        likely = [c for c in likely if c.entry.name not in hunt.barred and hunt.refused.worth(c, shade.scatter)]
        if not likely:
            break
        hunt.say(f"trying {likely[0].entry.name}")
        after = best_step(hunt, state, shade, likely[:MOST_TRIES])
        if after is None:
            break
        added = after.effects[-1].entry
        after = _prune(hunt, after)
        if any(after.kind == s.kind for s in path) or _is_worse(hunt, state, after):
            hunt.barred.add(added.name)  # it drives out what brought it in, or what is worth more: others first
        else:
            path.append(after)
    return path


def _is_worse(hunt: SearchContext, before: SearchState, after: SearchState) -> bool:
    """Tell whether a step leaves the run less likely, for what it drove out.

    What has no name takes no compliance's place: every arm yields, and a smooth curve is easily bent to the same shape.
    """
    gone = [h for h in before.effects if h.entry.name not in after.names]
    nameless = any(h.entry.kind == NAMELESS for h in after.effects)
    worth = hunt.memory(before)
    return after.evidence(worth) > before.evidence(worth) or (
        nameless and any(h.entry.kind == COMPLIANCE for h in gone)
    )


def _all_compliances(hunt: SearchContext, start: SearchState, entries: Sequence[Effect]) -> SearchState | None:
    """Return the model in which all joints give way and nothing else; ``None`` where the run cannot tell."""
    soft = tuple(FittedEffect(e, None) for e in entries if e.kind == COMPLIANCE)
    if not soft or len(start.fit.problem) * start.fit.model.width < len(start.fit.errors) + 2 * len(soft):
        return None
    return try_refit(lambda: refit(hunt.bench, soft[-1].entry.name, start.base, soft, start))


def _start_from_compliances(
    hunt: SearchContext, start: SearchState, together: SearchState, path: list[SearchState]
) -> list[SearchState]:
    """Begin with all joints that give way at once, where that alone is likelier than where single steps ended.

    In a short run of a soft arm no joint's compliance gains while the others' are missing.
    """
    worth = hunt.memory(start)
    if together.evidence(worth) > path[-1].evidence(worth) - SWAP_EVIDENCE:
        return path
    kept = _prune(hunt, together)
    if any(wald_log_p(kept, h, hunt.tried) > LOG_SIGNIFICANCE for h in kept.effects):
        return path
    hunt.refused.share.clear()
    return _forward_selection(hunt, [start, kept])


def _try_transmission_errors(
    hunt: SearchContext, entries: Sequence[Effect], together: SearchState | None, path: list[SearchState]
) -> list[SearchState]:
    """Go on with the curves of all gears at once, where the run is likelier so."""
    best = all_gear_curves(hunt, entries, path[-1], together)
    if best is None:
        return path
    kept = _prune(hunt, best)
    if any(wald_log_p(kept, h, hunt.tried) > LOG_SIGNIFICANCE for h in kept.effects):
        return path
    hunt.refused.share.clear()
    other = _forward_selection(hunt, [*(path if path[-1].names <= kept.names else path[:1]), kept])
    worth = hunt.memory(path[-1])
    return other if other[-1].evidence(worth) < path[-1].evidence(worth) else path


def _prune(hunt: SearchContext, state: SearchState) -> SearchState:
    """Take out effects that the later ones made needless, the faintest first."""
    while len(state.effects) > 1:
        chances = [wald_log_p(state, h, hunt.tried) for h in state.effects]
        faint = int(np.argmax(chances))
        if chances[faint] < LOG_SIGNIFICANCE:
            break
        effects = tuple(h for k, h in enumerate(state.effects) if k != faint)
        state = refit(hunt.bench, effects[-1].entry.name, state.base, effects, state)
    return state
