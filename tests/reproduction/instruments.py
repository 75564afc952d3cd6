"""The same arm measured by each instrument, at poses that the observability analysis chooses from a pool."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from planner.cell import load_cell
from planner.identification import identify
from planner.model import Model
from planner.run import load_runs
from planner.selection import detmax
from planner.tracing import trace
from tests.generator import runs, writing
from tests.generator.arm import Arm
from tests.generator.benches import BENCHES
from tests.generator.poses import at_targets, point, shell_points, toured, uniform
from tests.reproduction.truth import BAR_M, DEVICE_M, TOOL_KG, TRACKER_M, truth

NAME = "kuka-kr6-r700"
POOL = 1500  # poses that the analysis chooses from
FIXTURES_MM = ((430.0, 330.0, 60.0), (430.0, -330.0, 60.0), (-380.0, 330.0, 200.0))
TOOLS_MM = ((30.0, 0.0, 110.0), (-60.0, 40.0, 90.0))
SPEED = 0.3  # of the axes' full speed between poses


@dataclass(frozen=True)
class Measured:
    """One instrument's run: files, minutes of robot time, euros of equipment (orders of magnitude)."""

    name: str
    run_csv: str
    cell_toml: str
    poses: int
    minutes: float
    euros: float


def arm():
    return Arm.from_toml(NAME)


def bench(fixture=FIXTURES_MM[0], tool=TOOLS_MM[0]):
    """The cell, the end effector as heavy as in the paper."""
    return replace(BENCHES[NAME], fixture_mm=tuple(fixture), map_mm=tuple(tool), tool_kg=TOOL_KG)


