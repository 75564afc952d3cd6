"""A sound file for every way in, and what reads it: the fuzzer spoils the first and calls the second."""

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl

import tests.programs.sessions as sessions
from planner.cell.reading import load_cell
from planner.centring.journal import open_journal, read_planned_path
from planner.centring.settings import read_settings
from planner.compensation.compensated_file import compensate_file
from planner.design.discrimination.findings import read_identification
from planner.kinematics.bodies import Body
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Identification
from planner.motion.collision.engines import pin_model
from planner.motion.collision.scene import mesh_faces
from planner.programs.dialect import load_dialect
from planner.programs.verification import read_texts, write_program
from planner.runs.loader import load_run
from planner.runs.traces import import_run
from planner.session.document import read_plan, read_waypoints
from planner.simulation.truth import read_truth
from tests.centring.world import plan as ball_plan
from tests.compensation.robots import BentRobot, bent
from tests.motion.collision.test_meshes import stl

ROBOT = "kuka-kr6-r700"
URDF = """<robot name="r">{links}{joints}</robot>"""


@dataclass(frozen=True)
class Surface:
    """One way in: the name of the file, what it holds, and what is done with it."""

    file: str
    seed: Callable[[Path], bytes]
    read: Callable[[Path], object]


def _urdf(_: Path) -> bytes:
    body = '<collision><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.05" length="0.2"/></geometry></collision>'
    mass = '<inertial><mass value="3"/><origin xyz="0 0 0.1"/></inertial>'
    links = "".join(f'<link name="l{k}">{mass}{body}</link>\n' for k in range(7))
    axes = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>\n'
        f'<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="{a}"/><limit lower="-2" upper="2" velocity="2"/></joint>\n'
        for k, a in enumerate(axes)
    )
    return URDF.format(links=links, joints=joints).encode()


def _read_robot(path: Path) -> Robot:
    robot = load_robot(path.name, path.parent)
    pin_model(robot)
    return robot


def _mesh(folder: Path) -> bytes:
    stl(folder / "seed.stl")
    return (folder / "seed.stl").read_bytes()


def _rows() -> dict[str, list[object]]:
    rng = np.random.default_rng(0)
    columns: dict[str, list[object]] = {"t_s": [0.5 * k for k in range(12)], "pose": list(range(12))}
    columns |= {f"q{j}_deg": [round(v, 3) for v in rng.uniform(-50, 50, 12)] for j in range(1, 7)}
    return columns | {"length_mm": [round(v, 3) for v in rng.uniform(300, 500, 12)], "temperature_degC": [20.5] * 12}


def _csv(_: Path) -> bytes:
    return ("# plan_id: 0123456789ab\n" + pl.DataFrame(_rows()).write_csv()).encode()


def _parquet(_: Path) -> bytes:
    out = io.BytesIO()
    pl.DataFrame(_rows()).write_parquet(out)
    return out.getvalue()


def _read_plan(path: Path) -> object:
    plan = read_plan(path, "drives")
    for drive in plan.drives:
        if len({len(w.q_deg) for w in drive.waypoints}) == 1:
            read_waypoints(drive.waypoints)
    return read_planned_path(path)


def _identification(_: Path) -> bytes:
    quality = {"rms_mm": 0.1, "mean_mm": 0.1, "max_mm": 0.3}
    parameter = {"name": "d1", "value": 400.1, "nominal": 400.0, "std": 0.1, "unit": "mm", "identifiable": True}
    finding = {
        "effect": "joint compliance",
        "on": "joint 2",
        "value": 1.0,
        "std": 0.1,
        "unit": "urad/Nm",
        "p_value": 0.01,
    }
    content = {
        "schema": "edbb-identification/1", "robot": ROBOT, "n_samples": 100, "n_groups": 35,
        "split": {"by": "pose", "hold_out": 0.2},
        "stages": [{"name": "nominal", "effects": [], "parameters": 0, "train": quality, "held_out": quality}],
        "parameters": [parameter | {"absorbs": []}],
        "findings": [finding | {"p_value": 0.01, "held_out_gain": 0.1, "rivals": ["link mass, link 2"], "note": ""}],
        "unexplained": {"structured": False, "along": [], "rms_mm": 0.01}, "noise_floor_mm": 0.01,
        "condition_number": 100.0, "degrees_of_freedom": 70, "warnings": [],
    }  # fmt: skip
    return json.dumps(content).encode()


