"""The certified bound over the whole candidate set: relax, price in the poses whose dual is violated, verify.

The relaxation is solved on a few hundred active candidates; its dual is evaluated over all of them, those that
violate it most come in, and so on until bound and relaxation meet (column generation).
"""

from dataclasses import dataclass, replace

import numpy as np

from planner.common.determinism import Positions, on_one_thread, round_significant
from planner.common.errors import InputError
from planner.common.units import Array, read_only
from planner.design.observability.information import INDEX_RULES, find_rule, index_value
from planner.design.selection.certificate import Certificate, Dual, frozen_dual, smallest_ratio, verify_dual
from planner.design.selection.interior_point import solve_interior_point
from planner.design.selection.relaxation import RelaxationProblem, interior_start, quadratic_form

_BATCH = 150  # poses priced in a round
_ROUNDS = 40
_CORE = 4_000


@dataclass(frozen=True)
class _State:
    """Active candidates (K,), ascending, and their weights (K,); zero for those that have just come in."""

    active: Positions
    weights: Array


@on_one_thread
def certify_bound(
    rows: Array,
    index: str = "O2",
    poses: int | None = None,
    tolerance: float = 5e-4,
    seed: int = 0,
    near: Certificate | None = None,
) -> Certificate:
    """Return a certificate that no set of ``poses`` distinct candidates beats ``value`` on ``index``.

    ``rows`` (n, r, P) are reduced to identifiable columns; ``poses`` None bounds sets of any size (O1 and O2 only: the
    others grow without end). ``tolerance`` is the relative gap at which pricing stops; the value is proven
    whatever it is. ``near``: a certificate for another number of poses, whose duals tell where to begin.
    Deterministic.

    Raises:
        InputError: unknown index, more poses than candidates, or an index that needs a number of poses.
    """
    find_rule(index)
    if rows.ndim != 3:
        raise InputError(f"candidate rows must have shape (candidates, readings, parameters), not {rows.shape}")
    if poses is None and index not in ("O1", "O2"):
        raise InputError(f"{index} grows with every pose: its bound needs a number of poses")
    if poses is not None and not 1 <= poses <= len(rows):
        raise InputError(f"{poses} poses out of {len(rows)} candidates: choose between 1 and {len(rows)}")
    if index == "O4":
        parts = [certify_bound(rows, part, poses, tolerance, seed, near) for part in ("O3", "O2")]
        return _multiply_bounds(*parts)
    if poses == len(rows):
        return _certify_whole_pool(rows, index)
    state = _initial_state(rows, index, poses, seed, near)
    return _generate_columns(rows, index, poses, tolerance, state, 0.05 if near is None else tolerance)


def check_certificate(certificate: Certificate, rows: Array) -> bool:
    """Verify a certificate again, from its duals alone, over all ``rows``: does ``value`` follow?"""
    if not certificate.duals:
        return certificate.poses == len(rows) and index_value(certificate.index, rows) == certificate.value
    proven = [verify_dual(dual, rows) for dual in certificate.duals]
    value = proven[0] if len(proven) == 1 else proven[0] / proven[1]
    margin = certificate.value * 1e-12
    better = value <= certificate.value + margin, value >= certificate.value - margin
    return bool(np.isfinite(value) and better[0 if INDEX_RULES[certificate.index].maximise else 1])


def _certify_whole_pool(rows: Array, index: str) -> Certificate:
    """There is only one set."""
    value, count = index_value(index, rows), len(rows)
    return Certificate(
        index,
        _describe_size(count),
        value,
        count,
        np.arange(count),
        read_only(np.ones(count)),
        value,
        (),
        True,
        0,
        count,
    )


def _describe_size(poses: int | None) -> str:
    return "any number of poses" if poses is None else f"exactly {poses} poses"


def _multiply_bounds(smallest: Certificate, condition: Certificate) -> Certificate:
    """O4 = O3 / O2."""
    return Certificate(
        "O4",
        smallest.kind,
        smallest.value / condition.value,
        smallest.poses,
        smallest.support,
        smallest.weights,
        smallest.relaxed / condition.relaxed,
        smallest.duals + condition.duals,
        smallest.verified and condition.verified,
        smallest.rounds + condition.rounds,
        smallest.candidates,
    )


def _generate_columns(
    rows: Array, index: str, poses: int | None, tolerance: float, state: _State, accuracy: float
) -> Certificate:
    """Column generation: solve on the active candidates, verify on all, take in what violates the dual."""
    better = INDEX_RULES[index].better
    best: tuple[Dual, float] | None = None
    for turn in range(1, _ROUNDS + 1):
        state, dual = _solve_active(rows, index, poses, state, accuracy)
        value = verify_dual(dual, rows)
        if best is None or better(best[1], value):  # the tightest bound is the one that promises least
            best = dual, value
        relaxed = _relaxed_value(rows, index, poses, state)
        if abs(relaxed / best[1] - 1.0) < tolerance or turn == _ROUNDS:
            break
        grown = _update_active(rows, dual, state)
        settled = np.array_equal(grown.active, state.active)
        accuracy = accuracy / 4 if settled else max(tolerance / 3, accuracy / 4)
        state = grown
    assert best is not None
    return _make_certificate(rows, best[0], best[1], state, relaxed, turn)


