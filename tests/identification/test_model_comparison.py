"""What competes for a finding's place: probabilities against a normal density, distances against a projection."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from planner.effects.catalogue import check_effect_name
from planner.effects.drift_shapes import IN_TIME
from planner.inference.comparison_columns import Block, ComparisonColumns
from planner.inference.joint_inclusion import JointInclusion
from planner.inference.model_comparison import (
    NOTHING,
    OWN_NAME,
    PLAUSIBLE,
    TOLD_APART,
    ConditionalProducts,
    DrawComparison,
    average_standing,
)
from planner.inference.posterior_background import OF_BACKGROUND, UNNAMED, cause_of_family
from planner.model.linear_gaussian import LinearGaussian

M = 80
ODDS = float(np.log(0.02))


def block(name, first, count=1, factors=(1.0,)):
    weight = np.full(len(factors), 1 / len(factors))
    return Block(name, np.arange(first, first + count), np.array(factors), ODDS + np.log(weight))


def products(columns, y):
    white = np.column_stack([columns, y])
    return white.T @ white


def log_odds(columns, y, state):
    """Logarithm of a state's probability over that of the one in which nothing acts."""
    prior = np.zeros(columns.shape[1])
    for own, size in state:
        prior[own.columns] = size
    evidence = [LinearGaussian(columns, s, np.ones(len(y))).log_evidence(y) for s in (prior, 0 * prior)]
    return sum(own.log_odds(size) for own, size in state) + evidence[0] - evidence[1]


def compared(own, others=(), unnamed=()):
    return ComparisonColumns(None, None, None, None, 1.0, {}, (own,), (tuple(others),), tuple(unnamed))


def test_log_odds_are_those_of_the_normal_density():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(M, 5))
    y = columns @ [2.0, 0, 0, 1.0, 0] + rng.normal(size=M)
    a, b = block("a, joint 1", 0, 2, (0.5, 2.0)), block("b, joint 2", 3, 2, (0.5, 2.0))
    draws_compared = DrawComparison(compared(a), products(columns, y), ())
    covariance = np.eye(M) + 4 * columns[:, :2] @ columns[:, :2].T + 0.25 * columns[:, 3:] @ columns[:, 3:].T
    likelihood = [multivariate_normal(np.zeros(M), C).logpdf(y) for C in (covariance, np.eye(M))]
    expected = likelihood[0] - likelihood[1] + 2 * (ODDS + np.log(0.5))
    assert log_odds(columns, y, [(a, 2.0), (b, 0.5)]) == pytest.approx(expected, abs=1e-8)
    # beside the one, the other's gain with each factor is the difference of two states
    gains = ConditionalProducts.of(draws_compared.gram, [(a, 2.0)]).gains(b)
    differences = [log_odds(columns, y, [(a, 2.0), (b, s)]) - log_odds(columns, y, [(a, 2.0)]) for s in b.factors]
    np.testing.assert_allclose(gains, differences, atol=1e-8)


def test_distance_of_two_causes_is_that_of_a_projection():
    """δ by least squares on columns of what acts beside, each with its prior as a row below."""
    rng = np.random.default_rng(1)
    columns, values = rng.normal(size=(M, 6)), np.array([1.5, -0.5])
    own, other, held = block("a, joint 1", 0, 2), block("b, joint 2", 2, 2), block("c, joint 3", 4, 2)
    beside = ConditionalProducts.of(products(columns, np.zeros(M)), [(held, 2.0)])
    wide = np.vstack([columns[:, 2:], np.diag([1 / PLAUSIBLE] * 2 + [1 / 2.0] * 2)])
    target = np.append(columns[:, :2] @ values, np.zeros(4))
    left = target - wide @ np.linalg.lstsq(wide, target, rcond=None)[0]
    assert beside.distance_squares(own, values, [other]) == pytest.approx([left @ left], rel=1e-9)


def test_what_acts_beside_without_some_causes_is_what_the_others_are_by_themselves():
    """Causes taken out of what all take up, against the products that the others alone leave."""
    rng = np.random.default_rng(9)
    columns, y = rng.normal(size=(M, 12)), rng.normal(size=M)
    columns[:, 3:5] *= 1e3
    gram = products(columns, y)
    parts = [(block("a, joint 1", 0, 3), 0.5), (block("b, joint 2", 3, 2), 2.0), (block("c, joint 3", 5, 4), 1.5)]
    fit, every = JointInclusion.of(gram, parts), ConditionalProducts.of(gram, parts)
    for gone in ((), (0,), (1,), (2,), (0, 2), (0, 1, 2)):
        alone = ConditionalProducts.of(gram, [part for k, part in enumerate(parts) if k not in gone])
        found, own = every.without(fit, gone), np.arange(13)
        np.testing.assert_allclose(found.products(own, own), alone.products(own, own), rtol=1e-7, atol=1e-7)
        other, b = block("d, joint 4", 9), np.ones(2)
        mine = block("e, joint 5", 10, 2)
        expected = alone.distance_squares(mine, b, [other])
        assert found.distance_squares(mine, b, [other]) == pytest.approx(expected, rel=1e-8)
        np.testing.assert_allclose(found.gains(other), alone.gains(other), rtol=1e-8)


