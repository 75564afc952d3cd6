"""Steps at an unknown sample, and rows that are wrong: scored by cumulative sums of what is already computed.

A step of a thing with whitened columns A, less what the fitted parameters take up (basis Q), explains before sample j

    aᵀ (S − WᵀW)⁻¹ a,   S = Σ Aᵢᵀ Aᵢ,   W = Σ Qᵢᵀ Aᵢ,   a = Σ Aᵢᵀ eᵢ   (sums over i < j, e the residual)

so that all samples are tried in one pass (the score test for a change at an unknown time: Andrews 1993, Econometrica
61(4)). That the best of all samples and things is taken is paid for by Bonferroni's correction and by the rank.
"""

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from planner.common.units import Array
from planner.effects.basis import BasisFunction
from planner.effects.effect import Place
from planner.effects.steps import STEP, AtSample, BeforeSample, Steppable, extend_over_run, wrong_row
from planner.runs.run import Samples
from planner.tracing.assumptions import (
    ALIKE_TRIES,
    FEWEST_SAMPLES,
    LEAST_SLIP,
    RANGE_PROBABILITY,
    SHARE_OF_DRIVE,
    SIMILAR_GAIN_SHARE,
)
from planner.tracing.candidate_ranking import merit_of
from planner.tracing.column_space import row_products
from planner.tracing.dictionary import whiten
from planner.tracing.effect_scores import EffectScore, ScoreTest, order_of, score_gains
from planner.tracing.search_context import SearchContext
from planner.tracing.significance import LOG_SIGNIFICANCE
from planner.tracing.state import FittedEffect, SearchState


def rank_changes(
    test: ScoreTest, steppables: Sequence[Steppable], effects: tuple[FittedEffect, ...], continuous: bool
) -> list[EffectScore]:
    """Return the likeliest steps, each at its best sample, and of poses at rest the row that is worst, if it is wrong.

    Args:
        test: the model that they would join, with all rows counted in full: one that is wrong stands outside.
        steppables: what may step.
        effects: those that the model has already: what stepped at a sample does not step there again.
        continuous: whether the samples follow each other along a path.
    """
    if test.problem.samples.number is None or len(test.problem) < 2 * FEWEST_SAMPLES + 2:
        return []
    taken = {(f.effect.place, change_sample(f)) for f in effects if f.effect.kind == STEP}
    return [*([] if continuous else _worst_row(test)), *best_steps(test, steppables, taken)]


def change_sample(found: FittedEffect) -> int | None:
    """Sample, from 0, before which a step's cause stood otherwise, or of a wrong row; ``None`` of other effects."""
    phi: BasisFunction = found.effect.make(found.value)[0].main_move.phi
    return phi.sample if isinstance(phi, BeforeSample | AtSample) else None


def best_steps(
    test: ScoreTest, steppables: Sequence[Steppable], taken: Set[tuple[Place, int | None]] = frozenset()
) -> Iterator[EffectScore]:
    """Yield the likeliest steps of different things but those at places and samples that are taken.

    Those that a drift explains as well have no chance, and those that one sample alone speaks for.
    """
    free = [
        (columns, s)
        for columns, s in score_steps(test, steppables)
        if (s.effect.place, change_sample(FittedEffect(s.effect))) not in taken
    ]
    best = max((s.gain for _, s in free), default=0.0)
    near = sorted(
        (own for own in free if own[1].gain >= SIMILAR_GAIN_SHARE * best),
        key=lambda own: own[1].place_in_order,
    )
    for columns, score in near[:4]:  # steps that are tried side by side
        sure = score.log_p < LOG_SIGNIFICANCE
        real = sure and _is_sudden(test, columns, score) and _is_borne_by_several(test, columns, score)
        yield replace(score, log_p=0.0) if sure and not real else score


def score_steps(test: ScoreTest, steppables: Sequence[Steppable]) -> Iterator[tuple[Array, EffectScore]]:
    """Yield the columns (n, r, k) of each thing that may step, and its best step, sudden or not."""
    for steppable, columns in zip(steppables, _columns(test, steppables), strict=True):
        yield columns, _best_step(test, steppable, columns, len(steppables))


