"""Figures of the public runs in ``tests/data``: fitted as the command fits them, judged on poses that it never saw.

``measure_…`` fit the stages that the pictures show, ``released_…`` say how good the robot is that is written.
"""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

import planner.identification.pipeline as pipeline
from planner.cell.cell import Cell, MeasurementSetup, Targets
from planner.cell.reading import load_cell
from planner.common.units import MM, Array, to_mm
from planner.documents.calibrated_robot import CalibratedRobot
from planner.documents.calibration import Calibration
from planner.fit.cross_validation import validate_fit, validation_residual
from planner.fit.least_squares import Fit
from planner.fit.run_setup import add_motion, setup_for_run
from planner.identification.pipeline import FitSettings
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Metrics
from planner.runs.loader import load_run, load_runs
from planner.runs.run import Run
from planner.tracing.trace import trace
from planner.workflow.identification import identify

ROOT = Path(__file__).resolve().parents[2]
DATA, CELLS = ROOT / "tests" / "data", ROOT / "tests" / "identification" / "cells"
FAST = FitSettings(release=False)  # the stages of the fit are shown, not the robot that is written
UM_DIGITS = 4  # of a millimetre
PAGE_DIGITS = 2  # significant, as the pages say figures of the posterior: draws leave a tenth of each open
DRAWS_LEAVE = 0.1  # of such a figure at most, where readings are few: another seed or processor draws other robots
PANDA_CELL = """schema = "edbb-cell/1"
robot = "{urdf}"
tip = "ball_link"
[gauge]
kind = "ball-socket"
[[balls]]
name = "1"
position_mm = [0, 0, 0]
[[balls]]
name = "2"
position_mm = [50, 0, 0]
"""


def measure_ur5() -> dict[str, Any]:
    """UR5 and laser tracker: 1000 poses fitted, 20 kept apart; errors at these [mm], one a pose, after each stage."""
    cell = load_cell(CELLS / "ur5-tracker.toml", planning=False)
    run, apart = (load_run(DATA / "ur5-tracker" / f"{n}.csv", 6) for n in ("run", "validation"))
    c, fits = _fit_judged(run, cell, apart, trace)
    apart = add_motion(apart)  # as the fit has judged it: play and hysteresis need the way that each axis came
    bare = setup_for_run(cell, apart)
    last = c.stages[-1].name
    errors = {name: _sizes(validation_residual(fits[name], apart, bare)) for name in ("nominal", "geometry", last)}
    return {"errors_mm": errors, "last": last, **_stages(c)}


def measure_ur10() -> dict[str, Any]:
    """UR10 and laser tracker: 11 911 poses in ten sessions; held out by blocks in the order of measuring."""
    cell = load_cell(CELLS / "ur10-tracker.toml", planning=False)
    return _stages(pipeline.identify(load_run(DATA / "ur10-tracker" / "run.csv", 6), cell, settings=FAST))


