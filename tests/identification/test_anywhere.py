"""How well a robot is known over its workspace: against arms that are measured, calibrated and judged everywhere."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import tests.simulation.generator.catalogue as catalogue
import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files
from planner.fit.covariance import workspace_warning
from planner.identification.pipeline import identify
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Metrics
from planner.runs.loader import load_runs
from tests.identification.worlds import arm_of
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.course import course
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.scene import total
from tests.simulation.generator.truth import Noise, Truth, draw_errors
from tests.test_tool_error import aligned

NAME = "kuka-kr6-r700"
SEEDS = range(6)
SOFT = tuple(Effect("joint-compliance", j, 3e-5) for j in (2, 3))


@pytest.mark.long
@pytest.mark.parametrize(("gauge", "poses"), [("edbb_static", 60), ("tracker", 40)])
def test_the_expected_error_is_that_of_calibrated_arms_at_poses_all_over(gauge, poses):
    """Six arms with errors in everything and soft joints; few poses, so that there is something to be known badly."""
    found, expected = np.array([_judged(gauge, poses, seed) for seed in SEEDS]).T
    assert 0.6 < np.sqrt(found.mean() / (expected**2).mean()) < 1.5


def _judged(gauge, poses, seed):
    """Mean square error over joint space after the best alignment [m²], and the error that the fit expects [m]."""
    arm, bench = arm_of(NAME), BENCHES[NAME]
    truth = Truth(seed, draw_errors(arm, np.random.default_rng([8, seed])), SOFT, Noise(2e-6, 1e-5), (1.0,) * 6)
    with TemporaryDirectory() as folder:
        run, cell = getattr(runs, gauge)(arm, n_poses=poses, seed=seed, truth=truth, logs=()).write(folder)
        cell = load_cell(str(cell), planning=False)
        fit = identify(load_runs([run], 6), cell)
        for name, text in calibrated_files(fit):
            (Path(folder) / name).write_text(text)
        robot = CalibratedRobot(load_robot(str(Path(folder) / "robot.toml")))
    assert fit.stages[-1].name == "joint compliance"
    q = np.random.default_rng(seed).uniform(*cell.joint_range, (800, 6))
    scene = course(arm, bench, "tracker", q, truth, np.random.default_rng(1), frozenset())
    x = scene.points(total(truth.of_arm(arm), catalogue.motions(scene, truth.effects)))
    p, R = robot.flange(q)
    left = aligned(x, p + R @ fit.frames.tool[0].p_FM)
    return float((left**2).sum(axis=1).mean()), fit.workspace_error


def test_a_reader_is_told_where_held_out_samples_promise_more_than_the_fit_knows():
    held_out = Metrics(rms=1e-4, mean=8e-5, largest=2e-4)
    assert not workspace_warning(2.9e-4, held_out, 3)
    (said,) = workspace_warning(3.1e-4, held_out, 3)
    assert "0.310 mm" in said
    assert not workspace_warning(3.1e-4, held_out, 1)  # a bar reads one of three axes
    assert workspace_warning(5.3e-4, held_out, 1)
