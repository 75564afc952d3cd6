"""The questions of a discrimination design: for each finding and rival, what would show if either were the truth."""

from collections.abc import Iterator, Mapping, Sequence
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


def explain_not_shown(finding: str, rival: str, missing: Sequence[str]) -> str:
    """Say that a plan's readings do not show an effect at all."""
    kinds = list(dict.fromkeys(_effect_kind(name) for name in missing))
    needed = " and ".join(dict.fromkeys(needs_of(kind) for kind in kinds))
    what = " and ".join(missing)
    return f"{finding} and {rival}: a run of this plan does not show {what}; that needs {needed}"


def explain_identical(finding: str, rival: str, help_: Sequence[str]) -> str:
    """Say that two effects look alike in every pose, and what would help."""
    return (
        f"{finding} and {rival}: the same in every pose that this cell can measure;"
        f" {_suggest_help(finding, rival, help_)}"
    )


def explain_faint(finding: str, rival: str, poses: int, most: float, needed: int, help_: Sequence[str]) -> str:
    """Say that the difference of two effects is lost in the noise of so few poses, and what would help."""
    return (
        f"{finding} and {rival}: no {poses} poses differ by more than {most:.2g} noise variances; "
        f"about {needed} would be needed (--poses); {_suggest_help(finding, rival, help_)}"
    )


def _suggest_help(finding: str, rival: str, help_: Sequence[str]) -> str:
    if help_:
        return f"what would tell them apart: {'; or '.join(help_)}"
    if {_effect_kind(finding), _effect_kind(rival)} <= {"gauge lag", "servo lag"}:
        return "no other way of measuring would help but a gauge that the controller itself triggers or logs"
    return "another payload or speed, a second fixture or a longer bar would not help either"


def _effect_kind(name: str) -> str:
    return name.split(", ")[0]


@dataclass(frozen=True)
class RivalPair:
    """A truth and what may be taken for it.

    Attributes:
        finding, rival: names.
        named: whether the identification names the rival; else it is one that these poses would bring up.
    """

    finding: str
    rival: str
    named: bool = True


@dataclass(frozen=True)
class QuestionSet:
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
    pairs: tuple[RivalPair, ...] = ()
    questions: tuple[DiscriminationQuestion, ...] = ()
    not_shown: tuple[str, ...] = ()
    places: Mapping[tuple[str, float | None], np.ndarray] = field(default_factory=dict)

    def of(self, entry: Effect, inner: float | None) -> "tuple[QuestionSet, np.ndarray]":
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

    def asking(self, pair: RivalPair, *questions: DiscriminationQuestion) -> "QuestionSet":
        """Return with one more pair."""
        return replace(self, pairs=(*self.pairs, pair), questions=(*self.questions, *questions))

    def guarded(self, question: DiscriminationQuestion, entry: Effect, inner: float | None) -> "QuestionSet":
        """Return with the question whether readings of a question's truth would be taken for another entry."""
        more, where = self.of(entry, inner)
        signal = np.append(question.signal, np.zeros(len(more.parameters) - len(question.signal)))
        new = replace(question, pair=len(self.pairs), signal=signal, rival=where)
        return more.asking(RivalPair(question.truth, entry.name, False), new)


def pose_questions(
    sight: PredictedReadings, entries: Mapping[str, Effect], identified: IdentificationResult
) -> QuestionSet:
    """Return the questions for an identification's findings and their rivals."""
    few = sight.thinned()
    asked = QuestionSet(sight.model.parameters, np.arange(len(sight.model.parameters)))
    known = [(f, entries[f.name]) for f in identified.found if f.name in entries]
    places = []
    for found, entry in known:
        asked, where = asked.of(entry, found.inner)
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
            asked, there = asked.of(rival, inner)
            size, pair = len(asked.parameters), len(asked.pairs)
            asked = asked.asking(
                RivalPair(found.label, name),
                DiscriminationQuestion(pair, found.label, _place_signal(size, places[k], values), base, there),
                DiscriminationQuestion(pair, name, _place_signal(size, there, matching), base, places[k]),
            )
    return replace(asked, not_shown=tuple(s for f in identified.found for s in _explain_unseen(f, entries)))


def _own_columns_without(asked: QuestionSet, *entries: Effect) -> np.ndarray:
    """The plan's own columns, less those that are an entry's themselves: joint compliances may be among them."""
    made = {p.moves for e in entries if e.nonlinear is None for p in e.make(None)}
    return np.array([k for k in asked.own if asked.parameters[k].moves not in made], dtype=int)


def _place_signal(size: int, where: np.ndarray, values: Array) -> Array:
    out = np.zeros(size)
    out[where] = values
    return out


def _match_signal(columns: Array, signal: Array) -> Array:
    """Values of a rival's parameters (k,) that look most like the signal and show as much as it does."""
    values = np.linalg.lstsq(columns, signal, rcond=1e-6)[0]
    shown = float(np.linalg.norm(columns @ values))
    if shown <= 1e-6 * float(np.linalg.norm(signal)):  # nothing in common: any direction will do, of the signal's size
        values = np.ones(columns.shape[1])
        shown = float(np.linalg.norm(columns @ values))
    return np.asarray(values * (float(np.linalg.norm(signal)) / max(shown, 1e-300)))


def _explain_unseen(found: IdentifiedEffect, entries: Mapping[str, Effect]) -> Iterator[str]:
    for rival in found.rivals:
        missing = [name for name in (found.name, rival) if name not in entries]
        if missing:
            yield explain_not_shown(found.label, rival, missing)
