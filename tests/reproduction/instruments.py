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
from planner.workflow.writing import write_cell
from tests.reproduction.planned import minutes, of_bar, of_tracker, of_trical, stops
from tests.reproduction.truth import BAR_M, DEVICE_M, TOOL_COM_MM, TOOL_KG, TRACKER_M, truth
from tests.simulation.generator.arm import Arm
from tests.simulation.generator.benches import BENCHES

NAME = "kuka-kr6-r700"
CHOSEN = 80  # poses of TriCal and of the tracker, as in the paper
VALIDATED, REGISTERED = 500, 40  # poses of the figures, and others that place the robot in the tracker's frame
MEASURED = ("calibrate", "repeat")
EUROS = {"TriCal": 5_000.0, "laser tracker": 130_000.0, "ball bar": 5_000.0, "a further place": 300.0}  # about


@dataclass(frozen=True)
class Measured:
    """One instrument's run: files, minutes of robot time, euros of equipment, and its point on the flange [m].

    ``session``: fixtures, tool points, poses and aim of a bar's plan.
    """

    name: str
    run_csv: str
    cell_toml: str
    poses: int
    minutes: float
    euros: float
    tool: np.ndarray
    session: tuple = ()


def arm():
    """The arm by its data sheet."""
    return Arm.from_toml(NAME)


def bench(stop):
    """The cell at one place of a gauge, the end effector as heavy as in the paper."""
    return replace(
        BENCHES[NAME], fixture_mm=stop.fixture_mm, map_mm=stop.map_mm, tool_kg=TOOL_KG, com_mm=tuple(TOOL_COM_MM)
    )


def tricentred(more=(), seed=0):
    """TriCal on its four balls, as many poses on each."""
    plan = of_trical(CHOSEN)
    visits = [v for v in plan.drives[0].visits if v.role in MEASURED]
    ball = np.array([v.ball for v in visits])
    (stop,) = stops(plan, *MEASURED)
    there = replace(bench(stop), plate_mm=stop.fixture_mm)
    made = runs.centred(arm(), there, stop.q, ball, truth(DEVICE_M, more, seed), seed=1 + seed, logs=("direction",))
    return _measured("TriCal", made.run_csv, plan, len(visits), stop.map_mm)


def tracked(more=(), seed=0):
    """A laser tracker and one reflector."""
    plan = of_tracker(CHOSEN, VALIDATED + REGISTERED)
    (stop,) = stops(plan, *MEASURED)
    made = runs.measured(arm(), bench(stop), "tracker", stop.q, truth(TRACKER_M, more, seed), 4 + seed, ("direction",))
    plain = f"{made.cell_toml}\n"  # where the tracker stands is found from the run
    found = _measured("laser tracker", made.run_csv, plan, len(stop.q), stop.map_mm)
    share = len(stop.q) / (len(stop.q) + VALIDATED + REGISTERED)  # of one drive that validates as well
    return replace(found, cell_toml=plain, minutes=found.minutes * share)


def bars(fixtures, points, poses, aim="tracing", more=(), seed=0):
    """A ball bar about ``fixtures`` fixtures at ``points`` tool points: one plan of all of them."""
    return bar_run(of_bar(fixtures, points, poses, aim), aim, more, seed)


def bar_run(plan, aim, more=(), seed=0):
    """The run of a planned session with a bar."""
    tables, places = [], stops(plan, *MEASURED)
    for k, stop in enumerate(places):
        what = truth(BAR_M, more, seed)
        made = runs.measured(arm(), bench(stop), "edbb", stop.q, what, 10 + k + 20 * seed, ("direction",))
        table = pl.read_csv(made.run_csv.encode(), comment_prefix="#").drop("pose")
        more_columns = {"fixture": stop.fixture, "session": k + 1} | ({"point": stop.point} if stop.point else {})
        tables.append(table.with_columns(**{name: pl.lit(value) for name, value in more_columns.items()}))
    text = f"# robot: {NAME}\n" + pl.concat(tables, how="vertical").write_csv()
    cups, hung = len({s.fixture for s in places}), len({s.point for s in places})
    chosen = len(plan.choice.q)
    name = f"ball bar, {chosen} poses for {'the index' if aim == 'index' else 'tracing'}, {_several(cups, 'fixture')}, "
    name += _several(hung, "tool point") + (" (the default plan)" if aim is None else "")
    found = _measured(name, text, plan, chosen, places[0].map_mm)
    euros = EUROS["ball bar"] + EUROS["a further place"] * (cups + hung - 2)
    return replace(found, euros=euros, session=(cups, hung, chosen, aim or "tracing"))


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


def _measured(name, run_csv, plan, poses, map_mm):
    with tempfile.TemporaryDirectory() as folder:
        write_cell(plan.cell, Path(folder))
        cell = (Path(folder) / "cell.toml").read_text()
    tool = np.array(map_mm) / 1e3
    return Measured(name, run_csv, cell, poses, minutes(plan), EUROS[name.partition(",")[0]], tool)


def _several(n, what):
    return f"{n} {what}{'s' if n > 1 else ''}"