def step_series(test: ScoreTest, steppables: Sequence[Steppable]) -> list[tuple[EffectScore, ...]]:
    """Return the steps of each thing that steps more than once, those that explain most together first.

    What steps again and again, such as a wire clamped anew each day, looks like anything while only one of its steps
    is in the model: each thing is given all of its steps before the things are compared.
    """
    out = []
    for steppable, columns in zip(steppables, _columns(test, steppables), strict=True):
        steps, left = list[EffectScore](), test
        while len(steps) < 10:  # steps of one thing
            score = _best_step(left, steppable, columns, len(steppables))
            if score.merit < 0 or score.log_p > LOG_SIGNIFICANCE:
                break
            steps.append(score)
            left = _add_columns(left, _stepped_columns(left, columns, score))
        held = tuple(s for s in steps if _is_sudden(_beside_others(test, columns, steps, s), columns, s))
        if len(held) > 1:
            out.append(held)
    return sorted(out, key=lambda steps: order_of(series_merit(test, steps)))


def series_merit(test: ScoreTest, steps: Sequence[EffectScore]) -> float:
    """Return how much several steps together lower −2 log likelihood (noise unknown), less what chance explains."""
    left = max(test.scatter - sum(s.gain for s in steps), 1e-9 * test.scatter)
    costs = sum(s.gain / test.noise - merit_of(test, s) for s in steps)
    return float(test.dof * np.log(test.scatter / left)) - costs


def _add_columns(test: ScoreTest, A: Array) -> ScoreTest:
    """Return the test of a model that has the whitened columns A (n, r, k) as well."""
    U, taken = _split_off_model(test, A)
    beside, dof = np.column_stack([test.beside, U]), max(1.0, test.dof - U.shape[1])
    return replace(test, beside=beside, residual=test.residual - U @ taken, dof=dof)


def _split_off_model(test: ScoreTest, A: Array) -> tuple[Array, Array]:
    """What whitened columns A (n, r, k) reach beyond the model, (m, rank) of unit length, and of the residual, (rank,).

    Both with the prior's rows below them, in which the columns have nothing.
    """
    A = A.reshape(-1, A.shape[2])
    shared = test.products(A)
    # with the prior's rows below, the part of a column that is left has the length of the score's information
    mu, axes = np.linalg.eigh(A.T @ A - shared.T @ shared)
    seen = mu > 1e-9 * max(float(mu[-1]), 1e-300)
    root = axes[:, seen] / np.sqrt(mu[seen])
    return test.remainder(A, shared) @ root, root.T @ (A.T @ test.residual)


def _beside_others(test: ScoreTest, columns: Array, steps: Sequence[EffectScore], own: EffectScore) -> ScoreTest:
    """Return the test with all steps of a series but one in the model."""
    for other in steps:
        test = test if other is own else _add_columns(test, _stepped_columns(test, columns, other))
    return test


def _stepped_columns(test: ScoreTest, columns: Array, score: EffectScore) -> Array:
    """Columns (n, r, k) of the step that was scored."""
    sample = change_sample(FittedEffect(score.effect))
    before = np.asarray(test.problem.samples.number) < sample
    return np.where(before[:, None, None], -columns, 0.0)


