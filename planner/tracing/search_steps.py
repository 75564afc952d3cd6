"""Steps of the search: candidates are refitted side by side, or take the place of an effect, and the likeliest model
is kept."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial

from planner.common.errors import NoSolutionError
from planner.identification.stages import FitContext
from planner.tracing.auxiliary_parameters import COMPLIANCE as YIELDING
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.gear_curve import GEAR_CURVE_KIND as CURVE
from planner.tracing.gear_curve import effects_beside_curve, likeliest_curve
from planner.tracing.ranking import CandidateEffect, rank_candidates
from planner.tracing.rivals import without_effect
from planner.tracing.score_test import ScoreTest, refine_value
from planner.tracing.significance import (
    LOG_SIGNIFICANCE,
    held_out_gain,
    rejection_reason,
    screening_correlation_time,
    wald_log_p,
)
from planner.tracing.state import REPEATABLE_KINDS, FittedEffect, SearchState, base_kind, number_repeat, refit

RETRY_RATIO = 1.3  # times more of the residual than when it was refused: an entry is tried again
Progress = Callable[[str], None]


@dataclass
class RejectedEffects:
    """What was refitted and not kept: why, and how much of the residual it explained then."""

    why: dict[str, str] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)

    def note(self, state: SearchState, because: str) -> None:
        """Take note of why a state's last effect was refused."""
        self.why[state.effects[-1].entry.name] = because

    def judged(self, candidates: Sequence[CandidateEffect], scatter: float) -> None:
        """Take note of what refused candidates explain of a sum of squares."""
        self.share.update({c.entry.name: c.gain / scatter for c in candidates})

    def worth(self, candidate: CandidateEffect, scatter: float) -> bool:
        """Tell whether a candidate is worth a refit: a new one, or one that now explains more of what is left."""
        return candidate.gain / scatter > RETRY_RATIO * self.share.get(candidate.entry.name, 0.0)


@dataclass(frozen=True)
class SearchContext:
    """One search.

    Attributes:
        dictionary: entries and inner values that each step looks at.
        bench: run, split and judge.
        say: told of progress.
        refused: so far.
        barred: names that may not come again: they drove out what had brought them in.
    """

    dictionary: EffectDictionary
    bench: FitContext
    say: Progress
    refused: RejectedEffects
    barred: set[str] = field(default_factory=set)

    @property
    def tried(self) -> int:
        """Number of entries and inner values that each step looks at."""
        return len(self.dictionary.items)

    def memory(self, state: SearchState) -> float:
        """How many samples are worth one where effects are screened."""
        return screening_correlation_time(state, self.bench.run.continuous)

    def shade(self, state: SearchState) -> ScoreTest:
        """The space that a state's model spans."""
        return ScoreTest.of(state.fit, self.memory(state))


SIMILAR_GAIN = 0.9  # share of the best gain above which another entry is refitted beside it
PARALLEL_REFITS = 4  # entries that are refitted side by side
THREADS = 2  # refits at a time: they are taken in order, so their number does not show


def best_step(
    hunt: SearchContext, state: SearchState, shade: ScoreTest, likely: list[CandidateEffect]
) -> SearchState | None:
    """Refit the likely entries, alike ones side by side, and return the first kind that holds."""
    doubtful = list[SearchState]()
    while likely:
        near = [c for c in likely if c.gain > SIMILAR_GAIN * likely[0].gain][:PARALLEL_REFITS]
        likely = [c for c in likely if c not in near]
        trials = _refit_candidates(hunt, state, shade, near)
        held = []
        for trial in trials:
            because = rejection_reason(state, trial, hunt.bench, hunt.tried)
            if because is None:
                held.append(trial)
            else:
                hunt.refused.note(trial, because)
        if held:
            worth = hunt.memory(held[0])
            return min(held, key=lambda t: t.evidence(worth))
        hunt.refused.judged(near, shade.scatter)
        doubtful += trials
    return next((s for t in doubtful if (s := _add_pair(hunt, state, t)) is not None), None)


def refit_with(
    hunt: SearchContext,
    state: SearchState,
    shade: ScoreTest,
    candidate: CandidateEffect,
    effects: tuple[FittedEffect, ...],
) -> SearchState:
    """Refit with some effects of a state and a further one."""
    inner = candidate.inner
    if inner is not None:
        inner = refine_value(shade, candidate.entry, inner)
    entry = number_repeat(candidate.entry, effects)
    return refit(hunt.bench, entry.name, state.base, (*effects, FittedEffect(entry, inner)), state)


