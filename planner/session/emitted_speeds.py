"""What the speeds in a written program make of tool and gauge, from the text that was read back and positions alone."""

from collections.abc import Mapping

import numpy as np

from planner.cell.cell import Cell
from planner.common.circles_in_space import points_on_arc
from planner.common.units import Array, to_mm
from planner.programs.dialect import Dialect
from planner.programs.instructions import Program
from planner.programs.languages.execution import ReadBack
from planner.programs.verification import ProgramMismatchError
from planner.runs.run import Mounting

PIECES = 32  # of a leg, whose chords give the largest speed on it
SLACK = 1.0 + 1e-3
PRINTED = 1e-5  # [m] of travel that the rounding of printed angles may add to a short step


def check_emitted_speeds(cell: Cell, program: Program, dialect: Dialect, found: ReadBack) -> None:
    """Hold the largest speed of tool and gauge on every leg of a program against their limits.

    ``found`` is what was read back of its text. The joints are taken to move evenly over the time that the speed words
    give the leg, the tool evenly round a circle; a speed word of the tool is that of the tool.

    Raises:
        ProgramMismatchError: naming the move, the speed and the limit.
    """
    limited = [k for k, m in enumerate(program.moves) if np.isfinite(m.tool_limit_mm_s)]
    q = np.deg2rad(np.vstack([program.home_deg, found.joint_path_deg]))
    speeds, circles = found.speeds, found.circles
    for mounting in sorted({program.moves[k].mounting for k in limited}, key=str):
        rows = np.array([k for k in limited if k > 0 and program.moves[k].mounting == mounting], dtype=int)
        if not len(rows):
            continue
        x = _tool_points(cell, q, rows, dict(circles), mounting)
        travel, change = _largest_travel(cell, x, mounting)
        seconds = _leg_seconds(cell, dialect, q, speeds, rows, travel)
        round_legs = np.isin(rows, [k for k, _ in circles])
        seconds[round_legs] = travel[round_legs] / (np.array(speeds)[rows[round_legs]] / 1e3)
        limit = np.array([program.moves[k].tool_limit_mm_s for k in rows]) / 1e3
        _refuse(rows, travel, seconds, limit, "the tool")
        if mounting is not None and np.isfinite(cell.gauge.rate):
            _refuse(rows, change, seconds, np.full(len(rows), cell.gauge.rate), "the gauge")


def _tool_points(
    cell: Cell, q: Array, rows: np.ndarray, circles: Mapping[int, tuple[float, ...]], mounting: Mounting | None
) -> Array:
    """Where the tool is at equal shares of the legs ``rows`` of a path q (n + 1, N) [rad], (PIECES + 1, m, 3) [m]."""
    share = np.linspace(0.0, 1.0, PIECES + 1)
    states = q[rows] + share[:, None, None] * (q[rows + 1] - q[rows])
    at = cell if mounting is None else cell.at(mounting)
    x = at.map_position(states.reshape(-1, q.shape[1])).reshape(*states.shape[:2], 3)
    for i, k in enumerate(rows):
        if k in circles:
            ends = at.map_position(np.stack([q[k], np.deg2rad(circles[k]), q[k + 1]]))
            x[:, i] = points_on_arc(ends, share)[0]
    return np.asarray(x)


def _largest_travel(cell: Cell, x: Array, mounting: Mounting | None) -> tuple[Array, Array]:
    """Largest travel of the tool and change of the gauge's length per share of each leg, (m,) [m]; x: of the tool."""
    travel = np.linalg.norm(np.diff(x, axis=0), axis=2).max(axis=0) * PIECES
    if mounting is None:
        return travel, np.zeros(x.shape[1])
    length = np.linalg.norm(x - cell.fixtures[mounting.fixture].p_BX, axis=2)
    return travel, np.abs(np.diff(length, axis=0)).max(axis=0) * PIECES


def _leg_seconds(
    cell: Cell, dialect: Dialect, q: Array, speeds: tuple[float, ...], rows: np.ndarray, travel: Array
) -> Array:
    """Time that the speed words give each leg, (m,) [s]."""
    said = np.array(speeds)[rows]
    match dialect.speed.kind:
        case "axis_percent":
            quickest = (np.abs(q[rows + 1] - q[rows]) / cell.robot.speed).max(axis=1)
            return np.asarray(quickest / (said / 100.0))
        case "inverse_time":
            return np.asarray(60.0 / said)
        case "duration":
            return np.asarray(said)
        case "leading_axis":
            return np.asarray(np.rad2deg(np.abs(q[rows + 1] - q[rows])).max(axis=1) / said)
        case "tool_speed":
            per_second = said / (60.0 if dialect.speed.unit == "mm/min" else 1.0) / 1e3
            return np.asarray(travel / per_second)


def _refuse(rows: np.ndarray, travel: Array, seconds: Array, limit: Array, what: str) -> None:
    speed = np.maximum(travel - PRINTED, 0.0) / np.maximum(seconds, 1e-9)
    over = np.flatnonzero(speed > limit * SLACK)
    if len(over):
        k = int(over[np.argmax(speed[over] / limit[over])])
        raise ProgramMismatchError(
            f"the program is not released: move {rows[k] + 1} drives {what} at {to_mm(speed[k]):.2f} mm/s, allowed "
            f"are {to_mm(limit[k]):.2f} mm/s"
        )
