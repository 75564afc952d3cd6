"""The cases: every shipped cell, gauge, instrument, dialect and command, with few poses and few candidates."""

import json
import tomllib
from pathlib import Path

from tests.golden.case import ROOT, Case, edbb

INPUTS = Path(__file__).parent / "inputs"
FEW = "candidates = 400\nvalidate = 2\nrepeat = 1\nrefine = false"
ALL = ("bnr", "din66025", "krl", "linuxcnc", "pdl2", "rapid", "sinumerik")


def shipped(name, *changes, plan=FEW):
    """The text of a shipped cell with changes, each (old, new), and other keys in ``[plan]``."""
    robot, cell = name.split("/")
    text = (ROOT / "robots" / robot / "cells" / f"{cell}.toml").read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    if plan:
        new = {line.split(" = ")[0] for line in plan.splitlines()}
        here, _, there = text.partition("\n[plan]\n")
        kept = [line for line in there.splitlines() if line.split(" = ")[0] not in new]
        text = f"{here}\n[plan]\n{plan}\n" + "\n".join(kept) + "\n"
    tomllib.loads(text)
    return text


def part(text, begin, end, new):
    """The text with what stands from ``begin`` up to ``end`` replaced."""
    first, last = text.index(begin), text.index(end)
    return text[:first] + new + text[last:]


def given(*names):
    """Input files of the record."""
    return {name: (INPUTS / name).read_bytes() for name in names}


def dialects(*names):
    """Options that choose dialects."""
    return " ".join(f"--dialect {name}" for name in names)


CIRCLE = """
[[circles]]
name = "arc"
plane = "XY"
radius_mm = 350
start_deg = 150
sweep_deg = 60
overshoot_deg = 5
speed_mm_s = 100

"""
TRUTH = """schema = "edbb-truth/1"
[errors]
a2_mm = 0.8
theta3_deg = 0.05
d4_mm = -0.4
alpha4_mrad = 0.5
theta5_mrad = -0.7
compliance3_urad_Nm = 1.5
[noise]
gauge_um = 1.0
repeatability_mm = 0.01
"""
SMALL_TRUTH = 'schema = "edbb-truth/1"\n[errors]\na2_mm = 0.8\ntheta3_deg = 0.5\n'
BACKLASH = TRUTH + '[[effects]]\nkind = "backlash"\non = "joint 2"\nvalue = 200\nunit = "urad"\n'
POINTS = ("[[tool.bodies]]", '[[tool.points]]\nname = "2"\nmap_mm = [-40, 20, 100]\n\n[[tool.bodies]]')
RIVALS = {
    "schema": "edbb-identification/1",
    "robot": "kuka-kr6-r700",
    "n_samples": 200,
    "degrees_of_freedom": 160.0,
    "stages": [{"name": "last", "train": {"rms_mm": 0.008}, "held_out": {"rms_mm": 0.01}}],
    "parameters": [],
    "findings": [
        {
            "effect": "joint compliance",
            "on": "joint 3",
            "value": 1e-5,
            "unit": "rad/Nm",
            "rivals": ["reduction ratio, joint 3"],
            "p_value": 0.0,
        }
    ],
}
MOVE = "DEF P ( )\nPTP_REL {A1 10}\nEND\n"
MAP = """schema = "edbb-map/1"
separator = ";"
decimal = ","
[columns]
t_s = "Time"
q1_deg = "A1"
q2_rad = "A2"
[[traces]]
[traces.columns]
t_s = 1
length_mm = { column = 2, factor = 0.001 }
"""
AXES = "Time;A1;A2\n" + "".join(f"{k / 10:.2f};{k:.3f};{k / 100:.4f}\n".replace(".", ",") for k in range(120))
GAUGE = "t,L\n" + "".join(f"{k / 10:.2f},{400_000 + 10 * k:.1f}\n" for k in range(120))
LOADED = shipped(
    "abb-irb6700/ldbb",
    ("loads_N = [125, 250, 375, 500, 625]", "loads_N = [125, 625]"),
    ("repeats = 5", "repeats = 1"),
    ("overshoot_deg = 180", "overshoot_deg = 20"),
    plan="",
)
BAR = shipped("kuka-kr6-r700/edbb")


