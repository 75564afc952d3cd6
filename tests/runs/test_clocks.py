"""Two logs with clocks of their own, against the path that both were taken from."""

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import CubicSpline

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.runs.joint_motion import joint_speeds
from planner.runs.loader import load_runs
from planner.runs.synchronisation import align_clocks, edge_offset, rising_edges
from tests.runs.made import sine_path, write

OFFSET = 812.3456  # [s] what the gauge's clock is behind
MARKS = np.array([3.0, 5.1, 9.7, 11.2, 16.9])  # [s] by the controller's clock


def marked(t):
    return ((t[:, None] >= MARKS) & (t[:, None] < MARKS + 0.1)).any(axis=1).astype(int)


def logs(folder, sync=(True, True), last=20.0, begin=0.0):
    """Write the controller's log (every 2 ms) and the gauge's (every 1.7 ms) of 20 s; return the gauge's true times."""
    t = np.arange(0, 20, 0.002)
    columns = {"t_s": t, **{f"q{j}_deg": a for j, a in enumerate(np.rad2deg(sine_path(t)[0]).T, start=1)}}
    columns |= {"temperature_degC": 20 + 0.1 * t, "pose": np.floor(t).astype(int)}
    pl.DataFrame(columns | ({"sync": marked(t)} if sync[1] else {})).write_csv(folder / "axes.csv")
    true = np.arange(begin, last, 0.0017) + 0.00031
    columns = {"t_s": true - OFFSET * sync[0], "length_mm": 400 + 10 * np.sin(true)}
    pl.DataFrame(columns | ({"sync": marked(true)} if sync[0] else {})).write_csv(folder / "gauge.csv")
    return true


@pytest.mark.parametrize("order", [("gauge.csv", "axes.csv"), ("axes.csv", "gauge.csv")])
def test_angles_come_to_the_gauges_stamps(tmp_path, order):
    true = logs(tmp_path)
    run = load_runs([tmp_path / name for name in order], 3)
    assert run.continuous
    first = int(np.argmin(np.abs(0.4 + 0.01 * np.sin(true[:9]) - run.readings.length[0])))
    assert len(true) - len(run) <= 3  # those at either end that the controller's log just misses
    np.testing.assert_allclose(run.samples.t, true[first : first + len(run)], atol=1.9e-3)  # half a step of each log
    q, speed = sine_path(run.samples.t)
    np.testing.assert_allclose(run.samples.q, q, atol=1e-9)  # at the stamps as joined: cubic, not straight lines
    assert np.abs(joint_speeds(run.samples) - speed)[1:-1].max() < 1e-5
    np.testing.assert_allclose(run.samples.temperature, 20 + 0.1 * run.samples.t, atol=1e-9)
    assert set(run.samples.pose - np.floor(run.samples.t)) <= {0, -1}
    assert any("5 sync marks agree on it" in w for w in run.warnings)


@pytest.mark.slow
def test_without_marks_the_clocks_are_taken_for_the_same_and_it_is_said(tmp_path):
    true = logs(tmp_path, sync=(False, True))
    run = load_runs([tmp_path / "gauge.csv", tmp_path / "axes.csv"], 3)
    np.testing.assert_allclose(run.samples.t, true[: len(run)], atol=1e-9)
    assert any("the clocks are taken for the same" in w for w in run.warnings)


def test_readings_outside_are_counted(tmp_path):
    true = logs(tmp_path, sync=(False, False), last=25.0, begin=-2.0)
    run = load_runs([tmp_path / "gauge.csv", tmp_path / "axes.csv"], 3)
    lost = int(np.sum((true < 0) | (true > 19.998)))
    assert len(run) == len(true) - lost
    assert any(f"{lost} of {len(true)} readings lie outside the time of" in w for w in run.warnings)


def test_logs_that_never_meet(tmp_path):
    logs(tmp_path, sync=(False, False), last=160.0, begin=150.0)
    with pytest.raises(InputError, match="they do not overlap; a column sync in both would tell"):
        load_runs([tmp_path / "gauge.csv", tmp_path / "axes.csv"], 3)


def test_lost_marks_do_no_harm():
    rng = np.random.default_rng(8)
    errors = []
    for _ in range(50):
        marks = np.cumsum(rng.uniform(0.5, 4.0, 12))
        shift = rng.uniform(-1e4, 1e4)
        gauge = np.delete(marks, rng.integers(12)) - shift + rng.uniform(-5e-4, 5e-4, 11)
        axes = np.delete(marks, rng.choice(12, 2, replace=False)) + rng.uniform(-1e-3, 1e-3, 10)
        found = edge_offset(gauge, axes, 3e-3)
        errors.append(found.seconds - shift)
        assert found.marks >= 9
    assert np.sqrt(np.mean(np.square(errors))) < 4e-4  # of single marks: 6.5e-4


