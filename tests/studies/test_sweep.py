"""Sweeps: what a file asks for, parts that stay by content, the same arms everywhere, and numbers from a cluster."""

import os
import shutil
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import planner.studies.sweep as sweep_module
from planner.cell.reading import load_cell
from planner.common.cluster import UnreadPickle
from planner.common.errors import InputError, MissingProgramError
from planner.common.object_hashes import object_hash
from planner.studies.sweep import make_tasks, sweep
from planner.studies.sweep_comparison import compare_neighbours
from planner.studies.sweep_file import SweepFile, changed_file
from planner.studies.sweep_point import SweepTask, TrialErrors, cell_hash, draw_arms, run_task
from tests.command import edbb

SWEEP = 'schema = "edbb-sweep/1"\ncells = ["ur10/edbb"]\nposes = [30, 60]\ncandidates = 200\ntrials = 40\n'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    return path


@pytest.fixture
def computed(monkeypatch):
    """Tasks that were computed, each without its work: errors that fall with the poses and grow with the noise."""
    tasks = []

    def one(task):
        tasks.append(task)
        noise = dict(task.changes).get("gauge.noise_um", 2.0)
        size = np.linspace(1.0, 2.0, task.trials)[:, None] * [3.0, 2.0, noise / task.poses] * 1e-3
        return TrialErrors(size + 1e-6 * task.seed)

    monkeypatch.setattr(sweep_module, "run_task", one)
    monkeypatch.setattr(sweep_module, "map_in_copies", map)
    return tasks


def task_of(cell="ur10/edbb", poses=40, changes=(), trials=60):
    return SweepTask(cell, cell_hash(load_cell(cell)), poses, trials, 0, 200, changes)


def own_cell(folder, text=lambda t: t):
    """The shipped cell with a robot of its own in a folder, its file changed."""
    shipped = load_cell("ur10/edbb")
    folder.mkdir()
    shutil.copytree(shipped.robot.path.parent, folder / "robot", ignore=shutil.ignore_patterns("cells"))
    said = shipped.path.read_text()
    name = next(line for line in said.splitlines() if line.startswith("robot ="))
    (folder / "cell.toml").write_text(text(said.replace(name, 'robot = "robot/robot.toml"')))
    return folder / "cell.toml"


def test_a_file_asks_for_every_combination(tmp_path):
    wanted = SweepFile.model_validate(
        {"schema": "edbb-sweep/1", "cells": ["ur10/edbb", "ur5e/edbb"], "poses": [30, 40], "bars_mm": [[300, 500]],
         "fixtures_mm": [[1, 2, 3], [[4, 5, 6], [7, 8, 90]]], "axes": {"gauge.noise_um": [2, 5, 9]}}
    )  # fmt: skip
    tasks = make_tasks(wanted, tmp_path)
    assert len(tasks) == len({t.key for t in tasks}) == 24
    assert replace(tasks[0], seed=1).key != tasks[0].key


def test_a_set_of_places_takes_the_place_of_all_fixtures():
    base = load_cell("ur10/edbb").file
    places = [[600.0, 500.0, 60.0], [700.0, 0.0, 60.0]]
    moved = changed_file(base, (("fixtures.position_mm", places[0]),), 100, "cell")
    both = changed_file(base, (("fixtures.position_mm", places), ("gauge.noise_um", 7.0)), 100, "cell")
    assert [list(f.position_mm) for f in moved.fixtures] == places[:1]
    assert [(f.name, list(f.position_mm)) for f in both.fixtures] == list(zip("AB", places, strict=True))
    assert both.gauge.noise_um == 7.0
    assert {f.prior_mm for f in both.fixtures} == {base.fixtures[0].prior_mm}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('[axes]\n"gauge.nois_um" = [2]\n', "nois_um"),
        ('[axes]\n"nothing.here" = [2]\n', "has no \\[nothing\\]"),
        ('[axes]\n"plan.poses" = [2]\n', "'poses' of the sweep"),
        ('[axes]\n"tool.map_mm" = [[1, 2, 3]]\n', "'tools_mm' of the sweep"),
        ('index = "O1"\n[axes]\n"plan.index" = ["O2"]\n', "leave one out"),
    ],
)
def test_an_axis_that_is_no_key_or_is_given_twice_is_refused(file, tmp_path, more, says):
    file.write_text(SWEEP + more)
    with pytest.raises(InputError, match=says):
        sweep(file, tmp_path / "out")


