"""Where loaded circles tell the compliances apart: predictions held against dense least squares in another world."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.circular.plan import circles_of, replace_circles
from planner.common.errors import InputError, NoSolutionError
from planner.loaded.circle_candidates import (
    find_circle_places,
    find_own_place,
    predict_compliance,
    predict_information,
    predicted_turn_noise,
    select_circle_places,
    with_circles,
)
from planner.loaded.common_fit import UnloadedPoses, predict_common_fit
from planner.loaded.compliance import fit_compliances
from planner.loaded.curves import average_curves
from planner.loaded.results import places_content, places_csv
from planner.runs.run import Samples
from planner.workflow.loaded_planning import CirclePlacesResult, study_places

BINS = 36


@pytest.fixture(scope="module")
def cell():
    return load_cell(shared.CELL)


@pytest.fixture(scope="module")
def own(cell):
    return find_own_place(cell)


@pytest.fixture(scope="module")
def pool(cell):
    return find_circle_places(cell, steps=(4, 3))


@pytest.fixture(scope="module")
def places(cell, pool, own):
    return select_circle_places(cell, pool, own, 4)


def deflections(place, soft, raised=0.0):
    """Length of the bar (B, K) [m] at a place by each load, on the world's arm; the ball sinks with its sag."""
    truth, loads = world.World(soft=soft, white=0.0), np.array(world.LOADS)
    q, force = np.repeat(place.q, len(loads), axis=0), np.tile(loads, len(place.q))
    off = np.zeros(len(q))
    sag = world.true_point(shared.arm(), truth, q, off, place.p_BX)
    sag = (sag - world.true_point(shared.arm(), replace(truth, soft=np.zeros(6)), q, off, place.p_BX)).mean(axis=0)
    ball = place.p_BX + sag + raised * place.axis_B
    x = world.true_point(shared.arm(), truth, q, force, ball)
    return np.linalg.norm(x - ball, axis=1).reshape(len(place.q), len(loads))


@pytest.mark.slow
def test_the_prediction_is_dense_least_squares_in_another_world(cell, own):
    """Columns by differences in the world, a free offset at every angle, the noise's covariance written out.

    Rows are those of the arm as it stands unloaded: what the sag changes of the levers, a percent, is left out.
    """
    setup = setup_of(cell)
    soft = 0.5 * np.full(6, 2e-6)
    step = 1e-8
    columns = [(deflections(own, soft + step * e) - deflections(own, soft - step * e)) / (2 * step) for e in np.eye(6)]
    up, down = (deflections(own, soft, h) for h in (2e-4, -2e-4))
    columns.append((up - down) / 4e-4)
    spectrum = predicted_turn_noise(replace(setup, p_BX=own.p_BX[None]), own.q)
    harmonics = np.concatenate([spectrum, spectrum[1:-1][::-1]])
    C = np.real(np.fft.ifft(harmonics[:, None] * np.fft.fft(np.eye(BINS), axis=0), axis=0)) / 5  # five repeats
    K = len(world.LOADS)
    free = np.kron(np.ones((K, 1)), np.eye(BINS))
    A = np.concatenate([free, np.stack([c.T.ravel() for c in columns], axis=1)], axis=1)
    one_sense = A.T @ np.kron(np.eye(K), np.linalg.inv(C)) @ A
    both = 2 * (
        one_sense[BINS:, BINS:]
        - one_sense[BINS:, :BINS] @ np.linalg.solve(one_sense[:BINS, :BINS], one_sense[:BINS, BINS:])
    )
    both[-1, -1] += 1 / setup.place_prior[0] ** 2
    dense = both[:6, :6] - np.outer(both[:6, 6], both[6, :6]) / both[6, 6]
    ours = predict_information(setup, own)
    size = np.sqrt(np.diag(dense))
    np.testing.assert_allclose(ours / np.outer(size, size), dense / np.outer(size, size), atol=0.012)


