"""What every step of the search needs: the dictionary, what fits and judges, and what was refused so far."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planner.common.errors import NoSolutionError
from planner.common.progress import StageReport
from planner.common.system import give_back_memory
from planner.effects.compliance import LINK_MASSES
from planner.effects.effect import Effect, Parameter, Role
from planner.effects.steps import SLIP, Steppable
from planner.inference.stages import FitContext
from planner.tracing.assumptions import RETRY_RATIO
from planner.tracing.dictionary import EffectDictionary
from planner.tracing.effect_scores import EffectScore, ScoreTest
from planner.tracing.significance import LOG_SIGNIFICANCE, screening_correlation_time, variance_inflations, wald_log_p
from planner.tracing.state import FittedEffect, SearchState


@dataclass
class RejectedEffects:
    """What was refitted and not kept: why, and how much of the residual it explained then."""

    why: dict[str, str] = field(default_factory=dict)
    share: dict[str, float] = field(default_factory=dict)

    def add_shares(self, candidates: Sequence[EffectScore], scatter: float) -> None:
        """Take note of what refused candidates explain of a sum of squares."""
        self.share.update({c.effect.name: c.gain / scatter for c in candidates})

    def may_try(self, candidate: EffectScore, scatter: float) -> bool:
        """Tell whether a candidate deserves a refit: a new one, or one that now explains more of what is left."""
        return candidate.gain / scatter > RETRY_RATIO * self.share.get(candidate.effect.name, 0.0)


@dataclass(frozen=True)
class SearchContext:
    """One search.

    Attributes:
        effects: of the catalogue.
        dictionary: effects and values that each step looks at.
        fit_context: run, split and judge.
        report: told of progress.
        steppables: what may step at an unknown sample.
        rejected: so far.
        excluded: names that may not come again: they drove out what had brought them in.
    """

    effects: tuple[Effect, ...]
    dictionary: EffectDictionary
    fit_context: FitContext
    report: StageReport
    steppables: tuple[Steppable, ...] = ()
    rejected: RejectedEffects = field(default_factory=RejectedEffects)
    excluded: set[str] = field(default_factory=set)

    _tests: dict[int, tuple[SearchState, ScoreTest]] = field(default_factory=dict)

    @property
    def tried_number(self) -> int:
        """Number of effects and values that each step looks at."""
        return len(self.dictionary.items)

    def score_test(self, state: SearchState) -> ScoreTest:
        """The space that a state's model spans; kept as long as the search looks at the same state."""
        if id(state) not in self._tests:
            self._forget_before(state)
            near = (
                next((test.space for _, test in self._tests.values()), None)
                if self.fit_context.run.continuous
                else None
            )
            self._tests.clear()
            self._tests[id(state)] = state, ScoreTest.of(state.fit, self._correlation_time(state), near)
        return self._tests[id(state)][1]

    def change_test(self, state: SearchState) -> ScoreTest:
        """The test by which changes and wrong rows are looked for, in which all rows count in full."""
        whole = state.fit.count_in_full()
        return self.score_test(state) if whole is state.fit else ScoreTest.of(whole, self._correlation_time(state))

    def _forget_before(self, state: SearchState) -> None:
        """Let go of what states before were linearised about, and of the basis functions of what was tried."""
        for before, _ in self._tests.values():
            before.fit.problem.memory.linear = None
        self.fit_context.forget_values(state.fit.model)
        give_back_memory()

    def score_test_without(self, state: SearchState, found: FittedEffect) -> ScoreTest:
        """The same of the model less one effect; it is not kept: what may step makes it large."""
        return without_effects(self.score_test(state), [found])

    def evidence_fall(self, before: SearchState, after: SearchState, at: SearchState | None = None) -> float:
        """By how much minus twice the logarithm of the likelihood falls, with the correlation time of a state.

        Of the state ``before`` if not stated; see :meth:`SearchState.evidence`.
        """
        time = self._correlation_time(at or before)
        return before.evidence(time) - after.evidence(time)

    def choose_likeliest(self, states: Sequence[SearchState], at: SearchState) -> SearchState:
        """The state under which the run is likeliest, with the correlation time of the state ``at``."""
        time = self._correlation_time(at)
        return min(states, key=lambda s: s.evidence(time))

    def try_refit(self, state: SearchState, effects: tuple[FittedEffect, ...]) -> SearchState | None:
        """Refit with other effects, ``None`` where there are more than asked for or the fit does not come to rest."""
        limits = self.fit_context.limits
        causes = {f.effect.family for f in effects if f.effect.kind != SLIP and limits.counts(f.effect.kind)}
        if limits.most_causes is not None and len(causes) > limits.most_causes:
            return None
        try:
            return state.refit(self.fit_context, effects)
        except NoSolutionError:
            return None

    def settle(self, before: SearchState, state: SearchState, sigmas: float = 1.0) -> SearchState:
        """Let nonlinear values settle that what came since ``before`` has moved; the state as it is if that fails.

        Within so many standard deviations their steps, which are parameters of the fit, stand for them.
        """
        try:
            return state.settle(self.fit_context, before, sigmas)
        except NoSolutionError:
            return state

    def is_significant(self, state: SearchState, found: FittedEffect) -> bool:
        """Tell whether an effect is larger than chance would have it among everything that was tried."""
        return wald_log_p(state, found, self.tried_number) < LOG_SIGNIFICANCE

    def prune(self, state: SearchState) -> SearchState:
        """Take out effects that the later ones made needless, the faintest first."""
        while len(state.effects) > 1:
            factors = variance_inflations(state, state.effects)
            chances = [wald_log_p(state, f, self.tried_number, x) for f, x in zip(state.effects, factors, strict=True)]
            faint = max(range(len(chances)), key=chances.__getitem__)
            if chances[faint] < LOG_SIGNIFICANCE:
                break
            state = state.refit(self.fit_context, state.without(state.effects[faint]))
        return state

    def _correlation_time(self, state: SearchState) -> float:
        return screening_correlation_time(state, self.fit_context.run.continuous)


def without_effects(test: ScoreTest, gone: Sequence[FittedEffect]) -> ScoreTest:
    """Return the fitted model less some effects, nonlinear values and what masses do through them, about the fit."""
    names = {p.name for f in gone for p in f.parameters} | {f.sensitivity_name for f in gone}
    where = {m.index for f in gone if f.has(Role.COMPLIANCE) for p in f.parameters for m in p.moves}
    kept, errors = list[Parameter](), list[float]()
    for p, error in zip(test.model.parameters, test.errors.tolist(), strict=True):
        stays = tuple(m for m in p.moves if p.group != LINK_MASSES or m.index not in where)
        if p.name not in names and stays:
            kept.append(p if len(stays) == len(p.moves) else replace(p, moves=stays))
            errors.append(error)
    return test.with_model(replace(test.model, parameters=tuple(kept)), np.array(errors))
