"""The same arm measured by each instrument, at the poses that the planner chooses for it."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

import tests.simulation.generator.runs as runs
from planner.cell.reading import load_cell
from planner.identification.pipeline import FitSettings, identify
from planner.runs.loader import load_runs
from planner.tracing.trace import trace
from planner.workflow.plan_results import write_cell
from tests.reproduction.planned import of_tracker, stops
from tests.reproduction.truth import BAR_M, TOOL_COM_MM, TOOL_KG, TRACKER_M, truth
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES

NAME = "kuka-kr6-r700"
CHOSEN = 80  # poses of the tracker, as in the paper
VALIDATED, REGISTERED = 500, 40  # poses of the figures, and others that place the robot in the tracker's frame
MEASURED = ("calibrate", "repeat")


@dataclass(frozen=True)
class Measured:
    """One instrument's run: its files, and its point on the flange (3,) [m]."""

    name: str
    run_csv: str
    cell_toml: str
    tool: np.ndarray


def arm():
    """The arm by its data sheet."""
    return Arm.from_toml(NAME)


def bench(stop):
    """The cell at one place of a gauge, the end effector as heavy as in the paper."""
    return replace(
        BENCHES[NAME], fixture_mm=stop.fixture_mm, map_mm=stop.map_mm, tool_kg=TOOL_KG, com_mm=tuple(TOOL_COM_MM)
    )


def tracked(more=(), seed=0):
    """A laser tracker and one reflector."""
    plan = of_tracker(CHOSEN, VALIDATED + REGISTERED)
    (stop,) = stops(plan, *MEASURED)
    made = runs.measured(arm(), bench(stop), "tracker", stop.q, truth(TRACKER_M, more, seed), 4 + seed, ("direction",))
    # where the tracker stands is found from the run
    return Measured("laser tracker", made.run_csv, f"{made.cell_toml}\n", np.array(stop.map_mm) / 1e3)


def bar_run(plan, more=(), seed=0):
    """The run of a planned session with a bar."""
    tables, places = [], stops(plan, *MEASURED)
    for k, stop in enumerate(places):
        what = truth(BAR_M, more, seed)
        made = runs.measured(arm(), bench(stop), "edbb", stop.q, what, 10 + k + 20 * seed, ("direction",))
        table = pl.read_csv(made.run_csv.encode(), comment_prefix="#").drop("pose")
        more_columns = {"fixture": stop.fixture, "session": k + 1} | ({"point": stop.point} if stop.point else {})
        tables.append(table.with_columns(**{name: pl.lit(value) for name, value in more_columns.items()}))
    text = f"# robot: {NAME}\n" + pl.concat(tables, how="vertical").write_csv()
    with tempfile.TemporaryDirectory() as folder:
        write_cell(plan.cell, Path(folder))
        cell = (Path(folder) / "cell.toml").read_text()
    return Measured("ball bar", text, cell, np.array(places[0].map_mm) / 1e3)


def identified(measured, traced):
    """The calibration from an instrument's files: all that is traced, or least squares of what the cell declares."""
    with tempfile.TemporaryDirectory() as folder:
        run, cell = Path(folder) / "run.csv", Path(folder) / "cell.toml"
        run.write_text(measured.run_csv)
        cell.write_text(measured.cell_toml)
        loaded = load_cell(str(cell), planning=False)
        settings = FitSettings(release=traced)  # else effects that the model lacks would come in by the background
        tracer = trace if traced else None
        return identify(load_runs([run], loaded.robot.n_joints), loaded, settings=settings, tracer=tracer)
