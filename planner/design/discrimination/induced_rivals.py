"""Rivals that the chosen poses themselves would bring up: what they tell worse than the poses measured before."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from planner.common.units import Array
from planner.design.discrimination.criterion import DiscriminationQuestion
from planner.design.discrimination.power import SURE, discrimination_power
from planner.design.discrimination.predicted_readings import PredictedReadings, flatten_rows, orthonormal_span
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

    def explained(self, basis: Array, signal: Array) -> Array:
        """Square of what each item explains of a signal (m,), both off an orthonormal basis (m, p) of the model."""
        out = np.zeros(len(self.items))
        for which, columns in self.groups:
            left = columns - basis @ (basis.T @ columns)
            mu, axes = np.linalg.eigh(left.transpose(0, 2, 1) @ left)
            along = np.einsum("gij,gi->gj", axes, np.einsum("gmk,m->gk", left, signal))
            out[which] = np.where(mu > VISIBLE_SHARE, along**2 / np.maximum(mu, VISIBLE_SHARE), 0.0).sum(axis=1)
        return out


def add_induced_rivals(
    sight: PredictedReadings, entries: Mapping[str, Effect], asked: QuestionSet, open_: set[int], chosen: np.ndarray
) -> tuple[QuestionSet, set[int]]:
    """Return with a question for each effect of the catalogue that the chosen candidates would not tell from a truth.

    ``open_``: pairs that poses can tell apart; returned are the new ones.
    """
    few = sight.at(chosen)
    rows, dictionary = flatten_rows(few.rows(asked.parameters)), CatalogueColumns.of(few, entries)
    truths = {q.truth: q for q in asked.questions[::-1] if q.pair in open_ and asked.pairs[q.pair].named}
    new = set[int]()
    for truth, q in sorted(truths.items()):
        basis = orthonormal_span(rows[:, q.base])
        signal = rows[:, : len(q.signal)] @ q.signal
        signal = signal - basis @ (basis.T @ signal)
        whole = float(signal @ signal)
        left = whole - dictionary.explained(basis, signal)
        known = _known_names(asked, q)
        for k in np.argsort(left, kind="stable"):
            entry, inner = dictionary.items[k]
            if len(known[truth]) == RIVALS_PER_TRUTH or discrimination_power(float(left[k]), whole) > SURE:
                break
            if not any(entry.name in names for names in known.values()):
                known[truth].add(entry.name)
                new.add(len(asked.pairs))
                asked = asked.guarded(q, entry, inner)
    return asked, new


def _known_names(asked: QuestionSet, question: DiscriminationQuestion) -> dict[str, set[str]]:
    """Names that are asked for already with a truth, and room for new ones."""
    truth = question.truth
    with_it = {n for p in asked.pairs if truth in (p.finding, p.rival) for n in (p.finding, p.rival)}
    return {"": {n.split(" (")[0] for n in with_it}, truth: set()}
