"""Which entries to refit first: what they would explain, less what they explain by being many."""

from dataclasses import replace

import numpy as np

from planner.tracing.again import APART, open_to, taken
from planner.tracing.dictionary import Dictionary
from planner.tracing.inner_grid import spacing
from planner.tracing.screen import Scored, Shade, log_p, scored
from planner.tracing.softness import with_weights
from planner.tracing.state import Held
from planner.tracing.types import Candidate

COST = 7.0  # noise variances that a parameter must explain beyond what fits by chance, about the log of a run's length
WEIGHT, SIDES = "payload mass", "backlash by load"  # what joints that merely give way are easily taken for
LIKE_WEIGHT = 0.95  # share of what these explain that makes plain compliance, which every arm has, the likelier cause


def ranked(shade: Shade, dictionary: Dictionary, effects: tuple[Held, ...]) -> list[Candidate]:
    """Every entry that may join ``effects`` at its best inner value, the likeliest first; ties in catalogue order."""
    scores = [s for s in scored(shade, dictionary) if open_to(s.entry, effects) and apart(s, effects)]
    scores = with_weights(shade, scores)
    best: dict[str, Scored] = {}
    for s in scores:
        if s.entry.name not in best or s.gain > best[s.entry.name].gain:
            best[s.entry.name] = s
    unlikely = (s for s in best.values() if s.entry.kind in (WEIGHT, SIDES))
    doubted = frozenset(s.entry.name for s in unlikely if _yields(shade, s, best))
    tried = len(dictionary.items)
    variance = shade.variance / shade.worth
    out = [
        Candidate(s.entry, s.inner, s.gain, s.size, log_p(shade, s.gain, s.size, tried), penalised(s, variance))
        for s in best.values()
        if s.entry.name not in doubted
    ]
    return sorted(out, key=lambda c: -c.score)


def penalised(scored: Scored, variance: float) -> float:
    """Gain in noise variances less what parameters and scanned inner numbers explain by being many."""
    inner = scored.entry.inner
    return (
        scored.gain / variance - COST * scored.size - (0.0 if inner is None else COST + 2 * np.log(len(inner.values)))
    )


def apart(scored: Scored, effects: tuple[Held, ...]) -> bool:
    """Whether an inner number is another one than those that effects of the same entry have."""
    if scored.inner is None or not effects:
        return True
    known = taken(scored.entry, effects)
    if not known:
        return True
    return min(abs(scored.inner - k) for k in known) > APART * spacing(scored.entry, scored.inner)


def _yields(shade: Shade, mass: Scored, best: dict[str, Scored]) -> bool:
    """Whether plain compliance explains as much: of the joints at which a wrong mass would show, of all for play."""
    where = {p.main.index for p in mass.entry.make(None)}
    soft = [s.entry for s in best.values() if s.entry.kind == "joint compliance"]
    anywhere = mass.entry.kind == SIDES
    parts = tuple(p for e in soft for p in e.make(None) if anywhere or p.main.index in where)
    if not parts:
        return False
    both = replace(mass.entry, make=lambda _: parts)
    return scored(shade, shade.lay_out([(both, None)]))[0].gain > LIKE_WEIGHT * mass.gain
