"""Tables of targets: ``q1_deg`` … ``qN_deg``, or poses (``x_mm`` … ``c_deg``) with joint angles to start from.

Poses of a table against the joint angles beside them: place, orientation, and its convention.
"""

import re
from collections.abc import Sequence

import numpy as np

from planner.common.errors import InputError
from planner.common.remarks import CELL_ENDS, remark_of
from planner.common.text_table import decimal_sign, separator_of, with_point
from planner.common.units import DEG, MM, Array, read_only, to_deg
from planner.compensation.correction import NominalFlange
from planner.compensation.few_axes import FULL_AXES
from planner.compensation.orientation_conventions import agreeing_conventions, turn_of_tool, turns_between
from planner.compensation.rotations import frame, inverse, pose_matrix, to_euler
from planner.compensation.targets import CartesianTarget, Target, TargetReading
from planner.compensation.tolerances import CONVENTION_OFF, START_OFF, START_TURN
from planner.kinematics.angle_units import DEGREES, NOTE, find_small
from planner.kinematics.robot import Robot
from planner.programs.languages.statements import EXPONENT_NUMBER, Lines, Slot

PoseRow = tuple[int, tuple[Slot, ...], CartesianTarget]
"""Line, places of the numbers, and the pose of a row."""
_NAME_FRAMES = "name its tool and its base (--tool, --base; six zeros where it is the flange in the robot's own frame)"


def take_poses(rows: Sequence[PoseRow], spelling: str, reading: TargetReading) -> None:
    """Note the poses of a table; those that contradict the joint angles beside them are left, with the reason.

    Raises:
        InputError: the orientations are written in another convention than the columns say, which is named.
    """
    poses = [pose for _, _, pose in rows]
    T_BT, T_FT = np.array([p.T_BT for p in poses]), np.array([p.T_FT for p in poses])
    flange = frame(*NominalFlange(reading.robot).flange(np.array([p.start for p in poses])))
    T_wanted = inverse(np.array([p.T_WB for p in poses])) @ flange @ T_FT
    off = np.linalg.norm(T_BT[:, :3, 3] - T_wanted[:, :3, 3], axis=1)
    turn = turns_between(T_BT[:, :3, :3], T_wanted[:, :3, :3])
    _refuse_other_convention(rows, spelling, reading, turn, T_wanted[:, :3, :3])
    named = reading.frames.T_FT is not None or reading.frames.T_WB is not None
    turns_count = reading.robot.n_joints >= FULL_AXES  # others do not have every turn
    for (number, slots, pose), far, turned in zip(rows, off, turn, strict=True):
        if far > START_OFF and not named:
            said = f"the pose is {far / MM:.0f} mm from where the arm stands at its joint angles"
            reading.leave(number, f"{said}: {_NAME_FRAMES}")
        elif turned > START_TURN and turns_count and not named:
            said = f"the pose is turned by {turned / DEG:.0f}° from the tool at its joint angles"
            reading.leave(number, f"{said}: is it A, B, C (Z-Y'-X\") or qw, qx, qy, qz? else {_NAME_FRAMES}")
        else:
            reading.add(Target(number, slots, pose=pose))
    if named:
        _doubt_frames([number for number, _, _ in rows], off, turn * turns_count, reading)


def _doubt_frames(lines: Sequence[int], off: Array, turn: Array, reading: TargetReading) -> None:
    """Note where the tool and base that are named bring poses away from the joint angles beside them."""
    far = np.flatnonzero((off > START_OFF) | (turn > START_TURN))
    if far.size:
        reading.notes.append(
            (
                lines[int(far[0])],
                f"by this tool and base {far.size} of {len(lines)} poses are up to {off.max() / MM:.0f} mm and "
                f"{turn.max() / DEG:.0f}° from where the arm stands at the joint angles next to them: are "
                "they right (mm and degrees), and are the angles those of these poses?",
            )
        )


