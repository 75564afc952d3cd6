"""A centring that stops when it is good enough: how true it is, what it passes, which way it takes then."""

from dataclasses import replace
from types import SimpleNamespace as Of

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.centring.journal import BallVisit, Journal, JournalHead, PlannedPath
from planner.centring.session import CentringBench, CentringSession, run_session
from planner.centring.settings import CentringSettings, RestSettings
from planner.centring.simulated import SimulatedArm
from planner.centring.stop import StopRequest
from planner.common.units import from_deg
from planner.design.candidates.balls import draw_ball_candidates
from planner.next_session.live_advice import CentringAdvice
from planner.simulation.truth import draw_truth
from tests.next_session.named_errors import named_errors_alone

POSES, EACH = 30, 6  # poses in all; every so many one validates


@pytest.fixture(scope="module", autouse=True)
def quick():
    with named_errors_alone():
        yield


@pytest.fixture(scope="module")
def bench():
    whole = load_cell("kuka-kr6-r700/trical")
    cell = replace(whole, plan=replace(whole.plan, candidates=POSES))
    pool = draw_ball_candidates(cell, POSES)
    names = [b.name for b in cell.balls]
    poses, points, visits = [], [cell.home], []
    for k in range(POSES):
        role = "validate" if k % EACH == EACH - 1 else "calibrate"
        ball = names[pool.ball[k]]
        poses.append(Of(id=k + 1, q_deg=np.degrees(pool.q[k]).tolist(), ball=ball, role=role, fixture="", point=""))
        visits.append(BallVisit(k + 1, ball, len(points) + 1))
        points += [pool.back[k], pool.q[k], pool.back[k]]
    points.append(cell.home)
    way = PlannedPath("0123456789ab", cell.robot.name, np.array(points), tuple(visits))
    return Of(cell=cell, plan=Of(poses=poses), way=way)


def centred(bench, folder, until=None, seed=1):
    """Run a session of a simulated arm; return it, its adviser and what was said."""
    settings = CentringSettings(rest=RestSettings(settle_s=0.0))
    arm = SimulatedArm(bench.cell, draw_truth(bench.cell, seed), settings, seed)
    arm.move(bench.way.q[0])
    head = JournalHead(schema_name="edbb-centring-journal/1", plan_id="0123456789ab", robot="r", began_s=0.0)
    session = CentringSession(bench.way, Journal(folder / "run.csv", head, []))
    adviser = CentringAdvice.of(bench.plan, bench.cell, session.output, until)
    said = []
    run_session(session, CentringBench(arm, arm, settings, StopRequest(), said.append, adviser=adviser))
    return Of(journal=session.journal, adviser=adviser, said=said, arm=arm)


@pytest.fixture(scope="module")
def stopped(bench, tmp_path_factory):
    return centred(bench, tmp_path_factory.mktemp("stopped"), 0.2e-3)


@pytest.mark.slow
def test_it_stops_at_the_goal_and_centres_the_validation_poses(bench, stopped):
    live = stopped.adviser.advice.estimate
    assert live.reached
    assert any(line.endswith(": 0.2 mm is reached") for line in stopped.said)
    assert stopped.adviser.advice.fewest_poses <= len(live.read) < 0.8 * len(live.samples)
    validation = {p.id for p in bench.plan.poses if p.role == "validate"}
    assert validation <= stopped.journal.measured_ids
    assert len(stopped.journal.measured_ids) == len(live.read) + len(validation)
    passed = [line for line in stopped.said if line.endswith("passed by, the goal is reached")]
    assert len(passed) == POSES - len(stopped.journal.measured_ids)
    table = (stopped.journal.output.parent / "run.progress.csv").read_text().splitlines()
    assert len(table) == 1 + len(live.read)
    np.testing.assert_allclose(stopped.arm.joints()[0], bench.way.q[-1], atol=1e-9)  # the arm ends at the way's end


@pytest.mark.slow
def test_what_is_stated_is_true_at_poses_that_no_estimate_has_seen(bench, stopped):
    """Balls of the validation poses: millimetres off before, and within what is stated after."""
    live = stopped.adviser.advice.estimate
    every = replace(live.samples, q=np.concatenate([live.samples.q[:0], [from_deg(p.q_deg) for p in held(bench)]]))
    every = replace(every, place=np.zeros(len(held(bench)), dtype=int))
    rows = {r.pose: r for r in stopped.journal.rows}
    model, off = live.unknown.model, []
    mean = live.mean + live.unknown.root @ live.posterior.learnt.mean
    for k, pose in enumerate(held(bench)):
        reading = stopped.adviser.reading(rows[pose.id])
        here = replace(every.take(np.array([k])), q=reading.q[None])
        targets = model.setup.targets(here, reading.readings)
        off.append([np.linalg.norm(model.residual(here, targets, errors)[0]) for errors in (live.mean, mean)])
    before, after = np.sqrt(np.square(off).mean(axis=0))
    assert before > 0.5e-3
    assert after < live.history[-1].at_most
    assert after < 0.1 * before


def held(bench):
    return [p for p in bench.plan.poses if p.role == "validate"]


@pytest.mark.long
def test_a_session_that_goes_on_stands_where_it_stood(bench, stopped, tmp_path):
    again = CentringAdvice.of(bench.plan, bench.cell, tmp_path / "run.csv", 0.2e-3)
    again.resume(stopped.journal.rows)
    assert again.advice.rows == stopped.adviser.advice.rows
    assert again.passes(bench.plan.poses[-2].id) == "the goal is reached"
    assert again.passes(bench.plan.poses[-1].id) == ""  # it validates


@pytest.mark.slow
def test_a_goal_out_of_reach_is_told(bench, tmp_path):
    done = centred(replace_plan(bench, 3), tmp_path, 1e-6)
    assert all("0.001 mm" in line and "takes a plan of more poses" in line for line in done.said)
    assert "no pose is left and 0.001 mm is not reached" in done.said[-1]


@pytest.mark.slow
def test_without_a_goal_every_ball_is_centred(bench, tmp_path):
    few = replace_plan(bench, 4)
    done = centred(few, tmp_path)
    assert done.journal.measured_ids == {1, 2, 3, 4}
    assert all("95 % sure below" in line for line in done.said)


def replace_plan(bench, count):
    visits = bench.way.visits[:count]
    way = replace(bench.way, q=bench.way.q[: visits[-1].at + 2], visits=visits)
    return Of(cell=bench.cell, plan=Of(poses=bench.plan.poses[:count]), way=way)
