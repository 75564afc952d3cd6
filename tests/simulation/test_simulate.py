"""Simulated runs against an arm that shares no code with the planner, and what a wrong truth is told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from planner.cell.cell import setup_of
from planner.cell.reading import load_cell, read_cell
from planner.common.errors import InputError
from planner.design.candidates.balls import draw_ball_candidates
from planner.runs.loader import load_run
from planner.runs.run import Readings, Samples
from planner.runs.writer import save_run
from planner.session.document import read_plan
from planner.simulation.assumptions import CORRELATION_TIME
from planner.simulation.simulated_run import SAMPLE_RATE, SimulatedRun, simulate_run
from planner.simulation.truth import draw_truth, read_truth
from planner.workflow.plan_results import SimulationResult
from planner.workflow.plan_use import simulate
from tests.simulation.generator.arm import GRAVITY, Arm, moment_of_weight
from tests.simulation.made import plan_folder, truth_file

SILENT = "[noise]\ngauge_um = 0\nrepeatability_mm = 0\n"
ERRORS = """[errors]
a2_mm = 0.4
theta3_deg = 0.02
alpha1_urad = -300
map_z_um = 250
fixture_A_x_mm = -1.5
fixture_A_y_mm = 0.7
zero_mm = 0.3
compliance2_urad_Nm = 1.5
compliance3_deg_Nm = 2e-4
"""


def simulated_run(plan, truth=None, seed=0):
    return simulate(plan, truth=truth, seed=seed).run


def world(robot, cell, q):
    """Lengths of the same errors on the independent arm [m]."""
    arm = Arm.from_toml(robot)
    tool, com = cell.tool.p_FM + np.array([0, 0, 250e-6]), cell.tool.com_F
    stance = arm.walk(q, {}, keep=["theta2", "theta3"])
    load = stance.p + np.einsum("ijn,j->in", stance.R, com)
    give = {2: 1.5e-6, 3: np.deg2rad(2e-4)}
    sag = {}
    for joint, c in give.items():
        moment = moment_of_weight(arm, stance, f"theta{joint}", arm.mass, [(cell.tool.mass, load)])
        sag[joint] = c * moment * 9.80665 / GRAVITY
    errors = {"a2": 0.4e-3, "theta2": sag[2], "theta3": np.deg2rad(0.02) + sag[3], "alpha1": -300e-6}
    R, p = arm.flange(q, errors)
    fixture = cell.fixtures[0].p_BX + np.array([-1.5e-3, 0.7e-3, 0])
    return np.linalg.norm(p + R @ tool - fixture, axis=1) + 0.3e-3, max(np.abs(v).max() for v in sag.values())


@pytest.mark.parametrize("robot", ["kuka-kr6-r700", "comau-nj130"])
def test_lengths_are_those_of_an_independent_arm(tmp_path, robot):
    plan = plan_folder(tmp_path, robot)
    run = simulated_run(plan, truth_file(tmp_path, ERRORS + SILENT), 0)
    cell = read_cell(tmp_path / "cell.toml", "cell")
    expected, sag = world(robot, cell, run.samples.q)
    assert np.abs(run.readings.length - expected).max() < 1e-9
    assert sag > 1e-6  # the compliance took part
    nominal = simulated_run(plan, truth_file(tmp_path, SILENT), 0)
    assert np.abs(run.readings.length - nominal.readings.length).max() > 1e-4


def test_a_plan_at_rest_gives_one_sample_a_visit(tmp_path):
    run = simulated_run(plan_folder(tmp_path), None, 3)
    assert not run.continuous
    assert run.samples.pose.tolist() == [1, 2, 3, 4, 5]  # every role but the mounting poses
    assert run.plan_id == "0123456789ab"
    assert run.robot == "kuka-kr6-r700"
    moved = np.diff(run.samples.q, axis=0)
    assert (run.samples.direction[1:] == np.sign(moved)).all()
    cell = read_cell(tmp_path / "cell.toml", "cell")
    shortest = (np.abs(moved) / cell.robot.speed).max(axis=1) + cell.motion.dwell + cell.motion.settle
    assert (np.diff(run.samples.t) > shortest).all()


def test_a_driven_plan_is_sampled_both_ways(tmp_path):
    run = simulated_run(plan_folder(tmp_path, "comau-nj130"), truth_file(tmp_path, SILENT), 0)
    t, q, pose = run.samples.t, run.samples.q, run.samples.pose
    assert run.continuous
    assert np.allclose(np.diff(t)[:-1], 1 / SAMPLE_RATE)
    turn = len(q) // 2
    away, _ = KDTree(q[: turn + 100]).query(q[turn - 100 :])
    assert away.max() <= np.linalg.norm(np.diff(q, axis=0), axis=1).max()  # back the way it came
    between = np.abs(np.diff(q, axis=0) * SAMPLE_RATE - (run.samples.speed[1:] + run.samples.speed[:-1]) / 2)
    jerk = read_cell(tmp_path / "cell.toml", "cell").robot.jerk
    assert (between[:-1].max(axis=0) < jerk / SAMPLE_RATE**2 / 10).all()  # of a trapezoid: jerk · dt² / 12
    order = pose[np.flatnonzero(np.diff(pose, prepend=-1))]
    assert order.tolist() == [0, 1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1, 0]
    poses = json.loads((tmp_path / "plan.json").read_text())["poses"]
    for p in poses[2:5]:  # visited once each way: where one is passed closest its own number stands
        away = np.linalg.norm(np.rad2deg(q) - p["q_deg"], axis=1)
        assert pose[away.argmin()] == p["id"]


@pytest.mark.slow
def test_what_is_saved_is_what_is_loaded(tmp_path):
    for robot in ("kuka-kr6-r700", "comau-nj130"):
        run = simulated_run(plan_folder(tmp_path / robot, robot), None, 1)
        save_run(run, tmp_path / "run.csv")
        back = load_run(tmp_path / "run.csv", 6)
        assert back.warnings == ()
        assert back.continuous == run.continuous
        assert (back.plan_id, back.robot, back.places) == (run.plan_id, run.robot, run.places)
        assert np.abs(back.samples.q - run.samples.q).max() < 1e-10
        assert np.abs(back.readings.length - run.readings.length).max() < 1e-11
        assert (back.samples.pose == run.samples.pose).all()


def test_two_fixtures_are_measured_one_after_the_other(tmp_path):
    plan = plan_folder(tmp_path, fixtures=2)
    run = simulated_run(plan, truth_file(tmp_path, "[errors]\nfixture_B_z_mm = 2\n" + SILENT), 0)
    none = simulated_run(plan, truth_file(tmp_path, SILENT), 0)
    assert run.samples.place.tolist() == [0] * 5 + [1] * 5
    assert (np.diff(run.samples.t) > 0).all()
    moved = run.readings.length - none.readings.length
    assert np.abs(moved[:5]).max() == 0.0
    assert np.abs(moved[5:]).min() > 1e-5


def test_noise_has_the_size_that_is_said(tmp_path):
    cell_only = plan_folder(tmp_path)
    gauge = "[noise]\ngauge_um = 20\nrepeatability_mm = 0\n"
    shaken = "[noise]\ngauge_um = 0\nrepeatability_mm = 0.3\n"
    cell, plan = read_cell(tmp_path / "cell.toml", "cell"), read_plan(cell_only)
    still = simulated_run(cell_only, truth_file(tmp_path, SILENT), 0)
    off = {}
    for name, text in (("gauge", gauge), ("joints", shaken)):
        truth = read_truth(truth_file(tmp_path, text), cell, still.samples)
        runs = [simulate_run(cell, plan.plan_id, still.samples, truth, seed) for seed in range(120)]
        lengths = np.array([run.readings.length for run in runs])
        off[name] = lengths - still.readings.length
    assert abs(off["gauge"].std() / 20e-6 - 1) < 0.1  # 600 draws: 3 % is one sigma
    at_home = cell.map_jacobian(cell.home[None])[0]
    sigma = setup_of(cell).joint_sigma * 0.3e-3 / cell.robot.repeatability
    assert abs(np.sqrt((at_home**2).sum()) * sigma - 0.1e-3) < 1e-9  # published is three sigma
    assert 0.2e-4 < off["joints"].std() < 1.2e-4  # its share along the bar
    assert not np.allclose(off["joints"][0], off["joints"][1])


@pytest.mark.slow
def test_joints_wander_along_a_drive(tmp_path):
    plan = plan_folder(tmp_path, "comau-nj130", fixtures=2)
    still = simulated_run(plan, truth_file(tmp_path, SILENT), 0)
    text = "[noise]\ngauge_um = 0\nrepeatability_mm = 0.06\n"
    truth = read_truth(truth_file(tmp_path, text), read_cell(tmp_path / "cell.toml", "cell"), still.samples)
    run = simulated_run(plan, truth_file(tmp_path, text), 0)
    lever = np.linalg.norm(truth.model.joint_rows(still.samples)[:, 0], axis=1)
    off = (run.readings.length - still.readings.length) / lever / truth.model.joint_sigma
    # independent stretches; 7 % is one sigma of the spread below
    assert len(off) * CORRELATION_TIME > 500 * SAMPLE_RATE
    assert abs(off.std() - 1) < 0.15
    later = [np.corrcoef(off[:-k], off[k:])[0, 1] for k in (1, int(SAMPLE_RATE * CORRELATION_TIME))]
    assert np.allclose(later, np.exp([-1 / SAMPLE_RATE / CORRELATION_TIME, -1]), atol=0.12)
    first = np.flatnonzero(np.diff(still.samples.session, prepend=-1))
    assert len(first) == 2
    assert np.abs(off[first]).min() > 1e-3  # it wanders from the first sample on


@pytest.mark.slow
def test_drawn_errors_have_the_sizes_of_the_prior_and_are_told(tmp_path):
    measured = ("[[fixtures]]\n", '[[fixtures]]\nset_up = "measured"\n')  # else it stands where the robot comes
    plan = plan_folder(tmp_path, changes=(measured,))
    a, b, c = (simulated_run(plan, None, seed) for seed in (1, 1, 2))
    assert a.truth == b.truth != c.truth
    assert (a.readings.length == b.readings.length).all()
    values = []
    cell = read_cell(tmp_path / "cell.toml", "cell")
    for seed in range(200):
        lines = dict(line.split(" = ") for line in draw_truth(cell, seed).lines())
        values.append([float(lines[k]) for k in ("a2_mm", "theta3_deg", "fixture_A_y_mm", "compliance2_urad_Nm")])
    spread = np.sqrt(np.mean(np.square(values), axis=0))
    assert np.allclose(spread, [1.0, np.rad2deg(1e-3), 5.0, 2.0], rtol=0.2)  # 200 draws: 5 % is one sigma
    assert (np.array(values)[:, 3] > 0).all()  # a joint gives way, it does not push back


def test_one_seed_is_one_robot_in_every_cell():
    """Bar, head and tracker of a session stand about the same arm; a head about one built with more care."""
    told = [draw_truth(load_cell(f"kuka-kr6-r700/{name}"), 5) for name in ("edbb", "trical", "tracker")]
    names = ("a2", "alpha3", "theta4", "compliance2")
    bar, head, tracker = (np.array([t.errors[t.model.names.index(n)] for n in names]) for t in told)
    assert (bar == tracker).all()
    assert head == pytest.approx(told[1].bound.factor * bar, rel=1e-6)
    assert (bar != 0.0).all()


@pytest.mark.slow
def test_balls_that_no_head_could_have_met_are_told():
    cell = load_cell("kuka-kr6-r700/trical")
    q = draw_ball_candidates(cell, 100).q
    planned = Samples(q, np.zeros(len(q), dtype=int))
    ball = np.zeros(len(q), dtype=int)
    sent = SimulatedRun("run", planned, Readings(ball=ball))
    assert not cell.gauge.centring_warnings(cell, planned, sent)
    off = 0.02 * (np.arange(len(q)) % 4 == 0)  # [rad] of joint 1
    turned = replace(sent, samples=replace(planned, q=q + np.outer(off, np.eye(6)[0])))
    radius = np.linalg.norm(cell.map_position(q)[:, :2], axis=1)
    far = int((off * radius > 5e-3).sum())
    assert far
    (said,) = cell.gauge.centring_warnings(cell, planned, turned)
    assert said.startswith(f"{far} of {len(q)} balls were met more than 5 mm off centre")


def test_what_is_told_can_be_given_back(tmp_path):
    plan = plan_folder(tmp_path)
    run = simulated_run(plan, None, 4)
    noise = [line for line in run.truth if line.startswith(("gauge_um", "repeatability_mm"))]
    effects = [line for line in run.truth if line.startswith("effects")]
    errors = [line for line in run.truth if line not in (*noise, *effects)]
    text = "\n".join([*effects, "[errors]", *errors, "[noise]", *noise, ""])
    again = simulated_run(plan, truth_file(tmp_path, text), 4)
    assert np.abs(again.readings.length - run.readings.length).max() < 1e-12
    assert all(line.startswith("# truth: ") for line in run.comments().splitlines())
    assert len(run.comments().splitlines()) == len(run.truth) + 1


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_simulated_run_is_known_as_one_however_it_is_written(tmp_path, ending):
    first, second = (tmp_path / f"{n}.{ending}" for n in ("first", "second"))
    run = simulated_run(plan_folder(tmp_path))
    SimulationResult(run).write(first)
    read = load_run(first)
    assert read.simulated
    save_run(read, second)
    assert load_run(second).simulated
    save_run(replace(read, simulated=False), second)
    assert not load_run(second).simulated
    assert SimulationResult(run).text().count("nobody measured") == 1


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[errors]\na2_mn = 0.4\n", ["errors.a2_mn", "a2_mm"]),
        ("[errors]\ntheta3 = 0.4\n", ["errors.theta3", "theta3_deg", "its unit"]),
        ("[errors]\ntheta3_mm = 0.4\n", ["theta3_deg"]),
        ("[errors]\nfixture_C_x_mm = 0.4\n", ["fixture_A_x_mm"]),
        ("[errors]\nwobble = 0.4\n", ["wobble", "its unit"]),
        ("[errors]\na2_mm = 0.4\na2_um = 3\n", ["second time"]),
        ("[errors]\na2_mm = nan\n", ["errors.a2_mm", "finite"]),
        ('[errors]\na2_mm = "much"\n', ["errors.a2_mm", "number"]),
        ("[error]\na2_mm = 1\n", ["unknown key 'error'", "errors"]),
        ("[noise]\ngauge_mm = 1\n", ["noise.gauge_mm", "gauge_um"]),
        ("[noise]\ngauge_um = -1\n", ["noise.gauge_um"]),
    ],
)
def test_a_wrong_truth_is_told(tmp_path, text, parts):
    plan = plan_folder(tmp_path)
    truth = truth_file(tmp_path, text)
    with pytest.raises(InputError) as caught:
        simulated_run(plan, truth, 0)
    assert all(part in str(caught.value) for part in (str(truth), *parts)), caught.value


def test_a_plan_without_its_cell_is_told(tmp_path):
    plan = plan_folder(tmp_path)
    (tmp_path / "cell.toml").unlink()
    with pytest.raises(InputError, match=r"cell\.toml is missing"):
        simulated_run(plan, None, 0)


def test_a_plan_with_the_cell_of_another_robot_is_told(tmp_path):
    def seven(plan):
        plan["drives"][0]["waypoints"][1]["q_deg"].append(0.0)

    with pytest.raises(InputError, match="7 angles"):
        simulated_run(plan_folder(tmp_path, edit=seven), None, 0)


def test_lengths_beyond_the_bar_are_told(tmp_path):
    run = simulated_run(plan_folder(tmp_path), truth_file(tmp_path, "[errors]\nzero_mm = 5000\n" + SILENT), 0)
    assert "5 of 5 lengths lie outside" in run.warnings[0]


BACKLASH = '[[effects]]\nkind = "backlash"\non = "joint 3"\nvalue = 200\nunit = "urad"\n'
SCALE = '[[effects]]\nkind = "gauge scale"\nvalue = 1e-4\nunit = "1"\n'


def test_effects_of_the_catalogue_take_part(tmp_path):
    plan = plan_folder(tmp_path)
    none = simulated_run(plan, truth_file(tmp_path, SILENT), 0)
    run = simulated_run(plan, truth_file(tmp_path, SILENT + SCALE), 0)
    assert np.allclose(run.readings.length, none.readings.length * (1 + 1e-4), rtol=0, atol=1e-12)
    run = simulated_run(plan, truth_file(tmp_path, SILENT + BACKLASH), 0)
    cell, arm = read_cell(tmp_path / "cell.toml", "cell"), Arm.from_toml("kuka-kr6-r700")
    R, p = arm.flange(none.samples.q, {"theta3": 100e-6 * none.samples.direction[:, 2]})  # ± half the play
    expected = np.linalg.norm(p + R @ cell.tool.p_FM - cell.fixtures[0].p_BX, axis=1)
    assert np.abs(run.readings.length - expected).max() < 1e-12
    assert np.abs(run.readings.length - none.readings.length).min() > 1e-6
    assert any("backlash" in line and "joint 3" in line and "200" in line for line in run.truth)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        (BACKLASH.replace("backlash", "backlsh"), ["[[effects]] number 1", 'did you mean "backlash"']),
        (BACKLASH.replace("joint 3", "joint 9"), ["joint 9", "joint 6"]),
        (BACKLASH.replace('on = "joint 3"\n', ""), ["'on' is missing", "joint 1"]),
        (BACKLASH.replace("urad", "um"), ["is m", "rad"]),
        (BACKLASH.replace("urad", "grad"), ["'grad' is no unit"]),
        (BACKLASH.replace("200", "[1, 2]"), ["2 values", "backlash, joint 3"]),
        (BACKLASH + "inner = 3\n", ["takes no 'inner'"]),
        (BACKLASH + "size = 3\n", ["unknown key", "size"]),
        (SCALE.replace("gauge scale", "gauge lag"), ["gauge lag", "no effect that this run could show"]),
    ],
)
def test_a_wrong_effect_is_told(tmp_path, text, parts):
    plan, truth = plan_folder(tmp_path), truth_file(tmp_path, text)
    with pytest.raises(InputError) as caught:
        simulated_run(plan, truth, 0)
    assert all(part in str(caught.value) for part in (str(truth), *parts)), caught.value
