"""The questions of a discrimination design: for each finding and rival, what would show if either were the truth."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from planner.common.units import Array
from planner.design.discrimination.criterion import DiscriminationQuestion
from planner.design.discrimination.findings import IdentificationResult, IdentifiedEffect
from planner.design.discrimination.predicted_readings import (
    PredictedReadings,
    best_matching_inner,
    flatten_rows,
    found_values,
    orthonormal_span,
    project_out,
)
from planner.effects.catalogue import needs_of
from planner.effects.effect import Effect
from planner.effects.parameters import Parameter


def effect_kind(name: str) -> str:
    """Return the kind of an effect, from its name ``KIND, PLACE``."""
    return name.split(", ")[0]


@dataclass(frozen=True)
class RivalPair:
    """A truth and what may be taken for it.

    Attributes:
        finding, rival: names.
        questions: one for either truth where the identification names the rival; else one, for the finding.
        named: whether the identification names the rival; else it is one that these poses would bring up.
    """

    finding: str
    rival: str
    questions: tuple[DiscriminationQuestion, ...]
    named: bool = True


@dataclass(frozen=True)
class QuestionSet:
    """All that is asked.

    Attributes:
        parameters: of all columns: the plan's own first, then those of findings and rivals.
        own: positions of the plan's own.
        pairs: what is to be told apart.
        not_shown: a sentence for each pair whose effects the plan's readings cannot show at all.
        places: positions of the columns of each effect at an inner number.
    """

    parameters: tuple[Parameter, ...]
    own: np.ndarray
    pairs: tuple[RivalPair, ...] = ()
    not_shown: tuple[str, ...] = ()
    places: Mapping[tuple[str, float | None], np.ndarray] = field(default_factory=dict)

    def with_effect(self, entry: Effect, inner: float | None) -> "tuple[QuestionSet, np.ndarray]":
        """Return with an entry's columns, each effect's once, and their positions."""
        key = (entry.name, inner)
        if key in self.places:
            return self, self.places[key]
        parameters = (*self.parameters, *entry.make(inner))
        where = np.arange(len(self.parameters), len(parameters))
        return replace(self, parameters=parameters, places={**self.places, key: where}), where

    def with_pair(self, pair: RivalPair) -> "QuestionSet":
        """Return with one more pair."""
        return replace(self, pairs=(*self.pairs, pair))

    def with_rival(self, question: DiscriminationQuestion, entry: Effect, inner: float | None) -> "QuestionSet":
        """Return with the question whether readings of a question's truth would be taken for another entry."""
        more, where = self.with_effect(entry, inner)
        return more.with_pair(RivalPair(question.truth, entry.name, (replace(question, rival=where),), False))


def pose_questions(
    sight: PredictedReadings, entries: Mapping[str, Effect], identified: IdentificationResult
) -> QuestionSet:
    """Return the questions for an identification's findings and their rivals."""
    few = sight.thin()
    asked = QuestionSet(sight.model.parameters, np.arange(len(sight.model.parameters)))
    known = [(f, entries[f.name]) for f in identified.found if f.name in entries]
    places = []
    for found, entry in known:
        asked, where = asked.with_effect(entry, found.inner)
        places.append(where)
    for k, (found, entry) in enumerate(known):
        values = found_values(found, entry.make(found.inner), identified.values)
        others = [p for j, p in enumerate(places) if j != k]
        for name in (r for r in found.rivals if r in entries):
            rival = entries[name]
            base = np.concatenate([_own_columns_without(asked, entry, rival), *others])
            taken = orthonormal_span(flatten_rows(few.rows([asked.parameters[i] for i in base])))
            signal = project_out(flatten_rows(few.rows(entry.make(found.inner))) @ values[:, None], taken)[:, 0]
            inner = best_matching_inner(few, rival, signal, taken)
            matching = _match_signal(project_out(flatten_rows(few.rows(rival.make(inner))), taken), signal)
            asked, there = asked.with_effect(rival, inner)
            here = places[k]
            either = (
                DiscriminationQuestion(found.label, here, values, base, there),
                DiscriminationQuestion(name, there, matching, base, here),
            )
            asked = asked.with_pair(RivalPair(found.label, name, either))
    return replace(asked, not_shown=tuple(s for f in identified.found for s in _explain_unseen(f, entries)))


def _own_columns_without(asked: QuestionSet, *entries: Effect) -> np.ndarray:
    """The plan's own columns, less those that are an entry's themselves: joint compliances may be among them."""
    made = {p.moves for e in entries if e.nonlinear is None for p in e.make(None)}
    return np.array([k for k in asked.own if asked.parameters[k].moves not in made], dtype=int)


def _match_signal(columns: Array, signal: Array) -> Array:
    """Values of a rival's parameters (k,) that look most like the signal and show as much as it does."""
    values = np.linalg.lstsq(columns, signal, rcond=1e-6)[0]
    shown = float(np.linalg.norm(columns @ values))
    if shown <= 1e-6 * float(np.linalg.norm(signal)):  # nothing in common: any direction will do, of the signal's size
        values = np.ones(columns.shape[1])
        shown = float(np.linalg.norm(columns @ values))
    return np.asarray(values * (float(np.linalg.norm(signal)) / max(shown, 1e-300)))


def _explain_unseen(found: IdentifiedEffect, entries: Mapping[str, Effect]) -> Iterator[str]:
    """Say of each rival that a plan's readings do not show one of the two at all."""
    for rival in found.rivals:
        missing = [name for name in (found.name, rival) if name not in entries]
        if missing:
            needs = dict.fromkeys(needs_of(effect_kind(name)) for name in missing)
            what = f"{found.label} and {rival}: a run of this plan does not show {' and '.join(missing)}"
            yield f"{what}; that needs {' and '.join(needs)}"
