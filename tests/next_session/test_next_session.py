"""Poses after a calibration: what is foreseen of them, against the file's own figures and a second run as it comes out.

Runs are the generator's: its own forward model, and effects that no cell declares.
"""

from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.common.errors import InputError, NoSolutionError
from planner.common.progress import UNLIMITED
from planner.design.bayesian_design import BayesianPosterior, _exchange, errors_after, select_greedily
from planner.design.candidates.pool import PoseSet
from planner.design.expected_errors import error_limit, square_error_limit
from planner.model.identification_document import Identification
from planner.next_session.planned_poses import NextSessionChooser
from planner.next_session.remaining_errors import CalibratedState, RemainingErrors, places_in_region, places_of_program
from planner.runs.loader import load_runs
from planner.runs.run import Samples
from planner.runs.writer import save_run
from planner.session.options import PlanOptions
from planner.session.point_poses import BarPoses
from planner.session.validation_poses import order_by_distance
from planner.workflow.identification import identify
from tests.identification.worlds import arm_of
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import Noise, Truth, draw_errors

NAME = "kuka-kr6-r700"
FIRST, MORE = 50, 40  # poses


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Two runs of one arm whose joints give way, its cell, and the calibration by the first run."""
    folder = tmp_path_factory.mktemp("sessions")
    arm = arm_of(NAME)
    soft = tuple(Effect("joint-compliance", j, 3e-5) for j in (2, 3))
    truth = Truth(3, draw_errors(arm, np.random.default_rng(3)), soft, Noise(1e-5, 2e-5), (1.0,) * 6)
    made = runs.edbb_static(arm, n_poses=FIRST + MORE, seed=3, truth=truth, logs=())
    path, cell = made.write(folder)
    run = load_runs([path], 6)
    first = np.isin(run.samples.pose, np.unique(run.samples.pose)[:FIRST])
    for name, which in (("first", first), ("second", ~first)):
        save_run(run.take(which), folder / f"{name}.csv")
    cell = load_cell(str(cell), planning=False)
    identify(folder / "first.csv", cell=cell).write(folder / "known")
    return Of(folder=folder, cell=cell, second=run.take(~first))


@pytest.mark.long
def test_what_is_foreseen_is_what_the_second_run_brings(measured):
    before = CalibratedState.read(measured.folder / "known", measured.cell)
    release = Identification.read(measured.folder / "known" / "identification.json").release
    samples = measured.second.samples
    unknown = RemainingErrors.of(before, measured.cell, samples)
    nothing = unknown.white(samples)[:0]
    assert unknown.state(float(np.trace(unknown.weight_per_prior))) == pytest.approx(before.stated)
    assert error_limit(unknown, nothing) == pytest.approx(release.at_most, rel=0.02)
    share = before.known.file.likely_share[2]  # of the median in the root of the mean square, by robots drawn
    assert unknown.state(1.0) == pytest.approx(share, rel=0.1)
    foreseen = errors_after(unknown.white(samples), unknown)
    assert np.all(np.diff(foreseen) <= 1e-12)
    both = identify([measured.folder / "first.csv", measured.folder / "second.csv"], cell=measured.cell)
    stated = both.calibration.workspace_error
    assert foreseen[-1] < 0.9 * before.stated
    assert 0.5 < stated / foreseen[-1] < 2.0  # the second run also tells how large the effects are


@pytest.mark.long
def test_what_does_not_belong_together_is_refused(measured, tmp_path):
    with pytest.raises(InputError, match="the folder that 'edbb identify' wrote"):
        CalibratedState.read(tmp_path, measured.cell)
    with pytest.raises(InputError, match="calibrates the robot"):
        CalibratedState.read(measured.folder / "known", load_cell("ur5e/edbb", planning=False))
    before = CalibratedState.read(measured.folder / "known", measured.cell)
    with pytest.raises(NoSolutionError, match="already"):
        NextSessionChooser(before, until=2 * before.at_most)


@pytest.mark.parametrize(
    ("asked", "other"),
    [
        ({"after": "known", "index": "O1"}, "--index"),
        ({"until_mm": 0.1, "poses": 30}, "--poses"),
        ({"region": "box.toml"}, "--region"),
    ],
)
def test_what_also_chooses_the_poses_is_refused(asked, other):
    with pytest.raises(InputError, match=other):
        PlanOptions(**asked).aims_at_tracing(Of(path="cell.toml", plan=Of(aim=None, method=None, poses=None)))


@pytest.mark.long
def test_a_box_counts_by_its_own_states_and_is_lowered_most(measured, tmp_path):
    box = tmp_path / "box.toml"
    box.write_text('schema = "edbb-region/1"\nlower_mm = [200, -300, 100]\nupper_mm = [600, 300, 500]\n')
    before = CalibratedState.read(measured.folder / "known", measured.cell)
    samples = measured.second.samples
    counts = places_in_region(box, measured.cell)
    whole, there = (RemainingErrors.of(before, measured.cell, samples, c) for c in (None, counts))
    assert "in box.toml" in there.describe(1e-4, "0.1", "0.2")
    q = np.random.default_rng(5).uniform(*measured.cell.joint_range, (20_000, 6))
    p = measured.cell.map_position(q)
    inside = q[np.all((p > [0.2, -0.3, 0.1]) & (p < [0.6, 0.3, 0.5]), axis=1)]
    moved = before.known.aligned_spread(inside)
    assert np.trace(there.weight_per_prior) == pytest.approx((moved**2).sum() / len(inside), rel=0.1)
    assert np.trace(whole.weight_per_prior) == pytest.approx(np.trace(there.whole_weight))

    def left(weighed, judged, count):
        white, weight = weighed.white(samples), weighed.weight_per_prior
        order = _exchange(white, weight, select_greedily(BayesianPosterior.prior(white, weight), count, 0.0), UNLIMITED)
        return errors_after(judged.white(samples)[order], judged)[-1]

    assert left(there, there, 1) <= left(whole, there, 1) * 1.0001
    assert left(there, there, 10) <= left(whole, there, 10) * 1.02, "ten by exchanges are near the best ten, not they"
    box.write_text('schema = "edbb-region/1"\nlower_mm = [5000, 0, 0]\nupper_mm = [6000, 300, 500]\n')
    with pytest.raises(InputError, match="is in this box in 0 of"):
        places_in_region(box, measured.cell)


@pytest.mark.long
def test_a_program_counts_by_its_targets_and_their_tool(measured, tmp_path):
    before = CalibratedState.read(measured.folder / "known", measured.cell)
    q = np.array([[10.0, -80, 95, 5, 40, 0], [-20, -95, 100, 20, 50, 30], [35, -60, 80, -15, 60, -40]])
    names = ",".join(f"q{j}_deg" for j in range(1, 7))
    targets = tmp_path / "targets.csv"
    targets.write_text("\n".join([names, *(",".join(map(str, row)) for row in q.tolist())]) + "\n")
    counts = places_of_program(targets, before.folder / "robot.toml")
    np.testing.assert_allclose(np.degrees(counts.q), q, atol=1e-9)
    unknown = RemainingErrors.of(before, measured.cell, measured.second.samples, counts)
    assert "at the targets of targets.csv" in unknown.describe(1e-4, "0.1", "0.2")
    moved = before.known.aligned_spread(np.radians(q))
    assert np.trace(unknown.weight_per_prior) == pytest.approx((moved**2).sum() / len(q), rel=1e-6)
    other = replace(counts, p_FM=np.add(counts.p_FM, (0.1, 0.0, 0.0)))
    turned = RemainingErrors.of(before, measured.cell, measured.second.samples, other)
    assert np.trace(turned.weight_per_prior) != pytest.approx(np.trace(unknown.weight_per_prior), rel=1e-3)


def test_the_limit_is_what_is_stated_now_and_never_falls_below_the_error():
    """One direction is open before, as after few poses of a bar; many that are alike are left after."""
    weight = np.diag([1e-6, *[1e-9] * 40])
    few = square_error_limit(weight, np.zeros((0, 41)))
    for narrow in (0.8, 1.0, 1.3):
        stated, at_most = 1.02 * np.sqrt(np.trace(weight)), narrow * np.sqrt(few)
        before = Of(stated=stated, at_most=at_most, known=Of(file=Of(rest_mm=0.0)))
        errors = RemainingErrors(before, None, np.eye(41), np.zeros(41, dtype=bool), weight, weight)
        assert errors.state_limit(few) == pytest.approx(at_most)
        assert errors.state(np.trace(weight)) == pytest.approx(stated)
        limits = [errors.state_limit(few)]
        for readings in (1, 3, 10, 100):
            white = np.zeros((readings, 41))
            white[:, 0] = 3.0  # all see the one
            left = weight @ np.linalg.inv(np.eye(41) + white.T @ white)
            limits.append(errors.state_limit(square_error_limit(weight, white)))
            assert limits[-1] > errors.state(np.trace(left))
        assert np.all(np.diff(limits) < 0.0)


def test_ninety_five_of_a_hundred_sums_of_squares_stay_below():
    white = np.random.default_rng(0).standard_normal((7, 4))
    root = np.random.default_rng(1).standard_normal((3, 4))
    draws = np.random.default_rng(2).multivariate_normal(
        np.zeros(4), np.linalg.inv(white.T @ white + np.eye(4)), 200_000
    )
    expected = np.quantile(((draws @ root.T) ** 2).sum(axis=1), 0.95)
    assert square_error_limit(root.T @ root, white) == pytest.approx(expected, rel=0.08)


def test_several_calibrations_are_refused_and_one_named_twice_is_one(tmp_path):
    both = PlanOptions(after=[tmp_path / "a", tmp_path / "b"])
    with pytest.raises(InputError, match="identify them as one first"):
        _ = both.folder_before
    assert PlanOptions(after=[tmp_path, tmp_path]).folder_before == tmp_path
    assert PlanOptions(after=str(tmp_path)).folder_before == tmp_path
    assert PlanOptions().folder_before is None


@pytest.mark.slow
def test_no_rule_chooses_the_validation_poses():
    """They are none of the chosen poses, and among all others those that the rule likes are no more frequent."""
    session = BarPoses.__new__(BarPoses)
    cell = load_cell("kuka-kr6-r700/edbb", planning=False)
    q = np.random.default_rng(2).uniform(*cell.joint_range, (2000, 6))
    session.pool = PoseSet(Samples.at(q), None)
    session._find_unjoined_rows = lambda _: np.zeros(0, dtype=int)  # all are joined
    session.cell = replace(cell, plan=replace(cell.plan, validate=12))
    liked = np.random.default_rng(1).permutation(2000)  # rank of each candidate by the rule
    chosen = np.flatnonzero(liked < 20)
    ranks = []
    for seed in range(60):
        session.options = Of(seed=seed)
        drawn = session.draw_validation(Of(chosen=chosen))
        assert len(drawn) == 12
        assert not np.intersect1d(drawn, chosen).size
        ranks.append(liked[drawn].mean())
    assert np.mean(ranks) == pytest.approx((20 + 1999) / 2, abs=4 * 571 / np.sqrt(12 * 60))


def test_validation_poses_lie_where_the_chosen_poses_do_not():
    """Farther from the nearest chosen pose, by the joints that move the tool most, than poses drawn blindly."""
    cell = load_cell("kuka-kr6-r700/edbb", planning=False)
    q = np.random.default_rng(3).uniform(*cell.joint_range, (1000, 6))
    chosen = np.flatnonzero(q[:, 0] > 0.3)[:40]
    order = order_by_distance(cell, q, chosen, 0)
    assert sorted(order.tolist()) == np.setdiff1d(np.arange(1000), chosen).tolist()
    assert (q[order[:12], 0] < 0.3).sum() >= 9

    def apart(rows):
        return np.linalg.norm(q[rows][:, None, :3] - q[chosen][:, :3], axis=2).min(axis=1).mean()

    assert apart(order[:12]) > 1.3 * apart(order)
