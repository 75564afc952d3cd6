"""Whether a program keeps its cell, judged from its text alone: another reader, other kinematics, sampling."""

import csv
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from planner.cell.cell import Cell
from planner.cell.reading import read_cell
from planner.motion.collision.fcl_world import FclWorld
from planner.motion.collision.scene import build_scene

STEP = np.deg2rad(1.0)  # between two samples, by the joint that turns furthest
PRINTED = 2e-4  # [m] by which rounded angles may change a distance
SAMPLES = 25  # of a cut corner


@dataclass(frozen=True)
class Move:
    """A row of the list: angles (N,) [rad], distance at which the corner may be cut [m], whether the bar is on."""

    q: np.ndarray
    blend: float
    bar: bool


def read_moves(text: str) -> list[Move]:
    """Read the moves of a list of poses; the bar is on from the first pause to the next."""
    rows = csv.reader(line for line in text.splitlines() if line and not line.startswith("#"))
    head = next(rows)
    columns = [k for k, name in enumerate(head) if name.startswith("q")]
    bar, out = False, []
    for row in rows:
        if row[0] == "pause":
            bar = not bar
        if row[0] == "move":
            blend = float(row[head.index("blend_mm")] or 0.0) / 1e3
            out.append(Move(np.deg2rad([float(row[k]) for k in columns]), blend, bar))
    return out


def map_positions(folder: Path, q: np.ndarray) -> np.ndarray:
    """Where the tool's point is (n, 3) [m], multiplied out from the modified DH table of the robot's file."""
    cell = tomllib.loads((folder / "cell.toml").read_text())
    robot = tomllib.loads((Path(__file__).parents[2] / "robots" / cell["robot"] / "robot.toml").read_text())
    T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
    for k, joint in enumerate(robot["joints"]):
        angle = joint["sense"] * q[:, k] + np.deg2rad(joint["theta_deg"] - joint["sense"] * joint["zero_deg"])
        c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros(len(q)), np.ones(len(q))
        ca, sa = np.cos(np.deg2rad(joint["alpha_deg"])), np.sin(np.deg2rad(joint["alpha_deg"]))
        a, d = joint["a_mm"] / 1e3, joint["d_mm"] / 1e3
        rows = [[c, -s, zero, a * one], [s * ca, c * ca, -sa * one, -d * sa * one]]
        rows += [[s * sa, c * sa, ca * one, d * ca * one], [zero, zero, zero, one]]
        T = T @ np.moveaxis(np.array(rows), 2, 0)
    assert robot["flange"]["position_mm"] == [0, 0, 0]
    assert robot["flange"]["rpy_deg"] == [0, 180, 0]
    p = np.array(cell["tool"]["map_mm"]) / 1e3 * [-1, 1, -1]
    return np.einsum("nij,j->ni", T[:, :3, :3], p) + T[:, :3, 3]


@cache
def _cell(folder: Path, text: str) -> Cell:
    """The cell of a folder, read once as long as its text stays."""
    assert (folder / "cell.toml").read_text() == text
    return read_cell(folder / "cell.toml", "cell")


@cache
def _world(folder: Path, text: str, bar: bool) -> FclWorld:
    scene = build_scene(_cell(folder, text))
    return FclWorld(scene if bar else scene.without_bar())


@cache
def _least_distance(folder: Path, text: str, bar: bool, path: bytes) -> float:
    """Least distance [m] of any two bodies on a path (n, N) [rad]; most moves of programs that differ are the same."""
    q = np.frombuffer(path).reshape(-1, _cell(folder, text).robot.n_joints)
    return float(_world(folder, text, bar).distances(q).min())


def complaints(folder: Path, text: str) -> list[str]:
    """Return what a program does that the cell does not allow; nothing where it is driven from home to home."""
    written = folder, (folder / "cell.toml").read_text()
    cell = _cell(*written)
    moves, out = read_moves(text), []
    if max(np.abs(moves[k].q - cell.home).max() for k in (0, -1)) > 1e-5:
        out.append("it does not begin and end at home")
    here = moves[0].q
    with_bar, without = [], []
    for k, move in enumerate(moves[1:], start=1):
        count = 2 + int(np.abs(move.q - here).max() / STEP)
        path = here + np.linspace(0.0, 1.0, count)[:, None] * (move.q - here)
        if move.blend > 0.0 and k + 1 < len(moves):
            path = np.vstack([path, _corner(folder, here, move, moves[k + 1].q)])
        (with_bar if move.bar else without).append(path)
        here = move.q
    for bar, parts in ((True, with_bar), (False, without)):
        if not parts:
            out.append(f"nothing is driven {'with' if bar else 'without'} the bar")
            continue
        q = np.concatenate(parts)
        robot = cell.robot
        if (q < robot.q_lower - 1e-5).any() or (q > robot.q_upper + 1e-5).any():
            out.append("a joint leaves its stroke")
        least = min(_least_distance(*written, bar, part.tobytes()) for part in parts)
        if least < cell.motion.clearance - PRINTED:
            out.append(f"bodies come within {1e3 * least:.2f} mm")
        if bar:
            length = np.linalg.norm(map_positions(folder, q) - cell.fixtures[0].p_BX, axis=1)
            if length.min() < 0.3 - PRINTED or length.max() > 0.52 + PRINTED:
                out.append(f"the bar is {1e3 * length.min():.1f} to {1e3 * length.max():.1f} mm long")
    return out


def _corner(folder: Path, before: np.ndarray, move: Move, after: np.ndarray) -> np.ndarray:
    """Points of a parabola that cuts a corner as far as it may."""
    ends = []
    for other in (before, after):
        share = np.linspace(0.0, 0.5, 101)
        leg = move.q + share[:, None] * (other - move.q)
        x = map_positions(folder, leg)
        beyond = np.linalg.norm(x - x[0], axis=1) >= move.blend
        ends.append(leg[int(np.argmax(beyond)) if beyond.any() else -1])
    s = np.linspace(0.0, 1.0, SAMPLES)[:, None]
    return (1 - s) ** 2 * ends[0] + 2 * s * (1 - s) * move.q + s**2 * ends[1]
