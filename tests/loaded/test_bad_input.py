"""Bad input: one clear sentence each, and the class of its exit code."""

from dataclasses import replace

import numpy as np
import pytest

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.reading import load_cell
from planner.circular.plan import circles_of, replace_circles
from planner.circular.planning import check_loads, load_notes, plan_circles
from planner.common.errors import InputError, PlannerError
from planner.common.progress import Stages
from planner.loaded.compliance import compliance_posterior
from planner.loaded.evaluation import evaluate_loaded_circles, problems_of
from planner.session.options import PlanOptions


@pytest.fixture(scope="module")
def good():
    way = shared.course(loads=(125.0, 375.0, 625.0), repeats=1)
    length, _ = world.readings(shared.arm(), world.World(), way, np.random.default_rng(0))
    return way, length


def refused(run, *words, cell=None, error=InputError):
    with pytest.raises(error) as caught:
        evaluate_loaded_circles(run, cell or shared.cell())
    text = str(caught.value)
    assert all(w in text for w in words), text
    assert caught.value.exit_code == 2
    assert "\n" not in text


@pytest.mark.slow
def test_the_good_run_is_taken(good):
    assert not evaluate_loaded_circles(shared.run_of(*good), shared.cell()).problems


def test_no_force(good):
    way, length = good
    run = shared.run_of(way, length)
    refused(replace(run, samples=replace(run.samples, force=None)), "force_N", "missing")


def test_one_load_is_too_few(good):
    way, length = good
    refused(shared.run_of(way, length, np.full(len(length), 125.0)), "one load only, 125 N", "two at least")


def test_forces_of_the_wrong_sign(good):
    way, length = good
    refused(shared.run_of(way, length, -way.force), "against its load", "negative compliance", "check the sign")


def test_forces_of_both_signs(good):
    way, length = good
    refused(shared.run_of(way, length, way.force - 400.0), "both signs", "-275")


def test_more_load_than_the_robot_carries(good):
    way, length = good
    cell = load_cell(shared.CELL, planning=False)
    refused(shared.run_of(way, length, way.force * 10), "6250 N", "300 kg", cell=replace_circles(cell))


def test_a_plan_refuses_more_load_than_the_robot_carries():
    cell = load_cell(shared.CELL)
    heavy = replace_circles(cell, replace(circles_of(cell)[0], loads=(125.0, 62_500.0)))
    with pytest.raises(InputError, match=r"loads_N goes up to 62500 N, but abb-irb6700 may carry 300 kg, 2746 N"):
        plan_circles(heavy, PlanOptions(), Stages(lambda *_: None))
    check_loads(cell)
    check_loads(replace(heavy, robot=replace(cell.robot, payload=None)))


def test_a_plan_says_what_its_loads_do_not_tell():
    cell = load_cell(shared.CELL)
    assert not load_notes(cell)
    (one,) = load_notes(replace_circles(cell, replace(circles_of(cell)[0], loads=(125.0,))))
    assert "125 N only; a stiffness needs two loads" in one
    (unknown,) = load_notes(replace(cell, robot=replace(cell.robot, payload=None)))
    assert "no payload_kg" in unknown


@pytest.mark.parametrize(
    ("change", "words", "code"),
    [
        (("radius_mm = 125", "radius_mm = 160"), "needs a bar of 166.0 mm", 2),
        (("loads_N = [125, 250", "loads_N = [-125, 250"), "must be greater than 0", 2),
        (("500, 625]", "500, 62500]"), "may carry 300 kg", 2),
        (("mm = [1350, -125, 12", "mm = [4350, -125, 12"), "the robot does not reach", 3),
    ],
)
def test_a_plan_that_cannot_be_ends_in_one_sentence_and_its_code(tmp_path, change, words, code):
    text = shared.cell_text()
    assert change[0] in text
    (tmp_path / "cell.toml").write_text(text.replace(*change))
    with pytest.raises(PlannerError) as caught:
        plan_circles(load_cell(str(tmp_path / "cell.toml")), PlanOptions(), Stages(lambda *_: None))
    assert caught.value.exit_code == code
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_more_load_than_the_cell_states(good):
    way, length = good
    refused(shared.run_of(way, length, way.force * 2), "1250 N", "625 N", "loads_N")


