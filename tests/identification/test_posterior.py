"""The posterior mean as calibrated robot: against simulated arms judged anywhere, and a dense computation."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.identification.calibrated_robot import CalibratedRobot, calibrated_files
from planner.identification.pipeline import FitSettings, identify
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_runs
from tests.identification.worlds import arm_of
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.course import course
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import Noise, Truth, draw_errors
from tests.test_tool_error import aligned

NAME = "kuka-kr6-r700"
HIDDEN = (Effect("reducer-ripple", 2, 3e-4, (("frequency", 2.0), ("phase", 0.7))), Effect("joint-compliance", 3, 4e-5))


@cache
def judged(seed, hidden=HIDDEN, geometry=False):
    """Calibration of an arm by 60 poses of a tracker, and the error [m] of its written robot anywhere, aligned."""
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
    return found, float(np.sqrt((aligned(x, p + R @ found.frames.tool[0].p_FM) ** 2).sum(axis=1).mean()))


def test_it_beats_geometry_alone_anywhere_and_states_its_error():
    found, off = judged(0)
    plain, off_plain = judged(0, geometry=True)
    assert off < 0.8 * off_plain
    assert 0.4 < off / found.workspace_error < 2.0
    assert plain.release.basis == "geometry"
    assert plain.workspace_error == pytest.approx(found.release.geometry_anywhere)
    assert 0.4 < off_plain / plain.workspace_error < 2.0


def test_the_written_robot_holds_the_posterior_mean():
    """Flange positions of the file against the model with all of its parameters; faint effects are left out."""
    found, _ = judged(0)
    released = found.released
    written = set(released.effects)
    all_of = [p.name for p in released.fit.model.parameters if p.group not in ("gauge", "geometry")]
    left = [n for n in all_of if n not in written and n in released.tool.names]
    values = dict(zip(released.fit.model.names, released.fit.errors, strict=True))
    moved = released.tool.rows[:, :, [released.tool.names.index(n) for n in left]] @ [values[n] for n in left]
    assert np.sqrt((moved**2).sum(axis=1).mean()) < 1.01e-6


def test_the_expected_error_is_that_of_drawn_robots():
    """Errors drawn from the posterior move the tool, on average, as far as is stated."""
    released = judged(0)[0].released
    fit, tool = released.posterior.fit, released.tool
    root = fit.solution.root(fit.problem.prior)
    at = [fit.model.names.index(n) for n in tool.names]
    drawn = root[at] @ np.random.default_rng(0).standard_normal((root.shape[1], 400))
    assert np.sqrt(tool.square(drawn).mean() / 400) == pytest.approx(released.anywhere, rel=0.1)
