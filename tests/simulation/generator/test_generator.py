"""Runs keep to the gauge, the limits and the contract's files, and know nothing of the planner."""

import ast
import io
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import tests.simulation.generator.oracle as oracle
from tests.simulation.generator.benches import BALLS_MM, BENCHES
from tests.simulation.generator.draw import random_effect, random_run
from tests.simulation.generator.made import change, with_effects
from tests.simulation.generator.poses import limits
from tests.simulation.generator.runs import balls, edbb_static
from tests.simulation.generator.shared import NAMES, RUNS, arm, rng, run
from tests.simulation.generator.truth import Noise, draw_truth


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("what", ["edbb", "moving"])
def test_bar_stays_in_its_range_and_the_arm_in_its_limits(what, name):
    m = run(what, name)
    low, high = np.array(BENCHES[name].length_mm) / 1e3
    assert np.all((m.reading > low) & (m.reading < high))
    assert np.ptp(m.reading) > 0.4 * (high - low)
    lower, upper = limits(arm(name))
    assert np.all((m.scene.q >= lower) & (m.scene.q <= upper))


def test_continuous_run_is_smooth_and_comes_back():
    m = run("moving")
    q, t = m.scene.q, m.scene.t
    assert np.allclose(q, q[::-1], atol=1e-9)
    assert np.all(np.diff(t) > 0)
    assert np.abs(np.diff(q, 2, axis=0)).max() < 2.0 * np.diff(t)[0] ** 2  # [rad/s2]
    assert np.linalg.norm(np.gradient(m.clean[:, 0], t), ord=np.inf) < 0.06


@pytest.mark.parametrize("name", ["comau-nj130", "kuka-kr6-r700"])
@pytest.mark.parametrize("what", list(RUNS))
def test_file_holds_what_was_read(what, name):
    m = run(what, name)
    table = pl.read_csv(io.StringIO(m.run_csv), comment_prefix="#")
    cell = tomllib.loads(m.cell_toml)
    q = np.radians(table.select([f"q{i}_deg" for i in range(1, 7)]).to_numpy())
    R, p = arm(name).flange(q, m.truth.of_arm(arm(name)))
    x = p + R @ (np.array(cell["tool"]["map_mm"]) / 1e3 + m.truth.error("map"))
    if what in ("edbb", "moving"):
        fixture = np.array(cell["fixtures"][0]["position_mm"]) / 1e3 + m.truth.error("fixture_A")
        gap = np.linalg.norm(x - fixture, axis=1) + m.truth.errors["zero"] - table["length_mm"].to_numpy() / 1e3
    elif what == "tracker":
        seen = table.select("x_mm", "y_mm", "z_mm").to_numpy() / 1e3 @ m.station.R.T + m.station.place
        gap = np.linalg.norm(x - seen, axis=1)
    else:
        gap = np.linalg.norm(x - m.station.balls, axis=1)
    assert np.abs(gap).max() < 8 * m.noise_rms
    assert oracle.rms(gap[:, None]) == pytest.approx(m.noise_rms, rel=0.01)


def test_balls_are_the_plate_wherever_it_stands():
    m = run("balls", "kuka-kr6-r700")
    table = pl.read_csv(io.StringIO(m.run_csv), comment_prefix="#")
    assert table["ball"].value_counts()["count"].to_list() == [20] * 4
    stated = [b["position_mm"] for b in tomllib.loads(m.cell_toml)["balls"]]
    assert np.allclose(stated, BALLS_MM)
    centres = np.stack([m.station.balls[table["ball"].to_numpy() == k][0] for k in (1, 2, 3, 4)])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    truth = np.linalg.norm(np.array(BALLS_MM)[:, None] - np.array(BALLS_MM)[None], axis=2) / 1e3
    assert np.allclose(gaps, truth, atol=1e-12)


def test_recorded_angles_bring_the_bent_arm_into_the_ball():
    truth = draw_truth(
        arm("kuka-kr6-r700"), 5, [random_effect(arm("kuka-kr6-r700"), "joint-compliance", rng(), joint=2)]
    )
    m = balls(arm("kuka-kr6-r700"), seed=5, truth=replace(truth, noise=Noise(0.0, 0.0)))
    x = with_effects(m.scene, m.station, m.truth, m.truth.effects)
    assert np.allclose(x, m.station.balls, atol=1e-9)
    assert oracle.rms(change(m.scene, m.station, m.truth, m.truth.effects[0])) > 1e-5


@pytest.mark.slow
def test_same_seed_same_bytes():
    for build in (edbb_static, balls):
        a, b, c = (random_run(build, arm("kuka-kr6-r700"), s, ("encoder-twice",), 3.0, n_poses=40) for s in (8, 8, 9))
        assert (a.run_csv, a.cell_toml) == (b.run_csv, b.cell_toml)
        assert a.run_csv != c.run_csv
        assert a.truth == b.truth


def test_files_state_the_cell_and_not_the_truth(tmp_path):
    m = random_run(edbb_static, arm("ur10"), 4, ("strain-wave",), 3.0, n_poses=40)
    run_path, cell_path = m.write(tmp_path)
    assert cell_path.read_text() == m.cell_toml
    assert run_path.read_text().startswith("# robot: ur10\n")
    joints = tomllib.loads((tmp_path / "robot.toml").read_text())["joints"]
    e = m.truth.effects[0]
    assert e["frequency"] == 2 * joints[e.joint - 1]["gear_ratio"]
    assert np.abs(m.truth.error("fixture_A")).min() > 0


def test_two_logs_hold_every_other_sample_each():
    m = run("moving")
    controller, gauge = (pl.read_csv(io.StringIO(text), comment_prefix="#") for text in m.two_logs(0.5))
    assert np.allclose(controller["t_s"], m.scene.t[::2], atol=1e-6)
    assert np.allclose(controller["q3_deg"], np.degrees(m.scene.q[::2, 2]), atol=1e-6)
    assert np.allclose(gauge["t_s"], m.scene.t[1::2] + 0.5, atol=1e-6)
    assert np.allclose(gauge["length_mm"], m.reading[1::2, 0] * 1e3, atol=1e-5)
    assert "q1_deg" not in gauge.columns
    assert "length_mm" not in controller.columns


def test_generator_does_not_know_the_planner():
    for path in Path(__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                own = name.startswith(("tests.simulation.generator", "tests.not_everywhere"))
                library = name.split(".")[0] in {"numpy", "scipy", "polars", "pinocchio", "pytest"}
                assert own or library or name.split(".")[0] in {
                    "ast", "collections", "dataclasses", "functools", "io", "pathlib", "tomllib", "types",
                }, (path.name, name)  # fmt: skip
