"""What poses held out say of a posterior that is too sure, and the turns that have no name."""

import json
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell
from planner.documents.expected_error import expected_error_content
from planner.effects.catalogue import Excitation
from planner.effects.compliance import LoadMoment
from planner.effects.context import Context
from planner.effects.misfit_shapes import GravityHarmonic, misfit_shapes
from planner.effects.phi_keys import columns_of
from planner.effects.sizes import PART_TURN
from planner.fit.assumptions import USUAL_NOISE_SHARE
from planner.fit.least_squares import Fit, Solution
from planner.fit.problem import FitProblem
from planner.fit.run_setup import locate_gauge, number_samples, setup_for_run
from planner.inference.candidates import Candidate, Inclusion, Rival
from planner.inference.misfit import (
    HeldOutReadings,
    Misfit,
    RepeatedReadings,
    draw_misfit,
    no_rest_probability,
)
from planner.model.identification_document import Identification
from planner.model.model import Model
from planner.release.nameless_rivals import with_nameless_rivals
from planner.runs.run import Samples
from planner.tracing.trace import trace
from planner.workflow.measured_runs import load_any
from tests.blind.trial import identified
from tests.blind.workspace import difference, released_tool, states_anywhere, true_tool
from tests.identification.few_draws import few_draws
from tests.independent_arms.arm import make_arm
from tests.independent_arms.runs import CELLS, FIXTURE, bar_at_rest, bar_lengths, bar_poses, write_run
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.catalogue import KINDS
from tests.simulation.generator.kinds import Effect, Kind
from tests.simulation.generator.runs import measured, tracker
from tests.simulation.generator.truth import Noise, draw_truth

NOISE, OPEN = 1.5e-5, 1e-5  # [m]
NAMED = np.array([0, 0, 1])  # families that act without a name, of an arm whose causes all have one


def held_out(seed, noise=1.0, stretch=1.0, rest=0.0, m=330):
    """Readings whose noise, open part and rest are drawn so many times as large as is said."""
    rng = np.random.default_rng(seed)
    size = OPEN * np.exp(rng.normal(size=m))
    parts = rng.normal(size=(3, m)) * [np.full(m, noise * NOISE), stretch * size, np.full(m, rest)]
    return HeldOutReadings(parts.sum(axis=0), size**2, np.full(m, NOISE**2), np.eye(m))


def typical(misfit):
    return float(np.median(misfit.stretch)), float(np.median(misfit.rest))


@pytest.mark.slow
def test_what_no_reading_tells_of_is_not_stretched():
    """Of readings ten times as far off, in directions that the priors alone leave open, nothing is learnt."""
    part = held_out(3, stretch=10.0)
    kept = draw_misfit([replace(part, kept=part.open)], 400, NAMED)
    assert (kept.stretch > 1).mean() < 0.25
    assert np.median(draw_misfit([part], 400, NAMED).stretch) > 3


@pytest.mark.slow
def test_readings_as_expected_say_of_no_misfit():
    found = [draw_misfit([held_out(seed)], 400, NAMED) for seed in range(20)]
    assert np.median([m.probability for m in found]) < 0.3
    assert all(typical(m) == (1.0, 0.0) for m in found[:3])


@pytest.mark.slow
def test_a_posterior_that_is_not_sure_enough_is_left_as_it_is():
    found = [
        draw_misfit([held_out(seed, stretch=0.4), held_out(50 + seed, stretch=0.4)], 400, NAMED) for seed in range(20)
    ]
    assert all(typical(m)[0] == 1.0 for m in found)
    assert np.median([np.quantile(m.stretch, 0.95) for m in found]) < 1.2


@pytest.mark.slow
def test_regions_that_differ_leave_the_stretch_open():
    """Of four regions two are as expected and two five times as far off: what the next one is nobody knows well."""
    found = [
        draw_misfit([held_out(10 * seed + k, stretch=s) for k, s in enumerate((1.0, 1.0, 5.0, 5.0))], 400, NAMED)
        for seed in range(10)
    ]
    high, low = (np.median([np.quantile(m.stretch, p) for m in found]) for p in (0.95, 0.2))
    assert low < 2.0
    assert high > 4.0


@pytest.mark.slow
def test_the_limit_does_not_hang_on_the_seed():
    """What 95 % of the stretches stay below is that of a hundred times as many, whatever order they come in."""
    parts = [held_out(k, stretch=s) for k, s in enumerate((1.0, 2.0, 5.0, 3.0))]
    limits = [np.quantile(draw_misfit(parts, 400, NAMED, seed=s).stretch, 0.95) for s in range(5)]
    assert limits == pytest.approx([np.quantile(draw_misfit(parts, 40_000, NAMED).stretch, 0.95)] * 5, rel=0.05)
    assert np.ptp(limits) < 1e-9 * limits[0]


