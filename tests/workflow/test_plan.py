"""A whole plan against what does not share its code: finite differences, fcl on dense samples, the programs.

By default one that is measured while the robot moves; the TriCal head's tests have one at rest.
"""

import json
import re
import shutil

import numpy as np
import polars as pl
import pytest

from planner.cell.reading import load_cell, read_cell
from planner.common.errors import InputError, PlannerError
from planner.common.progress import TimeIsOverError
from planner.design.pose_selection import PoseChoice
from planner.model.model import Model
from planner.motion.collision.engines import CollisionWorld
from planner.motion.collision.fcl_world import FclWorld
from planner.programs.rendering import ProgramFile
from planner.runs.run import Samples
from planner.session.document import PlanDocument, read_plan
from planner.session.planning import PoseSession
from planner.workflow.plan_results import PosesResult
from planner.workflow.plan_use import export
from planner.workflow.planning import plan
from tests.command import edbb
from tests.programs.reading import read_back
from tests.quick_search import quick_search
from tests.workflow.conftest import FEWER, POSES, small_cell

KEYS = {
    "schema", "plan_id", "robot", "cell", "seed", "parameters", "dropped", "funnel", "poses", "supports",
    "observability", "tour", "path", "trajectory", "programs",
}  # fmt: skip


def measured(plan, role="calibrate"):
    return np.deg2rad([p["q_deg"] for p in plan["poses"] if p["role"] == role])


@pytest.mark.slow
def test_the_plan_keeps_the_contract(either):
    plan = either.plan
    assert set(plan) >= KEYS
    assert plan["schema"] == "edbb-plan/1"
    assert set(plan["observability"]) >= {
        "index",
        "n",
        "O1",
        "O2",
        "O3",
        "O4",
        "O5",
        "bound",
        "gap",
        "bound_kind",
        "on_grid",
        "path",
        "scaled",
    }
    assert set(plan["tour"]) >= {"solver", "unsorted_s", "cost_s", "lower_bound_s", "optimal", "driven_s"}
    assert set(plan["path"]) >= {
        "legs",
        "direct_legs",
        "planned_legs",
        "checked",
        "clearance_mm",
        "length_min_mm",
        "length_max_mm",
    }
    ids = [p["id"] for p in plan["poses"]]
    assert len(set(ids)) == len(ids)
    assert plan["poses"][0]["role"] == plan["poses"][-1]["role"] == "mount"
    assert len(measured(plan)) == plan["observability"]["n"] == POSES
    assert all(v["proven"] for v in plan["path"]["verdicts"])
    assert {v["engine"] for v in plan["path"]["verdicts"]} == {"coal", "python-fcl"}
    assert plan["path"]["direct_legs"] + plan["path"]["planned_legs"] == plan["path"]["legs"]
    assert plan["tour"]["lower_bound_s"] <= plan["tour"]["cost_s"] <= plan["tour"]["unsorted_s"]
    assert json.loads(either.stdout) == plan
    assert either.stderr == ""


@pytest.mark.slow
def test_a_plan_is_read_whole(either):
    assert json.dumps(PlanDocument.model_validate(either.plan).content()) == json.dumps(either.plan)


def test_the_index_is_that_of_a_numeric_jacobian(either):
    """O2 and the unit-free O1 from finite differences of the lengths at the poses of plan.json."""
    plan, cell = either.plan, read_cell(either.folder / "cell.toml", "cell")
    model = Model.from_cell(cell)
    at = Samples.at(measured(plan))
    columns = []
    for name in plan["parameters"]:
        step = np.zeros(len(model.names))
        step[model.names.index(name)] = 1e-6
        columns.append((model.reading(at, step) - model.reading(at, -step))[:, 0] / 2e-6)
    J = np.array(columns).T
    mu = np.linalg.svd(J, compute_uv=False)
    seen = plan["observability"]
    assert seen["O2"] == pytest.approx(mu[0] / mu[-1], rel=1e-5)
    assert seen["O3"] == pytest.approx(mu[-1], rel=1e-5)
    prior = np.array([model.prior[model.names.index(n)] for n in plan["parameters"]])
    scaled = np.linalg.svd(J * prior, compute_uv=False)
    assert seen["scaled"]["O1"] == pytest.approx(np.exp(np.log(scaled).mean()) / np.sqrt(POSES), rel=1e-5)
    own = seen["on_grid"]
    assert own["bound"] <= own["value"] * (1 + 1e-9)
    assert own["gap"] == pytest.approx(own["value"] / own["bound"] - 1, abs=1e-6)
    assert seen["O2"] < own["value"]  # off the grid of candidates
    assert seen["bound"] <= own["bound"] * (1 + 1e-9)
    assert seen["bound"] <= seen["O2"]  # the bound covers the poses that were refined, so the gap is never negative
    assert seen["gap"] == pytest.approx(seen["O2"] / seen["bound"] - 1, abs=1e-6)