def _read_identification(path: Path) -> object:
    Identification.read(path)
    return read_identification(path, ROBOT, 6)


def _journal(_: Path) -> bytes:
    head = {"schema_name": "edbb-centring-journal/1", "plan_id": "0123456789ab", "robot": ROBOT, "began_s": 1.7e9}
    row = {"session": 0, "moves": 3, "q_deg": [1.0] * 6, "cmd_deg": [1.0] * 6}
    row |= {"offset_mm": [0.1] * 3, "reading_mm": [0.1] * 3, "found_mm": [0.1] * 3}
    rows = [row | {"pose": 2 * k + 1, "ball": str(k % 4 + 1), "t_s": 10.0 * k} for k in range(3)]
    return "".join(json.dumps(r) + "\n" for r in (head, *rows)).encode()


def _read_journal(path: Path) -> object:
    plan = path.parent / "balls.json"
    plan.write_text(json.dumps(ball_plan()))
    return open_journal(path.with_suffix(""), read_planned_path(plan), 1.7e9)


def _program(dialect: str) -> Callable[[Path], bytes]:
    return lambda _: write_program(sessions.continuous(n_poses=2), dialect, "a")[0].text.encode()


def _read_program(dialect: str) -> Callable[[Path], object]:
    def read(path: Path) -> object:
        text = path.read_bytes().decode("latin-1")
        compensate_file(path, robot(), calibrated(), dialect=dialect)
        return read_texts(load_dialect(dialect), (text,), only_known=False)

    return read


@cache
def robot() -> Robot:
    return load_robot("comau-nj130")


@cache
def calibrated() -> BentRobot:
    return bent("comau-nj130")[1]


MAP = """schema = "edbb-map/1"
measure = "static"
separator = ";"
decimal = ","
encoding = "utf-8"
[columns]
t_s = "time"
q1_deg = 2
q2_deg = {column = 3, factor = 1.0, offset = 0.5}
length_mm = 4
[units]
[constants]
fixture = "A"
"""
TRACE = "time;a;b;len\n" + "".join(f"{k},5;{10 + 3 * k},0;{k * k},25;{350 + k},125\n" for k in range(12))


def _read_map(path: Path) -> object:
    trace = path.parent / "trace.csv"
    trace.write_text(TRACE)
    return import_run([trace], path)


def _cell(_: Path) -> bytes:
    return load_cell(f"{ROBOT}/trical").path.read_bytes()


def _truth(_: Path) -> bytes:
    return b'schema = "edbb-truth/1"\n[errors]\nd1_mm = 0.1\nfixture_A_z_mm = 2\n'


SURFACES = {
    "robot TOML": Surface("robot.toml", lambda _: robot().path.read_bytes(), _read_robot),
    "cell TOML": Surface("cell.toml", _cell, lambda p: (load_cell(p), load_cell(p, planning=False))),
    "URDF": Surface("arm.urdf", _urdf, _read_robot),
    "mesh": Surface("body.stl", _mesh, lambda p: mesh_faces(Body("b", "mesh", (), np.eye(4), p))),
    "run CSV": Surface("run.csv", _csv, load_run),
    "run Parquet": Surface("run.parquet", _parquet, load_run),
    "plan": Surface("plan.json", lambda _: json.dumps(ball_plan()).encode(), _read_plan),
    "identification": Surface("identification.json", _identification, _read_identification),
    "journal": Surface("run.csv.journal", _journal, _read_journal),
    "KRL": Surface("a.src", _program("krl"), _read_program("krl")),
    "RAPID": Surface("a.mod", _program("rapid"), _read_program("rapid")),
    "PDL2": Surface("a.pdl", _program("pdl2"), _read_program("pdl2")),
    "G-code": Surface("a.ngc", _program("linuxcnc"), _read_program("linuxcnc")),
    "map": Surface("map.toml", lambda _: MAP.encode(), _read_map),
    "settings": Surface("centring.toml", lambda _: b'[robot]\nprogram = "A"\ntool = 2\n[head]\nusable_mm = 4\n',
                        lambda p: read_settings(p, p.parent / "no.toml")),
    "truth": Surface("truth.toml", _truth, lambda p: read_truth(p, load_cell(f"{ROBOT}/edbb"), None)),
}  # fmt: skip
