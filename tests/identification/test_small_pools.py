"""How likely a cause is beforehand, as the draws have learnt it, in pools of a few families that may all act."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from planner.fit.assumptions import EXPECTED_CAUSES, PREVALENCE
from planner.inference.comparison_columns import LearntOdds
from planner.inference.posterior_draws import SizePrior
from planner.inference.posterior_fit import COMMON, RARE, UNNAMED

POOLS = (RARE, COMMON, UNNAMED)


def levels(pool):
    return SizePrior(np.array([0.0, 0.5, 1.5]), np.array([0.5, 0.3, 0.2]), pool)


def share_by_integration(acting, counted, pool_size):
    """Mean of the share θ that acts, by Bayes' rule on a grid-free integral: prior Beta(a, a · n / EXPECTED)."""
    a, b = PREVALENCE, PREVALENCE * pool_size / EXPECTED_CAUSES

    def moment(power):
        # θ = sin²(x): the density's poles at 0 and 1 are taken by the substitution
        def density(x):
            theta = np.sin(x) ** 2
            return theta**power * np.sin(x) ** (2 * (a + acting) - 1) * np.cos(x) ** (2 * (b + counted - acting) - 1)

        return quad(density, 0.0, np.pi / 2, limit=200)[0]

    return moment(1) / moment(0)


@st.composite
def records(draw):
    """Pools of 0 to 3 families each (8 of a large one), and what acts in each of a few draws."""
    sizes = {pool: draw(st.sampled_from([0, 1, 2, 3, 8])) for pool in POOLS}
    pool = np.array([0, *(p for p, n in sizes.items() for _ in range(n))])
    count = draw(st.integers(1, 4))
    likely = draw(st.sampled_from([0.0, 0.5, 1.0]))
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    factors = np.where(rng.random((count, len(pool))) < likely, 0.5, 0.0)
    effects = SimpleNamespace(priors=tuple(levels(int(p)) for p in pool))
    return sizes, pool, factors, SimpleNamespace(effects=effects, draws=[SimpleNamespace(factors=f) for f in factors])


@pytest.mark.slow
@given(made=records())
def test_odds_are_those_of_the_mean_share_and_finite_whatever_acts(made):
    sizes, pool, factors, record = made
    odds = LearntOdds.of(record)
    assert set(odds.logs) == {p for p, n in sizes.items() if n}
    for number, log in odds.logs.items():
        n, acting = sizes[number], (factors[:, pool == number] > 0).sum(axis=1)
        share = np.mean([share_by_integration(int(k), n, n) for k in acting])
        assert np.isfinite(log)
        assert log == pytest.approx(np.log(share / (1 - share)), abs=1e-5)
    for number in POOLS:
        assert np.isfinite(odds.of_pool(number))


@pytest.mark.parametrize("others", [0, 1, 2, 9])
@pytest.mark.parametrize("pool", POOLS)
def test_prior_of_a_family_beside_any_number_of_others_is_a_probability(pool, others):
    for acting in range(others + 1):
        chance = np.exp(levels(pool).logs(acting, others))
        assert np.isfinite(levels(pool).logs(acting, others)).all()
        assert chance.sum() == pytest.approx(1.0)
        assert 1 - chance[0] == pytest.approx(share_by_integration(acting, others, others + 1), abs=1e-6)


def test_more_cannot_act_than_there_are():
    with pytest.raises(ValueError, match="3 of 2 families cannot act"):
        levels(RARE).logs(3, 2)
