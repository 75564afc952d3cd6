"""Made runs with a stated effect, and what the tracer makes of them."""

import tempfile
from functools import cache
from pathlib import Path

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.draw import USUAL
from tests.simulation.generator.kinds import Effect
from tests.simulation.generator.truth import draw_truth

FITTED = FitSettings(release=False)  # the last stage is what these tests look at

NJ = "comau-nj130"


@cache
def arm(name=NJ):
    return Arm.from_toml(name)


@cache
def run(effects=(), seed=1, build="edbb_static", noise=USUAL, logs=("direction",), size=200):
    """Made run with these effects, masses a little off."""
    truth = draw_truth(arm(), seed, effects, noise, 0.1)
    how = {"n_rows": size, "waypoints": 12} if build == "edbb_continuous" else {"n_poses": size}
    return getattr(runs, build)(arm(), seed=seed, truth=truth, logs=logs, **how)


@cache
def calibrated(effects=(), traced=True, **how):
    """What is identified from the run's files."""
    with tempfile.TemporaryDirectory() as folder:
        files = run(effects, **how).write(Path(folder))
        cell = load_cell(str(files[1]), planning=False)
        return identify(
            load_runs([files[0]], cell.robot.n_joints), cell, settings=FITTED, tracer=trace if traced else None
        )


def effect(kind, joint, size=0.0, share=None, **inner):
    return Effect(kind, joint, size, tuple(sorted(inner.items())), share)


def names(found):
    return [f"{f.effect}, {f.on}" for cause in found.findings for f in cause.each]
