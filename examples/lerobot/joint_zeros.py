"""Put the joint zeros that edbb identify has found into the calibration file that LeRobot reads.

    python joint_zeros.py calibrated/identification.json OLD.json \\
        --robot calibrated/robot.toml -o arm.json --map joint_map.json

LeRobot shows (ticks − middle of the range) · 360° / 4095, where ticks = encoder − homing_offset (Feetech). A zero that
is off by so many degrees becomes another homing_offset. The range stays about its middle, the zero, and becomes
narrower by as much at both ends, so that no goal lies beyond the stop that was found by hand. The new file is written
to the servos by LeRobot as it connects: press ENTER where it asks whether to use it.

The map is for who keeps the old calibration: q_urdf = sign · q_motor + offset_deg, joint by joint, both in degrees.
Use the file or the map, not both, and not with the corrected robot.urdf: each of them holds the same zeros.
"""

import argparse
import json
import os
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

STEPS = 4095  # of a turn less one, as LeRobot counts for STS3215
MOST_OFFSET = 2047  # that a Feetech servo's register holds
FULL_TURN = (0, STEPS)  # range of a joint without stops: its middle needs no room


def read(path, parse):
    """Return what stands in a file.

    Raises:
        SystemExit: it is not there, or is of another kind.
    """
    try:
        return parse(Path(path).read_text())
    except (OSError, ValueError, ET.ParseError) as error:
        sys.exit(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})")


def read_zeros(identification, names):
    """Return what to add to the shown angle of each joint [deg], by name; joints that the run does not show have none.

    Raises:
        SystemExit: the zeros are of another controller's axes.
    """
    content = read(identification, json.loads)
    if content.get("problems"):
        sys.exit(f"{identification}: the fit failed its own checks: {content['problems'][0]}")
    of = {z.get("axes_of") for z in content["joint_zeros"]}
    if not of <= {"lerobot", None}:
        sys.exit(f"{identification}: the zeros are of the axes of {of.pop()}, not of LeRobot's")
    return {names[z["joint"] - 1]: z["zero_deg"] for z in content["joint_zeros"]}


def read_urdf_names(robot, content):
    """Return the names of the joints that are driven between base and tip, from base on, by the robot's URDF."""
    urdf = robot.parent / content["urdf"]
    joints = read(urdf, ET.fromstring).findall("joint")
    above = {joint.find("child").get("link"): joint for joint in joints}
    names, link = [], content["tip"]
    while link in above and link != content.get("base"):
        joint = above[link]
        link = joint.find("parent").get("link")
        parked = any(joint.get("name") + unit in content.get("parked", {}) for unit in ("_deg", "_mm"))
        if joint.get("type") != "fixed" and joint.find("mimic") is None and not parked:
            names.insert(0, joint.get("name"))
    return names


def read_axes(robot):
    """Return the joints' names, and sense and zero [deg] of each in LeRobot's count, by the robot's file."""
    content = read(robot, tomllib.loads)
    names = [j["name"] for j in content["joints"]] if "joints" in content else read_urdf_names(robot, content)
    own = content.get("controllers", {}).get("lerobot", {"same": True})
    if own.get("coupling"):
        sys.exit(f"{robot}: joints of LeRobot that are coupled have no map of their own")
    n = len(names)
    return names, own.get("sense", [1] * n), own.get("zero_deg", [0.0] * n)


def shift_zeros(calibration, zeros):
    """Return LeRobot's calibration with the zeros in place, and what of each zero is left by whole ticks [deg].

    Raises:
        SystemExit: a joint is not in the file, or its offset or range would not fit.
    """
    out, left = {k: dict(v) for k, v in calibration.items()}, {}
    for name, degrees in zeros.items():
        if name not in out:
            sys.exit(
                f"the calibration has no joint '{name}' (there: {', '.join(out)}): where the robot's file has other "
                "names than LeRobot, write LeRobot's, from base to tip, after --names"
            )
        motor = out[name]
        ticks = round(degrees * STEPS / 360)
        left[name] = degrees - ticks * 360 / STEPS
        motor["homing_offset"] -= ticks
        if abs(motor["homing_offset"]) > MOST_OFFSET:
            sys.exit(
                f"{name}: the homing_offset would be {motor['homing_offset']}, and a servo holds ±{MOST_OFFSET}: "
                "calibrate anew with the joint nearer to the middle of its stroke"
            )
        if (motor["range_min"], motor["range_max"]) != FULL_TURN:
            motor["range_min"] += abs(ticks)
            motor["range_max"] -= abs(ticks)
        if motor["range_min"] >= motor["range_max"]:
            sys.exit(f"{name}: a zero of {degrees:.1f} deg leaves no stroke: is it the calibration of this arm?")
    return out, left


def joint_map(names, senses, starts, zeros):
    """Return sign and offset [deg] of each joint: q_urdf = sign · q_motor + offset."""
    return {
        name: {"sign": sense, "offset_deg": round(sense * (zeros.get(name, 0.0) - start), 6) + 0.0}
        for name, sense, start in zip(names, senses, starts, strict=True)
    }


def write(path, content):
    """Write a file as a whole."""
    draft = Path(f"{path}.part")
    draft.write_text(json.dumps(content, indent=4) + "\n")
    os.replace(draft, path)


def main():
    """Read the identification and the old file, write the new one."""
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("identification", type=Path)
    given.add_argument("calibration", type=Path, help="LeRobot's file of this arm, as it was when the run was measured")
    given.add_argument("--robot", type=Path, required=True, help="robot.toml, for the joints' names and senses")
    given.add_argument("--names", nargs="+", help="of the joints in LeRobot's file, from base to tip, if others")
    given.add_argument("-o", "--output", type=Path, required=True)
    given.add_argument("--map", type=Path, help="where to write q_urdf = sign * q_motor + offset_deg")
    asked = given.parse_args()
    names, senses, starts = read_axes(asked.robot)
    if asked.names and len(asked.names) != len(names):
        sys.exit(f"--names: {len(asked.names)} names, but {asked.robot} has {len(names)} joints: {', '.join(names)}")
    names = asked.names or names
    zeros = read_zeros(asked.identification, names)
    found, left = shift_zeros(read(asked.calibration, json.loads), zeros)
    write(asked.output, found)
    for name in names:
        if name not in zeros:
            print(f"{name}: not shown by the run, left as it was")
        else:
            print(f"{name}: {zeros[name]:+.3f} deg, of which {left[name]:+.3f} is less than a tick and left")
    if asked.map:
        write(asked.map, joint_map(names, senses, starts, zeros))


if __name__ == "__main__":
    main()