def rows_of(cell_toml, q, place=0):
    """What each pose tells of the parameters, per prior size, (n, r, P)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        path.write_text(cell_toml)
        model = Model.from_cell(load_cell(str(path), planning=False))
    return model.jacobian(q, place) * np.where(np.isfinite(model.prior), model.prior, 1.0)  # a frame that is not known


def chosen(rows, count, group=None):
    """Positions of the poses (DETMAX on O1), in coordinates that the readings show."""
    _, s, V = np.linalg.svd(rows.reshape(-1, rows.shape[2]), full_matrices=False)
    return detmax(rows @ V[s > 1e-5 * s[0]].T, count, group=group)


def tricentred(more=(), count=80):
    """TriCal on its four balls, as many poses on each."""
    made = runs.balls(arm(), n_poses=6 * count, seed=1, truth=truth(DEVICE_M, more), logs=("direction",), bench=bench())
    ball = pl.read_csv(made.run_csv.encode(), comment_prefix="#")["ball"].to_numpy() - 1
    cell = writing.cell_toml(arm(), bench(), "tracker", DEVICE_M, False, NAME)  # a ball pins what a tracker sees
    which = chosen(rows_of(cell, made.scene.q), count, group=ball)
    return _measured("TriCal", made, which, 15.0, 5000.0)


def tracked(more=(), count=80):
    """A laser tracker and one reflector."""
    a, b = arm(), bench()
    q = _free(a, b, POOL, np.random.default_rng(3))
    cell = writing.cell_toml(a, b, "tracker", TRACKER_M, False, NAME)
    q = toured(a, q[chosen(rows_of(cell, q), count)])
    made = runs.measured(a, b, "tracker", q, truth(TRACKER_M, more), seed=4, logs=("direction",))
    return _measured("laser tracker", made, np.arange(len(q)), 4.0, 130_000.0)


def bars(places, tools, count, more=()):
    """A ball bar of 300 to 520 mm about ``places`` fixtures, at ``tools`` tool points; poses chosen over them all."""
    stands = [(k, j) for k in range(places) for j in range(tools)]
    pools = [_shell(k, j) for k, j in stands]
    rows = np.concatenate([rows_of(_bar_cell(places, j), q, k) for (k, j), q in zip(stands, pools, strict=True)])
    picked = chosen(rows, count)
    starts = np.cumsum([0, *map(len, pools)])
    tables, minutes = [], 0.0
    for n, (k, j) in enumerate(stands):
        own = picked[(picked >= starts[n]) & (picked < starts[n + 1])] - starts[n]
        if len(own):
            table, spent = _at_stand(k, j, pools[n][own], more)
            tables.append(table.with_columns(session=pl.lit(n + 1)))
            minutes += spent
    run = pl.concat(tables, how="diagonal").drop("pose")
    text = f"# robot: {NAME}\n" + (run.drop("point") if tools == 1 else run).write_csv()
    name = f"ball bar, {count} poses, {_several(places, 'fixture')}, {_several(tools, 'tool point')}"
    euros = 5000.0 + 300.0 * (places + tools - 2)
    return Measured(name, text, _bar_cell(places, 0), len(run), minutes, euros)


def _several(n, what):
    return f"{n} {what}{'s' if n > 1 else ''}"


def _shell(k, j):
    """Poses (n, N) in the shell of a fixture with a tool point."""
    a, b, rng = arm(), bench(FIXTURES_MM[k], TOOLS_MM[j]), np.random.default_rng([5, k, j])
    lengths = np.array(b.length_mm) / 1e3 + [0.008, -0.008]
    q = at_targets(a, shell_points(b.fixture, lengths, POOL, rng, np.radians(80.0)), b.tool, rng)
    return q[~np.isnan(q[:, 0])]


def _bar_cell(places, j):
    cell = writing.cell_toml(arm(), bench(FIXTURES_MM[0], TOOLS_MM[j]), "edbb", BAR_M, False, NAME)
    more = "".join(
        f'\n[[fixtures]]\nname = "{"ABC"[k]}"\nposition_mm = {list(FIXTURES_MM[k])}\n' for k in range(1, places)
    )
    return cell.replace("\n[motion]", f"{more}\n[motion]")


def _at_stand(k, j, q, more):
    """Rows of a run about one fixture at one tool point, and the minutes of robot time it takes."""
    a, b = arm(), bench(FIXTURES_MM[k], TOOLS_MM[j])
    q = toured(a, q)
    made = runs.measured(a, b, "edbb", q, truth(BAR_M, more), seed=10 + 3 * k + j, logs=("direction",))
    table = pl.read_csv(made.run_csv.encode(), comment_prefix="#")
    table = table.with_columns(fixture=pl.lit("ABC"[k]), point=pl.lit(f"tool {j + 1}"))
    return table, _minutes(a, q, 2.5) + 2.0  # the bar is set down, zeroed and attached


def identified(measured, traced):
    """The calibration from an instrument's files."""
    with tempfile.TemporaryDirectory() as folder:
        run, cell = Path(folder) / "run.csv", Path(folder) / "cell.toml"
        run.write_text(measured.run_csv)
        cell.write_text(measured.cell_toml)
        loaded = load_cell(str(cell), planning=False)
        return identify(load_runs([run], loaded.robot.n_joints), loaded, tracer=trace if traced else None)


def _free(a, b, count, rng):
    """Poses all over the workspace, above the floor and clear of the column."""
    q = uniform(a, 6 * count, rng)
    x = point(a, q, b.tool)
    return q[(x[:, 2] > 0.05) & (np.hypot(x[:, 0], x[:, 1]) > 0.15)][:count]


def _measured(name, made, which, dwell_s, euros):
    head, *lines = made.run_csv.splitlines()
    kept = [lines[0], *(lines[1 + k] for k in which)]
    minutes = _minutes(made.scene.arm, made.scene.q[which], dwell_s)
    return Measured(name, "\n".join([head, *kept]) + "\n", made.cell_toml, len(which), minutes, euros)


def _minutes(a, q, dwell_s):
    """Robot time of a tour by its slowest axis, with a rest at each pose."""
    speed = SPEED * np.radians([360, 300, 360, 381, 388, 615])
    travel = (np.abs(np.diff(q, axis=0)) / speed).max(axis=1).sum()
    return float(travel + dwell_s * len(q)) / 60
