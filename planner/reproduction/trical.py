"""The TriCal paper from simulation: its 31 parameters, its Table 8, its Table 9."""

import tempfile
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.accuracy.validation import validate_robot
from planner.cell.cell import Cell, setup_of
from planner.cell.reading import load_cell
from planner.common.progress import Stages
from planner.common.units import MM, Array, to_mm
from planner.design.free_parameters import preference_order
from planner.design.observability.identifiability import find_identifiable
from planner.documents.calibrated_robot import calibrated_files
from planner.effects.compliance import compliance_parameters
from planner.identification.pipeline import FitSettings, identify
from planner.inference.stages import Tracer
from planner.model.model import Model
from planner.model.tool_error import uniform_states
from planner.reproduction.published import paper_numbers
from planner.runs.run import Samples
from planner.session.options import PlanOptions
from planner.simulation.simulated_run import SimulatedRun, simulate_run
from planner.simulation.truth import read_truth
from planner.tracing.trace import trace
from planner.workflow.planning import pose_session

CELL, TRACKER = "kuka-kr6-r700/trical", "kuka-kr6-r700/tracker"


def table_numbers() -> dict[str, Any]:
    """Return what model and cell say of Tables 1 and 4 to 8; numbers by their keys in the rows."""
    cell = load_cell(CELL)
    model = Model.of(setup_of(cell), frozenset()).plus(compliance_parameters(setup_of(cell)))
    samples = Samples.at(uniform_states(cell, 400, 0), cell.mountings[0])
    seen = find_identifiable(model.rows(samples), model.names, prefer=preference_order(model))
    head, balls = cell.gauge.indicators, cell.balls
    radius = balls[0].radius
    return {
        "parameters": len(model.names),
        "rank": seen.rank,
        "dropped": ", ".join(d.name for d in seen.dropped),
        "position_difference_mm": float(to_mm(_position_difference(cell))),
        "master_mm": float(to_mm(head.master / 2 - radius)),
        "empty_mm": float(to_mm(head.master / 2 - radius - head.range)),
        "usable_mm": float(to_mm(head.usable)),
        "disc_mm": float(to_mm(head.tip / 2)),
        "widest_mm": float(to_mm(max(np.linalg.norm(a.p_GS - b.p_GS) for a in balls for b in balls))),
        "table_8_mm": float(to_mm(_moved_by_table_8(cell))),
    }


def _mdh_position(q: Array, tool: Array) -> Array:
    """Multiply the matrices of eq. 1 with Table 4 and return the tool's point in the frame of its row 0, (n, 3) [m]."""
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    table = paper_numbers().table_4
    for k, (alpha_deg, a_mm, d_mm) in enumerate(zip(table.alpha_deg, table.a_mm, table.d_mm, strict=True)):
        alpha, theta = np.deg2rad(alpha_deg), q[:, k] + np.deg2rad(table.theta_deg[k])
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        a, d = a_mm / 1e3, d_mm / 1e3
        row = np.zeros((len(q), 4, 4))
        row[:, 0] = np.stack([c, -s, 0 * c, 0 * c + a], axis=1)
        row[:, 1] = np.stack([s * ca, c * ca, 0 * c - sa, 0 * c - d * sa], axis=1)
        row[:, 2] = np.stack([s * sa, c * sa, 0 * c + ca, 0 * c + d * ca], axis=1)
        row[:, 3, 3] = 1.0
        T = T @ row
    return np.asarray(T[:, :3, :3] @ tool + T[:, :3, 3])


def _position_difference(cell: Cell) -> float:
    """Largest difference between the distances of tool points by eq. 1 and by the planner [m].

    Distances between poses do not depend on the frames of base and flange, which the paper does not state.
    """
    q = uniform_states(cell, 200, 0)
    T_LF = cell.robot.flange_frame()
    plain, ours = _mdh_position(q, T_LF[:3, :3] @ cell.tool.p_FM + T_LF[:3, 3]), cell.map_position(q)
    apart = [np.linalg.norm(x[:, None] - x[None], axis=2) for x in (plain, ours)]
    return float(np.abs(apart[0] - apart[1]).max())


def _moved_by_table_8(cell: Cell) -> float:
    """Mean distance by which the errors of Table 8 move the tool, over random states [m]."""
    model = Model.of(setup_of(load_cell(TRACKER)), frozenset())
    errors = np.array([_table_8().get(name, 0.0) for name in model.names])
    moved = model.rows(Samples.at(uniform_states(cell, 400, 0), cell.mountings[0])) @ errors
    return float(np.linalg.norm(moved, axis=1).mean())


def _table_8() -> dict[str, float]:
    """Return Table 8, identified less nominal, by the names of the parameters [m, rad]."""
    angles = {name: float(np.deg2rad(v)) for name, v in paper_numbers().table_8.deg.items()}
    return {**angles, **{name: v / 1e3 for name, v in paper_numbers().table_8.mm.items()}}


