"""Runs ``edbb compensate`` on programs with known truths and judges every motion of the corrected programs.

A truth names for every motion the pose (or the axis angles) that is meant, and the line that holds its numbers. The
corrected text is read here anew: the controller comes to the written pose with its nominal kinematics, and the true
robot stands where the calibrated one does at those axis angles.
"""

import difflib
import re
import shutil
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.command import edbb
from tests.compensation.foreign_kinematics import angle_deg, pose_of_angles, pose_of_quaternion

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
COMMENT = re.compile(r"\s*(;|!|\d*\s*:\s*!)")
NOT_HERE = re.compile(r"is declared elsewhere")  # says of the move, not of the point
WITHIN_MM, WITHIN_DEG = 0.05, 0.01
CORRECTED, LISTED, REFUSED, WRONG = "corrected", "listed", "refused", "silently wrong"


@dataclass(frozen=True)
class Target:
    """The numbers of one target of a program, and what it says of the arm's shape."""

    numbers: tuple
    shape: tuple = ()


@dataclass
class Outcome:
    """What became of a program: files as they were and as they are, listed lines, refused files."""

    before: dict
    after: dict = field(default_factory=dict)
    listed: set = field(default_factory=set)
    listed_as_elsewhere: set = field(default_factory=set)
    refused: set = field(default_factory=set)


@dataclass(frozen=True)
class Verdict:
    """The class of one motion, and why."""

    program: str
    file: str
    line: int
    kind: str
    outcome: str
    detail: str


def compensate(folder, model, scratch):
    """Run the command on each file that the truth names; ``scratch`` holds the corrected files."""
    truth = tomllib.loads((folder / "truth.toml").read_text(encoding="utf-8"))
    here = scratch / folder.name
    shutil.copytree(folder, here / "before")
    (here / "after").mkdir()
    outcome = Outcome({p.name: _text(p) for p in sorted(folder.iterdir()) if p.name != "truth.toml"})
    for run in truth["run"]:
        options = [here / "before" / o if (folder / o).is_file() else o for o in run["options"]]
        written = here / "after" / run["file"]
        done = edbb("compensate", here / "before" / run["file"], "--model", model, "-o", written, "-v", *options)
        assert done.returncode in (0, 2, 3, 5), done.stderr
        if done.returncode in (2, 3):  # 3: no target of it has a solution
            outcome.refused.add(run["file"])
        else:
            outcome.after[run["file"]] = _text(written)
        for file, line, reason in re.findall(r"left as it was: (?:.*/)?([^\s/:]+):(\d+)(.*)", done.screen):
            elsewhere = NOT_HERE.search(reason)
            (outcome.listed_as_elsewhere if elsewhere else outcome.listed).add((file, int(line)))
    return truth, outcome


def judge(name, truth, outcome, nominal, true):
    """A verdict for each motion of a program."""
    lines = {file: _pairs(text, outcome.after[file]) for file, text in outcome.before.items() if file in outcome.after}
    verdicts = []
    for motion in truth["motion"]:
        found, detail = _verdict(motion, outcome, lines, nominal, true)
        verdicts.append(Verdict(name, motion["file"], motion["line"], motion["kind"], found, detail))
    return verdicts


def stray_changes(truth, outcome):
    """Lines that were changed, or added and are no comment, though they hold no target of a motion."""
    holders = {
        (m["holder"]["file"], m["holder"]["line"] + k) for m in truth["motion"] if "holder" in m for k in range(8)
    }
    strays = []
    for file, text in outcome.before.items():
        if file not in outcome.after:
            continue
        pairs, new = _pairs(text, outcome.after[file]), outcome.after[file].split("\n")
        for i, line in enumerate(text.split("\n")):
            if (i not in pairs or new[pairs[i]] != line) and (file, i + 1) not in holders:
                strays.append(f"{file}:{i + 1}: {line}")
        kept = set(pairs.values())
        added = [line for i, line in enumerate(new) if i not in kept and line.strip()]
        strays += [f"{file}: {line}" for line in added if not COMMENT.match(line)]
    return strays


def _verdict(motion, outcome, lines, nominal, true):
    here, holder = (motion["file"], motion["line"]), motion.get("holder")
    there = (holder["file"], holder["line"]) if holder else here
    before, after = _targets(motion, holder, outcome, lines) if holder and "point" in motion else (None, None)
    changed = after is not None and after != before
    elsewhere = here in outcome.listed_as_elsewhere and (holder is None or there[0] not in outcome.after)
    named = here in outcome.listed or (elsewhere and not changed)
    if here[0] in outcome.refused and not changed:
        return REFUSED, ""
    if motion["kind"] == "unknowable":
        fine = named or (there in outcome.listed and not changed)
        return (LISTED, "") if fine else (WRONG, f"{motion['reason']}: not listed")
    try:
        off_mm, off_deg = _off(motion, after or before, nominal, true)
    except ValueError as unreachable:
        return WRONG, str(unreachable)
    detail = f"{off_mm:.4f} mm, {off_deg:.4f} deg"
    if off_mm < WITHIN_MM and off_deg < WITHIN_DEG:
        wrong = _wrong_shape(motion, before, after, nominal)
        return (WRONG, wrong) if wrong else (CORRECTED, detail)
    return (LISTED, detail) if named or (there in outcome.listed and not changed) else (WRONG, detail)