def fitted(*controllers):
    """The shipped KR 6 with controllers of other makers fitted to it, which count as its joints do."""
    text = (ROOT / "robots" / "kuka-kr6-r700" / "robot.toml").read_text()
    return text + "".join(f'\n[controllers.{c}]\nsame = true\nsource = "set up so"\n' for c in controllers)


FITTED = {
    "cell.toml": BAR.replace('robot = "kuka-kr6-r700"', 'robot = "kr6.toml"', 1),
    "kr6.toml": fitted("rapid", "pdl2"),
}
BALLS = """schema = "edbb-cell/1"
robot = "abb-irb120"
[gauge]
kind = "ball-socket"
noise_um = 2
""" + "".join(
    f'[[balls]]\nname = "{k}"\nposition_mm = {p}\n'
    for k, p in enumerate(
        (
            [-79.539, -330.141, 17.531],
            [-79.193, 287.805, 18.74],
            [-79.65, -21.958, 276.388],
            [26.379, -21.676, 170.489],
        ),
        1,
    )
)
WIRE = """schema = "edbb-cell/1"
robot = "abb-irb120"
home_deg = [0, 0, 0, 0, 90, 0]
[tool]
map_mm = [30, 0, 80]
mass_kg = 0.5
[gauge]
kind = "draw-wire"
length_mm = [200, 420]
noise_um = 2
[[fixtures]]
name = "A"
position_mm = [300, 250, 60]
[motion]
measure = "static"
"""
TRACKED = 'schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\nkind = "tracker"\nnoise_um = 5\n'

