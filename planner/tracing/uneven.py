"""All gears that run unevenly at once, where no single one of them shows.

Where every joint of an arm errs over its own angle, each error is small beside the sum of the others: no wave of one
joint is surer than chance, and what is named first is what happens to resemble the sum. All curves together explain it.
The run decides by its likelihood, and each curve must then hold for itself against the model without it.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from planner.catalogue import Entry
from planner.catalogue.curves import gear_curve
from planner.tracing.again import plain
from planner.tracing.curve import KIND, QUICKEST, TONES, evidence, likeliest
from planner.tracing.hunt import Hunt
from planner.tracing.judging import SURE, WORTH, gain, own_gains
from planner.tracing.rivals import without
from planner.tracing.screen import Shade
from planner.tracing.state import Held, State, refit
from planner.tracing.steps import settled

LEFT = 3.0  # logarithm of the likelihood that curves would add to where the search ended, below which there is no cause


def uneven(hunt: Hunt, entries: Sequence[Entry], end: State, yielding: State | None) -> State | None:
    """Return a state with the curves of all joints; ``None`` where the run is no likelier so than at ``end``.

    They join what the search has found or, where that is likelier, all joints that yield and nothing else.
    """
    joints = sorted({int(e.on.split()[-1]) - 1 for e in entries if e.kind == TONES[0]})
    bare = _without_curve(end, joints)
    shade = hunt.shade(end)
    if sum(max(0.0, evidence(shade, likeliest(shade, end.base, j))) for j in bare) < LEFT:
        return None
    hunt.say("trying all gears at once")
    begin = [end] if yielding is None else [end, yielding]
    trials = [t for b in begin if (t := _curved(hunt, b, joints)) is not None]
    if not trials:
        return None
    worth = hunt.memory(end)
    best = _settled(hunt, min(trials, key=lambda t: t.evidence(worth)))
    if best.evidence(worth) > end.evidence(worth) - 2 * (np.log(hunt.tried) - SURE):
        return None  # together they must be as sure as a single effect
    best = _each_for_itself(hunt, best)
    if _count(best) <= _count(end):
        return None
    fall, error = gain(end, best, hunt.bench)
    return best if fall > max(error, WORTH) else None


def _count(state: State) -> int:
    return sum(h.entry.kind == KIND for h in state.effects)


def _without_curve(state: State, joints: Sequence[int]) -> list[int]:
    has = {h.entry.on for h in state.effects if h.entry.kind == KIND}
    return [j for j in joints if f"joint {j + 1}" not in has]


def _curved(hunt: Hunt, state: State, joints: Sequence[int]) -> State | None:
    """Return a state with a curve for every joint that has none, in the place of its waves, all of one quickness."""
    bare = _without_curve(state, joints)
    if not bare:
        return None
    on = {f"joint {j + 1}" for j in bare}
    kept = [h for h in state.effects if plain(h.entry.kind) not in TONES or h.entry.on not in on]
    q, worth, best = state.fit.problem.samples.q, hunt.memory(state), None
    for quickest in QUICKEST:
        effects = (*kept, *(Held(gear_curve(state.base, q, j, quickest), None) for j in bare))
        trial = settled(partial(refit, hunt.bench, effects[-1].entry.name, state.base, effects, state))
        if trial is not None and best is not None and trial.evidence(worth) > best.evidence(worth):
            break  # the quicker, the less likely
        best = trial or best
    return best


def _settled(hunt: Hunt, state: State) -> State:
    """How quick each curve is, seen again beside the others; kept where the run is likelier so."""
    shade = hunt.shade(state)
    effects = tuple(_again(shade, state, h) for h in state.effects)
    again = settled(lambda: refit(hunt.bench, effects[-1].entry.name, state.base, effects, state))
    worth = hunt.memory(state)
    return state if again is None or again.evidence(worth) > state.evidence(worth) else again


def _again(shade: Shade, state: State, held: Held) -> Held:
    if held.entry.kind != KIND:
        return held
    return Held(likeliest(without(shade, state, held), state.base, int(held.entry.on.split()[-1]) - 1), None)


def _each_for_itself(hunt: Hunt, state: State) -> State:
    """Take out curves without which held-out samples lose nothing that matters, the least first."""
    while len(state.effects) > 1:
        own = zip(state.effects, own_gains(state, hunt.bench), strict=True)
        worth = [(g.share - max(g.error, WORTH), h.entry.name) for h, g in own if h.entry.kind == KIND]
        least, name = min(worth, default=(1.0, ""))
        if least > 0:
            break
        rest = tuple(h for h in state.effects if h.entry.name != name)
        state = refit(hunt.bench, rest[-1].entry.name, state.base, rest, state)
    return state