def _truth(size: float) -> str:
    """Return a ``TRUTH.toml``: Table 8, and what its parameters lack at ``size`` times its usual size."""
    hidden = (
        ("encoder once a turn", (1, 2, 3, 4, 5), (0.010, -0.006)),
        ("encoder twice a turn", (1, 2, 3, 4, 5), (-0.006, 0.009)),
        ("axis wobble once a turn", (1, 2, 3), (0.008, 0.006, -0.006, 0.008)),
    )  # kind, joints, sine and cosine parts at size 1 [deg]: effects of gears and bearings, as large as is usual
    lines = ['schema = "edbb-truth/1"', "[errors]"]
    lines += [f"{name}_deg = {value}" for name, value in paper_numbers().table_8.deg.items()]
    lines += [f"{name}_mm = {value}" for name, value in paper_numbers().table_8.mm.items()]
    lines += [f"{name}_deg_Nm = {value}" for name, value in paper_numbers().table_8.deg_Nm.items()]
    for kind, joints, parts in hidden if size else ():
        for j in joints:
            value = ", ".join(f"{size * part * (1 if j % 2 else -1):.8f}" for part in parts)
            lines += ["[[effects]]", f'kind = "{kind}"', f'on = "joint {j}"', f"value = [{value}]", 'unit = "deg"']
    return "\n".join(lines) + "\n"


def accuracy_numbers() -> dict[str, Any]:
    """Calibrate one simulated arm with the head and with a tracker; judge both at 500 poses, as Table 9 does.

    One size is common to the effects that the 31 parameters lack: that at which the tracker leaves the published mean.
    The other five figures follow from it.
    """
    head, tracker = Chosen.of(CELL), Chosen.of(TRACKER)
    size = paper_numbers().table_9.tracker_mm[0] / _judge(tracker, tracker, 1.0)[0]
    rows = {
        "head": _judge(head, tracker, size),
        "tracker": _judge(tracker, tracker, size),
        "clean": _judge(head, tracker, 0.0),
        "traced": _judge(head, tracker, size, trace),
    }
    figures = ("mean", "max", "std")
    named = {f"{key}_{what}_mm": v for key, row in rows.items() for what, v in zip(figures, row, strict=True)}
    return named | {
        "size": size,
        "head_by_tracker": rows["head"][0] / rows["tracker"][0],
        "poses": len(head.samples),
        "per_ball": head.per_ball,
        "o1": head.o1,
    }


@dataclass(frozen=True)
class Chosen:
    """80 poses that the planner chooses for a cell, and 500 others, drawn blindly, that judge."""

    cell: Cell
    samples: Samples
    validation: Samples
    per_ball: list[int]
    o1: float

    @classmethod
    def of(cls, name: str) -> "Chosen":
        """Choose them; the way between them is not planned: no reading depends on it."""
        cell = load_cell(name)
        cell = replace(cell, plan=replace(cell.plan, candidates=6000, validate=500))
        session, quiet = pose_session(cell, PlanOptions(poses=80)), Stages()
        session.draw(quiet)
        chosen = session.select(quiet)
        with chosen.curve or nullcontext():
            choice, pool = chosen.choice, session.pool
        others = np.setdiff1d(np.arange(len(pool)), choice.chosen)
        others = np.random.default_rng(0).permutation(others)[:500]
        balls = np.zeros(0, dtype=int) if choice.ball is None else choice.ball
        validation = pool.samples.take(np.sort(others))
        return cls(session.cell, choice.samples, validation, np.bincount(balls).tolist(), choice.raw_indices["O1"])


def _judge(gauge: Chosen, tracker: Chosen, size: float, tracer: Tracer | None = None) -> tuple[float, float, float]:
    """Measure with a gauge, fit, and judge at the tracker's 500 poses: mean, maximum, standard deviation [mm].

    Without a ``tracer`` it is the paper's fit: 31 parameters by least squares.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "truth.toml").write_text(_truth(size), encoding="utf-8")

        def measure(cell: Cell, samples: Samples, seed: int) -> SimulatedRun:
            """Return the run of some poses on the true arm."""
            return simulate_run(cell, "papers", samples, read_truth(folder / "truth.toml", cell, samples), seed)

        run, validation = measure(gauge.cell, gauge.samples, 1), measure(tracker.cell, tracker.validation, 2)
        settings = FitSettings(release=tracer is not None)
        found = identify(run, gauge.cell, settings=settings, tracer=tracer)
        for file, text in calibrated_files(found):
            (folder / file).write_text(text, encoding="utf-8")
        after = validate_robot(tracker.cell, validation, validation.beside, folder / "robot.toml", None).after
    assert after is not None
    return after.figures.mean / MM, after.figures.largest / MM, after.figures.std / MM