def test_a_circle_out_of_the_bars_reach(good):
    way, length = good
    cell = shared.cell()
    far = replace(cell.fixtures[0], p_BX=np.add(cell.fixtures[0].p_BX, (0.3, 0.0, 0.0)))
    refused(shared.run_of(way, length), "128 to 135 mm", "reaches", cell=replace(cell, fixtures=(far,)))


def test_a_path_that_is_no_circle(good):
    way, length = good
    q = way.q + 0.2 * np.sin(way.theta * 2.5)[:, None] * [0, 1, 0, 0, 0, 0]
    refused(shared.run_of(replace(way, q=q), length), "does not run on a circle")


def test_half_a_circle(good):
    way, length = good
    half = (way.theta > 0.2) & (way.theta < 4.0)
    part = replace(way, **{n: getattr(way, n)[half] for n in ("q", "t", "force", "part", "theta")})
    refused(shared.run_of(part, length[half]), "no whole turn", "360 degrees")


def test_a_load_that_lacks_in_every_sense(good):
    way, length = good
    kept = ~((way.force == 375.0) & (way.sense_of_travel > 0)) & ~((way.force == 625.0) & (way.sense_of_travel < 0))
    part = replace(way, **{n: getattr(way, n)[kept] for n in ("q", "t", "force", "part", "theta")})
    refused(shared.run_of(part, length[kept]), "375 N counter-clockwise", "625 N clockwise")


def test_a_hole_in_the_log(good):
    way, length = good
    kept = ~((way.part == 2) & (np.abs(way.theta - 2.0) < 0.3))
    part = replace(way, **{n: getattr(way, n)[kept] for n in ("q", "t", "force", "part", "theta")})
    refused(shared.run_of(part, length[kept]), "degrees", "hole")


def test_too_few_samples():
    way = shared.course(loads=(125.0, 625.0), repeats=1, rate=6.0)
    refused(shared.run_of(way, np.full(len(way.t), 0.1325) - 1e-6 * way.force), "samples", "slower")


def test_a_cell_without_fixture(good):
    refused(shared.run_of(*good), "[[fixtures]]", "missing", cell=replace(shared.cell(), fixtures=()))


def test_another_gauge(good):
    cell = shared.cell()
    other = load_cell("kuka-kr6-r700/tracker", planning=False).gauge
    refused(shared.run_of(*good), "ldbb", "tracker", cell=replace(cell, gauge=other))


@pytest.mark.slow
def test_a_trackers_run_that_is_none_or_of_another_path(good):
    run = shared.run_of(*good)
    with pytest.raises(InputError, match="x_mm, y_mm, z_mm"):
        evaluate_loaded_circles(run, shared.cell(), run)
    way, _ = good
    x = world.true_point(shared.arm(), world.World(), way.q + 0.1, 0 * way.force, world.FIXTURE)
    other = replace(run, samples=replace(run.samples, q=way.q + 0.1), readings=type(run.readings)(position=x))
    with pytest.raises(InputError, match="another path"):
        evaluate_loaded_circles(run, shared.cell(), other)


def test_a_compliance_that_is_negative_beyond_its_uncertainty():
    names = tuple(f"compliance{i + 1}" for i in range(6))
    prior, sharp = np.full(6, 2e-6), np.eye(6) / (1e-7) ** 2
    value = np.array([1e-6, -5e-7, 8e-7, 1e-6, -2e-7, 1e-6])
    (problem,) = problems_of(compliance_posterior(names, prior, sharp, sharp @ value, 1e-6, 1.0))
    assert problem.startswith("compliance2 came out at -0.499")
    assert "negative beyond its uncertainty" in problem


@pytest.mark.slow
def test_two_loads_are_enough_but_said_to_be_few(good):
    way, length = good
    two = way.force != 375.0
    part = replace(way, **{n: getattr(way, n)[two] for n in ("q", "t", "force", "part", "theta")})
    found = evaluate_loaded_circles(shared.run_of(part, length[two]), shared.cell())
    assert any("2 loads give a stiffness" in w for w in found.warnings)
    assert any("once only" in w for w in found.warnings)
