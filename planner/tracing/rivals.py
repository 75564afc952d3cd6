"""Which other effects would explain the same: the model without a finding, and everything tried in its place."""

from dataclasses import replace

import numpy as np

from planner.effects.parameters import Parameter
from planner.tracing.auxiliary_parameters import COMPLIANCE, LINK_MASSES
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.ranking import is_distinct, with_link_masses
from planner.tracing.score_test import ScoreTest, score_effects
from planner.tracing.state import FittedEffect, SearchState, base_kind, may_join

RIVAL_MARGIN = 9.2  # fall of minus twice the log likelihood that tells two causes apart: a hundred to one
# share of a finding's gain that makes another a rival however sure the run is: no model is that exact
RIVAL_SHARE = 0.98


def without_effect(shade: ScoreTest, state: SearchState, held: FittedEffect) -> ScoreTest:
    """Return the fitted model less one effect, its inner number and what wrong weights do through it, about the fit."""
    names = {p.name for p in held.entry.make(held.inner)} | {held.slope_name}
    where = (
        {m.index for p in held.entry.make(held.inner) for m in p.moves} if held.entry.kind == COMPLIANCE else set[int]()
    )
    kept, errors = list[Parameter](), list[float]()
    for p, value in zip(shade.problem.model.parameters, shade.errors, strict=True):
        moves = tuple(m for m in p.moves if m.index not in where) if p.group == LINK_MASSES else p.moves
        if p.name not in names and moves:
            kept.append(replace(p, moves=moves))
            errors.append(float(value))
    problem = shade.problem.with_model(replace(shade.problem.model, parameters=tuple(kept)))
    piece = problem.piece(slice(None), np.array(errors))
    rows = piece.rows.reshape(-1, piece.rows.shape[2])
    scale = np.sqrt(len(problem) / len(state.fit.problem))
    Q = np.linalg.qr(np.vstack([rows, np.eye(len(kept)) * scale]))[0][: len(rows)]
    residual = piece.residual.reshape(-1)
    return replace(shade, basis=Q, residual=residual - Q @ (Q.T @ residual))


def find_rivals(
    shade: ScoreTest, state: SearchState, held: FittedEffect, dictionary: EffectDictionary
) -> tuple[str, ...]:
    """Names of the entries that would explain what ``held`` explains, within uncertainty, the likeliest first."""
    bare = without_effect(shade, state, held)
    own = with_link_masses(bare, score_effects(bare, bare.lay_out([(held.entry, held.inner)])))[0]
    variance = shade.variance / shade.worth
    rest = tuple(h for h in state.effects if h.entry.name != held.entry.name)
    own_name = f"{base_kind(held.entry.kind)}, {held.entry.on}"
    best: dict[str, float] = {}
    for s in with_link_masses(bare, score_effects(bare, dictionary)):
        if s.entry.name == own_name or not may_join(s.entry, rest) or not is_distinct(s, rest):
            continue
        # more parameters explain more by chance alone
        score = s.gain / variance - 2 * s.size
        best[s.entry.name] = max(best.get(s.entry.name, -np.inf), score)
    least = min(own.gain / variance - 2 * own.size - RIVAL_MARGIN, RIVAL_SHARE * own.gain / variance)
    near = [(name, score) for name, score in best.items() if score > least and score > 0]
    return tuple(name for name, _ in sorted(near, key=lambda pair: -pair[1]))