def _initial_state(rows: Array, index: str, poses: int | None, seed: int, near: Certificate | None) -> _State:
    """Where to begin: around another certificate's support, or with a seeded sample that sees every parameter."""
    count = min(len(rows), max(300, 10 * rows.shape[2], 2 * (poses or 0)))
    dual = next((d for d in near.duals if d.index == index), None) if near else None
    if near is None or dual is None:
        return _State(np.sort(np.random.default_rng(seed).permutation(len(rows))[:count]), np.ones(count))
    price = round_significant(candidate_prices(rows, dual, np.arange(len(rows))))
    active = np.union1d(np.lexsort((np.arange(len(rows)), price))[:count], near.support)
    weights = np.full(len(active), 0.1 * np.mean(near.weights))
    weights[np.searchsorted(active, near.support)] += near.weights
    return _State(active, weights)


def _solve_active(rows: Array, index: str, poses: int | None, state: _State, accuracy: float) -> tuple[_State, Dual]:
    capped = poses is not None and len(state.active) > poses  # with no row to spare the cap leaves nothing inside it
    problem = RelaxationProblem(index, rows[state.active], poses or 1, capped)
    z, duals = solve_interior_point(problem, interior_start(problem, state.weights), accuracy)
    return _State(state.active, z[: problem.count]), frozen_dual(index, poses, *problem.proof(z, duals))


def _relaxed_value(rows: Array, index: str, poses: int | None, state: _State) -> float:
    """The index at the relaxation's weights, scaled to sum to the number of poses (or to one)."""
    count = poses or 1
    weights = state.weights * (count / np.sum(state.weights))
    active = rows[state.active]
    mass = RelaxationProblem(index, active, count, False).mass(weights)
    mu = np.sqrt(np.maximum(np.linalg.eigvalsh(mass)[::-1], 0.0))
    return float(INDEX_RULES[index].of(mu, count))


def _update_active(rows: Array, dual: Dual, state: _State) -> _State:
    """Bring in the candidates that violate the dual most; let go of the idle ones that are furthest from it."""
    price = candidate_prices(rows, dual, state.active)
    outside = np.ones(len(rows), dtype=bool)
    outside[state.active] = False
    count = dual.poses or 1
    limit = np.partition(price[state.active], count - 1)[count - 1]
    violating = np.flatnonzero(outside & (price < limit))
    order = np.lexsort((violating, round_significant(price[violating])))[:_BATCH]
    room = max(400, 3 * count)
    stay = np.lexsort((state.active, round_significant(price[state.active])))[:room]
    active = np.concatenate([state.active[stay], violating[order]])
    weights = np.concatenate([state.weights[stay], np.zeros(len(order))])
    arranged = np.argsort(active)
    return _State(active[arranged], weights[arranged])


def candidate_prices(rows: Array, dual: Dual, active: Positions) -> Array:
    """Reduced cost of every candidate (lower: more wanted), with the scale of X that fits the active ones."""
    x = quadratic_form(rows, dual.X)
    if dual.index != "O2":
        return -x
    y = quadratic_form(rows, dual.Y)
    ratio, _ = smallest_ratio(x[active], y[active], dual.poses or 1)
    return np.asarray(y - ratio * x)


def price_core(rows: Array, certificate: Certificate, n: int, margin: float = 0.06) -> tuple[Positions, Positions]:
    """Return all candidates by price, best first, and those whose use could cost less than ``margin`` of the bound.

    By complementary slackness a set within a share e of the bound can hold only candidates whose reduced costs sum up
    to e; one alone that takes up ``margin`` / n more than the n-th cheapest is no bargain.
    """
    everything = np.arange(len(rows))
    if not certificate.duals:
        return everything, everything
    dual = certificate.duals[-1]
    price = candidate_prices(rows, dual, everything)
    order = np.lexsort((everything, round_significant(price)))
    scale = np.mean(quadratic_form(rows[order[:n]], dual.Y if dual.index == "O2" else dual.X))
    near = int(np.sum(price <= price[order[n - 1]] + margin * scale))
    count = min(max(near, 150, 2 * n), _CORE)
    return order, np.union1d(order[:count], certificate.support)


def _make_certificate(rows: Array, dual: Dual, value: float, state: _State, relaxed: float, rounds: int) -> Certificate:
    held = state.weights > 1e-4 * np.max(state.weights)
    weights = state.weights[held] * ((dual.poses or 1) / np.sum(state.weights[held]))
    certificate = Certificate(
        index=dual.index,
        kind=_describe_size(dual.poses),
        value=value,
        poses=dual.poses,
        support=state.active[held],
        weights=read_only(weights),
        relaxed=relaxed,
        duals=(dual,),
        verified=False,
        rounds=rounds,
        candidates=len(rows),
    )
    return replace(certificate, verified=check_certificate(certificate, rows))