def _best_step(test: ScoreTest, steppable: Steppable, columns: Array, count: int) -> EffectScore:
    """Score the step of one of ``count`` steppables, of columns (n, r, k), at the sample at which it explains most."""
    number = np.asarray(test.problem.samples.number)
    information, along, length = _sums_before(test, columns, " ".join(p.name for p in steppable.parameters))
    gain, size = score_gains(information, along, length)
    allowed = _step_positions(test.problem.samples)
    ends = np.intersect1d(allowed, session_ends(test.problem.samples))
    likelier = 2.0 * np.log(_odds_of_end(allowed, ends)) * test.noise * np.isin(allowed, ends)
    j = int(allowed[np.argmax(gain[allowed] + likelier)])
    tries = 2 * len(ends) if j in ends else len(number)
    effect = steppable.step(int(number[j + 1]), -(-tries * count // ALIKE_TRIES))
    return _with_chance(test, EffectScore(effect, None, float(gain[j]), int(size[j]), information[j], along[j]))


def session_ends(samples: Samples) -> np.ndarray:
    """Positions of the last sample of every session but the last."""
    return np.flatnonzero(np.diff(samples.session_numbers) != 0)


def _odds_of_end(allowed: np.ndarray, ends: np.ndarray) -> float:
    """How much likelier a step is at the end of a session than at any other of the allowed positions.

    Between two sessions hours or days pass, and people take things down: all their ends together are as likely as all
    other samples together.
    """
    return max((len(allowed) - len(ends)) / max(len(ends), 1), 1.0)


def _step_positions(samples: Samples) -> np.ndarray:
    """Positions of the last samples before which something may have stepped: with enough of them on either side."""
    n = len(samples)
    fewest = FEWEST_SAMPLES if samples.speed is None else max(FEWEST_SAMPLES, round(SHARE_OF_DRIVE * n))
    return np.arange(fewest, n - fewest + 1) - 1


def _is_borne_by_several(test: ScoreTest, columns: Array, score: EffectScore) -> bool:
    """Tell whether a step holds without the sample of its shorter side that speaks for it most: else that is wrong.

    That sample is left out with all that it does to the fit: it has an error of its own beside the step.
    """
    n, r, _ = columns.shape
    before = np.asarray(test.problem.samples.number) < change_sample(FittedEffect(score.effect))
    shorter = before if before.sum() <= n - before.sum() else ~before
    lone = int(np.argmax(np.where(shorter, (test.residual.reshape(n, r) ** 2).sum(axis=1), -1.0)))
    left_out = np.zeros((n, r, r))
    left_out[lone] = np.eye(r)
    beside, A = _add_columns(test, left_out), _stepped_columns(test, columns, score).reshape(n * r, -1)
    shared, along = beside.products(A), A.T @ beside.residual
    gain, size = score_gains((A.T @ A - shared.T @ shared)[None], along[None], (A**2).sum(axis=0)[None])
    return beside.log_p(float(gain[0]), int(size[0]), score.effect.scanned) < LOG_SIGNIFICANCE


def _is_sudden(test: ScoreTest, columns: Array, score: EffectScore) -> bool:
    """Tell whether a step holds beside a steady drift of the same thing.

    Of poses in a systematic order whatever the model lacks changes slowly over the run, and much of that looks like a
    step.
    """
    log_sudden = float(np.log(1e-3))  # chance of a step beside a drift below which it is sudden
    drift, taken = _split_off_model(test, np.linspace(-1.0, 1.0, len(columns))[:, None, None] * columns)
    count, residual = drift.shape[1], test.residual - drift @ taken
    A = _stepped_columns(test, columns, score).reshape(-1, columns.shape[2])
    shared, along = np.vstack([test.products(A), drift.T @ A]), A.T @ residual
    gain, size = score_gains((A.T @ A - shared.T @ shared)[None], along[None], (A**2).sum(axis=0)[None])
    beside = replace(test, residual=residual, dof=max(1.0, test.dof - count), added=count)
    return beside.log_p(float(gain[0]), int(size[0]), 1.0) < log_sudden


def _columns(test: ScoreTest, steppables: Sequence[Steppable]) -> Iterator[Array]:
    """Yield the whitened columns (n, r, k) of each thing, as they would act all along."""
    white = test.space.step_columns(tuple(p for steppable in steppables for p in steppable.parameters))
    first = 0
    for steppable in steppables:
        yield np.ascontiguousarray(white[:, :, first : first + len(steppable.parameters)])
        first += len(steppable.parameters)


def _sums_before(test: ScoreTest, A: Array, name: str) -> tuple[Array, Array, Array]:
    """Return information (n − 1, k, k), products with the residual and squared lengths (n − 1, k) of a step.

    Of the columns −A (n, r, k) of what has this name, summed over the samples up to 0 … n − 2.
    """
    n, r, _ = A.shape
    length = np.cumsum(np.einsum("nri,nri->ni", A, A), axis=0)[:-1]
    along = -np.cumsum(np.einsum("nri,nr->ni", A, test.residual.reshape(n, r)), axis=0)[:-1]
    return test.information_before(A, name), along, length


def _worst_row(test: ScoreTest) -> list[EffectScore]:
    """Return the row whose reading fits its pose worst, where that is beyond any outlier."""
    n, r = len(test.problem), test.problem.model.width
    e, own = test.residual.reshape(n, r), test.space.own_information + row_products(test.space.combine(test.gone), r)
    gain = np.einsum("nr,nr->n", e, np.linalg.solve(own + 1e-9 * np.eye(r), e[..., None])[..., 0])
    size = np.sqrt(gain / r)
    k = int(np.argmax(gain))
    if size[k] < LEAST_SLIP * np.median(size) / np.sqrt(chdtri(r, 0.5) / r):
        return []
    root = test.problem.whitener.root[k]
    row = int(np.asarray(test.problem.samples.number)[k])
    score = EffectScore(wrong_row(r, row, n), None, float(gain[k]), r, root.T @ own[k] @ root, root.T @ e[k])
    return [_with_chance(test, score)]


def _with_chance(test: ScoreTest, score: EffectScore) -> EffectScore:
    log_p = test.log_p(score.gain, score.size, score.effect.scanned)
    return replace(score, log_p=log_p, merit=merit_of(test, score))


@dataclass(frozen=True)
class StepTime:
    """When something stepped: before sample ``sample``, from 0, surely before one of ``first`` … ``last``."""

    sample: int
    first: int
    last: int


def locate_step(state: SearchState, found: FittedEffect) -> StepTime:
    """Return where a step lies, everything else as fitted: its likeliest sample, and the range that holds it surely.

    With the residual e as if nothing had stepped and what the step adds, s, the misfit of a step before sample j is
    Σ_{i<j} |e + s|² + Σ_{i≥j} |e|². Every sample is as likely beforehand, and an end of a session as all of them.
    """
    problem, errors = state.fit.problem, state.fit.errors
    white = problem.white_columns(errors)
    number = np.asarray(problem.samples.number)
    here = change_sample(found)
    assert here is not None
    shift = _acting_throughout(state, found)
    before = (number < here)[:, None]
    still = np.where(before, white.residual - shift, white.residual)  # as if it had stood always as at the end
    allowed = _step_positions(problem.samples)
    fall = np.cumsum((still**2 - (still + shift) ** 2).sum(axis=1))[allowed]
    scale = max(1.0, float((white.residual**2).mean()))
    ends = np.isin(allowed, session_ends(problem.samples))
    fall = fall + np.where(ends, 2 * scale * np.log(_odds_of_end(allowed, allowed[ends])), 0.0)
    chance = np.exp((fall - fall.max()) / (2 * scale))
    chance /= chance.sum()
    low, high = np.searchsorted(np.cumsum(chance), [(1 - RANGE_PROBABILITY) / 2, (1 + RANGE_PROBABILITY) / 2])
    last = len(fall) - 1
    return StepTime(*(int(number[1 + allowed[min(int(k), last)]]) for k in (np.argmax(fall), low, high)))


def relocate_steps(context: SearchContext, state: SearchState, steppables: Sequence[Steppable]) -> SearchState:
    """Move each step to its likeliest sample with everything else in the model, and refit, until none moves."""
    for _ in range(3):  # rounds
        moved = tuple(_relocate(state, f, steppables) for f in state.effects)
        if [change_sample(f) for f in moved] == [change_sample(f) for f in state.effects]:
            break
        trial = context.try_refit(state, moved)
        if trial is None or context.evidence_fall(state, trial) < 0:
            break
        state = trial
    return state


def _relocate(state: SearchState, found: FittedEffect, steppables: Sequence[Steppable]) -> FittedEffect:
    if found.effect.kind != STEP:
        return found
    steppable = next(t for t in steppables if t.place == found.effect.place)
    effect = steppable.step(locate_step(state, found).sample, found.effect.scanned)
    return replace(found, effect=replace(effect, repeat=found.effect.repeat))


def _acting_throughout(state: SearchState, found: FittedEffect) -> Array:
    """Whitened change (n, r) that a step, as fitted, would make in every sample."""
    problem, own = state.fit.problem, state.positions(found)
    parameters = tuple(extend_over_run(state.fit.model.parameters[k]) for k in own)
    model = replace(state.fit.model.fix_at(state.fit.errors), parameters=parameters)
    rows = whiten(problem, model.linearize_in(problem.context, None).rows)
    return np.asarray(rows @ state.fit.errors[own])
