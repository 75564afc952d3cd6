"""What joint targets the text of a program holds, and where a robot stands with them: read and computed here, from the
languages' manuals and the robot files' tables, with nothing of the planner."""

import math
import re
import tomllib

import numpy as np

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
CONTROLLERS = {".pdl": "pdl2", ".script": "urscript", ".MPF": "sinumerik", ".SPF": "sinumerik", ".nc": "din66025"}

# A calibrated arm of each kind: row of the table of joints and its true values, where they differ (mm and degrees)
TRUE_ROWS = {
    "comau-nj130": {
        1: {"alpha_deg": -89.97},
        2: {"a_mm": 860.9, "theta_deg": -89.95},
        3: {"theta_deg": 180.06, "d_mm": -0.4, "alpha_deg": 90.03},
        4: {"d_mm": 762.3, "theta_deg": 179.93, "a_mm": 0.3},
        5: {"theta_deg": 0.08, "d_mm": 0.35},
    },
    "kuka-kr6-r700": {
        2: {"a_mm": 25.4, "theta_deg": 0.05, "alpha_deg": 90.04},
        3: {"a_mm": 315.5, "theta_deg": -90.07, "alpha_deg": 0.03},
        4: {"a_mm": 35.4, "d_mm": -365.6, "theta_deg": 0.08},
        5: {"theta_deg": -0.06, "alpha_deg": -90.03},
        6: {"alpha_deg": 90.02},
    },
    "ur10": {
        1: {"alpha_deg": 90.03},
        2: {"a_mm": -612.9, "theta_deg": 0.05},
        3: {"a_mm": -571.6, "theta_deg": -0.07, "alpha_deg": 0.04},
        4: {"theta_deg": 0.09, "d_mm": 164.3, "alpha_deg": 89.98},
        5: {"theta_deg": -0.06, "d_mm": 115.3},
    },
    "ur5e": {
        1: {"alpha_deg": 89.96},
        2: {"a_mm": -425.7, "theta_deg": -0.06},
        3: {"a_mm": -391.6, "theta_deg": 0.08, "alpha_deg": 0.03},
        4: {"theta_deg": -0.05, "d_mm": 133.7, "alpha_deg": 90.04},
        5: {"theta_deg": 0.1, "d_mm": 99.3},
    },
}


def write_calibrated(nominal, folder, rows):
    """A calibrated robot file: the nominal text with true values in its rows, the controller's own in [nominal]."""
    head, *joints = re.split(r"(?m)^(?=\[\[joints\]\])", nominal.read_text(encoding="utf-8"))
    table = tomllib.loads(nominal.read_text(encoding="utf-8"))
    own = ["", "[nominal]"]
    for row, values in rows.items():
        for key, value in values.items():
            letter, unit = key.split("_")
            # modified DH: row i holds alpha and a of the link before it
            link = row - 1 if table["convention"] == "mdh" and letter in ("a", "alpha") else row
            own.append(f"{letter}{link}_{unit} = {float(table['joints'][row - 1][key])}")
            joints[row - 1] = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", joints[row - 1])
    folder.mkdir(parents=True)
    text = head + "".join(joints) + "\n".join(own) + "\n"
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    return folder


def identity_rows(nominal, rows):
    """The same rows with the nominal values: a calibration that found nothing."""
    joints = tomllib.loads(nominal.read_text(encoding="utf-8"))["joints"]
    return {row: {key: joints[row - 1][key] for key in values} for row, values in rows.items()}


def controller_of(path):
    """Table of the robot file whose axes a program's joint angles are."""
    return "linuxcnc" if path.suffix == ".ngc" else CONTROLLERS[path.suffix]


def flange(robot, joints_deg, controller):
    """Last frame of the table of joints (4 x 4, mm) at joint angles of a controller; the flange stands firmly in it."""
    axes, q = robot["controllers"][controller], np.array(joints_deg, float)
    if not axes.get("same"):
        q = (q - axes["zero_deg"]) * axes["sense"]
    T = np.eye(4)
    for joint, angle in zip(robot["joints"], q, strict=True):
        turn = _about_z(math.radians(joint["theta_deg"] + joint.get("sense", 1) * angle + joint.get("zero_deg", 0)))
        twist = _about_x(math.radians(joint["alpha_deg"]))
        along_x, along_z = _along(joint["a_mm"], 0), _along(0, joint["d_mm"])
        if robot["convention"] == "dh":
            T = T @ turn @ along_z @ along_x @ twist
        else:
            T = T @ twist @ along_x @ turn @ along_z
    return T


