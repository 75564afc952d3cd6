"""The questions that a plan is asked: for each finding and rival, what would show if either were the truth."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from planner.catalogue import Entry
from planner.model import Parameter
from planner.separating.columns import Sight, alike, apart, flat, spanned, values_of
from planner.separating.criterion import Question
from planner.separating.file import Found, Identified
from planner.separating.reasons import not_shown
from planner.units import Array


@dataclass(frozen=True)
class Pair:
    """A truth and what may be taken for it.

    Attributes:
        finding, rival: names.
        named: whether the identification names the rival; else it is one that these poses would bring up.
    """

    finding: str
    rival: str
    named: bool = True


@dataclass(frozen=True)
class Asked:
    """All that is asked.

    Attributes:
        parameters: of all columns: the plan's own first, then those of findings and rivals.
        own: positions of the plan's own.
        pairs: what is to be told apart.
        questions: two for each pair that the identification names, one for either truth; one for the others.
        not_shown: a sentence for each pair whose effects the plan's readings cannot show at all.
    """

    parameters: tuple[Parameter, ...]
    own: np.ndarray
    pairs: tuple[Pair, ...] = ()
    questions: tuple[Question, ...] = ()
    not_shown: tuple[str, ...] = ()
    places: Mapping[tuple[str, float | None], np.ndarray] = field(default_factory=dict)

    def of(self, entry: Entry, inner: float | None) -> "tuple[Asked, np.ndarray]":
        """Return with an entry's columns, each effect's once, and their positions."""
        key = (entry.name, inner)
        if key in self.places:
            return self, self.places[key]
        new = entry.make(inner)
        where = np.arange(len(self.parameters), len(self.parameters) + len(new))
        questions = tuple(replace(q, signal=np.append(q.signal, np.zeros(len(new)))) for q in self.questions)
        more = replace(
            self, parameters=(*self.parameters, *new), questions=questions, places={**self.places, key: where}
        )
        return more, where

    def asking(self, pair: Pair, *questions: Question) -> "Asked":
        """Return with one more pair."""
        return replace(self, pairs=(*self.pairs, pair), questions=(*self.questions, *questions))

    def guarded(self, question: Question, entry: Entry, inner: float | None) -> "Asked":
        """Return with the question whether readings of a question's truth would be taken for another entry."""
        more, where = self.of(entry, inner)
        signal = np.append(question.signal, np.zeros(len(more.parameters) - len(question.signal)))
        new = replace(question, pair=len(self.pairs), signal=signal, rival=where)
        return more.asking(Pair(question.truth, entry.name, False), new)


def ask(sight: Sight, entries: Mapping[str, Entry], identified: Identified) -> Asked:
    """Return the questions for an identification's findings and their rivals."""
    few = sight.thinned()
    asked = Asked(sight.model.parameters, np.arange(len(sight.model.parameters)))
    known = [(f, entries[f.name]) for f in identified.found if f.name in entries]
    places = []
    for found, entry in known:
        asked, where = asked.of(entry, found.inner)
        places.append(where)
    for k, (found, entry) in enumerate(known):
        values = values_of(found, entry.make(found.inner), identified.values)
        others = [p for j, p in enumerate(places) if j != k]
        for name in (r for r in found.rivals if r in entries):
            rival = entries[name]
            base = np.concatenate([_without(asked, entry, rival), *others])
            taken = spanned(flat(few.rows([asked.parameters[i] for i in base])))
            signal = apart(flat(few.rows(entry.make(found.inner))) @ values[:, None], taken)[:, 0]
            inner = alike(few, rival, signal, taken)
            matching = _matching(apart(flat(few.rows(rival.make(inner))), taken), signal)
            asked, there = asked.of(rival, inner)
            size, pair = len(asked.parameters), len(asked.pairs)
            asked = asked.asking(
                Pair(found.label, name),
                Question(pair, found.label, _signal(size, places[k], values), base, there),
                Question(pair, name, _signal(size, there, matching), base, places[k]),
            )
    return replace(asked, not_shown=tuple(s for f in identified.found for s in _unseen(f, entries)))


def _without(asked: Asked, *entries: Entry) -> np.ndarray:
    """The plan's own columns, less those that are an entry's themselves: joint compliances may be among them."""
    made = {p.moves for e in entries if e.inner is None for p in e.make(None)}
    return np.array([k for k in asked.own if asked.parameters[k].moves not in made], dtype=int)


def _signal(size: int, where: np.ndarray, values: Array) -> Array:
    out = np.zeros(size)
    out[where] = values
    return out


def _matching(columns: Array, signal: Array) -> Array:
    """Values of a rival's parameters (k,) that look most like the signal and show as much as it does."""
    values = np.linalg.lstsq(columns, signal, rcond=1e-6)[0]
    shown = float(np.linalg.norm(columns @ values))
    if shown <= 1e-6 * float(np.linalg.norm(signal)):  # nothing in common: any direction will do, of the signal's size
        values = np.ones(columns.shape[1])
        shown = float(np.linalg.norm(columns @ values))
    return np.asarray(values * (float(np.linalg.norm(signal)) / max(shown, 1e-300)))


def _unseen(found: Found, entries: Mapping[str, Entry]) -> Iterator[str]:
    for rival in found.rivals:
        missing = [name for name in (found.name, rival) if name not in entries]
        if missing:
            yield not_shown(found.label, rival, missing)