def test_parts_are_known_by_content_wherever_the_files_lie(file, tmp_path, computed):
    first = own_cell(tmp_path / "a")
    file.write_text(SWEEP.replace("ur10/edbb", "a/cell.toml"))
    begun = sweep(file, tmp_path / "out")
    assert (begun.known, len(computed)) == (0, 2)
    assert set(begun.figures["cell"]) == {"a/cell.toml"}  # as the file says it: the table is the same in every folder
    shutil.copytree(first.parent, tmp_path / "b")
    file.write_text(SWEEP.replace("ur10/edbb", str(tmp_path / "b" / "cell.toml")))
    assert (sweep(file, tmp_path / "out").known, len(computed)) == (2, 2)
    noise = next(line for line in first.read_text().splitlines() if line.strip().startswith("noise_um"))
    (tmp_path / "b" / "cell.toml").write_text(first.read_text().replace(noise, "noise_um = 500"))
    assert (sweep(file, tmp_path / "out").known, len(computed)) == (0, 4)


def test_what_a_robot_or_a_mesh_says_counts_and_where_it_lies_does_not(tmp_path):
    a, b = own_cell(tmp_path / "a"), own_cell(tmp_path / "b")
    assert cell_hash(load_cell(a)) == cell_hash(load_cell(b))
    robot = b.parent / "robot" / "robot.toml"
    said = robot.read_text()
    line = next(text for text in said.splitlines() if text.startswith("repeatability_mm"))
    robot.write_text(said.replace(line, "repeatability_mm = 0.77"))
    assert cell_hash(load_cell(a)) != cell_hash(load_cell(b))
    mesh = tmp_path / "mesh.stl"
    mesh.write_bytes(b"one")
    before = object_hash({"mesh": mesh})
    mesh.write_bytes(b"two")
    assert object_hash({"mesh": mesh}) != before


def test_a_cell_that_changed_since_the_sweep_began_is_refused(tmp_path):
    path = own_cell(tmp_path / "a")
    task = task_of(str(path))
    path.write_text(path.read_text() + "\n[use]\ntolerance_mm = 0.5\n")
    with pytest.raises(InputError, match="begin again"):
        run_task(task)
    told = sweep_module.run_task_there(task)
    with pytest.raises(InputError, match=r"a worker: .*begin again"):
        sweep_module.read_table(told)


def test_code_of_an_own_effect_counts():
    made = {}
    exec("SIZE = 1.0\ndef own(x):\n    return inner(x)\ndef inner(x):\n    return SIZE * x", made)
    before = object_hash(made["own"])
    made["SIZE"] = 2.0
    assert object_hash(made["own"]) != before
    exec("def inner(x):\n    return x + 1", made)
    assert object_hash(made["own"]) != before


def test_seed_and_index_of_the_command_count(file, tmp_path, computed):
    assert edbb("study", "--sweep", file, "--seed", "-1", "-o", tmp_path / "o").returncode == 2
    plain = sweep(file)
    other = sweep(file, seed=3, index="O1")
    assert [t.seed for t in computed] == [0, 0, 3, 3]
    assert [dict(t.changes) for t in computed] == [{}, {}, {"plan.index": "O1"}, {"plan.index": "O1"}]
    assert not plain.table.equals(other.table)


def test_arms_are_the_same_at_every_point_and_a_longer_sweep_begins_alike():
    some, more = ("a1", "theta2", "gear3"), ("theta2", "compliance1", "a1")
    few, many = draw_arms(some, 20, 5), draw_arms(more, 50, 5)
    assert np.array_equal(few[:, 0], many[:20, 2])
    assert np.array_equal(few[:, 1], many[:20, 0])
    assert abs(np.corrcoef(draw_arms(("a", "b"), 4000, 0).T)[0, 1]) < 0.06


