"""A session with both bars: places that add most to what poses without load know, planned, written, and refused."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import planner.workflow.loaded_planning as loaded_both
import tests.loaded.shared as shared
import tests.loaded.world as world
from planner.cell.reading import load_cell
from planner.circular.plan import circles_of
from planner.common.errors import InputError, NoSolutionError
from planner.design.selection.d_optimal import augment_design
from planner.loaded.circle_candidates import find_circle_places
from planner.loaded.common_fit import (
    UnloadedPoses,
    collision_free_places,
    has_same_tool,
    predict_common_fit,
    select_circles_beside,
)
from planner.loaded.results import common_fit_content, describe_common_fit
from planner.workflow.loaded_planning import fit_cell, plan_both

FREE = "abb-irb6700/edbb"
FEW = {"loads_N = [125, 250, 375, 500, 625]": "loads_N = [125, 625]", "repeats = 5": "repeats = 1",
       '"rapid", "krl", "din66025"': '"rapid"', "overshoot_deg = 180": "overshoot_deg = 20"}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("both"))


def write_inputs(here):
    """A plan without load, as far as it is read, and the cell of a loaded circle that is quickly planned."""
    rng, fixture = np.random.default_rng(0), np.array([1.3, 0.9, 0.9])
    way = rng.normal(size=(60, 3))
    way[:, 2] = np.abs(way[:, 2])
    targets = fixture + way / np.linalg.norm(way, axis=1, keepdims=True) * rng.uniform(0.3, 0.52, (60, 1))
    q = np.degrees(world.reach(shared.arm(), targets, rng))
    poses = [{"id": k, "q_deg": row.tolist(), "fixture": "E", "role": "calibrate"} for k, row in enumerate(q)]
    poses += [{**poses[0], "role": "mount"}, {**poses[1], "role": "validate"}]
    drives = [{"fixture": "E", "travel": [], "waypoints": []}]
    plan = {"schema": "edbb-plan/1", "plan_id": "0" * 12, "drives": drives, "poses": poses}
    (here / "plan.json").write_text(json.dumps(plan))
    (here / "cell.toml").write_text(load_cell(FREE).path.read_text())
    text = shared.cell_text()
    for one, other in FEW.items():
        assert one in text
        text = text.replace(one, other)
    (here / "loaded.toml").write_text(text)
    return here


@pytest.fixture(scope="module", autouse=True)
def few_places():
    """A coarse grid: what is tested is not how many places there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loaded_both, "find_circle_places", lambda cell, seed: find_circle_places(cell, seed, (3, 2)))
        yield


@pytest.fixture(scope="module")
def done(folder, few_places):
    return plan_both(str(folder / "plan.json"), str(folder / "loaded.toml"), places=1)


@pytest.mark.slow
def test_only_poses_that_are_fitted_count(folder):
    free = UnloadedPoses.read(folder / "plan.json")
    assert len(free.samples) == len(json.loads((folder / "plan.json").read_text())["poses"]) - 2


@pytest.mark.slow
def test_the_set_is_as_good_as_brute_force():
    rng = np.random.default_rng(3)
    roots = rng.normal(size=(14, 3, 5)) * np.logspace(0, 1, 14)[:, None, None]
    blocks, base = np.einsum("mri,mrj->mij", roots, roots), np.diag([1.0, 50.0, 1.0, 1.0, 1.0])
    for count in (1, 2, 3):
        value = np.linalg.slogdet(base + blocks[augment_design(base, blocks, count)].sum(axis=0))[1]
        sets = itertools.combinations(range(len(blocks)), count)
        best = max(np.linalg.slogdet(base + blocks[list(s)].sum(axis=0))[1] for s in sets)
        assert value == pytest.approx(best)


@pytest.mark.long
def test_the_place_adds_more_than_others_do(folder):
    free, cell = UnloadedPoses.read(folder / "plan.json"), load_cell(shared.CELL)
    pool = find_circle_places(cell, steps=(3, 2))
    (chosen,) = select_circles_beside(free, cell, pool, 1)
    worth = [np.log(predict_common_fit(free, cell, [c]).both[-6:]).sum() for c in (pool[chosen], *pool)]
    assert worth[0] < np.quantile(worth, 0.35)  # of compliances alone; the choice looks at geometry too


@pytest.mark.slow
def test_places_in_the_way_are_left_out(folder):
    cell = load_cell(str(folder / "loaded.toml"))
    pool = find_circle_places(cell, steps=(3, 2))
    free = collision_free_places(cell, pool)
    assert 0 < len(free) <= len(pool)
    wide = replace(cell, motion=replace(cell.motion, clearance=1.0))
    with pytest.raises(NoSolutionError, match="collides: lower motion"):
        collision_free_places(wide, pool)