def _refuse_other_convention(
    rows: Sequence[PoseRow], spelling: str, reading: TargetReading, turn: Array, R_wanted: Array
) -> None:
    """Refuse a table whose orientations agree with its joint angles in another convention alone.

    Raises:
        InputError: naming the convention, or the tool by which all rows agree.
    """
    if turn.max() < CONVENTION_OFF:
        return
    count, most = int((turn >= CONVENTION_OFF).sum()), turn.max() / DEG
    said = (
        f"{reading.name}: the orientation of {count} of {len(rows)} poses contradicts the joint angles beside it, by "
        f"{most:.0f}° at most"
    )
    words = np.array([pose.words for _, _, pose in rows])
    if found := agreeing_conventions(words, R_wanted):
        more = "".join(f", and as {other.name}" for other in found[1:3])
        written = "A, B, C (Z-Y'-X\", moving axes)" if spelling == "ZYX" else "quaternions w, x, y, z"
        agree = f"the columns say {written}; read as {found[0].name}{more} all agree"
        raise InputError(f"{said}: {agree}; {found[0].cure}")
    R_FT = turn_of_tool(np.array([pose.T_BT[:3, :3] for _, _, pose in rows]), R_wanted)
    if R_FT is not None:
        T_FT = rows[0][2].T_FT
        numbers = [*T_FT[:3, 3] / MM, *to_euler((T_FT[:3, :3] @ R_FT)[None], np.zeros((1, 3)), "ZYX")[0] / DEG]
        tool = ",".join(f"{v + 0.0:.4g}" for v in numbers)
        raise InputError(
            f"{said}. All agree with a tool that is turned: --tool={tool} (mm and degrees), if it is that one"
        )


# factors to SI; a slide counts as its joint does: a millimetre as a degree
_UNITS = {"deg": DEG, "rad": 1.0, "mm": MM, "m": 1.0, "": 1.0, "travel_mm": DEG, "travel_m": 1e3 * DEG}
POSES_OF_TOOL = (
    "no tool is named: by the joint angles beside them these are poses of the measured tool point, which robot.toml has"
)
Column = tuple[int, str]  # index, unit
_BESIDE = re.compile(  # columns that change nothing of what a target means
    r"q\d+_(deg|rad|mm|m)|(x|y|z|r[xyz]|[abc])_?(mm|m|deg|rad)|q[wxyz]_?|kind|pose|role|name|id|no|nr|number|index|label"
    r"|point|target|text|comment|remark|note|description|(speed|velocity|acceleration|blend|zone|duration|seconds|time|t)"
    r"(_\w+)?",
    re.IGNORECASE,
)
_RELATIVE = re.compile(r"rel(ative)?|inc(r|remental)?|delta", re.IGNORECASE)  # what a cell says of a row


def read(text: str, reading: TargetReading) -> None:
    """Note every row of the table; comment lines (``#``) and other columns are kept as they are.

    Raises:
        InputError: the header has no complete set of target columns; angles in radians are called degrees.
    """
    separator, groups, said = ",", None, False
    for number, start, line in Lines.of(text):
        remark = remark_of(line)
        if not line.strip("\ufeff \t") or remark is not None:
            said |= remark is not None and re.fullmatch(f"{NOTE}: *{DEGREES}", remark.rstrip(CELL_ENDS)) is not None
            continue
        if groups is None:
            separator = separator_of(line)
            header = [name.strip("\ufeff \t\"'") for name in line.split(separator)]
            groups = _TargetColumns(header, reading)
            groups.decimal = decimal_sign(text[start + len(line) :], separator)
        else:
            _row(number, start, line, separator, groups, reading)
    if groups is not None and not said:
        _check_unit(groups, reading)
    if groups is not None and groups.poses:
        take_poses(groups.poses, groups.spelling, reading)


