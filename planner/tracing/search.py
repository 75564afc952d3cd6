"""The search: add the effect that explains most while held-out samples gain, then mend what an early choice got wrong.

Forward steps, each with backward pruning; when no step is left, effects are swapped for others that the run is
likelier under; and at the very end corrections without a name are tried.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from planner.catalogue import Entry
from planner.identification import Bench
from planner.tracing.again import numbered
from planner.tracing.dictionary import Dictionary
from planner.tracing.inner import refined
from planner.tracing.judging import SURE, reason, wald_log_p
from planner.tracing.memory import quick_memory
from planner.tracing.ranking import ranked
from planner.tracing.rivals import without
from planner.tracing.screen import Shade, grid
from planner.tracing.state import Held, State, refit
from planner.tracing.types import Candidate
from planner.tracing.unnamed import unnamed

TRIES = 6  # of the most surprising entries that are refitted before the search gives up
ALIKE = 0.9  # share of the best gain above which another entry is refitted beside it
SIDES = 4  # entries that are refitted side by side
MOST = 25  # effects
BETTER = 4.0  # fall of minus twice the log evidence for which an effect is swapped
SWAPS = 2  # rounds of swaps
Say = Callable[[str], None]


@dataclass(frozen=True)
class Rejected:
    """An entry that was refitted and not kept, and why."""

    name: str
    because: str


@dataclass(frozen=True)
class Trace:
    """Where the search ended.

    Attributes:
        path: states in order, the first without any effect.
        dictionary: entries and inner values that each round looked at.
        rejected: what was refitted and not kept.
    """

    path: tuple[State, ...]
    dictionary: Dictionary
    rejected: tuple[Rejected, ...]

    @property
    def tried(self) -> int:
        """Number of entries and inner values that each round looked at."""
        return len(self.dictionary.items)

    @property
    def last(self) -> State:
        """The final state."""
        return self.path[-1]


def memory(state: State, bench: Bench) -> float:
    """How many samples are worth one where effects are screened: along a continuous run errors remember each other."""
    return quick_memory(state) if bench.run.continuous else 1.0


def search(start: State, entries: Sequence[Entry], bench: Bench, say: Say) -> Trace:
    """Trace the residual of ``start`` to entries of the catalogue."""
    rejected: list[Rejected] = []
    shade = Shade.of(start.fit)
    dictionary = shade.lay_out([pair for e in entries for pair in grid(e)])
    path = _forward([start], dictionary, bench, say, rejected)
    for _ in range(SWAPS):
        swapped = _swapped(path[-1], dictionary, bench, say)
        if swapped is None:
            break
        path = _forward([*path, swapped], dictionary, bench, say, rejected)
    pruned = _pruned(path[-1], bench, len(dictionary.items))
    if pruned.names != path[-1].names:
        path = _forward([*path, pruned], dictionary, bench, say, rejected)
    nameless = shade.lay_out([(e, None) for e in unnamed(start.base, shade.problem.samples.q)])
    path = _forward(path, nameless, bench, say, rejected)
    return Trace(tuple(path), dictionary, tuple(rejected))


def _forward(
    path: list[State], dictionary: Dictionary, bench: Bench, say: Say, rejected: list[Rejected]
) -> list[State]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path, barred = list(path), set[str]()
    while len(path[-1].effects) < MOST:
        state = path[-1]
        shade = Shade.of(state.fit, memory(state, bench))
        likely = [c for c in ranked(shade, dictionary, state.effects) if c.log_p < SURE]
        likely = [c for c in likely if c.entry.name not in barred][:TRIES]
        if not likely:
            break
        say(f"trying {likely[0].entry.name}")
        after = _best(state, shade, likely, bench, len(dictionary.items), rejected)
        if after is None:
            break
        added = after.effects[-1].entry
        after = _pruned(after, bench, len(dictionary.items))
        if any(after.names == s.names for s in path):
            barred |= {added.name}  # it drives out what brought it in: others first
        else:
            path.append(after)
    return path


def _best(
    state: State, shade: Shade, likely: list[Candidate], bench: Bench, tried: int, rejected: list[Rejected]
) -> State | None:
    """Refit the likely entries, alike ones side by side, and return the first kind that holds."""
    while likely:
        near = [c for c in likely if c.gain > ALIKE * likely[0].gain][:SIDES]
        likely = [c for c in likely if c not in near]
        trials = [_with(state.effects, c, state, shade, bench) for c in near]
        reasons = [reason(state, t, bench, tried) for t in trials]
        rejected += [Rejected(t.effects[-1].entry.name, r) for t, r in zip(trials, reasons, strict=True) if r]
        held = [t for t, r in zip(trials, reasons, strict=True) if r is None]
        if held:
            worth = memory(held[0], bench)
            return min(held, key=lambda t: t.evidence(worth))
    return None


def _with(effects: tuple[Held, ...], candidate: Candidate, before: State, shade: Shade, bench: Bench) -> State:
    """Refit with effects and a further one."""
    inner = candidate.inner
    if inner is not None:
        inner = refined(shade, candidate.entry, inner)
    entry = numbered(candidate.entry, effects)
    return refit(bench, entry.name, before.base, (*effects, Held(entry, inner)), before)


def _pruned(state: State, bench: Bench, tried: int) -> State:
    """Take out effects that the later ones made needless, the faintest first."""
    while len(state.effects) > 1:
        chances = [wald_log_p(state, h, tried) for h in state.effects]
        faint = int(np.argmax(chances))
        if chances[faint] < SURE:
            break
        effects = tuple(h for k, h in enumerate(state.effects) if k != faint)
        state = refit(bench, effects[-1].entry.name, state.base, effects, state)
    return state


def _swapped(state: State, dictionary: Dictionary, bench: Bench, say: Say) -> State | None:
    """Put another entry in the place of each effect where the run is likelier so; ``None`` if it nowhere is."""
    found = None
    for held in state.effects:
        shade = Shade.of(state.fit, memory(state, bench))
        bare = without(shade, state, held)
        rest = tuple(h for h in state.effects if h.entry.name != held.entry.name)
        best = ranked(bare, dictionary, rest)[:2]
        other = next((c for c in best if c.entry.name != held.entry.name), None)
        if other is None or (best[0].entry.name == held.entry.name and best[0].score > other.score + BETTER):
            continue
        say(f"trying {other.entry.name} for {held.entry.name}")
        trial = _with(rest, other, state, bare, bench)
        tried = len(dictionary.items)
        worth = memory(state, bench)
        if (
            trial.evidence(worth) < state.evidence(worth) - BETTER
            and wald_log_p(trial, trial.effects[-1], tried) < SURE
        ):
            state = found = trial
    return found
