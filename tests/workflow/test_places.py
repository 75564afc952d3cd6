"""Sessions with several tool points and several fixtures: planned, exported, simulated and identified as one."""

import json
import os
import re
import tomllib

import numpy as np
import pytest

from planner.cell.reading import load_cell
from tests.command import edbb
from tests.simulation.generator.arm import Arm
from tests.workflow.conftest import planned, small_cell

TWO = ("mass_kg = 1.3", 'mass_kg = 1.3\npoints = [{ name = "low", map_mm = [-60, 40, 90] }]')
FEWER = ("candidates = 3000", "candidates = 1200")
OTHER = ("[[obstacles]]", '[[fixtures]]\nname = "B"\nposition_mm = [430, -330, 60]\n\n[[obstacles]]')
MAP_M = {"1": (0.03, 0.0, 0.11), "low": (-0.06, 0.04, 0.09)}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("places")
    made = planned("kuka-kr6-r700/edbb", folder, 40, "krl", changes=(FEWER, TWO, OTHER))
    return made.folder, made.plan


@pytest.mark.long
def test_lengths_are_those_of_the_named_fixture_and_tool_point(session):
    _, plan = session
    arm, cups = Arm.from_toml("kuka-kr6-r700"), {"A": (0.43, 0.33, 0.06), "B": (0.43, -0.33, 0.06)}
    q = np.deg2rad([p["q_deg"] for p in plan["poses"]])
    R, p = arm.flange(q)
    x = p + np.einsum("nij,nj->ni", R, [MAP_M[pose["point"]] for pose in plan["poses"]])
    length = np.linalg.norm(x - [cups[pose["fixture"]] for pose in plan["poses"]], axis=1)
    assert np.abs(length * 1e3 - [pose["length_mm"] for pose in plan["poses"]]).max() < 1e-6
    there = {(pose["fixture"], pose["point"]) for pose in plan["poses"]}
    assert len(there) == 4
    places = [(d["fixture"], d["point"]) for d in plan["drives"]]
    assert places == [("A", "1"), ("B", "1"), ("A", "low"), ("B", "low")]


@pytest.mark.long
def test_refinement_moves_the_poses_of_every_place_and_betters_the_index(session):
    _, plan = session
    seen = plan["observability"]
    assert seen["O2"] < 0.97 * seen["on_grid"]["value"]


@pytest.mark.long
def test_the_program_says_where_the_bar_goes_next(session):
    folder, _ = session
    main = (folder / "KUKA_KR6_R700_EDBB.src").read_text()
    parts = sorted(folder.glob("KUKA_KR6_R700_EDBB_*.src"))
    called = [main.index(f"{p.stem} ( )") for p in parts]
    assert called == sorted(called)
    text = main + "".join(p.read_text() for p in parts)  # a long program is cut, and calls its parts in turn
    assert [text.index(f"fixture {f} to tool point {p}") for p in ("1", "low") for f in "AB"] == sorted(
        text.index(f"fixture {f} to tool point {p}") for f in "AB" for p in ("1", "low")
    )


@pytest.mark.long
def test_poses_are_numbered_through_and_all_of_them_are_marked_once(session, tmp_path):
    """A tour for each place, from and to its own mount pose."""
    folder, plan = session
    ids = [p["id"] for p in plan["poses"]]
    assert ids == list(range(len(ids)))
    assert [p for p in plan["parameters"] if p.startswith("fixture_")] == [
        f"fixture_{f}_{a}" for f in "AB" for a in "xyz"
    ]
    done = edbb("export", folder / "plan.json", "--dialect", "bnr", "-o", tmp_path / "a.cnc")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "a.cnc").read_text()
    marked = [int(number) for number in re.findall(r"^; pose (\d+)$", text, re.MULTILINE)]
    assert marked == [p["id"] for p in plan["poses"] if p["role"] != "mount"]
    assert text.count("M00") == 2 * len(plan["drives"])