@pytest.mark.parametrize(("angle", "shared"), [(0.02, True), (1.2, False)])
def test_two_causes_share_a_place_where_their_columns_are_nearly_one(angle, shared):
    """What is at a small angle to the truth takes half of its place; what is at a large one, nothing."""
    rng = np.random.default_rng(2)
    basis = np.linalg.qr(rng.normal(size=(M, 2)))[0] * np.sqrt(M)
    columns = np.column_stack([basis[:, 0], np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 1]])
    half = []
    for _ in range(40):
        y = columns[:, 0] + rng.normal(size=M)
        own, other = block("a, joint 1", 0), block("b, joint 2", 1)
        draws_compared = DrawComparison(compared(own, [other]), products(columns, y), ((own, 1.0),))
        half.append(average_standing([draws_compared.weigh(0)]))
    mean = np.mean([s.probability for s in half])
    assert (0.35 < mean < 0.65) if shared else mean > 0.99
    assert all([r.name for r in s.rivals] == (["b, joint 2"] if shared else []) for s in half)


def test_one_law_under_two_names_shares_the_place_by_how_usual_the_names_are():
    """Sine and cosine, and the same two turned and stretched: what both say together is what the first said alone."""
    rng, odds = np.random.default_rng(7), 0.25
    law = rng.normal(size=(M, 2))
    near = law + 0.1 * rng.normal(size=(M, 2))
    columns = np.column_stack([law, law @ [[0.6, -0.8], [1.6, 1.2]], near, law[:, :1]])
    y = law @ [0.9, 0.3] + rng.normal(size=M)
    own, alone = block("a, joint 2", 0, 2), block("c, joint 3", 4, 2)
    same, other, part = (
        Block(name, np.arange(k, k + n), np.ones(1), np.log([odds]))
        for name, k, n in (("b, joint 2", 2, 2), ("d, joint 3", 4, 2), ("e, joint 2", 6, 1))
    )
    before = compared(own, [alone])
    one, many = (
        average_standing([DrawComparison(replace(before, same_law=s), products(columns, y), ((own, 1.0),)).weigh(0)])
        for s in ((), (same, part))
    )
    shared = {r.name: r.probability for r in many.rivals}
    assert many.probability == pytest.approx(one.probability / (1 + odds))
    assert shared["b, joint 2"] == pytest.approx(one.probability * odds / (1 + odds))
    assert "e, joint 2" not in shared  # a part of the law is another law
    # where a rival has the law, it is the rival's place that is shared
    weights = DrawComparison(replace(before, same_law=(other,)), products(columns, y), ((own, 1.0),)).weigh(0)
    assert weights.logs["d, joint 3"] - weights.logs["c, joint 3"] == pytest.approx(np.log(odds))
    assert average_standing([weights]).probability == pytest.approx(one.probability)


def test_poses_that_cannot_tell_make_a_rival_though_the_readings_spoke_by_luck():
    """At δ = 4 the readings decide in most runs, but not in 95 of 100: the other one is named in all of them."""
    rng, named, told = np.random.default_rng(3), 0, 0
    basis = np.linalg.qr(rng.normal(size=(M, 2)))[0]
    size, delta = 10.0, 4.0
    assert delta < TOLD_APART
    across = delta / size
    columns = size * np.column_stack([basis[:, 0], np.sqrt(1 - across**2) * basis[:, 0] + across * basis[:, 1]])
    own, other = block("a, joint 1", 0), block("b, joint 2", 1)
    for _ in range(100):
        y = columns[:, 0] + rng.normal(size=M)
        weights = DrawComparison(compared(own, [other]), products(columns, y), ((own, 1.0),)).weigh(0)
        rivals = {r.name: r.probability for r in average_standing([weights]).rivals}
        named += "b, joint 2" in rivals
        told += rivals.get("b, joint 2", 0.0) < 0.01
    assert named > 95
    assert told > 50


def test_all_are_named_that_poses_cannot_tell_however_many_they_are():
    """Twelve waves at δ = 3 from the truth, each in a direction of its own."""
    rng, size, across = np.random.default_rng(8), 10.0, 0.3
    basis = size * np.linalg.qr(rng.normal(size=(M, 13)))[0]
    columns = np.column_stack([basis[:, 0], np.sqrt(1 - across**2) * basis[:, [0]] + across * basis[:, 1:]])
    others = [block(f"b{k}, joint 2", 1 + k) for k in range(12)]
    y = columns[:, 0] + rng.normal(size=M)
    own = block("a, joint 1", 0)
    weights = DrawComparison(compared(own, others), products(columns, y), ((own, 1.0),)).weigh(0)
    assert {r.name for r in average_standing([weights]).rivals} == {b.name for b in others}


