"""``edbb loaded`` from files to files, beside a tracker and in one fit with runs without load."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy.stats import chi2

import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.reading import load_cell
from planner.common.progress import Stages
from planner.loaded.evaluation import compare_with_tracker
from planner.loaded.joint_fit import averaged_run, averages_noise, fit_jointly
from planner.report.loaded_report import loaded_charts
from planner.runs.loader import load_runs
from planner.runs.run import Readings, Run, Samples
from planner.runs.writer import save_run
from planner.workflow.circle_evaluation import evaluate_loaded
from planner.workflow.identification import identify

E, E_TRUE = np.array([1.3, 0.9, 0.9]), np.array([1.301, 0.8995, 0.9007])


def quiet():
    return Stages(lambda *_: None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A loaded run, a tracker's run and a bar's run without load of one arm, and a cell with both fixtures."""
    here, rng = tmp_path_factory.mktemp("loaded"), np.random.default_rng(5)
    truth, way = world.World(errors=shared.ERRORS, wander=4e-6), shared.course()
    length, _ = world.readings(shared.arm(), truth, way, rng)
    (here / "loaded.csv").write_text(world.run_text(way, length))
    single = world.course(shared.arm(), loads=(0.0,), repeats=1)
    x = world.true_point(shared.arm(), truth, single.q, 0 * single.force, world.FIXTURE)
    c, s = np.cos(2.2), np.sin(2.2)
    seen = (x - [3.0, 2.0, 1.0]) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) + rng.normal(0, 5e-6, x.shape)
    save_run(Run(
        "tracker", Samples(q=single.q, place=np.zeros(len(x), int), t=single.t), Readings(position=seen),
        continuous=True, robot="abb-irb6700"), here / "tracker.csv")  # fmt: skip
    way_out = rng.normal(size=(110, 3))
    way_out[:, 2] = np.abs(way_out[:, 2])
    targets = E + way_out / np.linalg.norm(way_out, axis=1, keepdims=True) * rng.uniform(0.3, 0.6, (110, 1))
    q = world.reach(shared.arm(), targets, rng)
    x = world.true_point(shared.arm(), truth, q, np.zeros(len(q)), E_TRUE)
    free = np.linalg.norm(x - E_TRUE, axis=1) + 3e-4 + rng.normal(0, 5e-6, len(q))
    samples = Samples(q=q, place=np.zeros(len(q), int))
    save_run(Run("free", samples, Readings(length=free), ("E",), robot="abb-irb6700"), here / "free.csv")
    text = shared.cell_text().replace("length_mm = [128, 135]", "length_mm = [125, 620]")
    (here / "cell.toml").write_text(text + '\n[[fixtures]]\nname = "E"\nposition_mm = [1300, 900, 900]\n')
    return here


@pytest.fixture(scope="module")
def done(folder):
    return evaluate_loaded(
        [folder / "loaded.csv"], cell=str(folder / "cell.toml"), tracker=folder / "tracker.csv",
        unloaded=[folder / "free.csv"],
    )  # fmt: skip


@pytest.mark.slow
def test_the_tracker_sees_the_same_kinematic_error(done):
    (circle,) = done.found.circles
    assert np.abs(circle.tracker.tracker).max() > 3e-5
    assert circle.tracker.mean < 5e-6


@pytest.mark.slow
def test_a_tracker_in_one_sense_is_compared_in_that_sense():
    """Reversal splits the senses by tens of micrometres; a tracker that went one way round sees one of them."""
    truth, _, found = shared.evaluated()
    (circle,) = found.circles
    apart = np.abs(np.diff(circle.kinematic, axis=0)).mean()
    assert apart > 1e-5
    for sense in (1, -1):
        way = world.course(shared.arm(), loads=(0.0,), directions=(sense,), repeats=1)
        x = world.true_point(shared.arm(), truth, way.q, 0 * way.force, world.FIXTURE, sense=way.sense)
        samples = Samples(q=way.q, place=np.zeros(len(x), int), t=way.t)
        run = Run("t", samples, Readings(position=x), continuous=True, robot="abb-irb6700")
        setup = shared.setup(shared.run_of(way, np.ones(len(x))))
        assert compare_with_tracker(shared.cell(), setup, circle, run).mean < 0.3 * apart


@pytest.mark.slow
def test_a_tracker_of_another_robot_would_not(done):
    """The comparison can fail: a kinematic error that is not there is seen."""
    (circle,) = done.found.circles
    wrong = circle.kinematic + 5e-5 * np.cos(3 * circle.curves.theta)
    other = type(circle)(**{**vars(circle), "kinematic": wrong})
    run = Run(
        "t", Samples(q=circle.curves.q[0, 0], place=np.zeros(len(circle.curves.theta), int)),
        Readings(position=world.circle_points(circle.curves.theta)), robot="abb-irb6700",
    )  # fmt: skip
    setup = shared.setup(Run("x", run.samples, Readings(length=np.ones(len(run))), ("A",)))
    assert compare_with_tracker(shared.cell(), setup, other, run).mean > 2e-5


