"""The search: add the effect that explains most while held-out samples gain, then mend what an early choice got wrong.

Forward steps, each with backward pruning; when no step is left, effects are swapped for others that the run is
likelier under; and at the very end corrections without a name are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from planner.catalogue import Entry
from planner.identification import Bench
from planner.tracing.dictionary import Dictionary
from planner.tracing.hunt import Hunt, Refused, Say
from planner.tracing.judging import SURE, wald_log_p
from planner.tracing.masses import KIND
from planner.tracing.ranking import ranked
from planner.tracing.screen import Shade, grid
from planner.tracing.state import Held, State, refit
from planner.tracing.steps import best, settled
from planner.tracing.swaps import BETTER, swapped
from planner.tracing.uneven import uneven
from planner.tracing.unnamed import KIND as NAMELESS
from planner.tracing.unnamed import unnamed

TRIES = 6  # of the most surprising entries that are refitted before the search gives up
MOST = 25  # effects
FORCED = 20.0  # noise variances by which what has no name must be ahead of an effect to take its place
SWAPS = 2  # rounds of swaps


@dataclass(frozen=True)
class Trace:
    """Where the search ended.

    Attributes:
        path: states in order, the first without any effect.
        dictionary: entries and inner values that each step looked at.
        rejected: names of what was refitted and not kept, each with the reason.
    """

    path: tuple[State, ...]
    dictionary: Dictionary
    rejected: tuple[tuple[str, str], ...]

    @property
    def tried(self) -> int:
        """Number of entries and inner values that each step looked at."""
        return len(self.dictionary.items)

    @property
    def last(self) -> State:
        """The final state."""
        return self.path[-1]


def search(start: State, entries: Sequence[Entry], bench: Bench, say: Say) -> Trace:
    """Trace the residual of ``start`` to entries of the catalogue."""
    shade = Shade.of(start.fit)
    hunt = Hunt(shade.lay_out([pair for e in entries for pair in grid(e)]), bench, say, Refused())
    path = _forward(hunt, [start])
    together = _all_yield(hunt, start, entries)
    if together is not None:
        path = _yielding(hunt, start, together, path)
    path = _uneven(hunt, entries, together, path)
    for _ in range(SWAPS):
        other = swapped(hunt, path[-1])
        if other is None:
            break
        path = _forward(hunt, [*path, other])
    pruned = _pruned(hunt, path[-1])
    if pruned.names != path[-1].names:
        path = _forward(hunt, [*path, pruned])
    nameless = shade.lay_out([(e, None) for e in unnamed(start.base, shade.problem.samples.q)])
    unnaming = replace(hunt, dictionary=nameless)
    path = _forward(unnaming, path)
    other = swapped(unnaming, path[-1], FORCED)  # a name that explains much less than no name would was forced
    path = path if other is None else [*path, other]
    gone = tuple((n, why) for n, why in hunt.refused.why.items() if n not in path[-1].names)
    return Trace(tuple(path), hunt.dictionary, gone)


def _forward(hunt: Hunt, path: list[State]) -> list[State]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path = list(path)
    hunt.barred.clear()
    while len(path[-1].effects) < MOST:
        state = path[-1]
        shade = hunt.shade(state)
        likely = [c for c in ranked(shade, hunt.dictionary, state.effects) if c.log_p < SURE]
        likely = [c for c in likely if c.entry.name not in hunt.barred and hunt.refused.worth(c, shade.scatter)]
        if not likely:
            break
        hunt.say(f"trying {likely[0].entry.name}")
        after = best(hunt, state, shade, likely[:TRIES])
        if after is None:
            break
        added = after.effects[-1].entry
        after = _pruned(hunt, after)
        if any(after.kind == s.kind for s in path) or _worse(hunt, state, after):
            hunt.barred.add(added.name)  # it drives out what brought it in, or what is worth more: others first
        else:
            path.append(after)
    return path


def _worse(hunt: Hunt, before: State, after: State) -> bool:
    """Tell whether a step leaves the run less likely, for what it drove out.

    What has no name takes no compliance's place: every arm yields, and a smooth curve is easily bent to the same shape.
    """
    gone = [h for h in before.effects if h.entry.name not in after.names]
    nameless = any(h.entry.kind == NAMELESS for h in after.effects)
    worth = hunt.memory(before)
    return after.evidence(worth) > before.evidence(worth) or (nameless and any(h.entry.kind == KIND for h in gone))


def _all_yield(hunt: Hunt, start: State, entries: Sequence[Entry]) -> State | None:
    """Return the model in which all joints give way and nothing else; ``None`` where the run cannot tell."""
    soft = tuple(Held(e, None) for e in entries if e.kind == KIND)
    if not soft or len(start.fit.problem) * start.fit.model.width < len(start.fit.errors) + 2 * len(soft):
        return None
    return settled(lambda: refit(hunt.bench, soft[-1].entry.name, start.base, soft, start))


def _yielding(hunt: Hunt, start: State, together: State, path: list[State]) -> list[State]:
    """Begin with all joints that give way at once, where that alone is likelier than where single steps ended.

    In a short run of a soft arm no joint's compliance gains while the others' are missing.
    """
    worth = hunt.memory(start)
    if together.evidence(worth) > path[-1].evidence(worth) - BETTER:
        return path
    kept = _pruned(hunt, together)
    if any(wald_log_p(kept, h, hunt.tried) > SURE for h in kept.effects):
        return path
    hunt.refused.share.clear()
    return _forward(hunt, [start, kept])


def _uneven(hunt: Hunt, entries: Sequence[Entry], together: State | None, path: list[State]) -> list[State]:
    """Go on with the curves of all gears at once, where the run is likelier so."""
    best = uneven(hunt, entries, path[-1], together)
    if best is None:
        return path
    kept = _pruned(hunt, best)
    if any(wald_log_p(kept, h, hunt.tried) > SURE for h in kept.effects):
        return path
    hunt.refused.share.clear()
    other = _forward(hunt, [*(path if path[-1].names <= kept.names else path[:1]), kept])
    worth = hunt.memory(path[-1])
    return other if other[-1].evidence(worth) < path[-1].evidence(worth) else path


def _pruned(hunt: Hunt, state: State) -> State:
    """Take out effects that the later ones made needless, the faintest first."""
    while len(state.effects) > 1:
        chances = [wald_log_p(state, h, hunt.tried) for h in state.effects]
        faint = int(np.argmax(chances))
        if chances[faint] < SURE:
            break
        effects = tuple(h for k, h in enumerate(state.effects) if k != faint)
        state = refit(hunt.bench, effects[-1].entry.name, state.base, effects, state)
    return state
