"""Calibrations of made runs: the generator's world shares no code with the planner."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.common.files import data_folder
from planner.documents.calibration import Calibration
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_run
from planner.runs.run import Run
from tests.identification.few_draws import few_draws
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.truth import draw_truth


@cache
@few_draws()
def calibrated(kind: str, count: int, wave: float = 0.0, released: bool = True) -> Calibration:
    """Identify a made run of the NJ-130; ``wave`` [rad] is the size of a gear error twice a turn of joint 4.

    ``released``: a robot is made of it, else there are the stages of the fit alone.
    """
    arm = Arm.from_toml(data_folder("robots") / "comau-nj130" / "robot.toml")
    made = getattr(runs, kind)(arm, count, seed=3, truth=draw_truth(arm, 3), logs=("temperature", "direction"))
    with TemporaryDirectory() as place:
        run_file, cell_file = made.write(Path(place))
        run, cell = load_run(run_file, 6), load_cell(str(cell_file), planning=False)
    if wave:
        run = waved(run, arm, wave, made.scene.tool, made.scene.fixture)
    return identify(run, cell, settings=FitSettings(release=released))


def waved(run: Run, arm: Arm, size: float, tool: np.ndarray, fixture: np.ndarray) -> Run:
    """Turn joint 4 by a wave of its angle, and read the lengths that follow, on the nominal arm."""
    length = run.readings.length
    assert length is not None
    off = run.samples.q.copy()
    off[:, 3] += size * np.sin(2 * off[:, 3])
    bar = [np.linalg.norm(_point(arm, q, tool) - fixture, axis=1) for q in (off, run.samples.q)]
    return replace(run, readings=replace(run.readings, length=length + bar[0] - bar[1]))


def _point(arm: Arm, q: np.ndarray, tool: np.ndarray) -> np.ndarray:
    R, p = arm.flange(q)
    return np.asarray(p + R @ tool)