@pytest.mark.slow
def test_one_fit_of_both_knows_what_neither_knows_alone(done):
    joint, alone = done.joint, done.found.compliances
    assert joint is not None
    std = {e.name: e.std for e in joint.estimates}
    better = [std[n] / s for n, s in zip(alone.names, alone.std, strict=True) if std[n] is not None]
    assert len(better) == 6
    assert max(better) < 0.8
    assert joint.rms[1] < 4e-6


@pytest.mark.slow
def test_readings_without_load_that_are_far_off_are_as_good_as_left_out(done, folder):
    free, loaded, turns = load_runs([folder / "free.csv"], 6), averaged_run(done.found), averages_noise(done.found)
    length, wrong = np.array(free.readings.length), [17, 60]
    length[wrong] += [1e-2, -1e-4]
    spoiled = replace(free, readings=replace(free.readings, length=length))
    left = np.setdiff1d(np.arange(len(free)), wrong)
    fewer = replace(free, samples=free.samples.take(left), readings=free.readings.take(left))
    cell = load_cell(str(folder / "cell.toml"), planning=False)
    theirs, mine = (fit_jointly(cell, run, loaded, turns) for run in (fewer, spoiled))
    std = np.sqrt(np.diag(theirs.covariance))
    assert mine.names == theirs.names
    assert np.abs((mine.errors - theirs.errors) / std).max() < 0.1
    assert np.sqrt(np.diag(mine.covariance)) == pytest.approx(std, rel=0.05)
    assert mine.problems == ()


@pytest.mark.slow
def test_compliances_of_the_joint_fit_are_true(done):
    joint = done.joint
    which = [joint.names.index(f"compliance{i + 1}") for i in range(6)]
    off = joint.errors[which] - world.SOFT
    square = float(off @ np.linalg.solve(joint.covariance[np.ix_(which, which)], off))
    assert square < chi2.ppf(0.9999, 6)


@pytest.mark.long
def test_the_averaged_run_goes_into_any_fit(done, folder, tmp_path):
    save_run(averaged_run(done.found), tmp_path / "averaged.csv")
    whole = load_runs([folder / "free.csv", tmp_path / "averaged.csv"], 6)
    assert whole.samples.force is not None
    assert set(np.unique(np.round(whole.samples.force))) == {0, 125, 250, 375, 500, 625}
    assert any("taken as no pull" in w for w in whole.warnings)
    paths = [folder / "free.csv", tmp_path / "averaged.csv"]
    found = identify(paths, cell=folder / "cell.toml", no_trace=True).calibration
    assert found.stages[-1].name == "joint compliance"
    assert {"zero", "zero_loaded"} <= {e.name for e in found.estimates}  # one for each bar
    assert found.stages[-1].held_out.rms < 0.1 * found.stages[-2].held_out.rms


@pytest.mark.slow
def test_files(done, tmp_path, browser):
    done.write(tmp_path / "out")
    content = json.loads((tmp_path / "out" / "loaded.json").read_text())
    assert content["schema"] == "edbb-loaded/1"
    assert [c["name"] for c in content["compliances"]] == [f"compliance{i + 1}" for i in range(6)]
    joint = load_runs([tmp_path / "out" / "joint.csv"], 6)
    assert not joint.continuous
    assert set(joint.places) == {"E", "A"}
    assert joint.samples.torque is None
    assert {"rms_without_load_um", "rms_with_load_um"} <= set(content["joint"])
    table = pl.read_csv(tmp_path / "out" / "curves.csv")
    (circle,) = done.found.circles
    assert len(table) == circle.curves.length.size
    base = table.filter(pl.col("load_N") == table["load_N"].min())
    assert base["deflection_um"].abs().max() == 0.0
    assert len(loaded_charts(done.found)) == 5
    assert len(browser.check_report(tmp_path / "out" / "report.html")) == 5  # loaded.html.j2
    page = (tmp_path / "out" / "report.html").read_text().replace("\u00a0", " ")
    assert all(s.replace("'", "&#39;") in page for s in done.found.sentences)


@pytest.mark.slow
def test_a_run_of_another_plan_is_refused(folder, tmp_path):
    from planner.common.errors import InputError

    (tmp_path / "plan.json").write_text('{"schema": "edbb-plan/1", "plan_id": "abcabcabcabc", "robot": "abb-irb6700"}')
    text = "# plan_id: def\n" + (folder / "loaded.csv").read_text()
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match="belongs to the plan def"):
        evaluate_loaded([tmp_path / "run.csv"], cell=shared.CELL, plan=tmp_path / "plan.json")


@pytest.mark.slow
def test_joint_runs_need_fixtures_of_their_own(done):
    from planner.common.errors import InputError

    run = averaged_run(done.found)
    with pytest.raises(InputError, match="shares the fixture 'A'"):
        fit_jointly(shared.cell(), run, run, ())