@pytest.mark.slow
def test_the_driven_path_keeps_every_limit_by_dense_samples(either):
    """Lengths, tilts and clearances of the written trajectory, by plain formulas and python-fcl."""
    cell = read_cell(either.folder / "cell.toml", "cell")
    rows = pl.read_csv(either.folder / "trajectory.csv").to_numpy()
    t, q, length = rows[:, 0], np.deg2rad(rows[:, 1:-1]), rows[:, -1]
    motion = cell.chain.forward(cell.robot.theta(q))
    bar = motion.x.T - cell.fixtures[0].p_BX
    true = np.linalg.norm(bar, axis=1)
    np.testing.assert_allclose(length, true * 1e3, atol=1e-3)
    assert true.min() >= cell.gauge.length_min
    assert true.max() <= cell.gauge.length_max
    assert np.degrees(np.arccos(bar @ cell.fixtures[0].axis_B / true)).max() <= np.degrees(cell.gauge.cone_fixture)
    axis = np.einsum("ijn,j->ni", motion.R, cell.tool.axis_F)
    assert np.arccos(-np.einsum("ni,ni->n", bar, axis) / true).max() <= cell.gauge.cone_map
    few = q[:: max(1, len(q) // 300)]
    judge = FclWorld(CollisionWorld.from_cell(cell).scene)
    assert judge.distances(few).min() >= cell.motion.clearance * 0.999
    speed = np.abs(np.diff(q, axis=0)) / np.diff(t)[:, None]
    assert (speed <= cell.robot.speed * 1.001).all()
    tool = np.linalg.norm(np.diff(motion.x.T, axis=0), axis=1) / np.diff(t)
    if cell.motion.measure == "continuous":
        assert tool.max() <= cell.motion.tool_speed * 1.001


@pytest.mark.long
def test_every_pose_is_passed_and_static_ones_rest(resting):
    """The robot stands still at each pose, long enough for settling and for a person who reads the bar."""
    cell = read_cell(resting.folder / "cell.toml", "cell")
    rows = pl.read_csv(resting.folder / "trajectory.csv").to_numpy()
    q = rows[:, 1:-1]
    for pose in resting.plan["poses"][1:-1]:
        here = np.abs(q - pose["q_deg"]).max(axis=1) < 1e-4
        if pose["role"] != "mount":
            assert here.sum() * 0.05 >= cell.rest_seconds - 0.06, pose["id"]


@pytest.mark.long
def test_repeats_visit_a_pose_again_and_validation_poses_are_new(resting):
    plan = resting.plan
    poses = {p["id"]: p for p in plan["poses"]}
    repeats = [p for p in plan["poses"] if p["role"] == "repeat"]
    assert len(repeats) == 3
    for p in repeats:
        assert p["q_deg"] == poses[p["repeats"]]["q_deg"]
    fit, check = measured(plan), measured(plan, "validate")
    assert len(check) == 4
    assert np.abs(fit[:, None] - check[None]).max(axis=2).min() > 1e-6


def test_programs_read_back_to_the_planned_poses(either):
    """Every measuring pose stands in every program, in order, and the plan's id in a comment."""
    names = {}
    for entry in either.plan["programs"]:
        names.setdefault(entry["dialect"], []).append(entry["file"])
    assert names
    for dialect, files in names.items():
        texts = tuple(ProgramFile(f, (either.folder / f).read_bytes().decode("latin-1"), "latin-1") for f in files)
        back = read_back(dialect, texts)
        assert back.plan_id == either.plan["plan_id"]
        cursor = 0
        for pose in either.plan["poses"]:
            near = np.abs(back.joint_path_deg[cursor:] - pose["q_deg"]).max(axis=1)
            assert near.min() < 2e-3, (dialect, pose["id"])
            cursor += int(np.argmin(near))


@pytest.mark.slow
def test_export_writes_the_same_program(either, tmp_path):
    entry = next(e for e in either.plan["programs"] if e["dialect"] != "krl")
    done = edbb("export", either.folder / "plan.json", "--dialect", entry["dialect"], "-o", tmp_path / entry["file"])
    assert done.returncode == 0, done.stderr
    assert (tmp_path / entry["file"]).read_bytes() == (either.folder / entry["file"]).read_bytes()


def test_every_index_is_said_with_its_units(moving):
    """On the screen, and in every sentence of the page with a value; the table has units above its columns."""
    page = re.sub(r"<(script|style|svg).*?</\1>", " ", (moving.folder / "report.html").read_text(), flags=re.DOTALL)
    sentences = re.split(r"[.:;]\s|</t[dh]>", page)
    values = [s for s in sentences if "condition number" in s and re.search(r"\d{2}", s)]
    assert values
    assert [s for s in values if "m, rad" not in s] == []
    assert "raw (m, rad)" in page
    facts = [line for line in moving.stderr.splitlines() if re.match(r"\W*O2\b", line)]
    assert [line for line in facts if "in m, rad" not in line] == []


@pytest.mark.slow
def test_export_to_standard_output(moving):
    done = edbb("export", moving.folder / "plan.json", "--dialect", "bnr", "-o", "-")
    assert done.returncode == 0, done.stderr
    (file,) = (p["file"] for p in moving.plan["programs"] if p["dialect"] == "bnr")
    assert done.stdout.encode("latin-1") == (moving.folder / file).read_bytes()
    assert done.stderr == ""


@pytest.mark.long
def test_same_bytes_with_one_thread_and_two(tmp_path):
    cell, (one, two) = small_cell("comau-nj130/edbb", tmp_path, *FEWER), (tmp_path / "one", tmp_path / "two")
    for folder, threads in ((one, {}), (two, {"threads": "2"})):
        words = ("-o", folder, "--poses", POSES, "--dialect", "krl", "--dialect", "linuxcnc")
        done = edbb("plan", cell, *words, **threads)
        assert done.returncode == 0, done.stderr
    files = sorted(p.relative_to(one) for p in one.rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(two) for p in two.rglob("*") if p.is_file())
    for file in files:
        if file.name != "timings.json":
            assert (one / file).read_bytes() == (two / file).read_bytes(), file


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words", "code", "said"),
    [
        ([("position_mm = [258, 1468, 708]", "position_mm = [258, 4468, 708]")], [], 3, ["out of reach", "move it by"]),
        ([("home_deg = [0, 0, 0, 0, -90, 0]", "home_deg = [0, 125, 75, 0, 0, 0]")], [], 2, ["home_deg", "start pose"]),
        (
            [('zero = "free"', 'zero = "free"\nmount_deg = [0, 0, 0, 0, 0, 0]')],
            [],
            2,
            ["mount_deg", "cannot hold the bar"],
        ),
        ([], ["--poses", "12"], 2, ["12 poses cannot identify 25 parameters"]),
        ([], ["--dialect", "klr"], 2, ["klr", "krl"]),
        ([], ["--index", "O9"], 2, ["O9"]),
        ([], ["--tsp", "concorde"], 4, ["oncorde"]),
        (
            [("radius_mm = 50\n", "radius_mm = 320\n"), ("candidates = 3000", "candidates = 300")],
            [],
            3,
            ["0 collision-free", "clearance_mm"],
        ),
        ([("candidates = 3000", "candidates = 20")], [], 3, ["candidate poses are left", "plan.candidates"]),
    ],
)
def test_bad_input_is_told_in_one_sentence_with_its_code(tmp_path, monkeypatch, changes, words, code, said):
    path = small_cell("comau-nj130/edbb", tmp_path, *changes)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    monkeypatch.setenv("EDBB_CONCORDE", "")
    done = edbb("plan", path, "-o", tmp_path / "out", *words)
    assert done.returncode == code, done.stderr
    assert all(w in done.stderr for w in said), done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.screen
    assert not (tmp_path / "out").exists()
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".edbb")]


