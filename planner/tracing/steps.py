"""One step forward: likely entries are refitted side by side, and the one that the run is likeliest under is kept."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

from planner.errors import NoSolutionError
from planner.tracing.again import KINDS, numbered, plain
from planner.tracing.curve import KIND as CURVE
from planner.tracing.curve import instead, likeliest
from planner.tracing.hunt import Hunt
from planner.tracing.inner import refined
from planner.tracing.judging import SURE, gain, reason, wald_log_p
from planner.tracing.ranking import ranked
from planner.tracing.rivals import without
from planner.tracing.screen import Shade
from planner.tracing.state import Held, State, refit
from planner.tracing.types import Candidate

ALIKE = 0.9  # share of the best gain above which another entry is refitted beside it
SIDES = 4  # entries that are refitted side by side
THREADS = 2  # refits at a time: they are taken in order, so their number does not show


def best(hunt: Hunt, state: State, shade: Shade, likely: list[Candidate]) -> State | None:
    """Refit the likely entries, alike ones side by side, and return the first kind that holds."""
    doubtful = list[State]()
    while likely:
        near = [c for c in likely if c.gain > ALIKE * likely[0].gain][:SIDES]
        likely = [c for c in likely if c not in near]
        trials = _refitted(hunt, state, shade, near)
        held = []
        for trial in trials:
            because = reason(state, trial, hunt.bench, hunt.tried)
            if because is None:
                held.append(trial)
            else:
                hunt.refused.note(trial, because)
        if held:
            worth = hunt.memory(held[0])
            return min(held, key=lambda t: t.evidence(worth))
        hunt.refused.judged(near, shade.scatter)
        doubtful += trials
    return next((s for t in doubtful if (s := _in_two(hunt, state, t)) is not None), None)


def joined(hunt: Hunt, state: State, shade: Shade, candidate: Candidate, effects: tuple[Held, ...]) -> State:
    """Refit with some effects of a state and a further one."""
    inner = candidate.inner
    if inner is not None:
        inner = refined(shade, candidate.entry, inner)
    entry = numbered(candidate.entry, effects)
    return refit(hunt.bench, entry.name, state.base, (*effects, Held(entry, inner)), state)


def _refitted(hunt: Hunt, state: State, shade: Shade, near: list[Candidate]) -> list[State]:
    """Refit with each of some candidates, and with the whole curve of each joint that is to have one more wave.

    A fit that does not come to rest is left out: what cannot be told from the geometry may run off with it.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        waves = pool.map(lambda c: settled(lambda: joined(hunt, state, shade, c, state.effects)), near)
        curves = pool.map(
            lambda joint: settled(lambda: _curved(hunt, state, shade, *joint)), _uneven(hunt, state, near)
        )
        return [s for s in (*waves, *curves) if s is not None]


def settled(refit: Callable[[], State]) -> State | None:
    """Refit, ``None`` where the fit does not come to rest."""
    try:
        return refit()
    except NoSolutionError:
        return None


def _uneven(hunt: Hunt, state: State, near: list[Candidate]) -> Iterator[tuple[str, tuple[Held, ...]]]:
    """Joints that are to have one more wave, with the effects that would stay beside their whole curve."""
    seen = {name.removeprefix(f"{CURVE}, ") for name in hunt.barred}
    for c in near:
        kept = instead(state.effects, c.entry)
        if kept is not None and c.entry.on not in seen:
            seen.add(c.entry.on)
            yield c.entry.on, kept


def _curved(hunt: Hunt, state: State, shade: Shade, on: str, kept: tuple[Held, ...]) -> State:
    for held in state.effects:
        shade = shade if held in kept else without(shade, state, held)
    entry = likeliest(shade, state.base, int(on.split()[-1]) - 1)
    return refit(hunt.bench, entry.name, state.base, (*kept, Held(entry, None)), state)


def _in_two(hunt: Hunt, state: State, trial: State) -> State | None:
    """Add an effect together with a second of its kind at its place, where one alone leaves too much to be sure of it.

    An arm that warms up in two ways leaves, less one of them, a residual so slow that neither would be believed.
    """
    first = trial.effects[-1]
    if plain(first.entry.kind) not in KINDS or len(trial.effects) == len(state.effects):
        return None
    fall, error = gain(state, trial, hunt.bench)
    if fall <= error:
        return None
    shade = hunt.shade(trial)
    same = (c for c in ranked(shade, hunt.dictionary, trial.effects) if c.entry.on == first.entry.on)
    second = next((c for c in same if c.entry.kind == plain(first.entry.kind) and c.log_p < SURE), None)
    if second is None:
        return None
    hunt.say(f"trying {first.entry.name} in two ways")
    both = settled(lambda: joined(hunt, trial, shade, second, trial.effects))
    if (
        both is None
        or reason(trial, both, hunt.bench, hunt.tried)
        or wald_log_p(both, both.effects[-2], hunt.tried) > SURE
    ):
        return None
    return both
