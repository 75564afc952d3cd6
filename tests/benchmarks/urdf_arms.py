"""An arm from any URDF as it truly is, and its driven path held against all its links: by pinocchio and coal alone.

Nothing here shares code with the planner but the expansion of templates and the look for meshes.
"""

import csv
import json
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from planner.cell.cell import Cell, setup_of
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import describe_robot
from planner.kinematics.urdf import parse_urdf
from planner.kinematics.urdf_elements import MeshFinder

TURN, SHIFT = 5e-4, 3e-4  # [rad, m] standard deviation of each error of an origin
STEP = np.deg2rad(0.1)  # of the joint that moves most between two states that are checked; 0.1 mm of one that slides
MOVING = ("revolute", "continuous", "prismatic")


def to_si(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return joint variables (n, N) in rad and m."""
    return np.where(robot.slides, np.rad2deg(q) * 1e-3, q)


def description(robot: Robot) -> ET.Element:
    """Return the URDF that the robot was read from; continuous joints as revolute ones without an end."""
    root = parse_urdf(robot.path.parent / str(describe_robot(robot.path).urdf), robot.packages)
    for joint in root.iter("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            for limit in joint.findall("limit"):
                joint.remove(limit)
            ET.SubElement(joint, "limit", lower="-1e3", upper="1e3", effort="1", velocity="1")
        elif joint.get("type") in ("planar", "floating"):
            joint.set("type", "fixed")
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)  # parked joints have their values said
    return root


def model_of(root: ET.Element) -> pin.Model:
    """Build pinocchio's model of a URDF without its foreign tags, which it cannot parse."""
    for parent in list(root.iter()):
        for child in [c for c in parent if not isinstance(c.tag, str) or ":" in c.tag]:
            parent.remove(child)
    return pin.buildModelFromXML(ET.tostring(root, encoding="unicode"))


def full_states(model: pin.Model, robot: Robot, q: np.ndarray) -> np.ndarray:
    """Return pinocchio's configurations: the arm's joints at q (n, N), all others where they are parked."""
    full = np.tile(pin.neutral(model), (len(q), 1))
    for joint in robot.parked:
        full[:, model.joints[model.getJointId(joint.name)].idx_q] = joint.value
    full[:, [model.joints[model.getJointId(n)].idx_q for n in robot.joint_names]] = to_si(robot, q)
    return full


@dataclass(frozen=True)
class UrdfArm:
    """An arm with its tool ``p_FM`` (3,) [m] as it truly is: every origin of the chain displaced, the tool too."""

    robot: Robot
    model: pin.Model
    frames: tuple[int, int]
    p_FM: np.ndarray
    rng: np.random.Generator

    @classmethod
    def read(cls, robot: Robot, p_FM: np.ndarray, rng: np.random.Generator, errors: bool = True) -> "UrdfArm":
        """Draw what is off, ``errors`` of an arm, or nothing."""
        root = description(robot)
        for link in root.iter("link"):
            for shape in (*link.findall("visual"), *link.findall("collision")):
                link.remove(shape)
        for joint in root.findall("joint"):
            if joint.get("name") not in robot.joint_names:
                continue
            origin = joint.find("origin")
            origin = ET.SubElement(joint, "origin") if origin is None else origin
            xyz, rpy = (np.array([float(v) for v in (origin.get(k) or "0 0 0").split()]) for k in ("xyz", "rpy"))
            turned = Rotation.from_euler("xyz", rpy) * Rotation.from_rotvec(errors * TURN * rng.standard_normal(3))
            moved = xyz + errors * SHIFT * rng.standard_normal(3)
            origin.set("xyz", " ".join(map(repr, map(float, moved))))
            origin.set("rpy", " ".join(map(repr, map(float, turned.as_euler("xyz")))))
        model = model_of(root)
        base = robot.base or model.frames[1].name
        ends = tuple(model.getFrameId(n, pin.FrameType.BODY) for n in (base, str(robot.tip)))
        return cls(robot, model, (ends[0], ends[1]), p_FM + errors * SHIFT * rng.standard_normal(3), rng)

    def tool(self, q: np.ndarray) -> np.ndarray:
        """Return where the tool point is in the base link, (n, 3) [m]."""
        data, out = self.model.createData(), np.empty((len(q), 3))
        for k, state in enumerate(full_states(self.model, self.robot, q)):
            pin.framesForwardKinematics(self.model, data, state)
            base, tip = (data.oMf[f] for f in self.frames)
            out[k] = base.actInv(tip.act(self.p_FM))
        return out

    def write_run(self, cell: Cell, plan: Path, path: Path) -> int:
        """Measure the poses of ``plan`` with the cell's wire; return how many."""
        document = json.loads(plan.read_text())
        poses = [p for p in document["poses"] if p["role"] != "mount"]
        key = "q" if "joint_units" in document else "q_deg"
        q = np.radians([p[key] for p in poses])
        x = self.tool(q + setup_of(cell).joint_sigma * self.rng.standard_normal(q.shape))
        end = cell.fixtures[0].p_BX + 1e-3 * self.rng.standard_normal(3)
        noise = cell.gauge.noise * self.rng.standard_normal(len(q))
        length = 1e3 * (np.linalg.norm(x - end, axis=1) + SHIFT * self.rng.standard_normal() + noise)
        names = self.robot.joint_columns("q")
        with path.open("w", newline="") as file:
            file.write(f"# plan_id: {document['plan_id']}\n# robot: {document['robot']}\n# measure: static\n")
            table = csv.writer(file)
            table.writerow(["pose", *names, "length_mm", "fixture"])
            for pose, row, value in zip(poses, np.degrees(q), length, strict=True):
                table.writerow([pose["id"], *row, value, pose["fixture"]])
        return len(poses)


def driven_states(path: Path, robot: Robot) -> np.ndarray:
    """Return the driven path of ``trajectory.csv`` at steps of 0.1° and 0.1 mm, (n, N)."""
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    q = np.deg2rad([[float(row[name]) for name in robot.joint_columns("q")] for row in rows])
    parts = [
        np.linspace(a, b, 1 + int(np.ceil(np.abs(b - a).max() / STEP)), endpoint=False)
        for a, b in pairwise(q) if (a != b).any()
    ]  # fmt: skip
    return np.vstack([*parts, q[-1:]])


def count_meetings(robot: Robot, q: np.ndarray) -> dict[str, int]:
    """Return at how many states two links overlap that may not: hulls of meshes, all links of the URDF.

    Left out are links that cannot move against each other, those that a joint joins, and the pairs that SRDF or
    ``robot.toml`` leave out.
    """
    root = description(robot)
    finder = MeshFinder.of(robot.path.parent / str(describe_robot(robot.path).urdf), root, robot.packages)
    for mesh in root.iter("mesh"):
        found = finder.find(str(mesh.get("filename")))
        mesh.set("filename", str(found or mesh.get("filename")))
    for link in root.iter("link"):
        for shape in link.findall("visual"):
            link.remove(shape)
    model = model_of(root)
    text = ET.tostring(root, encoding="unicode")
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    for shape in geometry.geometryObjects:
        if isinstance(shape.geometry, coal.BVHModelBase):
            shape.geometry.buildConvexRepresentation(False)
            shape.geometry = shape.geometry.convex
    _add_pairs(geometry, _owners(root, geometry), robot, root)
    data, placed = model.createData(), geometry.createData()
    meetings: dict[str, int] = {}
    for state in full_states(model, robot, q):
        if not pin.computeCollisions(model, data, geometry, placed, state, False):
            continue
        for k, result in enumerate(placed.collisionResults):
            if result.isCollision():
                pair = geometry.collisionPairs[k]
                name = " and ".join(geometry.geometryObjects[i].name for i in (pair.first, pair.second))
                meetings[name] = meetings.get(name, 0) + 1
    return meetings


def _owners(root: ET.Element, geometry: pin.GeometryModel) -> list[str]:
    """Return the link of each shape; pinocchio calls them by their links and a number."""
    links = {str(link.get("name")) for link in root.findall("link")}
    return [g.name if g.name in links else g.name.rpartition("_")[0] for g in geometry.geometryObjects]


def _add_pairs(geometry: pin.GeometryModel, owner: list[str], robot: Robot, root: ET.Element) -> None:
    """Add the pairs that are checked."""
    driven = set(robot.joint_names)
    part = {str(link.get("name")): str(link.get("name")) for link in root.findall("link")}

    def rigid(name: str) -> str:
        return name if part[name] == name else rigid(part[name])

    def link(joint: ET.Element, end: str) -> str:
        found = joint.find(end)
        assert found is not None
        return str(found.get("link"))

    ends = [(j, link(j, "parent"), link(j, "child")) for j in root.findall("joint")]
    for joint, parent, child in ends:
        if joint.get("name") not in driven:
            part[rigid(child)] = rigid(parent)
    joined = {frozenset((rigid(p), rigid(c))) for j, p, c in ends if j.get("name") in driven}
    allowed = {frozenset((a, b)) for a, b, _ in robot.never_meet_parts}
    for i in range(len(owner)):
        for k in range(i + 1, len(owner)):
            a, b = owner[i], owner[k]
            if rigid(a) == rigid(b) or frozenset((rigid(a), rigid(b))) in joined or frozenset((a, b)) in allowed:
                continue
            geometry.addCollisionPair(pin.CollisionPair(i, k))