def _check_unit(groups: "_TargetColumns", reading: TargetReading) -> None:
    """Refuse joint angles in degrees that look like radians, one row of them too: a corrected one is driven.

    Raises:
        InputError: none lies beyond a turn in radians, and they are not all zero.
    """
    joints = [k for k, (_, unit) in enumerate(groups.joints) if unit == "deg"]
    beside = [*(t.q for t in reading.take_targets()), *(pose.start for _, _, pose in groups.poses)]
    q = np.array([angles[joints] for angles in beside if angles is not None])
    small = find_small(to_deg(q))
    if small is not None and small.largest > 0.0:
        columns, cure = f"q{joints[0] + 1}_deg …", f"q{joints[0] + 1}_rad"
        raise InputError(f"{reading.name}: {small.refusal(columns, cure)}")


class _TargetColumns:
    """Which columns hold what."""

    def __init__(self, header: list[str], reading: TargetReading) -> None:
        where = f"{reading.name}:1"
        twice = {name for name in header if header.count(name) > 1}
        if twice:
            raise InputError(f"{where}: the column '{min(twice)}' stands twice")
        self.count = len(header)
        self.decimal = "."
        self.poses: list[PoseRow] = []
        n = reading.robot.n_joints
        self.joints = _joint_columns(header, reading.robot)
        position = _group(header, ["x", "y", "z"], "mm|m")
        angles = _group(header, ["a", "b", "c"], "deg|rad")
        quaternion = _group(header, ["qw", "qx", "qy", "qz"], "")
        beside = [name for name in header if re.fullmatch(r"(x|y|z|r[xyz]|[abc])_(mm|m|deg|rad)", name)]
        if beside and not (position and (angles or quaternion)):
            said = f"{', '.join(beside)} stay as they are: joint angles are corrected, no complete pose is beside them"
            reading.notes.append((1, said))
        self.pose = position + (angles or quaternion) if position and (angles or quaternion) else []
        self.spelling = "ZYX" if angles else "quaternion"
        self.others = [k for k, name in enumerate(header) if name and not _BESIDE.fullmatch(name)]
        if self.others:
            names = ", ".join(header[k] for k in self.others)
            said = (
                f"of the column{'s' * (len(self.others) > 1)} {names} nothing is taken in: where one says another tool "
                "or base, that a row is relative, or an axis that carries robot or part, correct those rows apart"
            )
            reading.notes.append((1, said))
        extra = [name for name in header if re.fullmatch(r"q\d+_(deg|rad|mm|m)", name)]
        if not self.joints or len(extra) != n:
            raise InputError(
                f"{where}: found the columns {', '.join(header)}. A table of targets for {reading.robot.title} has "
                f"{_describe_columns(reading.robot)}. For poses also x_mm, y_mm, z_mm and a_deg, b_deg, c_deg "
                "(Z-Y'-X\" angles) or qw, qx, qy, qz: the joint angles then being where the search starts"
            )


def _joint_columns(header: list[str], robot: Robot) -> list[Column]:
    """Return the columns of all joints, or none; of a joint that slides they are lengths."""
    found: list[Column] = []
    for i, slides in enumerate(robot.slides.tolist(), start=1):
        own = _group(header, [f"q{i}"], "mm|m" if slides else "deg|rad")
        if not own:
            return []
        found += [(k, f"travel_{unit}" if slides else unit) for k, unit in own]
    return found


def _describe_columns(robot: Robot) -> str:
    """Return the names of the columns of a robot's joints."""
    if robot.slides.any():
        return ", ".join(robot.joint_columns("q"))
    return f"q1_deg … q{robot.n_joints}_deg (or _rad)"


def _group(header: list[str], names: list[str], units: str) -> list[Column]:
    """Return the columns of ``names``, all of them or none."""
    found: list[Column] = []
    for name in names:
        match = [(k, m[1] or "") for k, h in enumerate(header) if (m := re.fullmatch(rf"{name}_?({units})", h))]
        if len(match) != 1:
            return []
        found += match
    return found


