"""Drawn sizes of random effects against enumeration, dense covariances and drawn data; the mixture over them."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import cholesky
from scipy.special import betaln
from scipy.stats import multivariate_normal

import planner.inference.posterior_draws as draws
import planner.inference.posterior_fit as mixture_room
from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.effects.catalogue import Excitation
from planner.effects.gauge_shapes import GAUGE_HANGING, GAUGE_SHAPE, BarShape, gauge_shapes
from planner.fit.assumptions import EXPECTED_CAUSES, PREVALENCE
from planner.inference.family_gains import FamilyGains, padded_width
from planner.inference.posterior_background import OF_BACKGROUND, background_families
from planner.inference.posterior_draws import RandomEffects, SizeDraw, SizePrior, draw_sizes
from planner.inference.size_mixture import SizeMixture
from planner.model.model import Model
from planner.runs.run import Samples
from tests.independent_arms.runs import CELLS, bar_poses

LEVELS = SizePrior(np.array([0.0, 0.5, 1.5]), np.array([0.6, 0.3, 0.1]))


def model_of(y_scale=1.0, m=20, p=9, fixed_noise=True):
    """Two families and one wide column of known size; noise of two components."""
    rng = np.random.default_rng(2)
    family = np.append(np.arange(p - 1) % 2, -1)
    columns = rng.normal(size=(m, p)) * np.where(family < 0, 1e4, 0.4)
    noise = np.stack([np.ones(m), rng.uniform(0.0, 4.0, m)], axis=1)
    y = rng.normal(size=m) * y_scale + columns[:, family == 0].sum(axis=1)
    return RandomEffects(columns, y, family, noise, (LEVELS, LEVELS), (1e12 if fixed_noise else 1.0) * np.eye(2))


def density(model, factors, logs):
    """Log density of the readings under their dense covariance."""
    size = model.sizes(np.array(factors))
    covariance = np.diag(model.variance(logs)) + (model.columns * size**2) @ model.columns.T
    return multivariate_normal(np.zeros(len(model.y)), covariance).logpdf(model.y)


@pytest.mark.slow
@pytest.mark.parametrize(("m", "p"), [(20, 9), (6, 13)])
def test_what_the_noise_may_be_is_drawn_as_the_dense_covariance_says(m, p):
    """Its mean is D C⁻¹ y and its covariance D − D C⁻¹ D, with D the noise and C the covariance of the readings."""
    model, logs, factors = model_of(m=m, p=p), np.array([0.2, -0.3]), np.array([0.5, 0.0])
    X, D = model.columns * model.sizes(factors), np.diag(model.variance(logs))
    inverse, rng = np.linalg.inv(D + X @ X.T), np.random.default_rng(0)
    drawn = np.stack([model.draw_residual(model.at(SizeDraw(factors, logs)), rng) for _ in range(4000)])
    covariance = D - D @ inverse @ D
    unit = np.sqrt(np.diag(covariance))
    assert np.abs((drawn.mean(axis=0) - D @ inverse @ model.y) / unit).max() < 5 / np.sqrt(len(drawn))
    assert np.abs((np.cov(drawn.T) - covariance) / np.outer(unit, unit)).max() < 0.08


@pytest.mark.long
def test_noise_is_drawn_from_its_posterior(monkeypatch):
    """Mean and deviation of both components' logarithms, against a grid of dense densities; sizes are known."""
    monkeypatch.setattr(draws, "NOISE_EVERY", 1)
    monkeypatch.setattr(draws, "KEPT_EVERY", 1)
    model = replace(model_of(fixed_noise=False), priors=(SizePrior(np.array([0.5]), np.ones(1)),) * 2)
    model = replace(
        model, columns=model.columns * np.where(model.family < 0, 1e-2, 1.0)
    )  # so that densities stay exact
    grid = np.linspace(-3.0, 2.5, 34)
    pairs = [np.array(pair) for pair in product(grid, grid)]
    log = np.array([density(model, (0.5, 0.5), pair) - 0.5 * pair @ model.noise_precision @ pair for pair in pairs])
    chance = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
    mean = chance @ np.stack(pairs)
    deviation = np.sqrt(chance @ (np.stack(pairs) - mean) ** 2)
    drawn = np.stack([d.noise_logs for d in draw_sizes(model, SizeDraw(np.full(2, 0.5), np.zeros(2)), sweeps=2400)])
    assert np.abs(drawn.mean(axis=0) - mean).max() < 0.15 * deviation.min()
    assert drawn.std(axis=0) == pytest.approx(deviation, rel=0.15)


