"""The posterior mean as calibrated robot: against simulated arms judged anywhere, and a dense computation."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import planner.release.compromise as compromise
import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files
from planner.documents.expected_error import NAME as NAME_OF_FILE
from planner.documents.expected_error import (
    ExpectedError,
    expected_error_content,
    expected_error_csv,
    expected_error_text,
)
from planner.gauges.frame_gauge import ToolPosition
from planner.identification.pipeline import FitSettings, identify
from planner.inference.misfit import Misfit
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_runs
from planner.runs.run import Samples
from tests.identification.worlds import arm_of
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.course import course
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import Noise, Truth, draw_errors
from tests.test_tool_error import aligned

NAME = "kuka-kr6-r700"
DRAWN = 60  # robots: few directions, some of them rare and large, make up most of the error
WEAK = (Effect("reducer-ripple", 2, 3e-6, (("frequency", 2.0), ("phase", 0.7))),)
HIDDEN = (Effect("reducer-ripple", 2, 3e-4, (("frequency", 2.0), ("phase", 0.7))), Effect("joint-compliance", 3, 4e-5))


@cache
def judged_targets(seed, hidden=HIDDEN, geometry=False):
    """Calibration of an arm by 60 poses of a tracker, and the error (500,) [m] of its written robot, aligned."""
    arm, bench = arm_of(NAME), BENCHES[NAME]
    truth = Truth(seed, draw_errors(arm, np.random.default_rng([8, seed])), hidden, Noise(5e-6, 1e-5), (1.0,) * 6)
    with TemporaryDirectory() as folder:
        run, cell = runs.tracker(arm, n_poses=60, seed=seed, truth=truth, logs=()).write(folder)
        cell = load_cell(str(cell), planning=False)
        found = identify(load_runs([run], 6), cell, settings=FitSettings(geometry=geometry))
        for name, text in calibrated_files(found):
            (Path(folder) / name).write_text(text)
        robot = CalibratedRobot(load_robot(str(Path(folder) / "robot.toml")))
    q = np.random.default_rng(seed).uniform(*cell.joint_range, (500, 6))
    scene = course(arm, bench, "tracker", q, truth, np.random.default_rng(1), frozenset())
    x = scene.points(total(truth.of_arm(arm), catalogue.motions(scene, truth.effects)))
    p, R = robot.flange(q)
    return found, np.sqrt((aligned(x, p + R @ found.frames.tool[0].p_FM) ** 2).sum(axis=1))


def judged(seed, hidden=HIDDEN, geometry=False):
    """The same, and the root mean square of the error [m]."""
    found, off = judged_targets(seed, hidden, geometry)
    return found, float(np.sqrt((off**2).mean()))


def by_posterior(released):
    """The robot judged by the posterior alone, without what held-out regions say of it."""
    count = released.posterior.drawn.shape[1]
    return replace(released, misfit=Misfit(np.ones(count), np.zeros(count)))


@pytest.mark.long
def test_it_beats_geometry_alone_anywhere_and_states_its_error():
    """Of one arm: over arms the true error scatters by 1.6 about the stated one, one sigma of its logarithm."""
    found, off = judged(0)
    plain, off_plain = judged(0, geometry=True)
    assert off < 0.8 * off_plain
    assert 1.6**-2.5 < off / found.workspace_error < 2.0
    assert plain.release.basis == "geometry"
    assert plain.workspace_error == pytest.approx(found.release.geometry_anywhere)
    assert 0.4 < off_plain / plain.workspace_error < 2.0


@pytest.mark.slow
def test_the_written_robot_holds_the_posterior_mean():
    """Flange positions of the file against the model with all of its parameters; faint effects are left out."""
    found, _ = judged(0)
    released = found.released
    written = set(released.effects)
    all_of = [p.name for p in released.fit.model.parameters if p.group not in ("gauge", "geometry")]
    left = [n for n in all_of if n not in written and n in released.tool.names]
    values = dict(zip(released.fit.model.names, released.fit.errors, strict=True))
    for where, expected in ((released.tool, released.anywhere), (released.measured, found.release.where_measured)):
        moved = where.rows[:, :, [where.names.index(n) for n in left]] @ [values[n] for n in left]
        assert 0 < np.sqrt((moved**2).sum(axis=1).mean()) < 0.101 * expected


@pytest.mark.slow
def test_the_expected_error_is_that_of_drawn_robots():
    """Errors drawn from the posterior move the tool, on average, as far as is stated."""
    released = by_posterior(judged(0)[0].released)
    fit, tool = released.posterior.fit, released.tool
    root = fit.solution.root(fit.problem.prior)
    at = [fit.model.names.index(n) for n in tool.names]
    drawn = root[at] @ np.random.default_rng(0).standard_normal((root.shape[1], 400))
    rms = np.sqrt((released.expected_errors(fit) ** 2).mean())
    assert np.sqrt(tool.square(drawn).mean() / 400) == pytest.approx(rms, rel=0.1)
    own = np.sqrt(
        tool.square(released.posterior.drawn[at] - fit.errors[at, None]).mean() / released.posterior.drawn.shape[1]
    )
    assert own == pytest.approx(rms, rel=0.1)
    assert released.anywhere < released.at_most


def test_the_error_at_poses_like_those_measured_is_that_of_drawn_robots():
    """Eight of them, by the whole forward model at the run's own poses, their bases aligned there (Kabsch)."""
    found = judged(0)[0]
    released = by_posterior(found.released)
    fit, q = released.fit, released.measured.q
    assert np.array_equal(q, found.run.samples.q)
    model = replace(fit.model, setup=replace(fit.model.setup, gauge=ToolPosition(noise=0.0)))
    moving = [k for k, n in enumerate(fit.model.names) if n in released.tool.names]
    model, samples = model.subset(moving), Samples(q, np.zeros(len(q), dtype=int))
    written, drawn = model.reading(samples, fit.errors[moving]), released.posterior.drawn[moving]
    count = drawn.shape[1]
    none = Misfit(np.ones(count), np.zeros(count))  # nor drift: what joint angles do not determine stands beside
    stated = replace(released, misfit=none, drift=np.zeros(count)).drawn_errors(fit, released.measured)
    for k in range(0, drawn.shape[1], drawn.shape[1] // 8):
        off = aligned(model.reading(samples, drawn[:, k]), written)
        assert np.sqrt((off**2).sum(axis=1).mean()) == pytest.approx(stated[k], rel=0.05)
    assert found.release.where_measured < found.workspace_error


@pytest.mark.long
@pytest.mark.parametrize("factor", [1.0, compromise.NOTICED])
def test_a_robot_part_way_is_as_likely_worse_than_geometry_as_is_accepted(factor, monkeypatch):
    """Counted over the drawn robots, at every probability that ends part of the way."""
    released = by_posterior(judged(0, WEAK)[0].released)
    before = replace(released, fit=released.geometry, share=0.0)
    aim = compromise.minimise_expected_error(before)
    partial = 0
    monkeypatch.setattr(compromise, "NOTICED", factor)
    for doubt in np.linspace(0.02, 0.7, 36):
        monkeypatch.setattr(compromise, "DOUBT", doubt)
        share = compromise.safe_share(before, aim)
        if not 0.0 < share < 1.0:
            continue
        there = compromise.interpolate_fit(released.geometry, aim, share)
        worse = (released.drawn_errors(there) > factor * released.drawn_errors(released.geometry)).mean()
        assert worse == pytest.approx(doubt, abs=2 / released.posterior.drawn.shape[1])
        partial += 1
    assert partial >= 3


@cache
def known():
    """The calibrated robot as written, with what lies beside it, and the calibration."""
    found = judged(0)[0]
    files = dict(calibrated_files(found))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.toml"
        path.write_text(files["robot.toml"])
        text = expected_error_text(expected_error_content(by_posterior(found.released), found.run), files["robot.toml"])
        (Path(folder) / NAME_OF_FILE).write_text(text)
        return found, ExpectedError.read(load_robot(str(path)), path)


@pytest.mark.slow
def test_an_expected_error_that_was_edited_is_not_taken(tmp_path):
    found, expected = known()
    (tmp_path / "robot.toml").write_text(dict(calibrated_files(found))["robot.toml"])
    written = json.loads(expected_error_text(expected.file.model_dump(mode="json", by_alias=True), "schema = 1"))
    content = written | {"rest_mm": 0.0}
    (tmp_path / NAME_OF_FILE).write_text(json.dumps(content))
    said = ExpectedError.read(found.setup.robot, tmp_path / "robot.toml")
    assert "was changed by hand since edbb wrote it (rest_mm)" in str(said)


@pytest.mark.slow
@pytest.mark.parametrize("offset", [pytest.param(None, marks=pytest.mark.long), (0.1, -0.05, 0.2)])
def test_the_file_expects_at_a_programs_poses_what_drawn_robots_do(offset):
    """Robots drawn from the posterior, by the whole forward model, their bases aligned over the workspace (Kabsch)."""
    found, expected = known()
    fit, tool = found.released.posterior.fit, found.released.tool
    p_FM = tool.p_FM if offset is None else np.array(offset)
    states, poses = tool.q[::24], found.run.samples.q[:12] + np.random.default_rng(1).normal(0, 0.1, (12, 6))
    samples = Samples(np.concatenate([states, poses]), np.zeros(len(states) + 12, dtype=int))
    moving = [k for k, n in enumerate(fit.model.names) if n in tool.names]
    alone = replace(fit.model.setup, gauge=ToolPosition(noise=0.0), p_FM=p_FM[None])
    model = replace(fit.model.subset(moving), setup=alone)
    on_tool = np.array([n.startswith("map_") for n in model.names])
    free = 1.0 if offset is None else np.where(on_tool, 0.0, 1.0)  # where another tool's point sits is known
    mean, root = free * fit.errors[moving], np.reshape(free, (-1, 1)) * fit.solution.root(fit.problem.prior)[moving]
    nominal, calibrated = (model.reading(samples, v) for v in (np.where(on_tool, mean, 0.0), mean))
    square = np.zeros((2, 12))
    for z in np.random.default_rng(2).standard_normal((DRAWN, root.shape[1])):
        x = model.reading(samples, mean + root @ z)
        for k, believed in enumerate((nominal, calibrated)):
            turn, _ = Rotation.align_vectors(*(v[: len(states)] - v[: len(states)].mean(axis=0) for v in (x, believed)))
            off = x - x[: len(states)].mean(axis=0) - turn.apply(believed - believed[: len(states)].mean(axis=0))
            square[k] += (off[len(states) :] ** 2).sum(axis=1) / DRAWN
    at, (nominal_share, _, share) = expected.at(poses, p_FM), expected.file.likely_share
    assert 0.5 < share <= 1.2  # a median beside a mean square
    assert np.sqrt((at.nominal**2).mean()) == pytest.approx(nominal_share * np.sqrt(square[0].mean()), rel=0.1)
    assert np.sqrt((at.released**2).mean()) == pytest.approx(share * np.sqrt(square[1].mean()), rel=0.3)
    ratio = at.released / share / np.sqrt(square[1])
    assert 0.5 < ratio.min() < ratio.max() < 2.0


@pytest.mark.slow
def test_what_was_written_expects_over_the_workspace_what_the_identification_states():
    found, expected = known()
    released = by_posterior(found.released)
    at = expected.at(released.tool.q, released.tool.p_FM)
    for errors, fit in ((at.nominal, None), (at.geometry, released.geometry), (at.released, released.fit)):
        assert np.sqrt((errors**2).mean()) == pytest.approx(released.likely_workspace_error(fit), rel=0.02)
    rows = np.loadtxt(expected_error_csv(found.released).splitlines(), delimiter=",", skiprows=1)
    assert rows.shape[1] == 6 + 3 + 3
    stated = (found.release.nominal_anywhere, found.release.geometry_anywhere, found.workspace_error)
    assert np.sqrt((rows[:, -3:] ** 2).mean(axis=0)) == pytest.approx([1e3 * e for e in stated], rel=1e-3)


@pytest.mark.long
def test_the_compromise_has_the_least_mean_square_error_over_that_of_geometry_alone():
    """Over the drawn robots: against the posterior mean, and steps towards robots drawn and away from them."""
    released = by_posterior(judged(0, WEAK)[0].released)
    before = replace(released, fit=released.geometry, share=0.0)
    aim, alone = compromise.minimise_expected_error(before), before.drawn_errors(before.geometry)

    def ratio(fit):
        return ((before.drawn_errors(fit) / alone) ** 2).mean()

    drawn = before.posterior.drawn
    noise = 5 * drawn.std(axis=1) / np.sqrt(drawn.shape[1])  # of a mean over the drawn robots
    assert ratio(aim) < ratio(before.posterior.fit)
    assert ratio(aim) < ratio(before.geometry)
    for own in np.random.default_rng(0).permutation(drawn.T)[:20]:
        for step in (0.3, -0.3):
            assert ratio(aim) < ratio(compromise.interpolate_fit(aim, compromise.with_values(aim, own), step))
    best = drawn @ (alone**-2 / (alone**-2).sum())
    assert np.all(np.abs(aim.errors - best) <= noise)
