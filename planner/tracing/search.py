"""The search: add the most surprising effect while held-out samples gain, then take out what is no longer needed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f as f_distribution

from planner.catalogue import Entry
from planner.identification import Bench
from planner.identification.spread import correlation_time
from planner.tracing.dictionary import Dictionary
from planner.tracing.inner import refined
from planner.tracing.screen import Shade, grid, ranked
from planner.tracing.state import Held, State, gain_in_errors, refit
from planner.tracing.types import Candidate

SURE = np.log(2e-3)  # chance, corrected for everything that was tried, below which an effect may be added
TRIES = 6  # of the most surprising entries that are refitted before the search gives up
ALIKE = 0.9  # share of the best gain above which another entry is refitted beside it
MOST = 25  # effects
SEEN = 3.0  # standard deviations that an effect's size must be above zero
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


def worth(state: State, bench: Bench) -> float:
    """How many samples are worth one, for their correlation along a continuous run."""
    if not bench.run.continuous:
        return 1.0
    return correlation_time(state.fit.problem.white_residual(state.fit.errors)[:, 0])


def search(start: State, entries: Sequence[Entry], bench: Bench, say: Say) -> Trace:
    """Trace the residual of ``start`` to entries of the catalogue."""
    path, rejected = [start], list[Rejected]()
    dictionary = Shade.of(start.fit).lay_out([pair for e in entries for pair in grid(e)])
    while len(path[-1].effects) < MOST:
        state = path[-1]
        names = {h.entry.name for h in state.effects}
        left = frozenset(e.name for e in entries) - names
        shade = Shade.of(state.fit, worth(state, bench))
        likely = [c for c in ranked(shade, dictionary, left) if c.log_p < SURE][:TRIES]
        if not likely:
            break
        say(f"trying {likely[0].entry.name}")
        after, refused = _best(state, shade, likely, bench)
        rejected += refused
        if after is None:
            break
        path.append(_pruned(after, bench, len(dictionary.items)))
        if {h.entry.name for h in path[-1].effects} == names:
            path.pop()
            break
    return Trace(tuple(path), dictionary, tuple(rejected))


def _best(state: State, shade: Shade, likely: list[Candidate], bench: Bench) -> tuple[State | None, list[Rejected]]:
    """Refit the likely entries, alike ones side by side, and return the first kind that holds."""
    rejected: list[Rejected] = []
    while likely:
        near = [c for c in likely if c.gain > ALIKE * likely[0].gain][:3]
        likely = [c for c in likely if c not in near]
        trials = [_with(state, c, shade, bench) for c in near]
        reasons = [_reason(state, t, bench) for t in trials]
        rejected += [Rejected(t.effects[-1].entry.name, r) for t, r in zip(trials, reasons, strict=True) if r]
        held = [t for t, r in zip(trials, reasons, strict=True) if r is None]
        if held:
            return min(held, key=lambda t: t.fit.solution.cost + _log_noise(t)), rejected
    return None, rejected


def _log_noise(state: State) -> float:
    """Minus twice the log likelihood's part that the size of the noise has."""
    white = state.fit.problem.whitener
    few = slice(0, None, max(1, len(state.fit.problem) // 3000))
    C = white.covariance(few)
    return float(np.linalg.slogdet(C)[1].mean() * len(state.fit.problem))


def _with(state: State, candidate: Candidate, shade: Shade, bench: Bench) -> State:
    inner = candidate.inner
    if inner is not None:
        inner = refined(shade, candidate.entry, inner)
    effects = (*state.effects, Held(candidate.entry, inner))
    return refit(bench, candidate.entry.name, state.base, effects, state)


def _reason(before: State, after: State, bench: Bench) -> str | None:
    """Return why the last effect of ``after`` is not kept, ``None`` if it is."""
    held = after.effects[-1]
    gain, error = gain_in_errors(before.stage, after.stage, bench.split)
    if gain <= error:
        return "held-out samples gain no more than chance"
    size = float(np.linalg.norm(after.sizes(held)))
    if size > held.entry.largest:
        return f"its size {size:.3g} is beyond what is plausible, {held.entry.largest:.3g}"
    if strength(after, held) < SEEN**2:
        return "its size is not determined once everything is refitted"
    return None


def strength(state: State, held: Held) -> float:
    """Wald statistic of an effect over its number of parameters: how far its size is from zero."""
    which = state.positions(held)
    root = state.fit.solution.root(state.fit.problem.prior)[which]
    value = state.fit.errors[which]
    return float(value @ np.linalg.solve(root @ root.T, value)) / len(which)


def wald_log_p(state: State, held: Held, tried: int, worth: float = 1.0) -> float:
    """Logarithm of the chance of so large an effect in the final model, corrected for everything that was tried."""
    which = state.positions(held)
    spare = max(1.0, len(state.fit.problem) * state.fit.model.width / worth - state.fit.effective)
    one = f_distribution.logsf(strength(state, held) / worth, len(which), spare)
    return min(0.0, float(one) + float(np.log(tried)))


def _pruned(state: State, bench: Bench, tried: int) -> State:
    """Take out effects that the later ones made needless, the faintest first."""
    while len(state.effects) > 1:
        chances = [wald_log_p(state, h, tried, worth(state, bench)) for h in state.effects]
        faint = int(np.argmax(chances))
        if chances[faint] < SURE:
            break
        effects = tuple(h for k, h in enumerate(state.effects) if k != faint)
        state = refit(bench, effects[-1].entry.name, state.base, effects, state)
    return replace(state)
