"""One file in, the same file with corrected targets out."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError, NoSolutionError
from planner.common.reading import read_bytes
from planner.common.units import DEG, Array
from planner.compensation.arm_shapes import has_shapes, shape_of
from planner.compensation.correction import MOVE_LIMIT, Correction, NominalPoser, Poser, correct_joints
from planner.compensation.languages import detect_dialect, read_targets
from planner.compensation.nominal_angles import solve_nominal_angles
from planner.compensation.report import (
    CompensationReport,
    large_joint_motions,
    near_singular_angles,
    report_of,
    summary,
)
from planner.compensation.rotations import frame, inverse, to_abc, to_quaternion
from planner.compensation.targets import Note, Target, TargetReading, ToolAndBase, list_lines
from planner.kinematics.robot import Robot
from planner.programs.languages.text import Slot, write_values

NO_FRAMES = ToolAndBase()


@dataclass(frozen=True)
class CompensatedFile:
    """The corrected text, in the encoding in which it was read, and the report."""

    name: str
    text: str
    encoding: str
    report: CompensationReport

    @property
    def summary(self) -> str:
        """What was done, for the person at the screen."""
        return summary(self.name, self.report)


def compensate_file(
    path: Path,
    nominal: Robot,
    calibrated: Poser,
    *,
    dialect: str | None = None,
    frames: ToolAndBase = NO_FRAMES,
    keep_unsolved: bool = False,
) -> CompensatedFile:
    """Replace every target in a file by its fake target; the text between the numbers stays byte for byte.

    Args:
        path: targets (CSV) or a robot program (KRL, RAPID, PDL2, G-code of the shipped dialects).
        nominal: the robot that the controller believes in.
        calibrated: the robot as it is.
        dialect: name of the dialect, or ``csv``, where suffix and content do not tell.
        frames: tool and base of Cartesian targets that the file does not say.
        keep_unsolved: leave targets without a correction as they are, and list them, instead of failing.

    Raises:
        InputError: the file cannot be read, or lines of it are not understood (each is named).
        NoSolutionError: targets cannot be corrected (each line is named, with the reason).
    """
    text, encoding = _read(path)
    targets, notes = _targets(path, text, nominal, dialect, frames)
    q, problems = solve_nominal_angles(nominal, targets)
    done = np.flatnonzero(~np.isnan(q).any(axis=1))
    good = np.zeros(0, dtype=bool)
    if done.size:
        correction = correct_joints(nominal, NominalPoser(nominal), calibrated, q[done])
        problems += _problems([targets[i].line for i in done], nominal, correction)
        good = correction.good
    if not good.any() or (problems and not keep_unsolved):
        raise NoSolutionError(
            "\n".join([_summary(path, problems, targets, keep_unsolved), *list_lines(path.name, problems)])
        )
    done, q_new = done[good], correction.q[good]
    chosen = [targets[i] for i in done]
    text = write_values(text, _values(nominal, chosen, q[done], q_new))
    again, _ = _targets(path, text, nominal, dialect, frames)
    report = report_of(nominal, calibrated, chosen, [again[i] for i in done], q[done], q_new)
    notes += [
        *large_joint_motions(nominal, chosen, q[done], q_new),
        *near_singular_angles(chosen, [again[i] for i in done]),
    ]
    report = replace(report, notes=tuple(notes), kept=tuple(sorted(problems)))
    return CompensatedFile(path.name, text, encoding, report)


def _read(path: Path) -> tuple[str, str]:
    """Return the text and the encoding that gives the same bytes back."""
    data = read_bytes(path)
    if b"\0" in data:
        raise InputError(f"{path}: holds zero bytes and is no text; UTF-8 and Latin-1 are allowed")
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "latin-1"


def _targets(
    path: Path, text: str, nominal: Robot, dialect: str | None, frames: ToolAndBase
) -> tuple[list[Target], list[Note]]:
    reading = TargetReading(path.name, nominal, frames)
    read_targets(dialect or detect_dialect(path, text), text, reading)
    if not has_shapes(nominal):
        for t in reading.targets:
            if t.pose is not None and t.pose.start is None:
                reading.refuse(
                    t.line,
                    f"a pose without joint angles found; {nominal.title} has no spherical wrist, so joint targets are "
                    "allowed, or a table of poses with joint angles to start from",
                )
    reading.check()
    if not reading.targets:
        raise InputError(f"{path}: holds no target that could be compensated{_why_none(reading)}")
    return reading.targets, reading.notes


def _why_none(reading: TargetReading) -> str:
    return "".join(f"; line {line}: {sentence}" for line, sentence in reading.notes[:3])


def _problems(lines: list[int], nominal: Robot, c: Correction) -> list[Note]:
    """Say of every target that cannot be used why."""
    problems = []
    for k in np.flatnonzero(~c.good):
        if not c.within[k] and c.solved[k]:
            j = int(np.argmax(np.maximum(nominal.q_lower - c.q[k], c.q[k] - nominal.q_upper)))
            low, up = nominal.q_lower[j] / DEG, nominal.q_upper[j] / DEG
            why = f"joint {j + 1} would have to stand at {c.q[k, j] / DEG:.4f}°; {low:g} … {up:g}° are allowed"
        elif c.solved[k]:
            j = int(np.abs(c.moved[k]).argmax())
            why = (
                f"joint {j + 1} would have to turn by {c.moved[k, j] / DEG:.1f}°, further than {MOVE_LIMIT / DEG:g}°: "
                "the target is near a singular position"
            )
        else:
            why = (
                f"{c.residual_m[k] * 1e6:.1f} µm and {c.residual_rad[k] * 1e6:.1f} µrad are left: the arm is at a "
                "singular position or at the end of its reach"
            )
        problems.append((lines[k], why))
    return problems


def _summary(path: Path, problems: list[Note], targets: list[Target], kept: bool) -> str:
    return (
        f"{path.name}: {len(problems)} of {len(targets)} targets have no fake target near the nominal one; move them "
        "away from limits and singular positions (a wrist that is straight)"
        + ("" if kept else ", or keep them as they are (--keep-unsolved)")
    )


def _values(robot: Robot, targets: list[Target], q: Array, q_new: Array) -> list[tuple[Slot, float]]:
    """Return what is to be written where."""
    out: list[tuple[Slot, float]] = []
    at = [i for i, t in enumerate(targets) if t.pose is not None]
    for i, t in enumerate(targets):
        if t.pose is None:
            out += zip(t.slots, q_new[i].tolist(), strict=True)
    if not at:
        return out
    poses = [p for t in targets if (p := t.pose) is not None]
    T = inverse(np.array([p.T_WB for p in poses])) @ frame(*NominalPoser(robot).flange(q_new[at]))
    T = T @ np.array([p.T_FT for p in poses])
    shaped = has_shapes(robot)
    before, after = (shape_of(robot, v[at]) if shaped else np.zeros(len(at), int) for v in (q, q_new))
    for k, (i, pose) in enumerate(zip(at, poses, strict=True)):
        to_words = to_abc if pose.spelling == "abc" else to_quaternion
        numbers = [*T[k, :3, 3], *to_words(T[k : k + 1, :3, :3], pose.words[None])[0]]
        if pose.configuration is not None:
            numbers += pose.configuration.renewed(int(before[k]), int(after[k]), q[i], q_new[i])
        elif pose.start is not None:
            numbers += q_new[i].tolist()
        out += zip(targets[i].slots, [float(v) for v in numbers], strict=True)
    return out
