"""Sweeps: what a file asks for, parts that stay, and the same numbers from a cluster whose worker is killed."""

import os
import signal
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import planner.studies.sweep as sweep_module
from planner.common.errors import InputError, MissingProgramError
from planner.studies.sweep import SweepFile, SweepTask, run_task, sweep
from tests.command import edbb

SWEEP = 'schema = "edbb-sweep/1"\ncells = ["ur10/edbb"]\nposes = [30, 60]\ncandidates = 200\ntrials = 40\n'
TASK = SweepTask("ur10/edbb", 40, 60, 0, 200)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    return path


def table_of(task):
    """What a task gives, without its work."""
    error = np.linspace(1.0, 2.0, task.trials) / task.poses
    point = {"cell": [task.cell] * task.trials, "poses": [task.poses] * task.trials}
    point |= {c: [None] * task.trials for c in sweep_module.POINT if c not in point}
    errors = {n: error for n in ("nominal_mm", "geometry_mm", "posterior_mm")}
    table = pl.DataFrame(point | {"trial": np.arange(task.trials)} | errors | {"because": [""] * task.trials})
    return table.with_columns(pl.col([c for c in table.columns if c.endswith("_mm")]).cast(pl.Float64))


def test_a_file_asks_for_every_combination(tmp_path):
    wanted = SweepFile.model_validate(
        {"schema": "edbb-sweep/1", "cells": ["a/b", "c/d"], "poses": [30, 40], "bars_mm": [[300, 500]],
         "fixtures_mm": [[1, 2, 3], [4, 5, 6], [7, 8, 9]]}
    )  # fmt: skip
    tasks = wanted.tasks(tmp_path)
    assert len(tasks) == len({t.key for t in tasks}) == 12
    assert replace(tasks[0], seed=1).key != tasks[0].key


def test_finished_parts_stay_and_what_is_missing_is_computed(file, tmp_path, monkeypatch):
    computed = []
    monkeypatch.setattr(sweep_module, "run_task", lambda t: computed.append(t.poses) or table_of(t))
    first = sweep(file, tmp_path / "out")
    assert (computed, first.points, first.known) == ([30, 60], 2, 0)
    assert [r["poses"] for r in first.figures.to_dicts()] == [60, 30]  # the best first
    parts = sorted((tmp_path / "out" / "parts").glob("*.parquet"))
    parts[0].write_bytes(parts[0].read_bytes()[:100])  # a machine died while it wrote
    again = sweep(file, tmp_path / "out")
    assert (len(computed), again.known) == (3, 1)
    assert again.table.equals(first.table)


def test_a_point_that_cannot_be_measured_says_why():
    table = run_task(replace(TASK, bar_mm=(300.0, 299.0)))
    assert table.height == 1
    assert "leaves nothing of the range" in table["because"][0]


def test_wrong_files_and_schedulers_are_told(file, tmp_path, monkeypatch):
    file.write_text(SWEEP.replace("ur10/edbb", "kuka-kr6-r700/tracker"))
    with pytest.raises(InputError, match="a sweep is of bars"):
        sweep(file, tmp_path / "out")
    assert edbb("study", "--sweep", file, "ur10/edbb", "-o", tmp_path / "o").returncode == 2
    assert edbb("study", "-o", tmp_path / "o").returncode == 2
    file.write_text(SWEEP)
    monkeypatch.setattr(sweep_module, "TIMEOUT", "1s")
    with pytest.raises(MissingProgramError, match="nobody answers"):
        sweep(file, tmp_path / "out", scheduler="tcp://127.0.0.1:9")


@pytest.mark.long
def test_more_poses_help_and_the_posterior_beats_geometry_alone():
    few, many = (run_task(replace(TASK, poses=n)).mean().to_dicts()[0] for n in (30, 90))
    assert many["posterior_mm"] < few["posterior_mm"] < few["nominal_mm"]
    assert many["posterior_mm"] < many["geometry_mm"]
    assert run_task(TASK).equals(run_task(TASK))


@pytest.mark.long
def test_a_killed_worker_costs_only_its_tasks(file, tmp_path):
    """Two processes, one killed as soon as the first part is there: the same bytes as computed here."""
    from distributed import LocalCluster

    here = sweep(file, tmp_path / "here")
    file.write_text(SWEEP.replace("[30, 60]", "[30, 60, 61]"))
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        killed = []

        def kill_one(stage, done, of):
            if not killed:
                victim = next(iter(cluster.workers.values())).pid
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        there = sweep(file, tmp_path / "there", scheduler=cluster.scheduler_address, progress=kill_one)
    assert killed
    assert there.points == 3
    assert there.table.filter(pl.col("poses") <= 60).equals(here.table)