@pytest.mark.slow
def test_readings_that_move_together_count_as_one():
    """A single direction open, seen by 300 readings: it says as little of the stretch as one number does."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(20):
        shared = rng.uniform(0.5, 1.5, 100)
        residual = (3.0 * OPEN * rng.normal() * shared + NOISE * rng.normal(size=100))[:, None]
        root = np.full((100, 1, 1), 1 / NOISE)
        part = HeldOutReadings.of(residual, OPEN * shared[:, None, None], root)
        assert (part.open > 1e-6 * NOISE**2).sum() == 1
        assert part.weigh(residual) == pytest.approx(part.residual / np.sqrt(part.open + part.noise))
        found.append(np.log(draw_misfit([part], 400, NAMED).stretch).std())
    assert np.median(found) > 0.3


@pytest.mark.slow
def test_a_posterior_that_is_too_sure_is_stretched():
    found = np.array([typical(draw_misfit([held_out(seed, stretch=4.0)], 400, NAMED))[0] for seed in range(20)])
    assert abs(np.log(np.median(found) / 4.0)) < 0.2
    assert np.std(np.log(found)) < 0.35


@pytest.mark.slow
def test_what_moves_the_tool_at_each_pose_alone_is_the_rest():
    found = np.array([typical(draw_misfit([held_out(seed, rest=4e-5)], 400, NAMED))[1] for seed in range(20)])
    assert np.median(found) == pytest.approx(4e-5, rel=0.2)


@pytest.mark.slow
def test_regions_whose_rests_differ_leave_open_how_large_the_next_one_is():
    """Four regions alike, or two with hardly any rest and two with much: as much on average, and known less well."""
    spread = []
    for rests in ((4e-5,) * 4, (1e-5, 1e-5, 6e-5, 6e-5)):
        found = [
            draw_misfit([held_out(10 * seed + k, rest=r) for k, r in enumerate(rests)], 400, NAMED) for seed in range(6)
        ]
        spread.append(np.median([np.quantile(m.rest, 0.95) / np.median(m.rest) for m in found]))
    assert spread[0] < 1.7
    assert spread[1] > 1.4 * spread[0]


@pytest.mark.slow
def test_a_gauge_that_is_a_little_noisier_than_its_data_sheet_is_no_misfit():
    found = [draw_misfit([held_out(seed, noise=1.15)], 400, NAMED) for seed in range(20)]
    assert np.median([m.rest_square**0.5 for m in found]) < NOISE


@pytest.mark.slow
def test_poses_measured_again_tell_noise_from_misfit():
    """What is left is as large as noise or as misfit would leave it: only readings of the same poses tell which."""

    def rest(square_of_one):
        repeats = RepeatedReadings(100 * square_of_one, 100)
        found = [draw_misfit([held_out(seed, noise=1.5)], 400, NAMED, repeats) for seed in range(20)]
        return np.median([np.sqrt(np.mean(m.rest**2)) for m in found])

    assert rest(1.5**2) < 0.4 * NOISE
    assert rest(1.0) == pytest.approx(np.sqrt(1.5**2 - 1) * NOISE, rel=0.2)


@pytest.mark.slow
def test_families_without_a_name_make_a_rest_likelier():
    found = [
        np.mean([draw_misfit([held_out(seed, noise=1.3)], 400, np.full(3, n)).rest ** 2 for seed in range(10)])
        for n in (0, 3, 8)
    ]
    assert found[0] < found[1] < found[2]
    assert no_rest_probability(np.array([1])) > 0.5 > no_rest_probability(np.array([5]))


@pytest.mark.slow
def test_poses_measured_again_scatter_by_the_noise_of_gauge_and_joints(tmp_path):
    """Four visits to each of 20 poses, of a bar whose scatter the arm itself says; geometry is not even fitted."""
    true = make_arm(3, "bar", 0, False)
    q = bar_poses()[:20]
    write_run(bar_at_rest(true, np.tile(q, (4, 1))), tmp_path / "run.csv")
    cell = load_cell(str(CELLS["bar"]), planning=False)
    run = number_samples(load_any(tmp_path / "run.csv", cell.robot))
    setup = locate_gauge(setup_for_run(cell, run), run)
    problem = FitProblem.of(Model.of(setup, frozenset()).subset([]), run)
    repeats = RepeatedReadings.of(
        Fit(problem, Solution(np.zeros(0), np.zeros((0, 0)), 0.0), 0.0, np.zeros(0, int)), run
    )
    rng = np.random.default_rng(0)
    lengths = [
        bar_lengths(true, q, np.zeros(20), rng.normal(0, true.joint_noise, q.shape), FIXTURE) for _ in range(300)
    ]
    usual = USUAL_NOISE_SHARE**2 * problem.whitener.covariance()[:20, 0, 0]
    expected = np.mean((np.var(lengths, axis=0) + true.noise**2) / usual)
    assert repeats.freedom == 60
    assert repeats.square / repeats.freedom == pytest.approx(expected, rel=3 * np.sqrt(2 / 60))


@pytest.mark.slow
def test_no_misfit_is_said_by_no_draw():
    assert Misfit(np.ones(5), np.zeros(5)).probability == 0.0
    assert Misfit(np.array([1.0, 2.0]), np.zeros(2)).probability == 0.5


@pytest.mark.slow
def test_harmonics_of_gravity_are_those_of_the_direction_in_the_part():
    """Degree 1 is the direction itself, and all are orthonormal over directions."""
    cell = load_cell("comau-nj130/edbb", planning=False)
    setup = setup_of(cell)
    q = np.random.default_rng(0).uniform(*cell.joint_range, (20_000, 6))
    context = Context(setup, Samples(q, np.zeros(len(q), dtype=int)))
    R = np.moveaxis(context.stations.R[5], 2, 0)
    down = Rotation.from_matrix(R).inv().apply(setup.gravity_B / np.linalg.norm(setup.gravity_B))
    first = np.array([GravityHarmonic(5, 1, k)(context) for k in range(3)])
    assert np.abs((first**2).sum(axis=0) - 3.0).max() < 1e-9
    assert np.abs(np.abs(np.corrcoef([*first, *down.T])[:3, 3:]).max(axis=1) - 1).max() < 1e-9
    polar = np.arccos(down[:, 2])
    even = np.where(np.abs(np.cos(polar)) < 2, 1.0, 0.0)
    third = np.array([GravityHarmonic(5, 3, k)(context) for k in range(7)])
    assert (third**2).sum(axis=0) == pytest.approx(7.0 * even)  # addition theorem


@pytest.mark.slow
def test_a_part_turns_as_much_as_is_usual_whatever_moves_it():
    cell = load_cell("comau-nj130/edbb", planning=False)
    q = np.random.default_rng(1).uniform(*cell.joint_range, (500, 6))
    run = Excitation.of(setup_of(cell), Samples(q, np.zeros(len(q), dtype=int)))
    families = dict(misfit_shapes(run))
    base = families.pop("base by its load")
    turned = sum((p.prior * run.values(p.main_move.phi)) ** 2 for p in base) / 2  # axes
    lean = np.hypot(*(run.values(LoadMoment(0, axis)) for axis in range(2)))
    assert np.sqrt(np.mean(turned / (lean / lean.max()) ** 2)) == pytest.approx(PART_TURN, rel=0.02)
    assert {"part 3 by gravity", "part 3 by joint 5"} < set(families)
    assert "part 3 by joint 3" not in families
    assert len({p.name for own in families.values() for p in own}) == sum(map(len, families.values()))
    for name, own in families.items():
        square = sum(p.prior**2 for p in own) / (3 if "gravity" in name else 2)  # axes
        waves = 1.0 if "gravity" in name else 0.5  # mean square
        assert np.sqrt(square * waves * 2 if "joint" in name else square) == pytest.approx(PART_TURN, rel=0.01), name


@pytest.mark.slow
def test_a_base_that_opens_to_one_side_is_waves_of_the_side_to_which_the_arm_leans():
    """Of a plate that opens under the moment to one side alone, without the linear part that a soft base has."""
    cell = load_cell("comau-nj130/edbb", planning=False)
    q = np.random.default_rng(2).uniform(*cell.joint_range, (400, 6))
    run = Excitation.of(setup_of(cell), Samples(q, np.zeros(len(q), dtype=int)))
    moment = np.stack([run.values(LoadMoment(0, axis)) for axis in range(2)], axis=1)
    opened = np.maximum(0.0, moment @ [np.cos(0.7), np.sin(0.7)])
    own = dict(misfit_shapes(run))["base by its load"]
    waves = np.stack([run.values(p.main_move.phi) for p in own if p.name.startswith("misfit_base_rx")], axis=1)
    left = [
        float(np.std(opened - columns @ np.linalg.lstsq(columns, opened)[0]) / np.std(opened))
        for columns in (moment, np.column_stack([moment, waves]))
    ]
    assert left[0] > 0.3
    assert left[1] < 0.07


def _cable(scene, e):
    """A cable pulls a part aside by the angle of a joint far from it."""
    turn = scene.joint(5)
    return {"tilt_x2": e.size * np.sin(turn + 1.0), "tilt_y2": 0.7 * e.size * np.cos(turn)}


@pytest.fixture(scope="module", params=["cable", pytest.param("", marks=pytest.mark.long)])
def identified_run(request):
    """A tracker's run of an arm with a cause that no catalogue lists, and of one without any."""
    arm, bench = Arm.from_toml("comau-nj130"), BENCHES["comau-nj130"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(KINDS, "cable", Kind("cable", "rad", (1e-4, 1e-3), _cable))
        hidden = [Effect("cable", 2, 3e-4)] if request.param else []
        truth = draw_truth(arm, 5, hidden, Noise(gauge=15e-6))
        made = measured(arm, bench, "tracker", tracker(arm, 110, seed=3).scene.q, truth, 3)
        with few_draws():
            found = identified(made, trace)[1]
        q = states_anywhere(arm, bench, np.random.default_rng(1))
        with tempfile.TemporaryDirectory() as folder:
            off = difference(released_tool(found, bench, Path(folder), q), true_tool(arm, bench, truth, q))
    return bool(hidden), found, float(np.sqrt((off**2).sum(axis=1).mean()))


@pytest.mark.slow
def test_a_run_with_a_cause_that_no_catalogue_lists_says_so(identified_run):
    foreign, found, true = identified_run
    release = found.release
    assert true < release.at_most
    assert 0.5 < found.workspace_error / true < 2.5
    assert (release.unexplained is not None) == foreign
    if foreign:
        assert 1e-4 < release.unexplained.anywhere < 1e-3
        assert release.parts.misfit > release.parts.unseen
        assert found.workspace_error < 0.5 * release.geometry_anywhere


@pytest.mark.slow
def test_the_parts_make_up_what_is_stated(identified_run):
    _, found, _ = identified_run
    parts = found.release.parts
    square = parts.seen**2 + parts.unseen**2 + parts.misfit**2 + parts.drift**2
    assert np.sqrt(square) == pytest.approx(found.workspace_error, rel=1e-6)
    file = expected_error_content(found.released, found.run)
    assert file["parts_mm"]["misfit"] == pytest.approx(1e3 * parts.misfit, rel=1e-4)
    again = Identification.model_validate_json(json.dumps(found.content()))
    assert again.release.parts.seen == pytest.approx(parts.seen, rel=1e-6)


@pytest.mark.slow
def test_what_moves_the_tool_beside_a_nameless_cause_may_be_a_part_of_it(identified_run):
    """What is nameless has its share in what both move; the probabilities stay those of one comparison."""
    hidden, found, _ = identified_run
    released, before = found.released, Inclusion(0.9, (Rival("gear ripple, joint 2", 0.1),))
    (unmoved,) = with_nameless_rivals(released, [_cause(released, "drift, gauge")], [before])
    assert unmoved == before
    released = replace(released, posterior=replace(released.posterior, fit=_called(released.posterior.fit)))
    (moved,) = with_nameless_rivals(released, [_cause(released, "geometry, all")], [before])
    nameless = [r for r in moved.rivals if r.name == "unnamed, all"]
    assert moved.probability + sum(r.probability for r in moved.rivals) == pytest.approx(1.0)
    assert len(nameless) == hidden
    assert moved.probability == pytest.approx(0.9 * (1 - sum(r.probability for r in nameless)))
    (twice,) = with_nameless_rivals(released, [_cause(released, "geometry, all")], [moved])
    assert len(twice.rivals) == len(moved.rivals)


@pytest.mark.slow
def test_what_a_gauge_does_by_itself_may_be_a_part_of_a_nameless_cause_too(identified_run):
    """A hose that pulled at four joints was called a lobed ball of the bar (99 %), which moves no tool."""
    hidden, found, _ = identified_run
    released, before = found.released, Inclusion(0.9, ())
    of_gauge = [
        p for p in released.posterior.fit.model.parameters
        if all(m.on == "reading" and not columns_of(m.phi.key) for m in p.moves)
    ]  # fmt: skip
    lobed = Candidate("ball lobing, ball on the tool", tuple(of_gauge))
    (after,) = with_nameless_rivals(released, [lobed], [before])
    assert {r.name for r in after.rivals} <= {"unnamed, ball on the tool"}
    assert (after.probability < 0.45) == hidden  # the gauge's scale moves the readings by next to nothing
    assert after.probability == pytest.approx(0.9 - sum(r.probability for r in after.rivals))


def _cause(released, name):
    """The cause of a name with the parameters that the released robot has of it."""
    return Candidate(name, tuple(p for p in released.posterior.fit.model.parameters if p.group == name))


def _called(fit):
    """The fit with its geometry as a finding."""
    parameters = tuple(replace(p, group="geometry, all") if p.group == "geometry" else p for p in fit.model.parameters)
    model = replace(fit.model, parameters=parameters)
    return replace(fit, problem=fit.problem.with_model(model))