def _targets(motion, holder, outcome, lines):
    """The target as it was written and as it is now; the latter is None where its file was not written."""
    old, at = outcome.before[holder["file"]].split("\n"), holder["line"] - 1
    before = _read(old[at:], motion["file"], holder["nth"])
    if holder["file"] not in outcome.after:
        return before, None
    new = outcome.after[holder["file"]].split("\n")
    return before, _read(new[lines[holder["file"]][at] :], motion["file"], holder["nth"])


def _off(motion, target, nominal, true):
    """How far from the intended pose the true robot's tool stands, in mm and degrees."""
    if motion["kind"] == "joints":
        meant, stands = nominal.stand(motion["axes_deg"]), true.stand(target.numbers)
    else:
        tool = pose_of_quaternion(motion["tool_mm"])
        meant, stands = pose_of_quaternion(motion["pose_mm"]), true.stand(_axes(motion, target, nominal)) @ tool
    return float(np.linalg.norm((stands - meant)[:3, 3])), angle_deg(stands, meant)


def _axes(motion, target, nominal):
    """Where the controller's axes come to at a pose, in the shape that the truth knows."""
    pose = pose_of_quaternion(target.numbers) if len(target.numbers) == 7 else pose_of_angles(target.numbers)
    tool, base = pose_of_quaternion(motion["tool_mm"]), pose_of_quaternion(motion["base_mm"])
    return nominal.axes_at(base @ pose @ np.linalg.inv(tool), motion["near_axes_deg"])


def _wrong_shape(motion, before, after, nominal):
    """What a target says of status, turn or confdata, where that was right before and is not now."""
    if motion["kind"] == "joints" or after is None or not after.shape:
        return ""
    said = _krl_shape if len(after.numbers) == 6 else _rapid_shape
    if before.shape != said(_axes(motion, before, nominal)):
        return ""
    now = said(_axes(motion, after, nominal))
    return "" if after.shape == now else f"shape {after.shape}, not {now}"


def _krl_shape(axes_deg):
    """Status and turn, for arms in front of the robot with the elbow up."""
    return 2 + 4 * bool(axes_deg[4] < 0), sum(1 << i for i in range(6) if axes_deg[i] < 0)


def _rapid_shape(axes_deg):
    """Confdata: quarters of axes 1, 4 and 6, and the sign of axis 5, for arms in front of the robot."""
    return *(int(axes_deg[i] // 90) for i in (0, 3, 5)), int(axes_deg[4] < 0)


def _read(lines, file, nth):
    """The target whose text begins in the first line, of which it is the one with the number ``nth``, from 0."""
    text = "\n".join(lines[:12])
    if file.lower().endswith(".src"):
        return _read_krl(re.findall(r"\{([^{}]*)\}", text)[nth])
    if file.lower().endswith(".ls"):
        held = dict(re.findall(rf"\b(J[1-6]|[XYZWPR])\s*=\s*({NUMBER})", re.search(r"\{(.*?)\};", text, re.S)[1]))
        return Target(tuple(float(held[k]) for k in ("J1 J2 J3 J4 J5 J6" if "J1" in held else "X Y Z R P W").split()))
    text = re.sub(r"!.*", "", text)
    group = r"\[([^\[\]]*)\]"
    found = list(re.finditer(rf"\[\s*{group}\s*,\s*{group}\s*(?:,\s*{group}\s*,\s*{group}\s*)?\]", text))[nth]
    numbers = tuple(float(x) for x in found[1].split(","))
    if len(numbers) == 6:
        return Target(numbers)
    shape = tuple(int(float(x)) for x in found[3].split(","))
    return Target(numbers + tuple(float(x) for x in found[2].split(",")), shape)


def _read_krl(text):
    held = {k.upper(): v for k, v in re.findall(rf"\b([A-Za-z]+\d?)\s+('B[01]+'|{NUMBER})", text)}
    keys = ["A1", "A2", "A3", "A4", "A5", "A6"] if "A1" in held else list("XYZABC")
    bits = [int(held[k][2:-1], 2) if held[k].startswith("'") else int(held[k]) for k in "ST" if k in held]
    return Target(tuple(float(held[k]) for k in keys), tuple(bits))


def _pairs(old, new):
    """For each line of the old text that is there still, whatever its numbers: its place in the new one."""
    first, second = ([re.sub(rf"{NUMBER}|\s", "", line) for line in text.split("\n")] for text in (old, new))
    blocks = difflib.SequenceMatcher(None, first, second, autojunk=False).get_matching_blocks()
    return {block.a + k: block.b + k for block in blocks for k in range(block.size)}


def _text(path: Path):
    return path.read_text(encoding="utf-8", errors="surrogateescape").replace("\r\n", "\n")
