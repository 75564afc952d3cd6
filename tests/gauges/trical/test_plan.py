"""A small plan from end to end: every leg free by a dense sweep of the second engine, program, plan.json, refusals."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.common.progress import Stages
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld
from planner.programs.dialect import load_dialect
from planner.programs.rendering import ProgramFile
from planner.programs.verification import ProgramMismatchError
from planner.runs.run import FIRST_MOUNTING
from planner.session.neutral_program import session_program
from planner.session.options import PlanOptions
from planner.session.plan_record import plan_document
from planner.session.planning import with_programs
from planner.workflow.plan_results import PlanResult, write_cell
from planner.workflow.planning import plan_cell
from tests.command import edbb
from tests.programs.reading import read_back, verify

SWEEP = 25  # states on each motion


@pytest.fixture(scope="module")
def planned(cell):
    quick = replace(cell, plan=replace(cell.plan, candidates=200, poses=12, repeat=1, validate=4))
    return plan_cell(quick, PlanOptions(), Stages(lambda *_: None))


@pytest.mark.slow
def test_every_ball_is_approached_centred_and_left_the_same_way(planned):
    (drive,) = planned.drives
    path, visits = drive.course.measuring, drive.visits
    at = np.flatnonzero(path.visit >= 0)
    by_id = {v.id: v for v in visits}
    roles = [v.role for v in visits]
    assert roles.count("calibrate") == 12
    assert roles.count("validate") == 4
    assert roles.count("repeat") == 2  # one pose, centred three times
    assert roles[0] == roles[-1] == "mount"
    assert len(at) == 18
    for k in at:
        assert np.array_equal(path.q[k - 1], path.q[k + 1])
        visit = by_id[int(path.visit[k])]
        x = planned.cell.map_position(path.q[k - 1 : k + 1])
        axis = planned.cell.map_axis(path.q[k : k + 1])[0]
        assert np.linalg.norm(x[1] - planned.cell.p_BS[visit.ball]) < 1e-7
        assert np.allclose(x[1] - x[0], 0.04 * axis, atol=1e-6)
        assert (path.blend[k - 1 : k + 2] == 0).all()
    repeats = [v for v in visits if v.role == "repeat"]
    assert all(np.array_equal(v.q, by_id[v.repeats].q) for v in repeats)


@pytest.mark.slow
def test_the_whole_way_is_free_in_a_dense_sweep(planned):
    cell, (drive,) = planned.cell, planned.drives
    scene = CollisionWorld.from_cell(cell).scene
    path = drive.course.measuring
    share = np.linspace(0, 1, SWEEP)[:, None]
    ball = {v.id: v.ball for v in drive.visits}
    clearance, judges = cell.motion.clearance, {}
    for k in range(len(path.q) - 1):
        ends = [ball[int(v)] for v in path.visit[k : k + 2] if v >= 0]
        at = ends[0] if ends else None
        judge = judges[at] = judges.get(at) or FclWorld(scene.at_ball(at) if ends else scene)
        states = path.q[k] + share * (path.q[k + 1] - path.q[k])
        assert judge.distances(states[:: 1 if ends else 3]).min() > clearance - 1e-6
    travel = drive.course.travel.q
    assert np.allclose(travel[0], cell.home)
    assert np.allclose(travel[-1], path.q[0])


@pytest.mark.slow
def test_the_last_way_is_driven_slowly(planned):
    (drive,) = planned.drives
    visit, peak = drive.course.measuring.visit, drive.trajectory.leg_peak_tool_speed
    touching = (visit[:-1] >= 0) | (visit[1:] >= 0)
    assert peak[touching].max() < planned.cell.motion.tool_speed * 1.001
    assert peak[~touching].max() > 5 * planned.cell.motion.tool_speed
    assert drive.trajectory.duration_s > 18 * planned.cell.gauge.head.seconds
    assert max(drive.limits.speed.max(), drive.limits.acceleration.max(), drive.limits.jerk.max()) <= 1.0 + 1e-9


@pytest.mark.slow
def test_the_head_is_mastered_upright(planned):
    mount = np.asarray(planned.cell.mount(FIRST_MOUNTING))
    assert planned.cell.map_axis(mount[None])[0, 2] > np.cos(np.deg2rad(10.0))


@pytest.mark.slow
def test_plan_json(planned):
    content: dict[str, Any] = plan_document(planned).content()
    json.dumps(content)
    assert len(content["parameters"]) == 31
    centred = [p for p in content["poses"] if p["role"] != "mount"]
    assert {p["ball"] for p in centred} == {"1", "2", "3", "4"}
    assert all(0 < p["first_contact_mm"] < 5 for p in centred)
    calibrate = [p["ball"] for p in centred if p["role"] == "calibrate"]
    assert sorted(calibrate) == sorted("1234" * 3)
    assert content["observability"]["index"] == "O1"
    assert content["observability"]["bound_verified"]
    assert content["observability"]["O1"] <= content["observability"]["bound"]
    assert content["path"]["clearance_mm"] >= 5
    assert content["funnel"]["contact"] >= 200


def written(plan, dialect):
    return dict(with_programs(plan, (dialect,)).programs)[dialect]


@pytest.mark.slow
def test_the_krl_program_centres_at_each_pose_and_a_wrong_call_is_caught(planned):
    files = written(planned, "krl")
    found = read_back("krl", files)
    ball = {v.id: v.ball + 1 for v in planned.drives[0].visits}
    assert [(b, p) for _, b, p in found.centrings] == [
        (ball[int(v)], int(v)) for v in planned.drives[0].course.measuring.visit if v >= 0
    ]
    text = files[0].text
    call = text.index("\nCENTRE (")
    assert "$AXIS_ACT" in text[call : call + 80]  # the axes are logged where the centring led
    program = session_program(planned.cell, [planned.drives[0].course], planned.plan_id, load_dialect("krl").path_form)
    wrong = text[:call] + text[call:].replace("\nCENTRE (", "\nCENTRE (1", 1)
    with pytest.raises(ProgramMismatchError, match="centres other balls"):
        verify(program, "krl", [ProgramFile(files[0].name, wrong), *files[1:]])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sinumerik", pytest.param("din66025", marks=pytest.mark.long)])
def test_a_dialect_without_a_centring_call_is_refused(planned, name):
    with pytest.raises(InputError, match="no call of a centring routine"):
        written(planned, name)


@pytest.mark.slow
def test_it_is_written_whole(planned, tmp_path):
    PlanResult(planned).write(tmp_path / "out")
    written = {p.name for p in (tmp_path / "out").iterdir()}
    assert {"plan.json", "cell.toml", "report.html", "trajectory.csv"} <= written
    head = (tmp_path / "out" / "trajectory.csv").read_text().splitlines()[0]
    assert head.startswith("t_s,q1_deg")


@pytest.mark.slow
def test_it_is_centred_where_no_engine_is_installed(planned, tmp_path, monkeypatch):
    """On a PC that does not plan: what was proven is driven, and what was changed is not."""
    path = tmp_path / "plan.json"
    path.write_text(PlanResult(planned).to_json())
    write_cell(planned.cell, tmp_path)
    monkeypatch.setattr("planner.session.judgement.has_judges", lambda: False)
    done = edbb("centre", path, "--simulate", "-o", tmp_path / "run.csv")
    assert done.returncode == 0, done.screen
    assert "not judged anew" in " ".join(done.screen.split())
    path.write_text(json.dumps(json.loads(path.read_text()) | {"seed": 12}))
    done = edbb("centre", path, "--simulate", "-o", tmp_path / "changed.csv")
    assert done.returncode == 4
    assert "as it was planned" in " ".join(done.screen.split())
    assert not (tmp_path / "changed.csv").exists()