CASES = (
    Case(
        "nj130-edbb",
        {"cell.toml": shipped("comau-nj130/edbb"), "truth.toml": TRUTH},
        (
            edbb(f"plan cell.toml -o out --poses 32 --seed 1 --json {dialects('bnr', 'krl')}"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml --seed 2"),
            edbb(
                "identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace --hold-out 0.3 --json"
            ),
        ),
        60,
    ),
    Case(
        "nj130-paper",
        {"cell.toml": shipped("comau-nj130/paper")},
        (edbb("plan cell.toml -o out --poses 23 --index O1"), edbb("simulate out/plan.json -o run.csv")),
        30,
    ),
    Case(
        "nj130-circular",
        {
            "cell.toml": part(shipped("comau-nj130/circular", plan=""), "[[circles]]", "[motion]", CIRCLE),
            "truth.toml": TRUTH,
        },
        (
            edbb("plan cell.toml -o out --dialect bnr --dialect rapid --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("circular run.csv --plan out/plan.json -o found --json"),
            edbb("export out/plan.json --dialect krl -o p.src"),
        ),
        40,
    ),
    Case(
        "kr6-edbb",
        {**FITTED, "truth.toml": BACKLASH},
        (
            edbb(f"plan cell.toml -o out --poses 34 {dialects('krl', 'rapid', 'pdl2', 'din66025')}"),
            edbb("export out/plan.json --dialect sinumerik -o p.mpf"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml --seed 3"),
            edbb("simulate out/plan.json -o again.csv --truth truth.toml --seed 4"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json --validate again.csv -o found --json"),
            edbb("compensate out/KUKA_KR6_R700_CELL.src --model found/robot.toml --measuring -o corrected.src"),
            edbb("compensate out/kuka_kr6_r700_cell.mod --model found/robot.toml --measuring -o corrected.mod"),
            edbb("compensate out/kuka_kr6_r700_cell.pdl --model found/robot.toml --measuring -o corrected.pdl"),
            edbb("compensate out/kuka_kr6_r700_cell.nc --model found/robot.toml --measuring -o corrected.nc"),
        ),
        50,
    ),
    Case(
        "kr6-traced",
        {**FITTED, "move.src": MOVE, **given("bar.csv", "part.src", "part.mod", "targets.csv")},
        (
            edbb("identify bar.csv --cell cell.toml -o found --json"),
            edbb("compensate part.src --model found/robot.toml -o part_corrected.src"),
            edbb("compensate move.src --model found/robot.toml -o move_corrected.src", 2, ("move.src:2", "PTP_REL")),
            edbb("compensate part.mod --model found/robot.toml -o part_corrected.mod"),
            edbb("compensate targets.csv --model found/robot.toml --cell cell.toml -o targets_corrected.csv"),
        ),
        60,
    ),
    Case(
        "kr6-separate",
        {**FITTED, "identification.json": json.dumps(RIVALS)},
        (edbb("plan cell.toml -o out --poses 36 --separate identification.json --dialect pdl2"),),
        60,
    ),
    Case(
        "kr6-fixtures",
        {"cell.toml": shipped("kuka-kr6-r700/edbb", plan=FEW.replace("400", "1200"))},
        (
            edbb("plan cell.toml -o out --poses 40 --fixtures 2 --dialect sinumerik"),
            edbb("simulate out/plan.json -o run.csv"),
        ),
        60,
    ),
    Case(
        "so101-wire",
        {"cell.toml": shipped("so101/wire", plan=FEW.replace("400", "4000")), "truth.toml": SMALL_TRUTH},
        (
            edbb("plan cell.toml -o out --poses 30"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
        ),
        40,
    ),
    Case(
        "kr6-tracker",
        {
            "cell.toml": shipped(
                "kuka-kr6-r700/tracker", plan="candidates = 400\nvalidate = 12\nrepeat = 0\nrefine = false"
            ),
            "truth.toml": TRUTH,
        },
        (
            edbb("plan cell.toml -o out --poses 24 --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
            edbb(
                "accuracy run.csv --cell out/cell.toml --plan out/plan.json --model found/robot.toml -o judged --json"
            ),
        ),
        50,
    ),
    Case(
        "ur5e-sockets",
        {
            "cell.toml": shipped("ur5e/sockets", plan="candidates = 3000\nvalidate = 2\nrepeat = 1\nrefine = false"),
            "truth.toml": TRUTH,
        },
        (
            edbb("plan cell.toml -o out --poses 24 --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
        ),
        50,
    ),
    Case(
        "panda-camera",
        {
            "cell.toml": shipped("panda/camera", plan="candidates = 300\nvalidate = 2\nrepeat = 1\nrefine = false"),
            "truth.toml": TRUTH,
        },
        (
            edbb("plan cell.toml -o out --poses 24 --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
        ),
        50,
    ),
    Case(
        "kr6-trical",
        {
            "cell.toml": shipped("kuka-kr6-r700/trical", plan="candidates = 600\nposes = 24\nvalidate = 2\nrepeat = 2"),
            "truth.toml": TRUTH,
        },
        (
            edbb("plan cell.toml -o out --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
            edbb("accuracy run.csv --cell out/cell.toml --plan out/plan.json -o judged --json"),
            edbb("centre out/plan.json --program-to robot"),
        ),
        50,
    ),
    Case(
        "ur10-two-points",
        {"cell.toml": shipped("ur10/edbb", POINTS, plan=FEW.replace("400", "1600")), "truth.toml": TRUTH},
        (
            edbb("plan cell.toml -o out --poses 38 --aim tracing --dialect sinumerik --dialect linuxcnc"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("identify run.csv --cell out/cell.toml --plan out/plan.json -o found --no-trace"),
        ),
        60,
    ),
    Case(
        "irb6700-both",
        {"free.toml": shipped("abb-irb6700/edbb"), "loaded.toml": LOADED, "truth.toml": TRUTH},
        (
            edbb("plan free.toml -o free --poses 44 --dialect rapid"),
            edbb("plan-both free/plan.json loaded.toml -o both --places 1 --dialect rapid --json"),
            edbb("simulate free/plan.json -o free.csv --truth truth.toml"),
            edbb("simulate both/loaded/plan.json -o loaded.csv --truth truth.toml"),
            edbb("loaded loaded.csv --cell both/cell.toml --unloaded free.csv -o found --json"),
        ),
        90,
    ),
    Case(
        "irb6700-ldbb",
        {"cell.toml": LOADED, "truth.toml": TRUTH},
        (
            edbb("plan cell.toml -o out --json"),
            edbb("simulate out/plan.json -o run.csv --truth truth.toml"),
            edbb("loaded run.csv --cell out/cell.toml --plan out/plan.json --overshoot-deg 20 -o found --json"),
        ),
        50,
    ),
    Case(
        "irb6700-places",
        {"cell.toml": LOADED},
        (edbb("loaded-places cell.toml -o places --places 2 --json"),),
        30,
    ),
    Case("nj130-study", {"cell.toml": shipped("comau-nj130/edbb")}, (edbb("study cell.toml -o study --json"),), 60),
    Case(
        "irb120-draw-wire",
        {"cell.toml": WIRE, **given("wire.csv")},
        (edbb("identify wire.csv --cell cell.toml -o found --json"),),
        20,
    ),
    Case(
        "irb120-ball-socket",
        {"cell.toml": BALLS, **given("balls.csv")},
        (edbb("identify balls.csv --cell cell.toml -o found --no-trace --json"),),
        15,
    ),
    Case(
        "ur10-tracker",
        {"cell.toml": TRACKED, **given("tracker.csv")},
        (edbb("identify tracker.csv --cell cell.toml -o found --json"),),
        25,
    ),
    Case(
        "import",
        {"map.toml": MAP, "axes.log": AXES, "gauge.csv": GAUGE},
        (edbb("import axes.log gauge.csv --map map.toml -o run.csv"),),
        3,
    ),
    Case(
        "lists",
        {},
        (
            edbb(
                "robots",
                facts=("abb-irb120", "comau-nj130/circular", "kuka-kr6-r700/trical", "ur10/edbb", "abb-irb6700/ldbb"),
            ),
            edbb("dialects", facts=ALL),
        ),
        5,
    ),
    Case(
        "refused",
        {
            "key.toml": BAR.replace("noise_um", "noize_um"),
            "metres.toml": BAR.replace("[300, 520]", "[0.3, 0.52]"),
            "gauge.toml": BAR.replace('"edbb"', '"ebdd"'),
            "few.toml": BAR.replace("candidates = 400", "candidates = 20"),
            "socket.toml": BALLS,
            "wall.toml": BAR + '\n[[obstacles]]\nkind = "box"\nat_mm = [0, 0, 600]\nsize_mm = [3000, 3000, 300]\n',
            "empty.csv": "t_s,q1_deg\n",
            "nan.csv": (INPUTS / "bar.csv").read_text().replace("375.921123", "nan"),
            "cell.toml": BAR,
            "robot.toml": (ROOT / "robots" / "kuka-kr6-r700" / "robot.toml").read_bytes(),
            "move.src": MOVE,
            **given("bar.csv", "tracker.csv"),
        },
        (
            edbb("plan key.toml -o out", 2, ("key.toml", "noize_um", "noise_um")),
            edbb("plan metres.toml -o out", 2, ("metres.toml", "length_mm", "metres")),
            edbb("plan gauge.toml -o out", 2, ("gauge.toml", "ebdd", "trical")),
            edbb("plan socket.toml -o out", 2, ("socket.toml", "[artifact]", "position_mm")),
            edbb("plan few.toml -o out --poses 30", 3, ("candidate", "plan.candidates", "clearance")),
            edbb("plan none.toml -o out", 2, ("none.toml",)),
            edbb("plan kuka-kr6-r700/ebdd -o out", 2, ("ebdd", "edbb")),
            edbb("identify empty.csv --cell cell.toml -o out", 2, ("empty.csv",)),
            edbb("identify nan.csv --cell cell.toml -o out", 2, ("nan.csv", "length_mm")),
            edbb("identify tracker.csv --cell cell.toml -o out", 2, ("x_mm", "cell.toml", "edbb")),
            edbb("compensate move.src --model robot.toml -o p.src", 2, ("robot.toml", "calibrated")),
            edbb("export none.json --dialect krl -o p.src", 2, ("none.json",)),
            edbb("loaded bar.csv --cell cell.toml -o out", 2, ("circle",)),
        ),
        20,
    ),
)