def test_one_cause_without_a_name_takes_the_place_of_three_with_one():
    """Three waves of one bearing, each sure alone, of which a single law of two numbers says the same."""
    rng = np.random.default_rng(4)
    waves = np.linalg.qr(rng.normal(size=(M, 3)))[0] * np.sqrt(M)
    law = waves @ [0.6, 0.5, 0.4]
    columns = np.column_stack([waves, law])
    y = law + 0.3 * rng.normal(size=M)
    each = [block(f"axis wobble {k} a turn, joint 4", j) for j, k in enumerate(("once", "twice", "three times"))]
    unnamed = block("unnamed, axis of joint 4 by its own angle", 3)
    found = tuple((b, 1.0) for b in each)
    weights = DrawComparison(compared(each[0], (), [unnamed]), products(columns / 0.3, y / 0.3), found).weigh(0)
    standing = average_standing([weights])
    assert standing.probability < 0.05
    assert standing.rivals[0].name == unnamed.name
    assert weights.logs[NOTHING] < -50 < weights.logs[OWN_NAME]


def test_where_it_was_drawn_beside_what_is_needless_a_finding_does_not_lose_by_that():
    rng = np.random.default_rng(5)
    columns = np.linalg.qr(rng.normal(size=(M, 7)))[0] * np.sqrt(M)
    own, other = block("a, joint 1", 0), block("b, joint 1", 1)
    idle = tuple((block(f"c{k}, joint 2", 2 + k), 1.0) for k in range(5))
    y = columns[:, 0] + rng.normal(size=M)
    gram = products(columns, y - columns[:, 2:] @ (columns[:, 2:].T @ y) / M)
    alone, beside = (DrawComparison(compared(own, [other]), gram, (*more, (own, 1.0))).weigh(0) for more in ((), idle))
    assert alone.logs == pytest.approx(beside.logs)


@pytest.mark.parametrize("where", ["part 3", "lengths", "base", "gauge"])
def test_what_moves_in_time_without_a_name_is_a_rival_wherever_it_does(where):
    name = cause_of_family(f"{UNNAMED}, {where} {IN_TIME}{OF_BACKGROUND}")
    assert name == f"unnamed, {where.replace('part', 'joint')} by time"
    check_effect_name(name, 6, "here")  # as who reads the document does


def test_causes_that_come_and_go_leave_the_fit_that_others_have_by_themselves():
    rng = np.random.default_rng(6)
    columns, y = rng.normal(size=(M, 7)), rng.normal(size=M)
    gram = products(columns, y)
    parts = [(block("a, joint 1", 0, 2), 0.5), (block("b, joint 2", 2, 3), 2.0), (block("c, joint 3", 5, 2), 1.5)]
    grown = JointInclusion.of(gram, parts[:1]).add_cause(gram, parts[1]).add_cause(gram, parts[2])
    for k in (None, 0, 1, 2):
        changed = grown if k is None else grown.remove_cause(k)
        state = changed.settle()
        alone = JointInclusion.of(gram, [p for j, p in enumerate(parts) if j != k])
        assert state.parts == alone.parts
        np.testing.assert_allclose(state.covariance, alone.covariance, atol=1e-12)
        np.testing.assert_allclose(state.mean, alone.mean, atol=1e-12)
        assert state.log_odds == pytest.approx(log_odds(columns, y, state.parts), abs=1e-10)
        gone = [log_odds(columns, y, [q for q in state.parts if q is not p]) for p in state.parts]
        np.testing.assert_allclose(state.conditional_log_odds(), state.log_odds - np.array(gone), atol=1e-10)
        odds = changed.conditional_log_odds()
        np.testing.assert_allclose(odds[changed.stays], state.conditional_log_odds(), atol=1e-10)
        assert k is None or odds[k] == np.inf


def test_what_is_needless_beside_a_finding_goes_as_if_it_were_looked_at_alone():
    """Several findings of one draw share what was looked at; each comes out as from products of its own."""
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(M, 16))
    columns[:, 9] = columns[:, 1] + 0.1 * columns[:, 9]  # one that is nearly the first finding
    y = columns @ np.where(np.arange(16) < 4, 1.0, 0.0) + rng.normal(size=M)
    gram = products(columns, y)
    findings = [block(f"found, joint {k}", 2 * k, 2, (0.5, 1.0)) for k in range(3)]
    idle = [block(f"idle, joint {k}", k) for k in range(6, 16)]
    every = ComparisonColumns(None, None, None, None, 1.0, {}, tuple(findings), ((),) * 3, ())
    present = (*((f, 0.5) for f in findings[:2]), *((b, 1.0) for b in idle))  # the last finding was not drawn
    together = DrawComparison(every, gram, present)
    needless = 0
    for own in findings:
        state = together._fit_around(own)
        held = [part for part in present if part[0] is not own]
        alone = JointInclusion.of(gram, [*held, (own, state.parts[-1][1])]).prune().settle()
        assert {b.name for b, _ in state.parts} == {b.name for b, _ in alone.parts}
        assert state.parts[-1][0].name == own.name
        assert state.log_odds == pytest.approx(alone.log_odds, abs=1e-8)
        needless += len(present) - len(state.parts)
    assert needless > 10
