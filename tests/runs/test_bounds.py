"""Numbers and files that no cell can have are told at once, each bound by a case of its own."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.fit.run_setup import setup_for_run
from planner.kinematics.robot_reader import load_robot
from planner.runs.loader import load_run
from planner.runs.run import Readings
from planner.workflow.run_checks import check_angles

CELL = load_cell("comau-nj130/edbb")
Q = "q1_deg,q2_deg,length_mm"


def _rows(extra: str, value: str, n: int = 6) -> str:
    rows = [f"{10 * k},{20 - 9 * k},{400 + k},{value if k == 3 else '1'}" for k in range(n)]
    return f"{Q},{extra}\n" + "\n".join(rows) + "\n"


RUNS = {
    "colder than any cell": (_rows("temperature_degC", "-400"), r"line 5, column 'temperature_degC': -400"),
    "negative payload": (_rows("payload_kg", "-5"), r"line 5, column 'payload_kg': -5"),
    "force of a press": (_rows("force_N", "1e9"), r"line 5, column 'force_N'"),
    "negative length": (_rows("pose", "1").replace("403", "-403"), r"line 5, column 'length_mm': -403 mm lies outside"),
    "length of 1e18": (_rows("pose", "1").replace("403", "1e18"), r"line 5, column 'length_mm': 1e\+18 mm"),
    "angles of 1e9": (_rows("pose", "1").replace("\n30,", "\n1e9,"), r"line 5, column 'q1_deg'"),
    "pose of 1e12": (_rows("pose", "1000000000000"), r"line 5, column 'pose'"),
    "a fixture that is a path": (_rows("fixture", "../../etc"), r"line 5, column 'fixture': '../../etc' is no name"),
    "a point of many letters": (_rows("point", "A" * 300), r"line 5, column 'point': .* at most 200 letters"),
    "a clock that runs backwards": (
        f"{Q},t_s\n" + "".join(f"{10 * k},{20 - 9 * k},400,{-k}\n" for k in range(6)),
        r"line 3, column 't_s': time runs backwards here and in 4 more of 6 rows",
    ),
    "a clock that stands": (_rows("t_s", "1"), r"column 't_s': all 6 rows have the time 1 s, but the arm moves"),
}


@pytest.mark.parametrize("case", RUNS)
def test_a_run_that_cannot_be_is_told(tmp_path, case):
    text, said = RUNS[case]
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        load_run(tmp_path / "run.csv", 2)


@pytest.mark.parametrize("torque", ["1e30", "-1e30", "1e7"])
def test_torques_that_no_gear_bears_are_told(tmp_path, torque):
    text = f"{Q},torque1_Nm,torque2_Nm\n10,20,400,1,2\n30,5,410,{torque},2\n"
    (tmp_path / "run.csv").write_text(text)
    with pytest.raises(InputError, match=r"line 3, column 'torque1_Nm'"):
        load_run(tmp_path / "run.csv", 2)


def _bar_run(folder, scale=1.0, joint=None, angle=0.0):
    rng = np.random.default_rng(0)
    q = np.rad2deg(CELL.home) + rng.uniform(-20, 20, (12, 6))
    if joint is not None:
        q[7, joint] = angle
    rows = [",".join(f"{v:.4f}" for v in (*row, scale * rng.uniform(320, 500))) for row in q]
    names = ",".join(f"q{j}_deg" for j in range(1, 7))
    (folder / "run.csv").write_text(f"{names},length_mm\n" + "\n".join(rows) + "\n")
    return load_run(folder / "run.csv")


UNITS = {
    1 / 25.4: " inches", 1 / 12.7: "half inches", 0.1: "centimetres", 1e-3: " metres in length_mm",
    1e3: "millimetres in length_m ", 1e-6: " metres in length_um",
}  # fmt: skip


@pytest.mark.parametrize("scale", UNITS)
@pytest.mark.parametrize("kind", ["edbb", "draw-wire"])
def test_lengths_in_another_unit_are_told_before_any_fit(tmp_path, scale, kind):
    text = CELL.path.read_text()
    run = _bar_run(tmp_path, scale)
    (tmp_path / "cell.toml").write_text(text)
    cell = load_cell(str(tmp_path / "cell.toml"))
    if kind == "draw-wire":  # nothing says how long the wire can be: the place of the fixture does
        cell = replace(cell, gauge=replace(cell.gauge, length_max=np.inf))
        away = np.linalg.norm(cell.map_position(run.samples.q) - cell.fixtures[0].p_BX, axis=1)
        setup_for_run(cell, replace(run, readings=Readings(length=away)))
        run = replace(run, readings=Readings(length=away * scale))
    with pytest.raises(InputError, match=f"these look like.*{UNITS[scale]}"):
        setup_for_run(cell, run)


def test_lengths_of_the_bar_itself_are_taken(tmp_path):
    setup_for_run(CELL, _bar_run(tmp_path))


def test_a_point_that_the_tool_does_not_have_is_told(tmp_path):
    run = _bar_run(tmp_path)
    for name in ("", "1"):
        setup_for_run(CELL, replace(run, points=(name,)))
    with pytest.raises(InputError, match=r"point '9' is not in .*there: 1"):
        setup_for_run(CELL, replace(run, points=("9",), samples=replace(run.samples, point=np.zeros(12, int))))


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("side", [-1, 1])
def test_joints_beyond_their_limits_are_told(tmp_path, joint, side):
    limits = np.rad2deg([CELL.robot.q_lower, CELL.robot.q_upper])[(side + 1) // 2]
    setup_for_run(CELL, _bar_run(tmp_path, joint=joint, angle=limits[joint] + side))
    with pytest.raises(InputError, match=rf"run.csv, line 9: joint {joint + 1} stands at"):
        setup_for_run(CELL, _bar_run(tmp_path, joint=joint, angle=limits[joint] + 3 * side))


CELLS = {
    "tool speed of 1e9": (r"tool_speed_mm_min = \d+", "tool_speed_mm_min = 1e9", "tool_speed_mm_min"),
    "a drive of years": (r"tool_speed_mm_min = \d+", "tool_speed_mm_min = 1e-9", "tool_speed_mm_min"),
    "a bar of no rate": (r"noise_um", "rate_mm_s = 1e-9\nnoise_um", "rate_mm_s"),
    "negative mass": (r"mass_kg = [\d.]+", "mass_kg = -1", "mass_kg"),
    "cable sums over nothing": (r"sums = \[.*\]", "sums = [{ axes = [], limit_deg = 270 }]", "axes"),
    "NaN radius": (r"radius_mm = [\d.]+", "radius_mm = nan", "radius_mm"),
    "1e12 candidates": (r"\[plan\]", "[plan]\ncandidates = 1000000000000", "candidates"),
    "a floor of 1e9": (r"\Z", "\n[base]\nfloor_mm = 1e9\n", "floor_mm"),
    "blocks of an hour": (r"\[controller\]", "[controller]\nblock_ms = 3.6e6", "block_ms"),
    "parts of nothing": (r"\[controller\]", "[controller]\npart_lines = 0", "part_lines"),
}


@pytest.mark.parametrize("case", CELLS)
def test_a_cell_that_cannot_be_is_told(tmp_path, case):
    old, new, key = CELLS[case]
    text = CELL.path.read_text()
    spoilt = re.sub(old, new, text, count=1)
    assert spoilt != text
    (tmp_path / "cell.toml").write_text(spoilt)
    with pytest.raises(InputError, match=key):
        load_cell(str(tmp_path / "cell.toml"))


ROBOTS = {
    "length of 1e18": (r"d_mm = [-\d.]+", "d_mm = 1e18"),
    "negative mass": (r"mass_kg = [\d.]+", "mass_kg = -3"),
    "limits the wrong way round": (r"limit_deg = \[.*\]", "limit_deg = [90, -90]"),
    "jerk of 1e30": (r"jerk_deg_s3 = [\d.]+", "jerk_deg_s3 = 1e30"),
}


@pytest.mark.parametrize("case", ROBOTS)
def test_a_robot_that_cannot_be_is_told(tmp_path, case):
    old, new = ROBOTS[case]
    text = CELL.robot.path.read_text()
    spoilt = re.sub(old, new, text, count=1)
    assert spoilt != text
    (tmp_path / "robot.toml").write_text(spoilt)
    with pytest.raises(InputError, match=old.partition(" ")[0]):
        load_robot(tmp_path / "robot.toml")


@pytest.mark.parametrize("spoil", ["one pose for all rows", "a pose beside another", "nothing"])
def test_rows_are_held_against_the_poses_of_their_plan(tmp_path, spoil):
    run = _bar_run(tmp_path)
    poses = np.arange(len(run))
    plan = SimpleNamespace(poses=[SimpleNamespace(id=k, q_deg=np.rad2deg(q)) for k, q in enumerate(run.samples.q)])
    said = {"one pose for all rows": np.full(len(run), 5), "a pose beside another": poses ^ 1}.get(spoil, poses)
    run = replace(run, samples=replace(run.samples, pose=said))
    if spoil == "nothing":
        check_angles(run, tmp_path / "plan.json", plan, CELL)
        return
    for measure, passing in (("static", False), ("continuous", True)):  # the rows of a drive, thinned, look like rests
        cell = replace(CELL, motion=replace(CELL.motion, measure=measure))
        wrong = r"run.csv, line 2: pose \d was measured with axis .*° off, by .*plan.json"
        with pytest.raises(InputError, match=wrong) as refused:
            check_angles(run, tmp_path / "plan.json", plan, cell)
        assert ("was it read in passing ('# measure: continuous'" in str(refused.value)) is passing