def apart(A, B):
    """How far two frames are apart: mm and degrees (of small turns)."""
    R = A[:3, :3].T @ B[:3, :3]
    turn = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    return float(np.linalg.norm(A[:3, 3] - B[:3, 3])), math.degrees(math.asin(min(1.0, float(turn))))


def _about_z(t):
    return np.array([[math.cos(t), -math.sin(t), 0, 0], [math.sin(t), math.cos(t), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def _about_x(t):
    return np.array([[1, 0, 0, 0], [0, math.cos(t), -math.sin(t), 0], [0, math.sin(t), math.cos(t), 0], [0, 0, 0, 1]])


def _along(x, z):
    T = np.eye(4)
    T[0, 3], T[2, 3] = x, z
    return T


def joint_targets(path, lines):
    """Joint angles in degrees of a controller that each line holds as plain numbers: line -> list of targets."""
    if path.suffix == ".pdl":
        return _of_pdl2(lines)
    return _of_urscript(lines) if path.suffix == ".script" else _of_gcode(path, lines)


def _of_pdl2(lines):
    found = {}
    for number, line in enumerate(lines, 1):
        code = re.sub(r"'[^']*'", "''", line).split("--")[0]
        following = number
        while code.count("{") > code.count("}") and following < len(lines):  # a list over several lines
            code = code.rstrip().rstrip("\\") + " " + lines[following]
            following += 1
        for braces in re.findall(r"\{([^}]*)\}", code):
            words = [w.strip() for w in braces.split(",")]
            if len(words) == 6 and all(re.fullmatch(NUMBER, w) for w in words):
                found.setdefault(number, []).append([float(w) for w in words])
    return found


def _of_urscript(lines):
    found = {}
    for number, line in enumerate(lines, 1):
        code = re.sub(r'"[^"]*"', '""', line).split("#")[0]
        for pose, brackets in re.findall(r"(p?)\[([^\[\]]*)\]", code):
            words = [w.strip() for w in brackets.split(",")]
            values = [_urscript_angle(w) for w in words]
            if not pose and len(words) == 6 and None not in values:
                found.setdefault(number, []).append(values)
    return found


def _urscript_angle(word):
    if degrees := re.fullmatch(rf"d2r\(\s*({NUMBER})\s*\)", word):
        return float(degrees[1])
    return math.degrees(float(word)) if re.fullmatch(NUMBER, word) else None


def _of_gcode(path, lines):
    """Straight through the lines: words that are left out keep their last value, what is no plain number is unknown."""
    found, state, absolute = {}, [None] * 6, True
    for number, line in enumerate(lines, 1):
        code, words = _linuxcnc_words(line) if path.suffix == ".ngc" else _axis_words(line)
        modes = re.findall(r"(?<![A-Z])G(\d+)", code)
        absolute = (absolute or "90" in modes) and "91" not in modes
        if words is None:
            state = [None] * 6
        elif words and not {"10", "28", "74", "75", "92"} & set(modes):
            for axis, word in words.items():
                word = re.sub(r"^AC\((.*)\)$", r"\1", word)
                state[axis] = float(word) if absolute and re.fullmatch(NUMBER, word) else None
            if None not in state:
                found[number] = [list(state)]
    return found


def _linuxcnc_words(line):
    code = re.sub(r"\([^)]*\)", " ", line).split(";")[0]
    code = re.sub(r"\s", "", code).upper()
    if re.search(r"O<|O\d", code):
        return code, {}
    words = re.findall(rf"(?<![A-Z#<])([XYZABC])({NUMBER}|\[[^\]]*\]|#<?\w+>?)", code)
    return code, {"XYZABC".index(axis): word for axis, word in words}


def _axis_words(line):
    """Words A1=... A6= of a block; None where an axis goes elsewhere than to a word's value."""
    code = re.sub(r'"[^"]*"', '""', line).split(";")[0]
    code = re.sub(r"\([^)]*[A-Z]{4}[^)]*\)", "", code)
    if re.search(r"POS\[|POSA\[|PO\[|PRESETON|REPEAT|TRANS|MIRROR", code):
        return code, None
    words = re.findall(r"\bA([1-6])=\s*(\w+\([^)]*\)|[^\s;]+)", code)
    return code, {int(axis) - 1: word for axis, word in words}
