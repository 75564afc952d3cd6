"""The search: add the effect that explains most while held-out samples gain, then mend what an early choice got wrong.

Forward steps, each with backward pruning; when no step is left, effects are swapped for others that the run is
likelier under; and at the very end corrections without a name are tried.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from planner.catalogue import Entry
from planner.identification import Bench
from planner.tracing.again import numbered
from planner.tracing.curve import instead, likeliest
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
AGAIN = 1.3  # times more of the residual than when it was refused: an entry is tried again
Say = Callable[[str], None]


class Refused:
    """What was refitted and not kept, why, and how much of the residual it explained then."""

    def __init__(self) -> None:
        """Begin with nothing refused."""
        self.why: dict[str, str] = {}
        self._share: dict[str, float] = {}

    def note(self, state: State, because: str) -> None:
        """Take note of a refusal of a state's last effect."""
        self.why[state.effects[-1].entry.name] = because

    def judged(self, candidates: Sequence[Candidate], scatter: float) -> None:
        """Take note of what the candidates that were refitted explain of a sum of squares."""
        self._share.update({c.entry.name: c.gain / scatter for c in candidates})

    def worth(self, candidate: Candidate, scatter: float) -> bool:
        """Tell whether a candidate is worth a refit: a new one, or one that now explains more of what is left."""
        return candidate.gain / scatter > AGAIN * self._share.get(candidate.entry.name, 0.0)


@dataclass(frozen=True)
class Trace:
    """Where the search ended.

    Attributes:
        path: states in order, the first without any effect.
        dictionary: entries and inner values that each round looked at.
        rejected: names of what was refitted and not kept, each with the reason.
    """

    path: tuple[State, ...]
    dictionary: Dictionary
    rejected: tuple[tuple[str, str], ...]

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
    refused = Refused()
    shade = Shade.of(start.fit)
    dictionary = shade.lay_out([pair for e in entries for pair in grid(e)])
    path = _forward([start], dictionary, bench, say, refused)
    for _ in range(SWAPS):
        swapped = _swapped(path[-1], dictionary, bench, say)
        if swapped is None:
            break
        path = _forward([*path, swapped], dictionary, bench, say, refused)
    pruned = _pruned(path[-1], bench, len(dictionary.items))
    if pruned.names != path[-1].names:
        path = _forward([*path, pruned], dictionary, bench, say, refused)
    nameless = shade.lay_out([(e, None) for e in unnamed(start.base, shade.problem.samples.q)])
    path = _forward(path, nameless, bench, say, refused)
    gone = tuple((n, why) for n, why in refused.why.items() if n not in path[-1].names)
    return Trace(tuple(path), dictionary, gone)


def _forward(path: list[State], dictionary: Dictionary, bench: Bench, say: Say, refused: Refused) -> list[State]:
    """Add effects one by one while any holds; returns the path so far with the states that came."""
    path, barred = list(path), set[str]()
    while len(path[-1].effects) < MOST:
        state = path[-1]
        shade = Shade.of(state.fit, memory(state, bench))
        likely = [c for c in ranked(shade, dictionary, state.effects) if c.log_p < SURE]
        likely = [c for c in likely if c.entry.name not in barred and refused.worth(c, shade.scatter)][:TRIES]
        if not likely:
            break
        say(f"trying {likely[0].entry.name}")
        after = _best(state, shade, likely, bench, len(dictionary.items), refused)
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
    state: State, shade: Shade, likely: list[Candidate], bench: Bench, tried: int, refused: Refused
) -> State | None:
    """Refit the likely entries, alike ones side by side, and return the first kind that holds."""
    while likely:
        near = [c for c in likely if c.gain > ALIKE * likely[0].gain][:SIDES]
        likely = [c for c in likely if c not in near]
        trials = [_with(state.effects, c, state, shade, bench) for c in near]
        trials += _curved(state, near, shade, bench)
        reasons = [reason(state, t, bench, tried) for t in trials]
        for trial, because in zip(trials, reasons, strict=True):
            if because:
                refused.note(trial, because)
        refused.judged([c for c, r in zip(near, reasons, strict=False) if r], shade.scatter)
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


def _curved(state: State, near: list[Candidate], shade: Shade, bench: Bench) -> Iterator[State]:
    """Refit with the whole error curve of each joint that is to have one more wave, in place of its waves."""
    for on in dict.fromkeys(c.entry.on for c in near):
        kept = next((k for c in near if c.entry.on == on and (k := instead(state.effects, c.entry)) is not None), None)
        if kept is None:
            continue
        bare = shade
        for held in state.effects:
            bare = bare if held in kept else without(bare, state, held)
        entry = likeliest(bare, state.base, int(on.split()[-1]) - 1)
        yield refit(bench, entry.name, state.base, (*kept, Held(entry, None)), state)


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
