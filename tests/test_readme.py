"""The examples of the how-to pages: cells plan, files are read and written; the README's picture is there."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.centring.settings import read_settings
from planner.circular.plan import circles_of
from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.runs.loader import load_run
from planner.runs.run import Samples
from planner.runs.traces import import_run
from planner.simulation.truth import read_truth
from tests.command import edbb
from tests.compensation.robots import bent

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
CELL, RUN, TRICAL, CIRCLES, COMPENSATE = (
    (ROOT / "docs" / "how-to" / f"{page}.md").read_text() for page in ("cell", "run", "trical", "circles", "compensate")
)
TEXTS = re.findall(r"```text\n(.*?)```", RUN, re.DOTALL)
(TARGETS,) = re.findall(
    r"```text\n(q1_deg.*?)```", (ROOT / "docs" / "commands" / "compensate.md").read_text(), re.DOTALL
)


@cache
def help_of(verb):
    """What a command says of itself."""
    done = edbb(verb, "--help")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
def test_the_shortest_cell_is_a_cell_that_plans(tmp_path):
    text, *_ = re.findall(r"```toml\n(.*?)```", CELL, re.DOTALL)
    path = tmp_path / "cell.toml"
    path.write_text(text + "\n[plan]\ncandidates = 500\nrefine = false\n")
    done = edbb("plan", path, "-o", tmp_path / "out", "--poses", "36")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000


def test_the_run_and_its_cell_are_read(tmp_path):
    (rows,) = re.findall(r"```csv\n(.*?)```", RUN, re.DOTALL)
    cell = TEXTS[0]
    (tmp_path / "run.csv").write_text(rows)
    (tmp_path / "cell.toml").write_text(cell)
    robot = load_cell(str(tmp_path / "cell.toml"), planning=False).robot
    assert len(load_run(tmp_path / "run.csv", robot.n_joints)) == 1
    done = edbb("identify", tmp_path / "run.csv", "--cell", tmp_path / "cell.toml", "-o", tmp_path / "out")
    assert done.returncode == 2  # one sample says nothing, and that is said
    assert "Traceback" not in done.screen
    assert not (tmp_path / "out").exists()


def test_the_balls_stand_in_a_cell(tmp_path):
    cell, balls = TEXTS[:2]
    (tmp_path / "cell.toml").write_text(cell.replace('"tracker"', '"ball-socket"') + balls)
    assert [b.name for b in load_cell(str(tmp_path / "cell.toml"), planning=False).balls] == ["1", "2"]


def test_the_column_map_reads_two_traces(tmp_path):
    (tmp_path / "map.toml").write_text(TEXTS[2])
    times = [0.1 * k for k in range(200)]
    rest = ";0" * 5  # all axes of Comau at 0: the arm straight up, joint 3 of the model at -90 degrees
    rows = "".join(f"{t:.2f};{10 * t:.3f}{rest}\n" for t in times)
    (tmp_path / "axes.log").write_text("Time;A1;A2;A3;A4;A5;A6\n" + rows)
    (tmp_path / "gauge.csv").write_text("t,L\n" + "".join(f"{t:.2f},{400_000 + 100 * t:.1f}\n" for t in times))
    run = import_run([tmp_path / "axes.log", tmp_path / "gauge.csv"], tmp_path / "map.toml")
    assert run.readings.length is not None
    assert 0.4 <= run.readings.length.min() <= run.readings.length.max() < 0.403
    q_deg = np.rad2deg(run.samples.q)
    assert q_deg[:, 0].min() < -19.5  # Comau's axis 1 counts the other way
    np.testing.assert_allclose(q_deg[:, 0], -10 * run.samples.t, atol=0.2)
    np.testing.assert_allclose(q_deg[:, 1:], np.tile([0, -90, 0, 0, 0], (len(q_deg), 1)), atol=1e-9)


def test_the_truth_is_what_a_simulated_robot_has(tmp_path):
    (tmp_path / "truth.toml").write_text(TEXTS[3])
    cell = load_cell("comau-nj130/edbb")
    q = np.random.default_rng(0).uniform(-1, 1, (30, 6))
    truth = read_truth(tmp_path / "truth.toml", cell, Samples(q, np.zeros(30, dtype=int)))
    values = dict(zip(truth.model.names, truth.errors, strict=True))
    assert {k: v for k, v in values.items() if v} == {"a2": 0.8e-3, "theta3": pytest.approx(np.radians(0.05))}
    assert [v for e in truth.effects for v in e.values if v] == [pytest.approx(120e-6)]
    assert (truth.model.setup.gauge.noise, truth.model.setup.robot.repeatability) == (1e-6, 2e-5)


@pytest.mark.parametrize("key", re.findall(r"compliance2\S+|fixture\S+|map\S+|zero_mm", TEXTS[3]))
def test_every_error_that_the_truth_may_name_is_there(key, tmp_path):
    (tmp_path / "truth.toml").write_text(f'schema = "edbb-truth/1"\n[errors]\n{key.rstrip(",")} = 0.1\n')
    truth = read_truth(
        tmp_path / "truth.toml", load_cell("comau-nj130/edbb"), Samples(np.zeros((1, 6)), np.zeros(1, int))
    )
    assert np.count_nonzero(truth.errors) == 1


def test_the_table_of_targets_is_corrected(tmp_path):
    (tmp_path / "targets.csv").write_text(TARGETS)
    robot, real = bent("ur10", seed=1)
    done = compensate_file(tmp_path / "targets.csv", robot, real)
    assert done.report.joint_targets == 2
    poses = TARGETS.replace("q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg", "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg")
    (tmp_path / "poses.csv").write_text(poses)
    with pytest.raises(InputError, match="the joint angles then being where the search starts"):
        compensate_file(tmp_path / "poses.csv", robot, real)


def test_the_options_that_compensate_is_said_to_have_are_there():
    options = set(re.findall(r"[ `](--[a-z-]+)", COMPENSATE))
    assert {"--strict", "--tool", "--base", "--frames", "--cell", "--again", "--measuring", "--zeros-set"} <= options
    assert all(option in help_of("compensate") for option in options)


def test_the_picture_is_there():
    (picture,) = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert (Path(__file__).parent.parent / picture).stat().st_size > 10_000


def test_the_settings_of_a_centring_are_read(tmp_path):
    (tmp_path / "centring.toml").write_text(*re.findall(r"```text\n(.*?)```", TRICAL, re.DOTALL))
    read = read_settings(tmp_path / "centring.toml", load_cell("kuka-kr6-r700/trical").path)
    assert (read.moves.tolerance_um, read.robot.speed_mm_s) == (3.0, 5.0)


def test_the_circles_stand_in_a_cell(tmp_path):
    text = load_cell("abb-irb6700/ldbb").path.read_text()
    start, end = text.index("[[circles]]"), text.index("[controller]")
    (given,) = re.findall(r"```text\n(.*?)```", CIRCLES, re.DOTALL)
    (tmp_path / "cell.toml").write_text(text[:start] + given + text[end:])
    (mine,), (shipped,) = circles_of(load_cell(str(tmp_path / "cell.toml"))), circles_of(load_cell("abb-irb6700/ldbb"))
    assert str(mine) == str(shipped)
    assert mine.loads == (125, 250, 375, 500, 625)
