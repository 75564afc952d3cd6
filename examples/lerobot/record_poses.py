"""Drive an SO-100, SO-101 or another arm of LeRobot through the files of a plan, and record its angles as a run.

    python record_poses.py /dev/ttyACM0 so101_edbb_*.csv --reading length_mm -o run.csv

Needs LeRobot on the machine at the arm, and nothing else. At each pose the arm's observations are averaged while it
rests; with ``--reading`` you are asked for what the gauge shows, and the arm holds until you have typed it.
"""

import argparse
import csv
import os
import re
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

RATE = 30.0  # [1/s] frames, as the files have them
APPROACH = 15.0  # [deg/s] of the quickest joint on the way to the first frame of a file
STILL = 1.5  # [deg] that a resting arm may be off its frame: servos sag under load, a blocked arm is further off


@dataclass
class Stretch:
    """What is driven without a stop by a person: frames, each with the number of the pose at which it rests."""

    first: list = field(default_factory=list)
    frames: list = field(default_factory=list)
    poses: list = field(default_factory=list)  # of each frame, None between poses
    fixtures: list = field(default_factory=list)


def read_stretch(path):
    """Read one file of frames; the comments beside them say what is done first, and where a pose begins."""
    out, names, pose, fixture = Stretch(), None, None, ""
    for line in Path(path).read_text().splitlines():
        if line.startswith("#"):
            text = line.lstrip("# ").strip()
            if text.startswith("FIRST:"):
                out.first.append(text.removeprefix("FIRST:").strip())
            if found := re.fullmatch(r"pose (\d+)", text):
                pose = int(found[1])
            if found := re.search(r"fixture (\S+)", text.strip("= ")):
                fixture = found[1].rstrip(",")
            continue
        cells = next(csv.reader([line]))
        if names is None:
            names = cells
            continue
        row = dict(zip(names, cells, strict=True))
        out.frames.append({k: float(v) for k, v in row.items() if k.endswith(".pos")})
        out.poses.append(pose)
        out.fixtures.append(fixture)
        if row.get("event", "").startswith("dwell"):
            pose = None  # the rest is over: what follows leads away
    return out


def drive_to(robot, goal, wait):
    """Bring the arm slowly to a frame, from where it stands."""
    now = robot.get_observation()
    far = max(abs(goal[k] - now[k]) for k in goal)
    steps = max(1, round(far / APPROACH * RATE))
    for k in range(1, steps + 1):
        robot.send_action({key: now[key] + (goal[key] - now[key]) * k / steps for key in goal})
        wait(1 / RATE)


def play(robot, stretch, wait=time.sleep, ask=None):
    """Drive a stretch; yield (pose, fixture, commanded, observed, reading) of each pose as it is left."""
    drive_to(robot, stretch.frames[0], wait)
    seen = []
    for k, (frame, pose) in enumerate(zip(stretch.frames, stretch.poses, strict=True)):
        robot.send_action(frame)
        wait(1 / RATE)
        if pose is None:
            continue
        seen.append(robot.get_observation())
        if k + 1 == len(stretch.frames) or stretch.poses[k + 1] != pose:
            late = seen[len(seen) // 3 :]  # it settles first
            mean = {key: sum(o[key] for o in late) / len(late) for key in frame}
            reading = None if ask is None else ask(pose)
            yield pose, stretch.fixtures[k], frame, mean, reading
            seen = []


def write_run(path, plan, robot, reading, rows):
    """Write the run as a whole, so that a stopped session leaves what was recorded."""
    names = list(rows[0][2])
    angles = [f"{stem}{j}_deg" for stem in ("q", "cmd") for j in range(1, len(names) + 1)]
    has_fixture = any(row[1] for row in rows)
    head = ["pose", *(["fixture"] if has_fixture else []), *angles, *([reading] if reading else [])]
    lines = ["# measure: static", f"# plan_id: {plan}", f"# robot: {robot}", ",".join(head)]
    for pose, fixture, told, seen, value in rows:
        numbers = [*(seen[n] for n in names), *(told[n] for n in names)]
        cells = [str(pose), *([fixture] if has_fixture else []), *(f"{v:.5f}" for v in numbers)]
        lines.append(",".join([*cells, *([str(value)] if reading else [])]))
    draft = Path(f"{path}.part")
    draft.write_text("\n".join(lines) + "\n")
    os.replace(draft, path)


def note(path, key):
    """Return what a comment line of a file says, such as its plan_id."""
    found = re.search(rf"^# {key}: (\S+)", Path(path).read_text(), re.MULTILINE)
    return found[1] if found else ""


def ask_number(pose, what, type_in=input):
    """Ask until a number is typed."""
    while True:
        try:
            return float(type_in(f"pose {pose}: {what} = ").replace(",", "."))
        except ValueError:
            print("a number, please")


def record(robot, files, output, reading=None, wait=time.sleep, type_in=input):
    """Play the files in order and write the run after every pose; return how many poses it has."""
    rows = []
    ask = None if reading is None else lambda pose: ask_number(pose, reading, type_in)
    for path in files:
        stretch = read_stretch(path)
        for todo in stretch.first:
            type_in(f"{todo} — then press ENTER ")
        for row in play(robot, stretch, wait, ask):
            rows.append(row)
            write_run(output, note(path, "plan_id"), note(path, "robot"), reading, rows)
            off = max(abs(row[2][k] - row[3][k]) for k in row[2])
            if off > STILL:
                print(f"pose {row[0]}: a joint stands {off:.1f} deg from its frame: is it blocked, or too weak?")
    return len(rows)


def main():
    """Connect, play, disconnect."""
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("port")
    given.add_argument("files", nargs="+", type=Path)
    given.add_argument("--id", default="arm", help="name of the arm's calibration in LeRobot")
    given.add_argument("--reading", help="column of the gauge's reading that is typed at each pose, such as length_mm")
    given.add_argument("-o", "--output", type=Path, required=True)
    asked = given.parse_args()
    try:
        from lerobot.robots.so_follower import SO101Follower, SO101FollowerConfig
    except ImportError:
        sys.exit("LeRobot is not installed here: run this in its environment (pip install 'lerobot[feetech]')")
    arm = SO101Follower(SO101FollowerConfig(port=asked.port, id=asked.id, use_degrees=True))
    arm.connect()
    try:
        print(f"{record(arm, sorted(asked.files), asked.output, asked.reading)} poses in {asked.output}")
    finally:
        arm.disconnect()


if __name__ == "__main__":
    main()
