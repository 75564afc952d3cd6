"""Rivals that the chosen poses themselves would bring up: what they tell worse than the poses measured before."""

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np

from planner.common.determinism import Positions
from planner.common.units import Array
from planner.design.discrimination.power import SURE, discrimination_power
from planner.design.discrimination.predicted_readings import (
    PredictedReadings,
    flatten_rows,
    orthonormal_span,
    project_out,
)
from planner.design.discrimination.questions import QuestionSet
from planner.effects.effect import Effect, Role

RIVALS_PER_TRUTH = 2  # that are taken up for each truth at a time
VISIBLE_SHARE = 1e-6  # share of a column that must be left off the model's for its parameter to count


@dataclass(frozen=True)
class CatalogueColumns:
    """The catalogue over some poses: entries with an inner number each, and their columns.

    Attributes:
        items: K of them.
        groups: for each number k of parameters, positions of the items (g,), and columns of unit length (g, m, k).
    """

    items: tuple[tuple[Effect, float | None], ...]
    groups: tuple[tuple[np.ndarray, Array], ...]

    @classmethod
    def of(cls, sight: PredictedReadings, entries: Mapping[str, Effect]) -> "CatalogueColumns":
        """Lay out the catalogue over the poses of a sight."""
        items = tuple((e, v) for e in entries.values() if not e.has(Role.UNTRACED) for v in e.grid)
        made = [e.make(v) for e, v in items]
        widths = np.array([len(m) for m in made])
        groups = []
        for k in np.unique(widths):
            which = np.flatnonzero(widths == k)
            columns = flatten_rows(sight.rows([p for j in which for p in made[j]]))
            columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            groups.append((which, columns.reshape(len(columns), len(which), k).transpose(1, 0, 2)))
        return cls(items, tuple(groups))

    def explained_squares(self, basis: Array, signal: Array) -> Array:
        """Square of what each item explains of a signal (m,), both off an orthonormal basis (m, p) of the model."""
        out = np.zeros(len(self.items))
        for which, columns in self.groups:
            left = columns - basis @ (basis.T @ columns)
            mu, axes = np.linalg.eigh(left.transpose(0, 2, 1) @ left)
            along = np.einsum("gij,gi->gj", axes, np.einsum("gmk,m->gk", left, signal))
            out[which] = np.where(mu > VISIBLE_SHARE, along**2 / np.maximum(mu, VISIBLE_SHARE), 0.0).sum(axis=1)
        return out


def add_induced_rivals(
    sight: PredictedReadings,
    entries: Mapping[str, Effect],
    asked: QuestionSet,
    open_: Container[int],
    chosen: Positions,
) -> QuestionSet:
    """Return with a question for each effect of the catalogue that the chosen candidates would not tell from a truth.

    ``open_``: pairs that poses can tell apart.
    """
    few = sight.at(chosen)
    rows, dictionary = flatten_rows(few.rows(asked.parameters)), CatalogueColumns.of(few, entries)
    pairs = [p for k, p in enumerate(asked.pairs) if k in open_ and p.named]
    truths = {q.truth: q for p in pairs[::-1] for q in p.questions[::-1]}
    for truth, q in sorted(truths.items()):
        basis = orthonormal_span(rows[:, q.base])
        signal = project_out(rows[:, q.shows] @ q.values, basis)
        whole = float(signal @ signal)
        left = whole - dictionary.explained_squares(basis, signal)
        with_it = {n for p in asked.pairs if truth in (p.finding, p.rival) for n in (p.finding, p.rival)}
        known, new = {n.split(" (")[0] for n in with_it}, set[str]()
        for k in np.argsort(left, kind="stable"):
            entry, inner = dictionary.items[k]
            if len(new) == RIVALS_PER_TRUTH or discrimination_power(float(left[k]), whole) > SURE:
                break
            if entry.name not in known | new:
                new.add(entry.name)
                asked = asked.with_rival(q, entry, inner)
    return asked