@pytest.mark.slow
def test_one_fit_is_predicted_for_the_circles_as_driven(done):
    known = done.known
    assert done.unloaded is None
    assert len(done.loaded.arcs) == 1
    assert np.all(known.both <= np.minimum(known.unloaded, known.loaded) * 1.001)
    assert "map_x" in known.names  # one tool
    assert not any(n.startswith(("fixture", "zero")) for n in known.names)  # each bar has its own
    soft = np.array([n.startswith("compliance") for n in known.names])
    assert np.median(known.both[soft]) < 0.5 * np.median(known.unloaded[soft])


@pytest.mark.slow
def test_the_way_that_was_looked_at_is_driven(done, folder):
    """Another turn of the tool about its axis would be another lever for the last joints."""
    cell, free = load_cell(str(folder / "loaded.toml")), done.free
    pool = collision_free_places(cell, find_circle_places(cell, steps=(3, 2)))
    chosen = select_circles_beside(free, cell, pool, 1)
    looked_at = predict_common_fit(free, cell, [pool[int(i)] for i in chosen])
    np.testing.assert_allclose(done.known.both, looked_at.both, rtol=0.05)


@pytest.mark.slow
def test_files_of_a_session_and_the_cell_of_its_fit(done, tmp_path):
    done.write(tmp_path / "out")
    out = tmp_path / "out"
    content = json.loads((out / "both.json").read_text())
    assert content["schema"] == "edbb-both/1"
    assert {p["name"] for p in content["parameters"]} == set(done.known.names)
    row = next(p for p in content["parameters"] if p["name"] == "compliance1")
    assert row["std_together_urad_Nm"] == pytest.approx(row["share_together"] * row["prior_urad_Nm"], rel=1e-3)
    assert 'id="known"' in (out / "report.html").read_text()
    assert json.loads((out / "loaded" / "plan.json").read_text())["plan_id"] == done.loaded.plan_id
    assert not (out / "unloaded").exists()  # it was there already
    cell = load_cell(str(out / "cell.toml"), planning=False)
    assert [f.name for f in cell.fixtures] == ["P1", "E"]
    assert (cell.gauge.length_min, cell.gauge.length_max) == (0.128, 0.520)
    assert len(circles_of(cell)) == 1


@pytest.mark.slow
def test_sentences(done):
    compliance, geometry = describe_common_fit(done.known)
    assert compliance.startswith("Compliance, 6 parameters")
    assert geometry.startswith("Geometry")
    assert common_fit_content(done.known, "x", 1, ["P1"], ())["sentences"] == [compliance, geometry]


@pytest.mark.slow
def test_cells_that_do_not_belong_together(folder, tmp_path):
    def refused(words, first, second=str(folder / "loaded.toml"), places=1):
        with pytest.raises(InputError, match=words):
            plan_both(first, second, places=places)

    refused("needs one robot|one fit needs one robot", "comau-nj130/edbb")
    refused(r"the first cell is that of a bar without load.* with \[\[circles\]\]", shared.CELL)
    heavy = tmp_path / "heavy.toml"
    heavy.write_text((folder / "cell.toml").read_text().replace("mass_kg = 20", "mass_kg = 12"))
    refused(r"differ in \[tool\]", str(heavy))
    assert not has_same_tool(load_cell(str(heavy)), load_cell(shared.CELL))
    tilted = tmp_path / "tilted.toml"
    tilted.write_text((folder / "cell.toml").read_text() + "\n[base]\nrpy_deg = [5, 0, 0]\n")
    refused("differ in base.rpy_deg", str(tilted))
    empty = tmp_path / "plan.json"
    full = json.loads((folder / "plan.json").read_text())
    empty.write_text(json.dumps({**full, "poses": []}))
    refused("no poses to calibrate by", str(empty))


@pytest.mark.slow
def test_more_places_than_can_be_driven(folder):
    with pytest.raises(NoSolutionError, match="places were asked for, but only"):
        plan_both(str(folder / "plan.json"), str(folder / "loaded.toml"), places=12)


@pytest.mark.slow
def test_the_cell_of_the_fit_reaches_as_far_as_both_bars():
    cell = fit_cell(load_cell(FREE), load_cell(shared.CELL))
    assert cell.file.gauge.length_mm == (128.0, 520.0)
    assert [f.name for f in cell.file.fixtures] == ["A", "E"]
