"""Mends what an early choice got wrong: another entry in the place of an effect, where the run is likelier so."""

from functools import partial

from planner.tracing.curve import KIND as CURVE
from planner.tracing.hunt import Hunt
from planner.tracing.judging import SURE, wald_log_p
from planner.tracing.masses import KIND as YIELDING
from planner.tracing.ranking import ranked
from planner.tracing.rivals import without
from planner.tracing.state import State
from planner.tracing.steps import joined, settled

BETTER = 4.0  # fall of minus twice the log evidence for which an effect is swapped
SURELY = 20.0  # the same for the compliance of a joint: every arm has it, so that it is the likelier cause beforehand


def swapped(hunt: Hunt, state: State, ahead: float = -BETTER) -> State | None:
    """Put another entry in the place of each effect where the run is likelier so; ``None`` if it nowhere is.

    ``ahead`` is by how much its score must be above the effect's own to be tried.
    """
    found = None
    for held in state.effects:
        if held.entry.kind == CURVE:
            continue  # it took the place of the waves that would now be tried for it
        bare = without(hunt.shade(state), state, held)
        rest = tuple(h for h in state.effects if h.entry.name != held.entry.name)
        own = ranked(bare, bare.lay_out([(held.entry, held.inner)]), rest)
        other = next((c for c in ranked(bare, hunt.dictionary, rest)[:2] if c.entry.name != held.entry.name), None)
        if other is None or (own and other.score < own[0].score + ahead):
            continue
        hunt.say(f"trying {other.entry.name} for {held.entry.name}")
        trial = settled(partial(joined, hunt, state, bare, other, rest))
        if trial is None:
            continue
        worth = hunt.memory(state)
        least = SURELY if held.entry.kind == YIELDING else BETTER
        likelier = trial.evidence(worth) < state.evidence(worth) - least
        if likelier and wald_log_p(trial, trial.effects[-1], hunt.tried) < SURE:
            state = found = trial
    return found