def _refit_candidates(
    hunt: SearchContext, state: SearchState, shade: ScoreTest, near: list[CandidateEffect]
) -> list[SearchState]:
    """Refit with each of some candidates, and with the whole curve of each joint that is to have one more wave.

    A fit that does not come to rest is left out: what cannot be told from the geometry may run off with it.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        waves = pool.map(lambda c: try_refit(lambda: refit_with(hunt, state, shade, c, state.effects)), near)
        curves = pool.map(
            lambda joint: try_refit(lambda: _refit_with_curve(hunt, state, shade, *joint)),
            _joints_for_curves(hunt, state, near),
        )
        return [s for s in (*waves, *curves) if s is not None]


def try_refit(refit: Callable[[], SearchState]) -> SearchState | None:
    """Refit, ``None`` where the fit does not come to rest."""
    try:
        return refit()
    except NoSolutionError:
        return None


def _joints_for_curves(
    hunt: SearchContext, state: SearchState, near: list[CandidateEffect]
) -> Iterator[tuple[str, tuple[FittedEffect, ...]]]:
    """Joints that are to have one more wave, with the effects that would stay beside their whole curve."""
    seen = {name.removeprefix(f"{CURVE}, ") for name in hunt.barred}
    for c in near:
        kept = effects_beside_curve(state.effects, c.entry)
        if kept is not None and c.entry.on not in seen:
            seen.add(c.entry.on)
            yield c.entry.on, kept


def _refit_with_curve(
    hunt: SearchContext, state: SearchState, shade: ScoreTest, on: str, kept: tuple[FittedEffect, ...]
) -> SearchState:
    for held in state.effects:
        shade = shade if held in kept else without_effect(shade, state, held)
    entry = likeliest_curve(shade, state.base, int(on.split()[-1]) - 1)
    return refit(hunt.bench, entry.name, state.base, (*kept, FittedEffect(entry, None)), state)


def _add_pair(hunt: SearchContext, state: SearchState, trial: SearchState) -> SearchState | None:
    """Add an effect together with a second of its kind at its place, where one alone leaves too much to be sure of it.

    An arm that warms up in two ways leaves, less one of them, a residual so slow that neither would be believed.
    """
    first = trial.effects[-1]
    if base_kind(first.entry.kind) not in REPEATABLE_KINDS or len(trial.effects) == len(state.effects):
        return None
    fall, error = held_out_gain(state, trial, hunt.bench)
    if fall <= error:
        return None
    shade = hunt.shade(trial)
    same = (c for c in rank_candidates(shade, hunt.dictionary, trial.effects) if c.entry.on == first.entry.on)
    second = next((c for c in same if c.entry.kind == base_kind(first.entry.kind) and c.log_p < LOG_SIGNIFICANCE), None)
    if second is None:
        return None
    hunt.say(f"trying {first.entry.name} in two ways")
    both = try_refit(lambda: refit_with(hunt, trial, shade, second, trial.effects))
    if (
        both is None
        or rejection_reason(trial, both, hunt.bench, hunt.tried)
        or wald_log_p(both, both.effects[-2], hunt.tried) > LOG_SIGNIFICANCE
    ):
        return None
    return both


SWAP_EVIDENCE = 4.0  # fall of minus twice the log evidence for which an effect is swapped
# the same for the compliance of a joint: every arm has it, so that it is the likelier cause beforehand
COMPLIANCE_EVIDENCE = 20.0


def swap_effects(hunt: SearchContext, state: SearchState, ahead: float = -SWAP_EVIDENCE) -> SearchState | None:
    """Put another entry in the place of each effect where the run is likelier so; ``None`` if it nowhere is.

    ``ahead`` is by how much its score must be above the effect's own to be tried.
    """
    found = None
    for held in state.effects:
        if held.entry.kind == CURVE:
            continue  # it took the place of the waves that would now be tried for it
        bare = without_effect(hunt.shade(state), state, held)
        rest = tuple(h for h in state.effects if h.entry.name != held.entry.name)
        own = rank_candidates(bare, bare.lay_out([(held.entry, held.inner)]), rest)
        other = next(
            (c for c in rank_candidates(bare, hunt.dictionary, rest)[:2] if c.entry.name != held.entry.name), None
        )
        if other is None or (own and other.score < own[0].score + ahead):
            continue
        hunt.say(f"trying {other.entry.name} for {held.entry.name}")
        trial = try_refit(partial(refit_with, hunt, state, bare, other, rest))
        if trial is None:
            continue
        worth = hunt.memory(state)
        least = COMPLIANCE_EVIDENCE if held.entry.kind == YIELDING else SWAP_EVIDENCE
        likelier = trial.evidence(worth) < state.evidence(worth) - least
        if likelier and wald_log_p(trial, trial.effects[-1], hunt.tried) < LOG_SIGNIFICANCE:
            state = found = trial
    return found
