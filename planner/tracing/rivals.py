"""Which other effects would explain the same: the model without a finding, and everything tried in its place."""

from dataclasses import replace

import numpy as np

from planner.tracing.dictionary import Dictionary
from planner.tracing.screen import Shade, scored
from planner.tracing.state import Held, State

MARGIN = 9.2  # fall of minus twice the log likelihood that tells two causes apart: a hundred to one


def without(shade: Shade, state: State, held: Held) -> Shade:
    """Return the fitted model less one effect and its inner number, linear about the fit."""
    names = {p.name for p in held.entry.make(held.inner)} | {
        f"{held.entry.name}, {held.entry.inner.name}" if held.entry.inner else ""
    }
    model, problem = shade.problem.model, shade.problem
    own = [j for j, n in enumerate(model.names) if n in names]
    rest = [j for j in range(len(model.names)) if j not in own]
    piece = problem.piece(slice(None), shade.errors)
    rows = piece.rows.reshape(-1, piece.rows.shape[2])
    scale = np.sqrt(len(problem) / len(state.fit.problem))
    Q = np.linalg.qr(np.vstack([rows[:, rest], np.eye(len(rest)) * scale]))[0][: len(rows)]
    residual = piece.residual.reshape(-1) + rows[:, own] @ (shade.errors[own] / problem.prior[own])
    return replace(shade, basis=Q, residual=residual - Q @ (Q.T @ residual))


def rivals(shade: Shade, state: State, held: Held, dictionary: Dictionary) -> tuple[str, ...]:
    """Names of the entries that would explain what ``held`` explains, within uncertainty, the likeliest first."""
    bare = without(shade, state, held)
    own = scored(bare, bare.lay_out([(held.entry, held.inner)]))[0]
    variance = max(shade.scatter / shade.spare, 1e-300)
    taken = {h.entry.name for h in state.effects}
    best: dict[str, float] = {}
    for s in scored(bare, dictionary):
        if s.entry.name in taken:
            continue
        # more parameters explain more by chance alone
        score = s.gain / variance - 2 * s.size
        best[s.entry.name] = max(best.get(s.entry.name, -np.inf), score)
    least = own.gain / variance - 2 * own.size - MARGIN
    near = [(name, score) for name, score in best.items() if score > least and score > 0]
    return tuple(name for name, _ in sorted(near, key=lambda pair: -pair[1]))
