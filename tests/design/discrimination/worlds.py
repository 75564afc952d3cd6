"""Robots with a stated effect, measured at stated poses by the made world, and what is identified from the runs."""

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.design.candidates.pool import draw_candidates
from planner.design.discrimination.findings import read_identification
from planner.design.discrimination.selection import select_discriminating_poses
from planner.design.pose_selection import select_poses
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import draw_truth

NJ, POSES = "comau-nj130", 45
CALLED = {"joint-compliance": "joint compliance, joint 2", "reduction-ratio": "reduction ratio, joint 2"}


@cache
def cell(measure="static", candidates=1500):
    """The NJ-130's shipped cell, measured at rest or in motion."""
    text = load_cell(f"{NJ}/edbb").path.read_text()
    text = text.replace('measure = "continuous"', f'measure = "{measure}"')
    text = text.replace("both_ways = true", f"both_ways = {'true' if measure == 'continuous' else 'false'}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        path.write_text(text.replace("[plan]", f"[plan]\ncandidates = {candidates}"))
        return load_cell(str(path))


@cache
def pool(measure="static"):
    """Candidates of the cell."""
    return draw_candidates(cell(measure), 1500, 0)


@cache
def usual(measure="static"):
    """As many poses, chosen by the index alone."""
    choice, curve = select_poses(cell(measure), pool(measure), POSES, "O1", 0)
    curve.__exit__(StopIteration, None, None)  # the curve against the number of poses is not asked for
    return choice


def blindly(seed):
    """As many poses, drawn from the candidates."""
    return np.sort(np.random.default_rng(seed).choice(len(pool()), POSES, replace=False))


def measured(q, truth, seed):
    """A run at the poses q (n, N) of an arm as it truly is, a tenth of them measured twice."""
    arm, rng = Arm.from_toml(NJ), np.random.default_rng([seed, 9])
    q, pose = runs.every_pose(runs.toured(arm, q), 0.1, rng)
    return runs._counted(arm, BENCHES[NJ], "edbb", q, pose, seed, truth, ("direction",), rng)


@cache
def first(kind, seed):
    """A first run at blindly drawn poses of an arm with one effect at joint 2."""
    arm = Arm.from_toml(NJ)
    truth = draw_truth(arm, seed, (Effect(kind, 2, 0.0, (), 2.0),))
    return measured(pool().q[blindly(seed)], truth, seed)


def identified(made):
    """What is identified from a run's files."""
    with tempfile.TemporaryDirectory() as folder:
        files = made.write(Path(folder))
        stated = load_cell(str(files[1]), planning=False)
        run, findings_alone = load_runs([files[0]], stated.robot.n_joints), FitSettings(release=False)
        return identify(run, stated, settings=findings_alone, tracer=trace)


def named(calibration):
    """Findings and their rivals."""
    return [(f"{f.effect}, {f.on}", f.rivals) for cause in calibration.findings for f in cause.each]


def written(calibration, path):
    """The identification's file."""
    path.write_text(calibration.to_json())
    return path


def separated(calibration, folder):
    """The poses that tell the findings from their rivals."""
    path = written(calibration, folder / "identification.json")
    return select_discriminating_poses(cell(), pool(), usual(), read_identification(path, NJ, 6), 0)


def again(made, q, seed):
    """The same arm measured at other poses."""
    return named(identified(measured(q, replace(made.truth, seed=seed), seed)))