def measure_panda() -> dict[str, Any]:
    """Panda and ball: one placement of the plate is fitted; distances to the socket's mean on the others [mm]."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "panda.toml"
        path.write_text(PANDA_CELL.format(urdf=(DATA / "panda-ball" / "panda.urdf").as_posix()))
        cell = load_cell(path, planning=False)
        others = _other_placements()
        c, fits = _fit_judged(load_run(DATA / "panda-ball" / "front_center.csv", 7), cell, others)
        each = {name: _by_placement(fits[name], others) for name in ("nominal", c.stages[-1].name)}
    return {"places": list(others.places), "mean_mm": each, "last": c.stages[-1].name, **_stages(c)}


def released_ur5() -> dict[str, float]:
    """UR5, as the README identifies it: errors [mm] over the workspace and at the 20 poses kept apart (mean)."""
    folder = DATA / "ur5-tracker"
    c = identify(folder / "run.csv", cell=CELLS / "ur5-tracker.toml", validate=folder / "validation.csv").calibration
    return _stated(c) | {"validation_mean_mm": c.release.validation.mean / MM}


def released_panda() -> dict[str, float]:
    """Panda, as its tutorial identifies it, on its other placements by the robot as it is read back from the file."""
    found = identify(DATA / "panda-ball" / "front_center.csv", cell=ROOT / "examples" / "panda_ball.toml")
    others = _other_placements()
    with TemporaryDirectory() as folder:
        found.write_robot(Path(folder))
        p, R = CalibratedRobot(load_robot(str(Path(folder) / "robot.toml"))).flange(others.samples.q)
    (p_FM,) = found.calibration.released.tool_points.values()
    off = _off_sockets(p + R @ p_FM, others)
    return _stated(found.calibration) | {"other_placements_mean_mm": float(off.mean()) / MM}


def released_ur10() -> dict[str, float]:
    """UR10 with its causes, minutes of a processor: errors [mm] over the workspace and at the blocks held out."""
    cell = CELLS / "ur10-tracker.toml"
    c = identify(DATA / "ur10-tracker" / "run.csv", cell=cell).calibration
    held_out = {"held_out_mean_mm": c.release.held_out.mean, "held_out_rms_mm": c.release.held_out.rms}
    return _stated(c) | {name: value / MM for name, value in held_out.items()}


def _stated(c: Calibration) -> dict[str, float]:
    """Return what ``identify`` states of the robot that it writes, rms over the workspace [mm]."""
    stated = {
        "nominal_anywhere_mm": c.release.nominal_anywhere,
        "known_anywhere_mm": c.workspace_error,
        "at_most_mm": c.release.at_most,
        "where_measured_mm": c.release.where_measured,
    }
    return {name: value / MM for name, value in stated.items()}


def on_page(value: float) -> str:
    """Return a figure of the posterior as the pages say it."""
    return f"{value:#.{PAGE_DIGITS}g}".removesuffix(".")


def page_tolerance(value: float) -> float:
    """Return how far off a figure may be that the pages say: half its last digit, and what the draws leave open."""
    return 0.5 * 10.0 ** (np.floor(np.log10(value)) + 1 - PAGE_DIGITS) + DRAWS_LEAVE * value


def _other_placements() -> Run:
    """Return the Panda's readings that no fit sees."""
    files = sorted(f for f in (DATA / "panda-ball").glob("*.csv") if f.stem != "front_center")
    return load_runs(files, 7)


def _fit_judged(run: Run, cell: Cell, apart: Run, tracer: Any = None) -> tuple[Calibration, dict[str, Fit]]:
    """Identify, and keep the fit of every stage that is judged on the run kept apart."""
    judged: dict[float, Fit] = {}

    def judge(found: Fit, other: Run, bare: MeasurementSetup) -> Metrics:
        metrics = validate_fit(found, other, bare)
        judged[metrics.mean] = found
        return metrics

    with patch.object(pipeline, "validate_fit", judge):
        c = pipeline.identify(run, cell, apart, FAST, tracer=tracer)
    return c, {s.name: judged[s.validation.mean] for s in c.stages if s.validation and s.validation.mean in judged}


def _by_placement(found: Fit, run: Run) -> dict[str, Any]:
    """Mean distance [mm] of the ball to the mean of its socket, of each placement and over all."""
    samples = replace(run.samples, place=np.zeros(len(run), dtype=int))
    model = found.model.fix_at(found.errors)
    x = -model.residual(samples, Targets(position=np.zeros((len(run), 3))), np.zeros(0))
    off = to_mm(_off_sockets(x, run))
    each = [float(off[run.samples.place == k].mean()) for k in range(len(run.places))]
    return {"all": round(float(off.mean()), UM_DIGITS), "each": [round(v, UM_DIGITS) for v in each]}


def _off_sockets(p: Array, run: Run) -> Array:
    """Distances [m] of balls (n, 3) [m] to the mean of those in the same socket."""
    socket = run.samples.place * len(run.balls) + run.readings.ball
    centre = np.stack([p[socket == k].mean(axis=0) for k in range(socket.max() + 1)])
    return np.asarray(np.linalg.norm(p - centre[socket], axis=1))


def _sizes(residual: Array) -> list[float]:
    return [round(float(v), UM_DIGITS) for v in to_mm(np.linalg.norm(residual, axis=1))]


def _stages(c: Calibration) -> dict[str, Any]:
    """Return what the picture and the pages say of every stage, in mm."""
    rows = [
        {
            "name": s.name,
            "parameters": s.parameters,
            "held_out_mean_mm": round(s.held_out.mean / MM, UM_DIGITS),
            "held_out_rms_mm": round(s.held_out.rms / MM, UM_DIGITS),
            "validation_mean_mm": None if s.validation is None else round(s.validation.mean / MM, UM_DIGITS),
        }
        for s in c.stages
    ]
    return {"samples": len(c.run), "by": c.split.by, "stages": rows, "found": [f.note for f in c.findings]}