@pytest.mark.long
def test_the_exported_program_is_that_of_the_plan(session, tmp_path):
    folder, _ = session
    done = edbb("export", folder / "plan.json", "--dialect", "krl", "-o", tmp_path / "KUKA_KR6_R700_EDBB.src")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "KUKA_KR6_R700_EDBB.src").read_bytes() == (folder / "KUKA_KR6_R700_EDBB.src").read_bytes()


@pytest.mark.long
def test_the_run_is_identified_with_the_parameters_of_the_plan(session, tmp_path):
    folder, plan = session
    run = tmp_path / "run.csv"
    assert edbb("simulate", folder / "plan.json", "-o", run).returncode == 0
    words = ["--cell", folder / "cell.toml", "--plan", folder / "plan.json", "--no-trace", "-o", tmp_path / "out"]
    done = edbb("identify", run, *words)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "identification.json").read_text())
    names = {p["name"] for p in found["parameters"] if p["identifiable"]}
    assert set(plan["parameters"]) <= names
    assert {"map_1_x", "map_low_x", "fixture_A_x", "fixture_B_x"} <= names
    held_out = {stage["name"]: stage["held_out"]["rms_mm"] for stage in found["stages"]}
    assert held_out["geometry"] < held_out["frames"] / 5  # gears, lost motion and a soft base stay


@pytest.mark.long
def test_a_run_with_a_point_that_the_tool_has_not_is_refused(session, tmp_path):
    folder, _ = session
    run = tmp_path / "run.csv"
    assert edbb("simulate", folder / "plan.json", "-o", run).returncode == 0
    run.write_text(run.read_text().replace("low", "lov"))
    done = edbb("identify", run, "--cell", folder / "cell.toml", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "point 'lov'" in done.screen
    assert 'did you mean "low"?' in done.screen


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("low", "1"), "two tool points share a name"),
        (("[-60, 40, 90]", "[30, 0, 110.2]"), "tool points '1' and 'low' stand at one place"),
        (("[-60, 40, 90]", "[-0.06, 0.04, 0.09]"), "tool.points.low.map_mm"),
        (("length_mm =", "mount_deg = [0, -60, 90, 0, 45, 0]\nlength_mm ="), "leave it out"),
        (("map_mm = [-60", "map_m = [-60"), "map_m"),
    ],
)
def test_a_wrong_tool_point_is_refused(tmp_path, change, words):
    cell = small_cell("kuka-kr6-r700/edbb", tmp_path, TWO, change)
    done = edbb("plan", cell, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert words in done.screen


@pytest.mark.long
@pytest.mark.skipif(not os.environ.get("EDBB_ALL_TRIALS"), reason="takes minutes: only with EDBB_ALL_TRIALS=1")
def test_further_fixtures_are_found_and_written_into_the_cell(tmp_path):
    cell = small_cell("kuka-kr6-r700/edbb", tmp_path, FEWER)
    done = edbb("plan", cell, "-o", tmp_path / "out", "--poses", 40, "--fixtures", 2)
    assert done.returncode == 0, done.stderr
    planned = tomllib.loads((tmp_path / "out" / "cell.toml").read_text())
    assert [f["name"] for f in planned["fixtures"]] == ["A", "B"]
    apart = np.subtract(planned["fixtures"][1]["position_mm"], planned["fixtures"][0]["position_mm"])
    assert np.linalg.norm(apart) > 100
    cup = planned["obstacles"][-1]
    assert cup["name"] == "fixture cup of fixture B"
    assert np.allclose(np.subtract(cup["to_mm"], [430, 330, 15]), apart)
    again = load_cell(str(tmp_path / "out" / "cell.toml"))
    assert len(again.fixtures) == 2
    plan = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert {p["fixture"] for p in plan["poses"]} == {"A", "B"}


def test_fixtures_beside_several_are_not_looked_for(tmp_path):
    cell = small_cell("kuka-kr6-r700/edbb", tmp_path, OTHER)
    done = edbb("plan", cell, "-o", tmp_path / "out", "--fixtures", 3)
    assert done.returncode == 2
    assert "has 2 of them" in done.screen