@pytest.mark.slow
def test_points_side_by_side_are_those_of_one_process(file):
    """Copies are made after this process has used threads of OpenMP and of data frames, which they do not have."""
    said = []
    here = pl.concat(run_task(task_of(poses=n, trials=40)).table() for n in (30, 60)).sort("trial", maintain_order=True)
    found = sweep(file, progress=lambda *step: said.append(step))
    assert found.table.sort("trial", maintain_order=True).select(here.columns).equals(here)
    assert said == [("points", k, 2) for k in range(3)]


@pytest.mark.slow
def test_points_of_one_robot_are_paired(file):
    """The uncalibrated error is the arms' own: gauge noise, poses and place of the fixture do not change it."""
    result = sweep({"cells": ["ur10/edbb"], "poses": [30, 60], "candidates": 200, "trials": 20,
                    "axes": {"gauge.noise_um": [2, 500]}})  # fmt: skip
    by_point = [part["nominal_mm"].to_numpy() for _, part in result.table.group_by("point", maintain_order=True)]
    for nominal in by_point[1:]:
        np.testing.assert_allclose(nominal, by_point[0], rtol=1e-9)
    noisy = result.figures.group_by("gauge.noise_um").agg(pl.col("posterior_mm").min()).sort("gauge.noise_um")
    assert noisy["posterior_mm"][1] > 1.5 * noisy["posterior_mm"][0]
    step = result.comparisons.filter(pl.col("along") == "gauge.noise_um")
    assert step["differs"].all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "changes"),
    [
        ("kuka-kr6-r700/tracker", ()),
        ("ur10/edbb", (("fixtures.position_mm", [[600, 500, 60], [700, 0, 60]]), ("plan.free", ["fixture"]))),
        ("ur10/edbb", (("plan.index", "O1"), ("tool.map_mm", [60, 0, 130]), ("gauge.length_mm", [310, 500]))),
    ],
)
def test_any_gauge_and_any_key_may_be_swept(cell, changes):
    errors = run_task(task_of(cell, 40, changes, trials=12)).errors
    assert errors.shape == (12, 3)
    nominal, _, posterior = np.median(errors, axis=0)
    assert 0 < posterior < nominal / 2


def test_neighbours_differ_beyond_chance_only_where_they_do():
    """Against the known truth: two points whose arms err alike but for noise, and one that is 5 % worse."""
    rng = np.random.default_rng(1)
    arms = rng.lognormal(0.0, 0.5, 300)
    errors = [arms, arms * rng.lognormal(0.0, 0.02, 300), arms * 1.05 * rng.lognormal(0.0, 0.02, 300)]
    table = pl.concat(
        pl.DataFrame({"point": [k] * 300, "cell": ["c"] * 300, "poses": [10 * k] * 300, "nominal_mm": e,
                      "geometry_mm": e, "posterior_mm": e, "because": [""] * 300})
        for k, e in enumerate(errors)
    )  # fmt: skip
    found = compare_neighbours(table, ("cell", "poses"))
    told = {(r["point"], r["neighbour"]): r["differs"] for r in found.pairs.to_dicts() if r["along"] == "poses"}
    assert told == {(0, 1): False, (1, 2): True}
    apart = found.pairs.filter(pl.col("along") == "poses")["se_mm"].to_numpy()
    alone = found.figures["posterior_se_mm"].to_numpy()
    assert apart.max() < alone.min() / 2  # pairs: the arms' own spread is not in it
    assert alone[0] == pytest.approx(1.2533 * np.std(arms) / np.sqrt(300), rel=0.6)  # of a median, were it normal