def _split_cells(line: str, separator: str) -> list[str]:
    """Return the cells as they are written; a separator in quotes is text."""
    cells: list[list[str]] = []
    within = False
    for piece in line.split(separator):
        if within:
            cells[-1].append(piece)
        else:
            cells.append([piece])
        within ^= piece.count('"') % 2 == 1
    return [separator.join(pieces) for pieces in cells]


def _row(number: int, start: int, line: str, separator: str, columns: _TargetColumns, reading: TargetReading) -> None:
    cells = _split_cells(line, separator)
    if len(cells) != columns.count:
        reading.refuse(number, f"{len(cells)} cells found, the header has {columns.count}")
        return
    if not any(cells[k].strip() for k, _ in columns.pose + columns.joints):
        return  # a row of another kind: a wait, a mark
    if relative := [cells[k].strip() for k in columns.others if _RELATIVE.fullmatch(cells[k].strip('" '))]:
        reading.refuse(number, f"'{relative[0]}' found: relative rows are not known here, angles of the axes are")
        return
    places = np.cumsum([start, *(len(c) + 1 for c in cells)])
    slots, values = [], []
    for k, unit in columns.pose + columns.joints:
        match = re.fullmatch(rf"(\s*\"?)({EXPONENT_NUMBER})(\"?\s*)", with_point(cells[k], columns.decimal))
        if match is None:
            sign = "a point" if columns.decimal == "." else "a comma, as this table's others have it,"
            reading.refuse(number, f"'{cells[k].strip()}' found in column {k + 1}; a number with {sign} is allowed")
            return
        place = int(places[k]) + len(match[1])
        slots.append(Slot(place, place + len(match[2]), _UNITS[unit], _decimals(unit), decimal=columns.decimal))
        values.append(float(match[2]) * _UNITS[unit])
    numbers = np.array(values)
    if not columns.pose:
        reading.add(Target(number, tuple(slots), q=read_only(numbers)))
        return
    words, q = numbers[3 : len(columns.pose)], numbers[len(columns.pose) :]
    if columns.spelling == "quaternion" and abs(np.linalg.norm(words) - 1.0) > 1e-3:
        reading.refuse(number, f"the quaternion has the length {np.linalg.norm(words):.4f}; 1 is allowed")
        return
    frames = _frames(number, numbers[:3], q, reading)
    pose = CartesianTarget(
        pose_matrix(numbers[:3], words), columns.spelling, read_only(words), *frames, start=read_only(q)
    )
    columns.poses.append((number, tuple(slots), pose))


def _frames(number: int, p_BT: Array, q: Array, reading: TargetReading) -> tuple[Array, Array]:
    """Return base and tool of a pose: those the person named, else the robot's own frame and the flange.

    Where no tool is named and the joint angles beside the pose bring the measured tool point nearer to it than the
    flange, it is a pose of that point.
    """
    T_WB, T_FT, p_FM = reading.frames.T_WB, reading.frames.T_FT, reading.frames.p_FM
    base = np.eye(4) if T_WB is None else T_WB
    if T_FT is not None or p_FM is None:
        return base, np.eye(4) if T_FT is None else T_FT
    p_WT = base[:3, :3] @ p_BT + base[:3, 3]
    p, R = NominalFlange(reading.robot).flange(q[None])
    if np.linalg.norm(p[0] + R[0] @ p_FM - p_WT) >= np.linalg.norm(p[0] - p_WT):
        return base, np.eye(4)
    if not any(said == POSES_OF_TOOL for _, said in reading.notes):
        reading.notes.append((number, POSES_OF_TOOL))
    T = np.eye(4)
    T[:3, 3] = p_FM
    return base, T


def _decimals(unit: str) -> int:
    """Return the decimals with which a number of a unit is written: a hundredth of a micrometre, a millionth of 1°."""
    return {"deg": 6, "rad": 8, "mm": 5, "m": 8, "": 9, "travel_mm": 6, "travel_m": 9}[unit]