def test_an_export_of_what_is_no_plan(tmp_path, moving):
    (tmp_path / "plan.json").write_text('{"schema": "edbb-plan/1", "plan_id": "x"}')
    done = edbb("export", tmp_path / "plan.json", "--dialect", "krl", "-o", tmp_path / "p.src")
    assert done.returncode == 2
    assert "plan_id" in done.screen
    (tmp_path / "plan.json").write_text((moving.folder / "plan.json").read_text())
    done = edbb("export", tmp_path / "plan.json", "--dialect", "krl", "-o", tmp_path / "p.src")
    assert done.returncode == 2
    assert "cell.toml is missing" in done.screen


def test_lists():
    assert "comau-nj130/paper" in edbb("robots").stdout
    assert {r["name"] for r in json.loads(edbb("robots", "--json").stdout)} >= {"comau-nj130", "ur10"}
    assert "krl" in edbb("dialects").stdout
    assert edbb("--version").stdout.startswith("edbb ")


@pytest.mark.slow
def test_shipped_cells_are_loaded_from_anywhere(tmp_path):
    done = edbb("robots", cwd=tmp_path)
    assert done.returncode == 0
    assert load_cell("ur10/edbb").robot.name == "ur10"


@pytest.mark.slow
def test_a_plan_that_was_changed_is_proven_anew_or_refused(moving, tmp_path):
    """The folder can be moved; an axis turned, a pose moved or a corner widened is never driven unproven."""
    there = tmp_path / "moved"
    shutil.copytree(moving.folder, there)
    assert export(there / "plan.json", dialect="krl").notes == ()

    def changed(change):
        content = json.loads(json.dumps(moving.plan))
        change(content)
        (there / "plan.json").write_text(json.dumps(content))
        return export(there / "plan.json", dialect="krl")

    middle = len(moving.plan["drives"][0]["waypoints"]) // 2
    for axis, to in ((1, -25.0), (4, 25.0)):
        with pytest.raises(PlannerError):
            changed(lambda c, j=axis, d=to: c["drives"][0]["waypoints"][middle]["q_deg"].__setitem__(j, d))
    with pytest.raises(PlannerError):
        changed(lambda c: [w.update(blend_mm=400.0) for w in c["drives"][0]["waypoints"][1:-1]])
    try:  # a corner is rounded within half of its legs: one alone may hold, which is then said
        one = changed(lambda c: c["drives"][0]["waypoints"][middle].update(blend_mm=400.0))
    except PlannerError:
        pass
    else:
        assert "proven anew by both engines" in one.notes[0]
    assert "proven anew by both engines" in changed(lambda c: c.update(seed=99)).notes[0]


