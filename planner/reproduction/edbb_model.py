"""Sections 2.1.1 and 2.1.2 of the EDBB paper: the model of the length, its Jacobian and what it sees."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import load_cell
from planner.common.units import Array
from planner.design.observability.identifiability import Identifiability, find_identifiable
from planner.design.observability.information import index_value
from planner.kinematics.robot_reader import load_robot
from planner.model.model import Model
from planner.model.tool_error import uniform_states
from planner.reproduction.published import paper_numbers
from planner.runs.run import Samples

CELL = "comau-nj130/paper"


def model_numbers() -> dict[str, Any]:
    """Return what the model of the length says; numbers by their keys in the rows."""
    cell = load_cell(CELL)
    samples = Samples.at(uniform_states(cell, 2000, 0), cell.mountings[0])
    model = Model.from_cell(cell)
    seen, printed = _identify_parameters(cell, samples), _make_printed_cell(cell)
    everything = Model.from_cell(cell, frozenset({"fixture", "tool"}))
    all_seen = find_identifiable(everything.rows(samples), everything.names)
    rows = model.rows(samples.take(np.arange(35)))
    chosen = rows[:, :, list(seen.kept)]
    return {
        "dh_parameters": len(model.parameters),
        "all_parameters": len(everything.parameters),
        "rank_dh": seen.rank,
        "rank_all": all_seen.rank,
        "dropped_all": ", ".join(d.name for d in all_seen.dropped),
        "dropped": ", ".join(d.name for d in seen.dropped),
        "rank_printed": _identify_parameters(printed, samples).rank,
        "reach_used_mm": _wrist_reach(cell, paper_numbers().table_1.used_alpha_deg),
        "reach_printed_mm": _wrist_reach(cell, paper_numbers().table_1.printed_alpha_deg),
        "length_difference_m": _length_difference(cell, model, samples),
        "jacobian_difference": _jacobian_difference(model, samples.take(np.arange(50))),
        "o2_random": index_value("O2", chosen),
        "o1_random": index_value("O1", chosen),
        "shell_per_cent": 100 * _shell_share(cell),
    }


def _identify_parameters(cell: Cell, samples: Samples) -> Identifiability:
    model = Model.from_cell(cell)
    return find_identifiable(model.rows(samples), model.names)


def _make_printed_cell(cell: Cell) -> Cell:
    """Return the cell with a robot whose twists are those of Table 1 as printed."""
    table, text = paper_numbers().table_1, cell.robot.path.read_text(encoding="utf-8")
    parts = text.split("[[joints]]")
    for k, (used, printed) in enumerate(zip(table.used_alpha_deg, table.printed_alpha_deg, strict=True), start=1):
        line = f"alpha_deg = {used:g}\n"
        assert line in parts[k]
        parts[k] = parts[k].replace(line, f"alpha_deg = {printed:g}\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.toml"
        path.write_text("[[joints]]".join(parts), encoding="utf-8")
        return replace(cell, robot=load_robot(str(path), beta="none"))


def _wrist_reach(cell: Cell, alpha_deg: tuple[float, ...]) -> float:
    """Largest distance of the wrist's centre from axis 1 over many states [mm], with these twists."""
    p = _dh_position(uniform_states(cell, 50_000, 0), alpha_deg, wrist=True)
    return float(np.hypot(p[:, 0], p[:, 1]).max() * 1e3)


def _dh_position(q: Array, alpha_deg: tuple[float, ...], wrist: bool = False, tool: Array | None = None) -> Array:
    """Multiply the homogeneous matrices of Table 1 (eq. 1); return the last frame's origin, or the tool's, (n, 3)."""
    table, T = paper_numbers().table_1, np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for k in range(4 if wrist else 6):
        a, d, alpha = table.a_m[k], table.d_m[k], np.deg2rad(alpha_deg[k])
        theta = q[:, k] + np.deg2rad(table.theta_deg[k])
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        row = np.zeros((len(q), 4, 4))
        row[:, 0] = np.stack([c, -s * ca, s * sa, a * c], axis=1)
        row[:, 1] = np.stack([s, c * ca, -c * sa, a * s], axis=1)
        row[:, 2] = [0.0, sa, ca, d]
        row[:, 3, 3] = 1.0
        T = T @ row
    return np.asarray(T[:, :3, 3] if tool is None else T[:, :3, :3] @ tool + T[:, :3, 3])


def _length_difference(cell: Cell, model: Model, samples: Samples) -> float:
    """Largest difference of the length (eq. 2) to plain products of homogeneous matrices [m]."""
    x = _dh_position(samples.q, paper_numbers().table_1.used_alpha_deg, tool=cell.tool.p_FM)
    plain = np.linalg.norm(x - cell.fixtures[0].p_BX, axis=1)
    return float(np.abs(model.reading(samples)[:, 0] - plain).max())


def _jacobian_difference(model: Model, samples: Samples) -> float:
    """Largest difference of the Jacobian (eq. 4) to central differences [m per m or rad]."""
    step = 1e-5  # [m or rad]: truncation and rounding are both near 1e-10
    steps = step * np.eye(len(model.parameters))
    plain = np.stack([model.reading(samples, e) - model.reading(samples, -e) for e in steps], axis=2) / (2 * step)
    return float(np.abs(model.rows(samples) - plain).max())


def _shell_share(cell: Cell) -> float:
    """Share of states, drawn evenly, in which the bar has a length within its range."""
    q = np.random.default_rng(0).uniform(*cell.robot.one_turn, (50_000, cell.robot.n_joints))
    away = np.linalg.norm(cell.map_position(q) - cell.fixtures[0].p_BX, axis=1)
    return float(((away > cell.gauge.length_min) & (away < cell.gauge.length_max)).mean())