def test_finished_parts_stay_and_what_is_missing_is_computed(file, tmp_path, computed):
    first = sweep(file, tmp_path / "out")
    assert ([t.poses for t in computed], first.points, first.known) == ([30, 60], 2, 0)
    assert [r["poses"] for r in first.figures.to_dicts()] == [60, 30]  # the best first
    parts = sorted((tmp_path / "out" / "parts").glob("*.parquet"))
    parts[0].write_bytes(parts[0].read_bytes()[:100])  # a machine died while it wrote
    again = sweep(file, tmp_path / "out")
    assert (len(computed), again.known) == (3, 1)
    assert again.table.equals(first.table)
    assert {Path(p).name for p in again.write(tmp_path / "out")} == {"sweep.json", "sweep.csv", "comparisons.csv"}


def test_a_point_that_cannot_be_measured_says_why():
    found = run_task(task_of(changes=(("gauge.length_mm", (300.0, 299.0)),)))
    assert len(found.errors) == 1
    assert "shortest length must come first" in found.because


@pytest.mark.slow
def test_wrong_files_and_schedulers_are_told(file, tmp_path, monkeypatch):
    file.write_text(SWEEP.replace("ur10/edbb", "comau-nj130/circular"))
    with pytest.raises(InputError, match="measure at poses"):
        sweep(file, tmp_path / "out")
    assert edbb("study", "--sweep", file, "ur10/edbb", "-o", tmp_path / "o").returncode == 2
    assert edbb("study", "-o", tmp_path / "o").returncode == 2
    file.write_text(SWEEP)
    monkeypatch.setattr(sweep_module, "TIMEOUT", "1s")
    with pytest.raises(MissingProgramError, match="nobody answers"):
        sweep(file, tmp_path / "out", scheduler="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_from_a_cluster_data_alone_is_read(file, monkeypatch):
    """While it listens to a cluster this process reads no pickle, and it reads them again afterwards."""
    distributed = pytest.importorskip("distributed")
    from distributed.protocol import pickle

    before, seen = pickle.loads, []

    class Client:
        loop = None

        def submit(self, task, argument, key, retries):
            seen.append(pickle.loads is not before)
            future = distributed.Future.__new__(distributed.Future)
            future.__dict__["told"] = task(argument)
            return future

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    monkeypatch.setattr(sweep_module, "connect", lambda *_: Client())
    monkeypatch.setattr(distributed, "as_completed", lambda futures, loop: list(futures))
    monkeypatch.setattr(distributed.Future, "__del__", lambda self: None)
    monkeypatch.setattr(distributed.Future, "__hash__", lambda self: id(self))
    monkeypatch.setattr(distributed.Future, "__eq__", lambda self, other: self is other)
    monkeypatch.setattr(distributed.Future, "result", lambda self: self.told)
    monkeypatch.setattr(sweep_module, "run_task_there", lambda _: UnreadPickle("a call"))
    with pytest.raises(InputError, match="sent no table"):
        sweep(file, scheduler="tcp://127.0.0.1:9")
    assert seen == [True, True]
    assert pickle.loads is before


@pytest.mark.long
def test_more_poses_help_and_the_posterior_beats_geometry_alone():
    few, many = (run_task(task_of(poses=n)).table().mean().to_dicts()[0] for n in (30, 90))
    assert many["posterior_mm"] < few["posterior_mm"] < few["nominal_mm"]
    assert many["posterior_mm"] < many["geometry_mm"]
    assert np.array_equal(run_task(task_of()).errors, run_task(task_of()).errors)


@pytest.mark.long
def test_a_killed_worker_costs_only_its_tasks(file, tmp_path):
    """Two processes, one killed as soon as the first part is there: the same bytes as computed here."""
    from distributed import LocalCluster

    here = sweep(file, tmp_path / "here")
    file.write_text(SWEEP.replace("[30, 60]", "[30, 60, 61]"))
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        killed = []

        def kill_one(stage, done, of):
            if not killed and done:
                victim = next(iter(cluster.workers.values())).pid
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        there = sweep(file, tmp_path / "there", scheduler=cluster.scheduler_address, progress=kill_one)
    assert killed
    assert there.points == 3
    assert there.table.filter(pl.col("poses") <= 60).equals(here.table)