@pytest.mark.slow
def test_poses_that_no_proven_path_joins_in_time_are_told_and_are_no_plan(tmp_path, monkeypatch):
    def give_up(*_):
        raise TimeIsOverError("the time limit is over while motions are proven")

    monkeypatch.setattr(PoseSession, "_drive_places", give_up)
    unrefined = ("[plan]", "[plan]\nrefine = false")
    cell, folder = small_cell("kuka-kr6-r700/edbb", tmp_path / "cell", *FEWER, unrefined), tmp_path / "out"
    with quick_search():
        found = plan(cell, poses=POSES, time_limit_s=1e4)
    assert isinstance(found, PosesResult)
    assert found.cut_short[-1] in found.summary()
    assert f"no set of these falls below {found.poses.certificate.value:#.4g}" in found.summary()  # less is better
    with monkeypatch.context() as other:
        other.setattr(PoseChoice, "index", "O1")
        assert "no set of these exceeds" in found.summary()
    assert sorted(p.name for p in found.write(folder)) == ["cell.toml", "plan.json"]
    told = json.loads((folder / "plan.json").read_text())
    assert "motions are proven" in told["not_proven"]
    seen, rows = told["observability"], np.deg2rad([p["q_deg"] for p in told["poses"]])
    assert rows.shape == (POSES, 6)
    assert seen["bound_verified"]
    model = Model.from_cell(load_cell(str(folder / "cell.toml")))
    kept = [model.names.index(name) for name in told["parameters"]]
    jacobian = model.rows(Samples.at(rows))[:, 0, kept]
    assert seen[seen["index"]] == pytest.approx(np.linalg.cond(jacobian), rel=1e-3)
    with pytest.raises(InputError, match="edbb-plan/1"):
        read_plan(folder / "plan.json")