@pytest.mark.slow
def test_the_prediction_is_what_the_evaluation_finds(cell, own):
    """Same circle, same noise: the information of a measured run is the one that was predicted."""
    way = world.course(shared.arm(), rate=150.0, repeats=1)
    truth = world.World(soft=np.full(6, 1e-6), offset=np.zeros(3), white=0.0)
    length, _ = world.readings(shared.arm(), truth, way, np.random.default_rng(0))
    run = shared.run_of(way, length)
    (curves,) = average_curves(shared.setup(run), run, np.pi)
    thin = slice(None, None, len(curves.theta) // BINS)
    fields = {name: getattr(curves, name)[:, :, thin][:, :, :BINS] for name in ("q", "length", "force")}
    noise = predicted_turn_noise(replace(setup_of(cell), p_BX=own.p_BX[None]), own.q)
    curves = replace(
        curves, **fields, theta=curves.theta[thin][:BINS], noise=noise, repeats=np.full(curves.repeats.shape, 5)
    )
    found = fit_compliances(shared.setup(run), [curves]).compliances
    setup = setup_of(cell)
    promised = predict_compliance(predict_information(setup, own) * np.outer(found.prior, found.prior))
    np.testing.assert_allclose(found.std / found.prior, promised.std, rtol=0.03)


@pytest.mark.slow
def test_candidates_stand_within_limits_and_on_their_circles(cell, pool):
    assert len(pool) > 20
    assert {c.circle.plane for c in pool} == {"XY", "XZ", "YZ"}
    for c in pool[:: len(pool) // 8]:
        x = cell.map_position(c.q)
        np.testing.assert_allclose(np.linalg.norm(x - c.circle.p_BC, axis=1), 0.125, atol=1e-7)
        length = np.linalg.norm(x - c.p_BX, axis=1)
        np.testing.assert_allclose(length, length[0], atol=1e-7)
        assert np.all((c.q > cell.robot.q_lower) & (c.q < cell.robot.q_upper))
        assert np.abs(np.diff(c.q, axis=0)).max() < 0.6


@pytest.mark.slow
def test_the_choice_is_as_good_as_brute_force(places):
    """No pair of half of the pool has a larger determinant than the pair that was chosen."""
    info, pair = places.information, places.sets[1]
    best = np.linalg.slogdet(info[pair].sum(axis=0))[1]
    some = range(0, len(places.pool), 2)
    others = max(np.linalg.slogdet(info[[i, j]].sum(axis=0))[1] for i, j in itertools.combinations(some, 2))
    assert best >= others - 1e-6


@pytest.mark.slow
def test_more_places_know_more_and_four_know_every_joint(places):
    worst = [k.worst_share for k in places.known]
    assert places.own.worst_share > 0.5  # one circle barely separates six
    assert worst == sorted(worst, reverse=True)
    assert worst[-1] < 0.25


@pytest.mark.slow
def test_files_and_the_cell_that_drives_them(cell, places, tmp_path):
    CirclePlacesResult(cell, places, 3).write(tmp_path / "out")
    content = json.loads((tmp_path / "out" / "places.json").read_text())
    assert content["schema"] == "edbb-places/1"
    assert len(content["sets"][2]["places"]) == 3
    chosen = load_cell(str(tmp_path / "out" / "cell.toml"))
    assert [c.name for c in circles_of(chosen)] == [f.name for f in chosen.fixtures] == ["P1", "P2", "P3"]
    for circle, fixture, i in zip(circles_of(chosen), chosen.fixtures, places.sets[2], strict=True):
        np.testing.assert_allclose(circle.p_BC, places.pool[i].circle.p_BC, atol=1e-6)
        np.testing.assert_allclose(fixture.p_BX, places.pool[i].p_BX, atol=1e-6)
        assert circle.loads == circles_of(cell)[0].loads
    assert places_csv(places).count("\n") == len(places.pool) + 1


@pytest.mark.slow
def test_one_fit_of_both_knows_more_than_either(cell, places):
    rng = np.random.default_rng(0)
    fixture = np.array([1.3, 0.9, 0.9])
    way = rng.normal(size=(60, 3))
    way[:, 2] = np.abs(way[:, 2])
    targets = fixture + way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(0.3, 0.6, (60, 1))
    q = world.reach(shared.arm(), targets, rng)
    free = replace(cell, fixtures=(replace(cell.fixtures[0], name="E", p_BX=fixture),))
    both = predict_common_fit(UnloadedPoses(free, Samples.at(q)), cell, places.best_places(1))
    rows = both.of("compliance")
    assert len(rows) == 6
    assert all(together <= min(unloaded, loaded) * 1.001 for _, unloaded, loaded, together in rows)
    assert any(together < 0.8 * min(unloaded, loaded) for _, unloaded, loaded, together in both.of(""))
    content = places_content(places, "abb-irb6700", both)
    assert len(content["with_unloaded_plan"]) == len(both.names)


@pytest.mark.slow
def test_a_cell_without_loads_is_refused(cell):
    with pytest.raises(InputError, match=r"no \[\[circles\]\]"):
        find_circle_places(replace_circles(cell))
    few = replace(circles_of(cell)[0], loads=(125.0,))
    with pytest.raises(InputError, match="1 loads in loads_N"):
        find_circle_places(replace_circles(cell, few))


@pytest.mark.slow
def test_a_circle_out_of_the_arms_reach_is_refused(cell):
    far = replace(circles_of(cell)[0], p_BC=np.array([4.0, 0.0, 1.0]))
    with pytest.raises(NoSolutionError, match="cannot be followed"):
        find_own_place(replace_circles(cell, far))


@pytest.mark.slow
def test_more_places_than_there_are(monkeypatch, places, cell):
    monkeypatch.setattr("planner.workflow.loaded_planning.study_circle_places", lambda *_: places)
    with pytest.raises(InputError, match="only 4 circles"):
        study_places(shared.CELL, places=5)
    assert len(circles_of(with_circles(cell, places.best_places(2)))) == 2
