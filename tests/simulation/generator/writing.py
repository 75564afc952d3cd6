"""The files as the contract has them: ``RUN.csv`` and the cell file, in millimetres and degrees."""

import numpy as np
import polars as pl

from tests.simulation.generator.arm import ROBOTS
from tests.simulation.generator.benches import BALLS_MM, RATIOS

READING = {"edbb": ("length_mm",), "tracker": ("x_mm", "y_mm", "z_mm")}


def run_csv(scene, reading, pose, ball, shown):
    """The run as text; ``shown``: optional columns out of command, direction, temperature, payload, force, session."""
    deg, n = np.degrees, scene.arm.n_joints
    data = {"t_s": np.round(scene.t, 6)}
    data |= {f"q{i + 1}_deg": np.round(deg(scene.q[:, i]), 7) for i in range(n)}
    if "command" in shown:
        data |= {f"cmd{i + 1}_deg": np.round(deg(scene.command[:, i]), 7) for i in range(n)}
    if ball is not None:
        data["ball"] = ball + 1
    else:
        names = READING[scene.gauge]
        data |= {name: np.round(reading[:, k] * 1e3, 6) for k, name in enumerate(names)}
    if not scene.moving:
        data["pose"] = pose
    if scene.gauge == "edbb":
        data["fixture"] = np.repeat("A", len(pose))
    if "temperature" in shown:
        data["temperature_degC"] = np.round(20.0 + scene.warmth, 4)
    if "direction" in shown:
        data |= {f"direction{i + 1}": scene.direction[:, i].astype(int) for i in range(n)}
    one = {
        "payload": ("payload_kg", scene.payload),
        "force": ("force_N", scene.force),
        "session": ("session", scene.session + 1),
    }
    data |= {one[name][0]: one[name][1] for name in one if name in shown}
    return f"# robot: {scene.arm.name}\n" + pl.DataFrame(data).write_csv()


def robot_toml(arm):
    """The robot's file with gear ratios stated."""
    head, *joints = (ROBOTS / arm.name / "robot.toml").read_text().split("\n[[joints]]")
    joints = [
        j.replace("\nalpha_deg", f"\ngear_ratio = {r}\nalpha_deg", 1) for j, r in zip(joints, RATIOS, strict=True)
    ]
    return "\n[[joints]]".join([head, *joints])


def cell_toml(arm, bench, gauge, noise, moving, robot):
    """The cell as the engineer states it: nominal places, and the gauge's noise; ``robot``: name or file."""
    text = f'schema = "edbb-cell/1"\nrobot = "{robot}"\nhome_deg = {list(bench.home_deg)}\n\n'
    text += f"[tool]\nmap_mm = {list(bench.map_mm)}\nmass_kg = {bench.tool_kg}\ncom_mm = {list(bench.com_mm)}\n\n"
    kind = {"edbb": "edbb", "tracker": "tracker", "balls": "trical"}[gauge]
    text += f'[gauge]\nkind = "{kind}"\nnoise_um = {noise * 1e6:g}\n'
    if gauge == "edbb":
        text += f'length_mm = {list(bench.length_mm)}\nzero = "free"\n\n'
        text += f'[[fixtures]]\nname = "A"\nposition_mm = {list(bench.fixture_mm)}\n'
    if gauge == "balls":
        for k, ball in enumerate(BALLS_MM, 1):
            text += f'\n[[balls]]\nname = "{k}"\nposition_mm = {list(ball)}\n'
    return text + f'\n[motion]\nmeasure = "{"continuous" if moving else "static"}"\n'
