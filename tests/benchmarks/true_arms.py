"""Arms as they truly are, by means that share no code with the planner, and the runs that a gauge reads on them.

A shipped arm of DH rows is that of ``tests.simulation.generator``; one by URDF is the file with every joint's origin
displaced, walked by pinocchio. Angles are off by ``TURN``, lengths by ``SHIFT``, and nothing else is wrong with it.
"""

import csv
import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell, setup_of
from planner.kinematics.packages import NO_PACKAGES
from planner.kinematics.robot import Robot
from planner.kinematics.urdf_elements import MeshFinder
from tests.simulation.generator.arm import Arm

TURN, SHIFT = 5e-4, 3e-4  # [rad, m] standard deviation of each error
ROUNDS = 20  # of leading the arm into a socket
LOGGED_ROWS = 400  # of a drive told at 100 Hz, of which one is logged: one in four seconds
GEAR = 2e-4  # [rad] standard deviation of each of a gear's two amplitudes
ORDERS = (2, 9)  # from and below which the order of the second is drawn; the first errs once a turn
SAG = 1.5e-4  # [rad/m] standard deviation of how far a joint gives way, of the lever of a load at the tool
STEP = 1e-4  # [rad] by which that lever is found
WANDER_S = 0.2  # over which what a driven joint is off stays alike