def test_marks_that_do_not_tell():
    with pytest.raises(InputError, match="never rises from 0 to 1"):
        edge_offset(np.empty(0), np.array([1.0]), 0.01)
    with pytest.raises(InputError, match="fit as well at an offset of 0 s as at 1 s"):
        edge_offset(np.arange(9.0), np.arange(10.0), 0.01)
    rng = np.random.default_rng(2)
    with pytest.raises(InputError, match="do not belong together"):
        edge_offset(np.cumsum(rng.uniform(1, 5, 9)), np.cumsum(rng.uniform(1, 5, 9)), 1e-4)


def test_edges_lie_between_their_samples():
    t = np.arange(8.0)
    np.testing.assert_allclose(rising_edges(t, np.array([1, 1, 0, 1, 1, 0, 0, 1.0])), [2.5, 6.5])


def test_poses_are_matched_where_there_is_no_time(tmp_path):
    axes = write(tmp_path / "axes.csv", "pose,q1_deg\n4,10\n1,90\n4,12\n9,50\n")
    gauge = write(tmp_path / "gauge.csv", "pose,length_mm\n1,401\n4,402\n4,403\n5,404\n")
    run = load_runs([axes, gauge], 1)
    assert run.samples.pose.tolist() == [1, 4, 4]
    np.testing.assert_allclose(np.rad2deg(run.samples.q[:, 0]), [90, 10, 12])
    np.testing.assert_allclose(run.readings.length, [0.401, 0.402, 0.403])
    assert run.warnings == tuple(
        f"{f}.csv: 1 of {n} rows have no partner of their pose and were left out"
        for f, n in (("gauge", 4), ("axes", 4))
    )


CASES = {
    "coarse": ("t_s,q1_deg\n0,10\n1,90\n2,40\n", "t_s,length_mm\n0,400\n1,401\n", r"stand 1 s apart, too far"),
    "backwards": (
        "t_s,q1_deg\n0,10\n0.1,90\n0.05,40\n",
        "t_s,length_mm\n0,400\n0.1,401\n",
        r"axes\.csv, line 4, column 't_s'",
    ),
    "nothing in common": (
        "t_s,q1_deg\n0,10\n0.1,90\n",
        "length_mm\n400\n",
        r"both need a column t_s, or both a column pose",
    ),
    "visits": ("pose,q1_deg\n4,10\n4,90\n", "pose,length_mm\n4,400\n", r"pose 4 stands 1 times in .* and 2 times in"),
    "no pose in common": ("pose,q1_deg\n4,10\n", "pose,length_mm\n5,400\n", r"have no pose in common"),
}


@pytest.mark.parametrize("case", CASES)
def test_logs_that_cannot_be_joined(tmp_path, case):
    axes, gauge, message = CASES[case]
    with pytest.raises(InputError, match=message):
        load_runs([write(tmp_path / "gauge.csv", gauge), write(tmp_path / "axes.csv", axes)], 1)


def test_a_half_without_its_other_half(tmp_path):
    gauge = write(tmp_path / "gauge.csv", "t_s,length_mm\n0,400\n")
    axes = [write(tmp_path / f"axes{i}.csv", "t_s,q1_deg\n0,10\n") for i in range(2)]
    with pytest.raises(InputError, match="each of the one needs one of the other"):
        load_runs([gauge, *axes], 1)
    with pytest.raises(InputError, match="there are no joint angles"):
        load_runs([gauge], 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5e/edbb", "panda/tracker"])
def test_clocks_seconds_apart_are_aligned_by_the_readings(name, tmp_path):
    """A drive through random poses; the true offset is known, and the import says how sure it is."""
    cell, rng, offset = load_cell(name), np.random.default_rng(4), -7.3
    t, n = np.arange(0, 300, 0.04), cell.robot.n_joints
    via = cell.home + rng.uniform(-0.5, 0.5, (60, n))
    q = CubicSpline(np.linspace(0, 300, len(via)), via)
    true = np.arange(5.0, 290.0, 0.05)
    x = cell.map_position(q(true))
    read = x if n == 7 else np.linalg.norm(x - cell.fixtures[0].p_BX, axis=1)[:, None]
    titles = ["x_mm", "y_mm", "z_mm"] if n == 7 else ["length_mm"]
    read = 1e3 * read + rng.normal(0, 0.01, read.shape)
    pl.DataFrame({"t_s": true - offset, **dict(zip(titles, read.T, strict=True))}).write_csv(tmp_path / "gauge.csv")
    angles = {f"q{j}_deg": a for j, a in enumerate(np.rad2deg(q(t)).T, start=1)}
    pl.DataFrame({"t_s": t, **angles}).write_csv(tmp_path / "axes.csv")
    (run,) = [load_runs([tmp_path / "gauge.csv", tmp_path / "axes.csv"], n)]
    (said,) = [w for w in run.warnings if "was added to the gauge's clock" in w]
    assert float(said.split(": ")[1].split()[0]) == pytest.approx(offset, abs=0.06)  # the rest is the fit's lag
    assert "of their variance is left" in said
    noise = align_clocks(true, rng.normal(size=read.shape), t, q(t))
    assert noise is None  # readings that follow nothing
    assert align_clocks(true, read, t, q(t)) is None  # clocks that agree stay as they are
