"""One fit of runs with and without load: as true as it says over seeds, a zero for each bar, drives thinned out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.circular.plan import replace_circles
from planner.common.errors import InputError
from planner.loaded.assumptions import JOINT_FIT
from planner.loaded.circle_candidates import find_own_place, planned_curves
from planner.loaded.common_fit import UnloadedPoses, predict_common_fit
from planner.loaded.joint_fit import at_rest, fit_jointly
from planner.model.model import Model
from planner.runs.loader import join_runs
from planner.runs.run import Mounting, Readings, Run, Samples

SEEDS, FEW, ANGLES, REPEATS = 20, 3, 24, 5
E, E_TRUE = np.array([1.3, 0.9, 0.9]), np.array([1.3010, 0.8995, 0.9007])
NAMES = [f"compliance{i + 1}" for i in range(6)]


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """The shipped cell with a second fixture for the other bar."""
    path = tmp_path_factory.mktemp("cell") / "cell.toml"
    text = shared.cell_text().replace("length_mm = [128, 135]", "length_mm = [125, 620]")
    path.write_text(text + '\n[[fixtures]]\nname = "E"\nposition_mm = [1300, 900, 900]\n')
    return load_cell(str(path), planning=False)


@cache
def clean():
    """The arm with its errors: poses and lengths without load; angles, loads, lengths on the circle."""
    truth, arm, rng = world.World(errors=shared.ERRORS), shared.arm(), np.random.default_rng(5)
    out = rng.normal(size=(110, 3))
    out[:, 2] = np.abs(out[:, 2])
    targets = E + out / np.linalg.norm(out, axis=1, keepdims=True) * rng.uniform(0.3, 0.6, (110, 1))
    q = world.reach(arm, targets, rng)
    x = world.true_point(arm, truth, q, np.zeros(len(q)), E_TRUE)
    free = np.linalg.norm(x - E_TRUE, axis=1) + 3e-4
    theta = (np.arange(ANGLES) + 0.5) * 2 * np.pi / ANGLES
    around = np.tile(world.angles(arm, world.circle_points(theta)), (2 * len(world.LOADS), 1))
    force = np.tile(np.repeat(world.LOADS, ANGLES), 2)
    ball = world.FIXTURE + truth.offset + world.shift(arm, truth, shared.course())
    length = np.linalg.norm(world.true_point(arm, truth, around, force, ball) - ball, axis=1) + truth.zero
    return q, free, around, force, length, theta


def runs(rng):
    """Both runs with noise: white, and on the circle a smooth curve for every turn as well."""
    q, free, around, force, length, theta = clean()
    n = np.arange(8)[:, None] * theta
    wave = rng.normal(0, 3e-6, (2 * len(world.LOADS), 2, 8)) / np.sqrt(REPEATS)
    smooth = (np.einsum("th,hb->tb", wave[:, 0], np.cos(n)) + np.einsum("th,hb->tb", wave[:, 1], np.sin(n))).ravel()
    length = length + smooth + rng.normal(0, 2e-6 / np.sqrt(REPEATS), len(length))
    under = Samples(q=around, place=np.zeros(len(around), int), force=force)
    rest = Samples(q=q, place=np.zeros(len(q), int))
    noisy = Readings(length=free + rng.normal(0, 1e-5, len(q)))
    return (
        Run("free", rest, noisy, ("E",), robot="abb-irb6700"),
        Run("loaded", under, Readings(length=length), ("A",), robot="abb-irb6700"),
    )


def noise():
    """Covariance of the averages of each sense, (K, A, A), as ``runs`` draws them."""
    n = np.arange(8)[:, None] * clean()[-1]
    one = ((3e-6) ** 2 * (np.cos(n).T @ np.cos(n) + np.sin(n).T @ np.sin(n)) + (2e-6) ** 2 * np.eye(ANGLES)) / REPEATS
    return (np.repeat(one[None], len(world.LOADS), axis=0),) * 2


@pytest.fixture(scope="module")
def fits(cell):
    return [fit_of(cell, seed) for seed in range(FEW)]


def fit_of(cell, seed):
    unloaded, loaded = runs(np.random.default_rng([seed, 7]))
    return fit_jointly(cell, unloaded, loaded, noise())


@pytest.mark.long
def test_compliances_are_as_true_as_they_say(cell, fits):
    """Joint chi-square of all six over the seeds; with the torques of the nominal pose it is far off."""
    total = []
    for joint in (*fits, *(fit_of(cell, seed) for seed in range(FEW, SEEDS))):
        assert not joint.problems
        which = [joint.names.index(n) for n in NAMES]
        off = joint.errors[which] - world.SOFT
        total.append(float(off @ np.linalg.solve(joint.covariance[np.ix_(which, which)], off)))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 6 * SEEDS) / SEEDS
    assert low < np.mean(total) < 1.1 * high  # the noise without load is learnt from 110 readings


@pytest.mark.slow
def test_runs_of_two_robots_are_refused(cell, fits):
    assert not any(joint.problems for joint in fits)
    free, loaded = runs(np.random.default_rng(0))
    arm, rng = shared.arm(), np.random.default_rng(2)
    other = world.World(errors={k: float(v + rng.normal(0, 3e-4)) for k, v in shared.ERRORS.items()})
    x = world.true_point(arm, other, free.samples.q, np.zeros(len(free)), E_TRUE)
    length = np.linalg.norm(x - E_TRUE, axis=1) + 3e-4
    (said,) = fit_jointly(cell, replace(free, readings=Readings(length=length)), loaded, noise()).problems
    assert "disagree" in said


@pytest.mark.slow
def test_each_bar_has_its_own_zero(fits):
    found = {e.name: e for e in fits[0].estimates}
    assert found["zero"].value == pytest.approx(3e-4, abs=4 * found["zero"].std)
    off = (found["zero_loaded"].value - world.World().zero) / found["zero_loaded"].std
    assert abs(off) < 4  # one circle leaves it to the prior: height and zero are one
    assert abs(found["fixture_E_x"].value - E_TRUE[0]) < 4 * found["fixture_E_x"].std


@pytest.mark.slow
def test_the_model_has_two_zeros_only_where_there_are_two_bars(cell):
    both = setup_of(cell)
    assert tuple(both.loaded) == ("A",)
    names = [n for n in Model.of(both, cell.plan.free).names if n.startswith("zero")]
    assert names == ["zero", "zero_loaded"]
    one = replace(both, p_BX=both.p_BX[:1], place_names=("A",), place_prior=both.place_prior[:1])
    assert [n for n in Model.of(one, cell.plan.free).names if n.startswith("zero")] == ["zero"]
    rows = Model.of(both, cell.plan.free).rows(Samples(q=clean()[0][:2], place=np.array([0, 1])))[:, 0]
    columns = [Model.of(both, cell.plan.free).names.index(n) for n in ("zero", "zero_loaded")]
    np.testing.assert_array_equal(rows[:, columns], [[0, 1], [1, 0]])


@pytest.mark.slow
def test_a_drive_is_thinned_and_a_run_at_rest_is_not(cell):
    free, loaded = runs(np.random.default_rng(0))
    assert len(at_rest(free)) == len(free)
    n = 400
    t = np.arange(n * len(free)) * JOINT_FIT.sample_spacing / n
    samples = replace(free.samples, q=np.repeat(free.samples.q, n, axis=0), t=t, place=np.zeros(len(t), int))
    readings = Readings(length=np.repeat(free.readings.length, n))
    many = replace(free, samples=samples, readings=readings, continuous=True)
    thin = at_rest(many)
    assert len(thin) == len(free)
    assert not thin.continuous
    np.testing.assert_array_equal(thin.samples.q, free.samples.q)
    found, other = (fit_jointly(cell, run, loaded, noise()) for run in (many, free))
    np.testing.assert_allclose(found.errors, other.errors, atol=1e-12)


@pytest.mark.slow
def test_raw_circles_beside_a_run_at_rest_are_told_what_would_help():
    free, loaded = runs(np.random.default_rng(0))
    raw = replace(loaded, continuous=True, samples=replace(loaded.samples, t=np.arange(len(loaded)) * 0.01))
    with pytest.raises(InputError, match=r"averaged.csv.*--unloaded"):
        join_runs([free, raw])


@pytest.mark.slow
def test_the_plan_predicts_what_the_fit_finds(cell):
    """Standard deviations of a fit whose noise is as declared, beside those predicted for its poses and circle."""
    shipped, rng = load_cell(shared.CELL), np.random.default_rng(11)
    place, q = find_own_place(shipped), clean()[0]
    curves = planned_curves(setup_of(shipped), place)
    _, K, A = curves.length.shape
    turn = np.fft.irfft(curves.noise, A)[(np.arange(A)[:, None] - np.arange(A)) % A] / REPEATS
    around, force = curves.q.reshape(-1, 6), curves.force.ravel()
    truth, ball = world.World(errors=shared.ERRORS), np.array(world.FIXTURE)
    length = np.linalg.norm(world.true_point(shared.arm(), truth, around, force, ball) - ball, axis=1)
    model = Model.of(setup_of(cell), frozenset())
    pose = rng.normal(size=(2, 1, A)) * model.noise(
        Samples.at(around[:A])
    )  # the error of a pose, the same under all loads
    smooth = np.linalg.cholesky(turn) @ rng.normal(size=(2, K, A, 1))
    length = length + (pose + smooth[..., 0]).ravel()
    free = clean()[1] + model.noise(Samples.at(q, Mounting(1))) * rng.normal(size=len(q))
    found = fit_jointly(
        cell,
        Run("free", Samples(q=q, place=np.zeros(len(q), int)), Readings(length=free), ("E",), robot="abb-irb6700"),
        Run(
            "loaded", Samples(q=around, place=np.zeros(len(around), int), force=force), Readings(length=length), ("A",)
        ),
        (np.repeat(turn[None], K, axis=0),) * 2,
    )
    other = replace_circles(replace(shipped, fixtures=(replace(cell.fixtures[1], prior=5e-3),)))
    known = predict_common_fit(UnloadedPoses(other, Samples.at(q)), shipped, [place])
    std = dict(zip(found.names, np.sqrt(np.diag(found.covariance)), strict=True))
    ratio = [std[n] / (b * p) for n, b, p in zip(known.names, known.both, known.prior, strict=True) if n in NAMES[:5]]
    assert len(ratio) == 5
    assert 0.6 < min(ratio) <= max(ratio) < 1.6, ratio