Flange = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From joint angles (n, N) [rad] to R (n, 3, 3) and p (n, 3) [m] of the flange."""


def true_flange(robot: Robot, urdf: Path | None, tip: str, rng: np.random.Generator, errors: bool = True) -> Flange:
    """Return the flange of an arm with drawn ``errors``, by its URDF or by the shipped file of its name."""
    if urdf is not None:
        return _displaced_urdf(ET.parse(urdf).getroot(), robot.joint_names, tip, rng, errors)
    arm = Arm.from_toml(robot.name)
    turns = {s.name: s.turns for s in arm.slots}
    drawn = {n: errors * rng.standard_normal() * (TURN if turns[n] else SHIFT) for n in arm.geometry}
    return lambda q: arm.flange(q, drawn)


def _displaced_urdf(
    root: ET.Element, joints: tuple[str, ...], tip: str, rng: np.random.Generator, errors: bool
) -> Flange:
    for element in (*root.iter("visual"), *root.iter("collision")):
        element.clear()
    for joint in root.iter("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            ET.SubElement(joint, "limit", lower="-7", upper="7", effort="1", velocity="1")
        if joint.get("name") not in joints:
            continue
        origin = joint.find("origin")
        origin = ET.SubElement(joint, "origin") if origin is None else origin
        xyz, rpy = (np.array([float(v) for v in origin.get(k, "0 0 0").split()]) for k in ("xyz", "rpy"))
        turned = Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(errors * TURN * rng.standard_normal(3))
        moved = xyz + errors * SHIFT * rng.standard_normal(3)
        origin.set("xyz", " ".join(map(repr, map(float, moved))))
        origin.set("rpy", " ".join(map(repr, map(float, turned.as_euler("xyz")))))
    model = pin.buildModelFromXML(ET.tostring(root, encoding="unicode"))
    data, frame = model.createData(), model.getFrameId(tip, pin.FrameType.BODY)
    index = [model.joints[model.getJointId(n)].idx_q for n in joints]

    def flange(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        R, p = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        for k, row in enumerate(q):
            full = pin.neutral(model)
            full[index] = row
            pin.framesForwardKinematics(model, data, full)
            R[k], p[k] = data.oMf[frame].rotation, data.oMf[frame].translation
        return R, p

    return flange


def with_hidden_errors(flange: Flange, joints: int, p_FM: np.ndarray, rng: np.random.Generator) -> Flange:
    """Return the flange of an arm whose gears err, and whose joints give way under a load at ``p_FM`` (3,) [m].

    A joint's lever is how fast it lifts the load (virtual work), so nothing need be known of the arm.
    """
    size, phase = GEAR * rng.standard_normal((2, joints)), rng.uniform(0.0, 2.0 * np.pi, (2, joints))
    order = np.stack([np.ones(joints), rng.integers(*ORDERS, joints)])
    soft = SAG * np.abs(rng.standard_normal(joints))

    def height(q: np.ndarray) -> np.ndarray:
        R, p = flange(q)
        return (p + R @ p_FM)[:, 2]

    def hidden(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        gears = sum(size[k] * np.sin(order[k] * q + phase[k]) for k in range(2))
        steps = STEP * np.eye(joints)
        lever = np.column_stack([(height(q + step) - height(q - step)) / (2 * STEP) for step in steps])
        return flange(q + gears - soft * lever)

    return hidden


@dataclass(frozen=True)
class TrueArm:
    """An arm with its tool ``p_FM`` (3,) [m] and its gauge as they truly are in a cell."""

    cell: Cell
    flange: Flange
    p_FM: np.ndarray
    rng: np.random.Generator

    @classmethod
    def draw(cls, cell: Cell, flange: Flange, rng: np.random.Generator) -> "TrueArm":
        """Draw how far the tool point is off."""
        return cls(cell, flange, cell.tool.p_FM + SHIFT * rng.standard_normal(3), rng)

    def tool(self, q: np.ndarray) -> np.ndarray:
        """Return where the tool point is, (n, 3) [m]."""
        R, p = self.flange(q)
        return p + R @ self.p_FM

    def write_run(self, plan: Path, path: Path) -> None:
        """Measure the poses of ``plan``: joints off by the repeatability, readings by the gauge's noise."""
        document = json.loads(plan.read_text())
        poses = [p for p in document["poses"] if p["role"] != "mount"]
        q = np.radians([p["q_deg"] for p in poses])
        off = setup_of(self.cell).joint_sigma * self.rng.standard_normal(q.shape)
        read, columns = self._read(q, off, poses)
        names = [f"q{k}_deg" for k in range(1, q.shape[1] + 1)]
        rows = [
            {"t_s": 5 * k, "pose": p["id"], **dict(zip(names, np.degrees(read[k]), strict=True)), **columns[k]}
            for k, p in enumerate(poses)
        ]
        with path.open("w", newline="") as file:
            file.write(f"# plan_id: {document['plan_id']}\n# robot: {document['robot']}\n# measure: static\n")
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)

    def write_driven_run(self, told: Path, path: Path) -> None:
        """Measure along a drive: times and angles are of the run ``told`` (at 100 Hz), the readings this arm's."""
        lines = told.read_text().splitlines()
        head = [line for line in lines if line.startswith("#") and "truth" not in line and "simulated" not in line]
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))[::LOGGED_ROWS]
        joints = [name for name in rows[0] if name.startswith("q") and name.endswith("_deg")]
        q = np.radians([[float(row[name]) for name in joints] for row in rows])
        off = self.rng.standard_normal(q.shape)
        stay = np.exp(-0.01 * LOGGED_ROWS / WANDER_S)
        for k in range(1, len(off)):
            off[k] = stay * off[k - 1] + np.sqrt(1 - stay**2) * off[k]
        _, columns = self._read(q, setup_of(self.cell).joint_sigma * off, rows)
        with path.open("w", newline="") as file:
            file.writelines(f"{line}\n" for line in head)
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows({**row, **column} for row, column in zip(rows, columns, strict=True))

    def _read(self, q: np.ndarray, off: np.ndarray, poses: list[dict]) -> tuple[np.ndarray, list[dict]]:
        """Return the joint angles as read and the columns of the gauge."""
        noise = self.cell.gauge.noise * self.rng.standard_normal((len(q), 3))
        if self.cell.gauge.kind == "ball-socket":
            return self._seated(q, noise, [p["ball"] for p in poses]) - off, [{"ball": p["ball"]} for p in poses]
        x = self.tool(q + off)
        if self.cell.gauge.kind == "tracker":
            place = self.cell.fixtures[0]
            turn = Rotation.from_rotvec(2e-3 * self.rng.standard_normal(3)).as_matrix() @ place.R_BX
            seen = 1e3 * ((x - place.p_BX - 2e-3 * self.rng.standard_normal(3)) @ turn + noise)
            return q, [dict(zip(("x_mm", "y_mm", "z_mm"), row, strict=True)) for row in seen]
        there = {f.name: f.p_BX + 1e-3 * self.rng.standard_normal(3) for f in self.cell.fixtures}
        zero = SHIFT * self.rng.standard_normal()
        ends = np.array([there[p["fixture"]] for p in poses])
        length = 1e3 * (np.linalg.norm(x - ends, axis=1) + zero + noise[:, 0])
        return q, [{"length_mm": v, "fixture": p["fixture"]} for v, p in zip(length, poses, strict=True)]

    def _seated(self, q: np.ndarray, noise: np.ndarray, balls: list[str]) -> np.ndarray:
        """Lead the ball from ``q`` into its socket, the shortest way of the joints; the plate is off its place."""
        plate = self.cell.fixtures[0]
        turn = Rotation.from_rotvec(1e-3 * self.rng.standard_normal(3)).as_matrix() @ plate.R_BX
        at = plate.p_BX + 1e-3 * self.rng.standard_normal(3)
        goal = np.array([at + turn @ next(b.p_GS for b in self.cell.balls if b.name == name) for name in balls]) + noise
        for _ in range(ROUNDS):
            J = np.stack([(self.tool(q + d) - self.tool(q - d)) / 2e-6 for d in 1e-6 * np.eye(q.shape[1])], axis=2)
            q = q + np.einsum("nij,nj->ni", np.linalg.pinv(J), goal - self.tool(q))
        assert np.abs(goal - self.tool(q)).max() < 1e-9
        return q


def aligned_distance(x: np.ndarray, true: np.ndarray) -> float:
    """Return how far points (n, 3) are from others once they are moved rigidly onto them [m], rms."""
    a, b = x - x.mean(axis=0), true - true.mean(axis=0)
    return float(Rotation.align_vectors(b, a)[1] / np.sqrt(len(a)))


def readable_urdf(path: Path, folder: Path) -> Path:
    """Return a URDF whose meshes are there; a copy where its package calls them otherwise (``BASE``, ``base_link``)."""
    tree = ET.parse(path)
    meshes = list(tree.iter("mesh"))
    if all(MeshFinder(path, NO_PACKAGES).find(m.get("filename", "")) for m in meshes):
        return path
    files = {f.stem.lower().removesuffix("_link"): f for f in sorted(path.parents[1].rglob("*.[Ss][Tt][Ll]"))}
    for mesh in meshes:
        mesh.set("filename", str(files[Path(mesh.get("filename", "")).stem.lower()]))
    copy = folder / path.name
    tree.write(copy)
    return copy
