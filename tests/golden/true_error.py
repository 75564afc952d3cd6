"""How far a calibrated robot is from the simulated truth, by the arm of the tests' own generator."""

import tomllib
from pathlib import Path

import numpy as np

from planner.documents.calibrated_robot import CalibratedRobot
from planner.kinematics.robot_reader import load_robot
from tests.simulation.generator.arm import Arm, moment_of_weight

STATES = 400
AROUND = np.radians(90.0)  # of home, each joint
FACTORS = {"mm": 1e-3, "mrad": 1e-3, "deg": np.pi / 180, "urad_Nm": 1e-6}


def true_error_mm(cell: Path, truth: Path, robot: Path) -> float:
    """Return the rms error of the tool over joint states around home, after one rigid alignment of the base [mm].

    Args:
        cell: whose robot, tool and home are those of the run.
        truth: geometry and joint compliances of the simulated arm; what else acts in it is left out.
        robot: that was calibrated by the run.
    """
    said = tomllib.loads(cell.read_text())
    named = Path(said["robot"])
    arm = Arm.from_toml(cell.parent / named if named.suffix else said["robot"])
    tool = said["tool"]
    q = _states(arm, np.radians(said.get("home_deg", np.zeros(arm.n_joints))))
    found = load_robot(robot)
    p, R = CalibratedRobot(found).flange(q)
    reached = p + R @ found.tool_points[0].p_FM
    map_mm = tool["map_mm"] if "map_mm" in tool else tool["points"][0]["map_mm"]
    errors = tomllib.loads(truth.read_text())["errors"]
    true = _true_tool(arm, errors, q, np.array(map_mm) / 1e3, tool)
    return float(1e3 * np.sqrt((_aligned(reached, true) ** 2).sum(axis=1).mean()))


def _states(arm: Arm, home: np.ndarray) -> np.ndarray:
    lower, upper = np.maximum(arm.lower, home - AROUND), np.minimum(arm.upper, home + AROUND)
    return np.random.default_rng(0).uniform(lower, upper, (STATES, arm.n_joints))


def _true_tool(arm: Arm, errors: dict[str, float], q: np.ndarray, p_FM: np.ndarray, tool: dict) -> np.ndarray:
    """Return the tool point of the true arm, (n, 3) [m]."""
    by_name = {}
    for key, value in errors.items():
        name, _, unit = key.partition("_")
        by_name[name] = value * FACTORS[unit]
    soft = {n: v for n, v in by_name.items() if n.startswith("compliance")}
    moves = {n: v for n, v in by_name.items() if n not in soft}
    joints = {f"theta{n.removeprefix('compliance')}": v for n, v in soft.items()}
    stance = arm.walk(q, {}, joints)
    com = np.array(tool.get("com_mm", (0, 0, 0))) / 1e3
    centre = stance.p + np.einsum("ijn,j->in", stance.R, com)
    for name, compliance in joints.items():
        moment = moment_of_weight(arm, stance, name, arm.mass, [(tool.get("mass_kg", 0.0), centre)])
        moves[name] = moves.get(name, 0.0) + compliance * moment
    stance = arm.walk(q, moves)
    return (stance.p + np.einsum("ijn,j->in", stance.R, p_FM)).T


def _aligned(x: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return how far points (n, 3) are from others once they are moved rigidly onto them."""
    a, b = x - x.mean(axis=0), true - true.mean(axis=0)
    U, _, Vt = np.linalg.svd(a.T @ b)
    return a @ (U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt) - b