@pytest.mark.parametrize("changes", [(), ((1, 1.5),), ((0, 1.5), (1, 0.5), (0, 0.0))])
@pytest.mark.parametrize(("m", "p", "idle"), [(20, 9, 0), (6, 13, 0), (20, 9, 40)], ids=["", "many act", "few act"])
def test_what_is_known_of_the_readings_is_that_of_the_dense_covariance(changes, m, p, idle):
    """At a draw, and after the sizes of families changed one after the other."""
    model, logs = model_of(m=m, p=p), np.array([0.1, -0.2])
    more = np.random.default_rng(5).normal(size=(m, idle))
    family = np.append(model.family, np.repeat(2 + np.arange(idle // 4), 4))
    priors = (LEVELS,) * (2 + idle // 4)
    model = replace(model, columns=np.hstack([model.columns, more]), family=family, priors=priors)
    factors = np.append(0.5, np.zeros(len(priors) - 1))
    known = FamilyGains(model.at(SizeDraw(factors.copy(), logs)), model.places)
    for family, factor in changes:
        known.set_size(family, factor)
        factors[family] = factor
    X = model.columns * model.sizes(factors)
    C = np.diag(model.variance(logs)) + X @ X.T
    own = model.sorted_columns[:, : model.places[-1].stop]
    dense = own.T @ np.linalg.solve(C, own)
    for family, place in enumerate(model.places):
        width = padded_width(place.stop - place.start)
        padded = np.zeros((width, width))
        padded[: place.stop - place.start, : place.stop - place.start] = dense[place, place]
        assert known.grams([family])[0] == pytest.approx(padded, rel=1e-6, abs=1e-7)
    toward = own.T @ np.linalg.solve(C, model.y)
    assert known.toward[: len(toward)] == pytest.approx(toward, rel=1e-6, abs=1e-7)
    more = np.array([0.3, 2.0])
    gains = [density(model, (factors[0], np.sqrt(factors[1] ** 2 + v), *factors[2:]), logs) for v in more]
    assert known.gains([1], more)[0] == pytest.approx(np.array(gains) - density(model, factors, logs), abs=1e-5)


def prior_of(pair, pools):
    """Log probability of two families' factors; in a pool of n by Beta(a, n a / EXPECTED) on how likely they act."""
    own = np.prod([dict(zip(LEVELS.factors, LEVELS.probability, strict=True))[f] for f in pair])
    a, acts, log = PREVALENCE, np.array(pair) > 0, np.log(own)
    for pool in {*pools} - {0}:
        mine = np.array(pools) == pool
        n, count = mine.sum(), (mine & acts).sum()
        known = betaln(a + count, n * a / EXPECTED_CAUSES + n - count) - betaln(a, n * a / EXPECTED_CAUSES)
        log += known - np.log(0.4**count * 0.6 ** (n - count))
    return log


@pytest.mark.slow
@pytest.mark.parametrize(
    "pools",
    [pytest.param((0, 0), marks=pytest.mark.long), pytest.param((1, 1), marks=pytest.mark.long), (1, 2)],
    ids=["alone", "of one pool", "of two pools"],
)
def test_shares_of_the_draws_are_the_probabilities(monkeypatch, pools):
    """All nine pairs of factors, by enumeration; 3000 sweeps."""
    monkeypatch.setattr(draws, "SWEEPS", 3000)
    monkeypatch.setattr(draws, "KEPT_EVERY", 1)
    monkeypatch.setattr(draws, "NOISE_EVERY", 200)
    model = replace(model_of(y_scale=1.7), priors=tuple(replace(LEVELS, pool=p) for p in pools))
    pairs = list(product(LEVELS.factors, LEVELS.factors))
    prior = [prior_of(pair, pools) for pair in pairs]
    log = np.array([density(model, f, np.zeros(2)) + q for f, q in zip(pairs, prior, strict=True)])
    chance = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
    draws_of_sizes = draw_sizes(model, SizeDraw(np.ones(2) * 0.5, np.zeros(2)))
    drawn = [tuple(d.factors) for d in draws_of_sizes]
    acting = [sum(p for pair, p in zip(pairs, chance, strict=True) if pair[k] > 0) for k in (0, 1)]
    assert np.mean([d.acting for d in draws_of_sizes], axis=0) == pytest.approx(acting, abs=0.03)
    share = np.array([drawn.count(f) for f in pairs]) / len(drawn)
    assert (chance > 0.05).sum() >= 3  # else it would say nothing
    assert np.abs(share - chance).max() < 0.04


@pytest.mark.slow
def test_what_acts_is_found_and_what_does_not_is_absent():
    rng = np.random.default_rng(3)
    columns, family = rng.normal(size=(200, 60)), np.repeat([0, 1], 30)
    y = columns[:, :30] @ rng.normal(size=30) * 1.5 + rng.normal(size=200) * 2.0
    model = RandomEffects(columns, y, family, np.ones((200, 1)), (LEVELS, LEVELS), np.eye(1))
    drawn = draw_sizes(model, SizeDraw(np.zeros(2), np.zeros(1)))
    assert np.mean([d.factors[0] == 1.5 for d in drawn]) > 0.9
    assert np.mean([d.factors[1] > 0 for d in drawn]) < 0.2
    assert np.mean([d.noise_logs[0] for d in drawn]) == pytest.approx(np.log(2.0), abs=0.15)


def test_mean_covariance_and_draws_are_those_of_the_mixture(monkeypatch):
    """Against draws of the parameters themselves: two sizes, once with another noise, the third absent in one."""
    rng = np.random.default_rng(4)
    rows, y, z = rng.normal(size=(15, 3)), rng.normal(size=15), rng.normal(size=3)
    gram = np.column_stack([rows, y - rows @ z]).T @ np.column_stack([rows, y - rows @ z])
    mixture = SizeMixture(np.array([[1.0, 0.5, 2.0], [2.0, 1.0, 0.0]]), np.array([1.0, 4.0]))
    means, seconds = [], []
    for size, ease in zip(mixture.size, mixture.ease, strict=True):
        X = rows * size
        C = np.linalg.inv(X.T @ X / ease + np.eye(3)) * np.outer(size, size)
        means.append(C @ rows.T @ y / ease)
        seconds.append(C + np.outer(means[-1], means[-1]))
    mean = np.mean(means, axis=0)
    assert np.allclose(mixture.mean(gram, z), mean)
    R = mixture.moments(gram, z).information_root
    assert np.allclose(mixture.moments(gram, z).mean, mean)
    assert np.allclose(R, np.triu(R))
    covariance = np.mean(seconds, axis=0) - np.outer(mean, mean)
    assert np.allclose(np.linalg.inv(R.T @ R), covariance)
    drawn = mixture.moments(gram, z, each=20_000).drawn
    assert np.allclose(drawn.mean(axis=1), mean, atol=0.02)
    assert np.allclose(np.cov(drawn), covariance, atol=0.03 * covariance.max())
    assert np.all(np.isfinite(cholesky(R.T @ R)))


def test_noise_twice_as_large_puts_the_mean_off_by_its_own_part_twice():
    """Against estimates of truths drawn from the prior, whose readings are noisier than was counted with."""
    rng = np.random.default_rng(5)
    rows, size, ease = rng.normal(size=(6, 4)) * [3.0, 1.0, 0.3, 0.0], np.array([2.0, 1.0, 0.5, 1.0]), 1.5
    gain = np.diag(size**2) @ rows.T @ np.linalg.inv(rows @ np.diag(size**2) @ rows.T + ease * np.eye(6))
    truth = size[:, None] * rng.normal(size=(4, 40_000))
    readings = rows @ truth + 2 * np.sqrt(ease) * rng.normal(size=(6, 40_000))
    expected = np.cov(truth - gain @ readings)
    y = readings[:, 0]
    gram = np.column_stack([rows, y]).T @ np.column_stack([rows, y])
    found = SizeMixture(size[None], np.array([ease])).moments(gram, np.zeros(4), each=40_000)
    off = found.drawn - found.mean[:, None] + found.of_noise
    assert np.allclose(np.cov(off), expected, atol=0.05)
    covariance = np.linalg.inv(found.information_root.T @ found.information_root)
    assert np.allclose(covariance + 3 * found.noise_root @ found.noise_root.T, expected, atol=0.05)
    assert np.allclose(found.of_noise[3], 0.0)  # of which no reading tells
    assert covariance[3, 3] == pytest.approx(1.0)


@pytest.mark.long
@pytest.mark.parametrize("readings", [40, 120])
def test_truths_drawn_from_the_prior_are_as_far_off_as_is_stated(readings):
    """How far truth is off the mean among how far the draws are: even (Talts et al. 2018, arXiv:1804.06788).

    Families by twos explain nearly the same, so that each must give way to the other.
    """
    rng, pairs, truths = np.random.default_rng(4), 12, 150
    slab = mixture_room._spike_and_slab(mixture_room.SLAB, mixture_room.SLAB_WEIGHT, 0.5, pool=1)
    half = rng.normal(size=(readings, pairs, 2))
    columns = np.stack([half, half + 0.3 * rng.normal(size=half.shape)], axis=2).reshape(readings, -1)
    columns = np.column_stack([columns, 30 * rng.normal(size=(readings, 20))])
    family = np.append(np.repeat(np.arange(2 * pairs), 2), np.full(20, -1))
    tool = rng.normal(size=(60, len(family)))
    places = []
    for _ in range(truths):
        share = rng.beta(PREVALENCE, PREVALENCE * 2 * pairs / EXPECTED_CAUSES)
        acts = rng.random(2 * pairs) < share
        factors = acts * rng.choice(
            slab.factors[1:], p=slab.probability[1:] / slab.probability[1:].sum(), size=len(acts)
        )
        z = np.append(factors, 1.0)[family] * rng.standard_normal(len(family))
        noise = np.exp(0.7 * rng.standard_normal())
        y = columns @ z + noise * rng.standard_normal(readings)
        model = RandomEffects(columns, y, family, np.ones((readings, 1)), (slab,) * len(acts), np.eye(1) / 0.7**2)
        drawn = draw_sizes(model, SizeDraw(np.zeros(len(acts)), np.zeros(1)))
        variance = np.array([model.variance(d.noise_logs)[0] for d in drawn])
        size = np.append(np.stack([d.factors for d in drawn]), np.ones((len(drawn), 1)), axis=1)[:, family]
        rows = np.column_stack([columns, y]) / np.sqrt(variance.mean())
        mixture = SizeMixture(size, variance / variance.mean())
        errors = tool @ mixture.moments(rows.T @ rows, np.zeros(len(family))).drawn
        off = np.linalg.norm(errors - errors.mean(axis=1, keepdims=True), axis=0)
        places.append((off < np.linalg.norm(tool @ z - errors.mean(axis=1))).mean())
    assert abs(np.mean(places) - 0.5) < 3.5 / np.sqrt(12 * truths)
    assert np.mean(np.array(places) > 0.95) < 0.05 + 3.5 * np.sqrt(0.05 * 0.95 / truths)


@pytest.mark.parametrize(("gauge", "least"), [("bar", 0.1), ("tracker", 0.0)])
def test_a_gauge_of_lengths_always_errs_somewhat(gauge, least):
    """How much, the run says; of a line of sight it may be nothing."""
    setup = setup_of(load_cell(str(CELLS[gauge]), planning=False))
    q = bar_poses()[:40]
    background = background_families(setup, Samples(q, np.zeros(len(q), dtype=int)))
    whole = Model.of(setup, frozenset())
    families = mixture_room._Families.of(whole.subset([]), whole, background)
    priors = dict(zip(families.names, families.priors, strict=True))
    prior = priors[f"{GAUGE_SHAPE}{OF_BACKGROUND}"]
    assert prior.factors[0] == least
    assert prior.probability.sum() == pytest.approx(1.0)
    assert (f"{GAUGE_HANGING}{OF_BACKGROUND}" in priors) == (gauge == "bar")


def arm_beside_a_bar_that_hangs(run, families, rng):
    """How far off the lengths are that the arm adds, the bar set up anew, and how far by the draws, rms of all [m]."""
    whole, noise, direction = Model.of(run.setup, frozenset()), 2e-6, run.context.bar.direction
    own = tuple(p for p in whole.parameters if p.group == "geometry")
    every = (*own, *(p for f in families for p in f.parameters))
    rows = replace(whole, parameters=every).rows(run.samples)[:, 0] * [p.prior for p in every]
    arm, count = rows[:, : len(own)], len(own)
    z = rng.standard_normal(count)
    # a beam's chord is shorter by the square of its load and the seventh power of its length
    sag = -15e-6 * (run.context.length / 0.5) ** 7 * (1 - direction[:, 2] ** 2)
    y = arm @ z + sag + noise * rng.standard_normal(len(sag))
    placed = np.column_stack([direction, np.ones(len(y))])  # by where it stands, and its zero
    rows = np.column_stack([rows, 1e-2 * placed]) / noise
    family = np.array([*[-1] * count, *(k for k, f in enumerate(families) for _ in f.parameters), *[-1] * 4])
    size = mixture_room._spike_and_slab(mixture_room.SLAB, mixture_room.SLAB_WEIGHT, 1.0)
    model = RandomEffects(rows, y / noise, family, np.ones((len(y), 1)), (size,) * len(families), 1e6 * np.eye(1))
    drawn = draw_sizes(model, SizeDraw(np.ones(len(families)), np.zeros(1)), sweeps=60)
    mixture = SizeMixture(np.stack([model.sizes(d.factors) for d in drawn]), np.ones(len(drawn)))
    white = np.column_stack([rows, y / noise])
    moved = arm @ mixture.moments(white.T @ white, np.zeros(len(family))).drawn[:count]
    off = moved - (arm @ z)[:, None]
    off -= placed @ np.linalg.lstsq(placed, off)[0]
    return np.sqrt((off.mean(axis=1) ** 2).mean()), np.sqrt(off.var(axis=1).mean())


@pytest.mark.slow
def test_a_bar_that_hangs_is_told_from_the_arm():
    """What the arm takes up of it is what is stated; beside a gauge of any shape alone it is more."""
    setup, q = setup_of(load_cell(str(CELLS["bar"]), planning=False)), bar_poses()
    run = Excitation.of(setup, Samples(q, np.zeros(len(q), dtype=int)))
    families = {f.name: f for f in background_families(setup, run.samples)}

    def judge(*names):
        own = [families[name] for name in names]
        off = [arm_beside_a_bar_that_hangs(run, own, np.random.default_rng(k)) for k in range(6)]
        return np.sqrt((np.array(off) ** 2).mean(axis=0))

    (alone, stated_alone), (error, stated) = judge(GAUGE_SHAPE), judge(GAUGE_SHAPE, GAUGE_HANGING)
    assert error < 0.5 * alone
    assert 0.6 < stated / error < 1.6
    assert stated_alone / alone < 0.75


def test_a_gauge_errs_by_what_is_declared_of_it():
    """In proportion to its noise, by some micrometres at least."""
    setup = setup_of(load_cell(str(CELLS["bar"]), planning=False))
    q = bar_poses()[:10]
    sizes = []
    for noise in (1e-6, 1e-5, 2e-5):
        declared = replace(setup, gauge=replace(setup.gauge, noise=noise))
        run = Excitation.of(declared, Samples(q, np.zeros(len(q), dtype=int)))
        sizes.append(float(np.sqrt(sum(p.prior**2 for p in dict(gauge_shapes(run))[GAUGE_SHAPE]))))
    assert sizes == pytest.approx([5e-6, 3e-5, 6e-5])


def test_one_shape_of_a_gauge_is_a_scale_and_the_others_are_none():
    """What is alike in all directions is at right angles to each other and to the zero, and as large as it says."""
    setup = setup_of(load_cell(str(CELLS["bar"]), planning=False))
    q = bar_poses()
    run = Excitation.of(setup, Samples(q, np.zeros(len(q), dtype=int)))
    shapes = [p.moves[0].phi for p in dict(gauge_shapes(run))[GAUGE_SHAPE]]
    alike = [phi for phi in shapes if isinstance(phi, BarShape) and not (phi.x or phi.y or phi.z)]
    assert [phi.length for phi in alike] == [1, 2, 3]
    at, weight = np.polynomial.legendre.leggauss(8)
    length = alike[0].about + alike[0].span * at
    every_way = SimpleNamespace(length=length, bar=SimpleNamespace(direction=np.tile([0.6, 0.0, 0.8], (8, 1))))
    columns = np.stack([np.ones(8), *(phi(every_way) for phi in alike)])
    assert 0.5 * columns * weight @ columns.T == pytest.approx(np.eye(4), abs=1e-12)


def gap_of_lumps(families, q, rng):
    """How far the errors of a gear at two angles differ [sigma of what is stated]; what was read is off by lumps."""
    waves, amplitude, ends = np.array([1.0, 2.0, 5.0, 7.0]), 2e-4 * rng.standard_normal(8), np.array([1.4, -1.7])
    at = np.append(q, ends)
    error = np.hstack([np.sin(np.outer(at, waves)), np.cos(np.outer(at, waves))]) @ amplitude
    terms = [(p.prior, p.moves[0].phi) for f in families for p in f.parameters]
    columns = np.stack([size * getattr(np, phi.wave)(phi.frequency * at) for size, phi in terms], axis=1)
    rows = np.column_stack([columns[:-2], 1e-2 * (q > 0), 1e-2 * (q < 0)])
    y = error[:-2] + 1e-5 * rng.standard_normal(len(q))
    family = np.array([*(k for k, f in enumerate(families) for _ in f.parameters), -1, -1])
    slab = mixture_room.SLAB_WEIGHT / mixture_room.SLAB_WEIGHT.sum()
    rare = SizePrior(np.append(0.0, mixture_room.SLAB), np.append(0.92, 0.08 * slab))  # as one of some hundred
    model = RandomEffects(rows, y, family, np.full((len(q), 1), 1e-10), (rare,) * len(families), 1e6 * np.eye(1))
    drawn = draw_sizes(model, SizeDraw(np.zeros(len(families)), np.zeros(1)), sweeps=36)
    mixture = SizeMixture(np.stack([model.sizes(d.factors) for d in drawn]), np.ones(len(drawn)))
    white = 1e5 * np.column_stack([rows, y])
    gaps = (columns[-2] - columns[-1]) @ mixture.moments(white.T @ white, np.zeros(len(family))).drawn[:-2]
    return (error[-2] - error[-1] - gaps.mean()) / gaps.std()


@pytest.mark.slow
def test_a_gear_of_which_high_waves_are_seen_may_err_once_a_turn():
    """Where a joint is measured about two angles, each beside a gauge whose place is free, once a turn is hardly seen.

    Where the two truly stand to each other is then within what is stated, over gears with drawn waves.
    """
    rng = np.random.default_rng(4)
    turns = np.concatenate([rng.uniform(0.6, 2.1, 90), rng.uniform(-2.6, -0.9, 60)])
    q = np.resize(bar_poses(), (len(turns), 6))
    setup = setup_of(load_cell(str(CELLS["bar"]), planning=False))
    there = background_families(setup, Samples(np.column_stack([turns, q[:, 1:]]), np.zeros(len(q), dtype=int)))
    gear = [f for f in there if f.name.startswith("gear ") and f.name.endswith(", joint 1")]
    off = np.array([gap_of_lumps(gear, turns, rng) for _ in range(8)])
    assert np.abs(off).max() < 4.0
    assert 0.3 < np.sqrt((off**2).mean()) < 1.7
