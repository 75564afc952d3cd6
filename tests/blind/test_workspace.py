"""The judge of robots over the workspace, where the answer is known."""

import json
from dataclasses import asdict, replace

import numpy as np

from tests.blind.workspace import (
    SCALE,
    Outcome,
    Task,
    arm_tool,
    difference,
    gauge_scale,
    hidden_effects,
    states_anywhere,
    true_tool,
)
from tests.blind.workspace_table import read_log, table
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.truth import draw_truth

NAME = "comau-nj130"
TASK = Task("edbb", "plan", 0, False, 1)


def test_a_moved_base_is_no_error_and_a_turned_joint_is_one():
    arm, bench, rng = Arm.from_toml(NAME), BENCHES[NAME], np.random.default_rng(3)
    q = states_anywhere(arm, bench, rng)
    x = arm_tool(arm, bench, {}, q)
    assert len(q) == 500
    assert x[:, 2].min() > 0.0
    moved = arm_tool(arm, bench, {"base_x": 0.1, "base_rz": 0.3, "theta1": 0.01}, q)
    assert np.abs(difference(moved, x)).max() < 1e-12
    assert 1e-4 < length(difference(arm_tool(arm, bench, {"theta3": 1e-3}, q), x)).mean() < 2e-3


def length(x):
    return np.linalg.norm(x, axis=1)


def test_hidden_effects_move_the_true_tool():
    arm, bench, rng = Arm.from_toml(NAME), BENCHES[NAME], np.random.default_rng(4)
    q = states_anywhere(arm, bench, rng)
    for outside in (False, True):
        effects = hidden_effects(arm, rng, 3, outside)
        truth = draw_truth(arm, 5, effects)
        bare = difference(true_tool(arm, bench, truth, q), arm_tool(arm, bench, dict(truth.errors), q))
        assert len({(e.kind, e.joint) for e in effects}) == 3
        assert length(bare).mean() > 2e-5


def test_the_scale_of_a_gauge_is_off_and_moves_no_tool():
    drawn = [gauge_scale(replace(TASK, seed=k)).size / SCALE["edbb"] for k in range(400)]
    assert abs(np.std(drawn) - 1) < 0.15
    arm, bench = Arm.from_toml(NAME), BENCHES[NAME]
    q = states_anywhere(arm, bench, np.random.default_rng(5))[:20]
    one, other = (true_tool(arm, bench, draw_truth(arm, 5, e), q) for e in ([], [gauge_scale(TASK)]))
    assert np.array_equal(one, other)


def test_the_table_says_which_arms_came_out_worse():
    outcomes = [
        Outcome(TASK, 1e-3, 2e-4, 1e-4, 1e-4, rms=1.1e-4, stated=1e-4),
        Outcome(TASK, 1e-3, 1e-4, 1.2e-4, 1e-4, rms=1.1e-4, stated=1e-4),
        Outcome(TASK, failed="broken: here\nthere"),
    ]
    lines = list(table(outcomes))
    assert lines[1].split()[3:10] == ["2", "1.000", "0.150", "0.110", "0.85", "1.20", "1"]
    assert lines[2].startswith("failed: edbb plan 0 1: broken")


def test_a_log_that_was_cut_off_is_read_as_far_as_it_goes(tmp_path):
    log, whole = tmp_path / "log.jsonl", replace(Outcome(TASK, 1e-3, 2e-4, 1e-4), found=("gear, joint 1",))
    text = json.dumps(asdict(whole))
    log.write_text(f"{text}\n{text[:40]}")
    assert [(o.task, o.geometry, list(o.found)) for o in read_log(log)] == [(TASK, 2e-4, ["gear, joint 1"])]
