"""One file in, the same file with corrected targets out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from planner.common.errors import InputError, NoSolutionError
from planner.common.units import Array
from planner.compensation.arm_shapes import has_shapes, shape_margins
from planner.compensation.correction import ALL_TURNS, FlangeModel, NominalFlange, correct_joints
from planner.compensation.correction_mark import CorrectionMark, check_no_measuring_program, refuse_second_correction
from planner.compensation.few_axes import TurnWeights
from planner.compensation.file_axes import FlangeInAxes, axes_notes, axes_of_file, axes_statement, next_step
from planner.compensation.foreign_languages import refuse_foreign_language
from planner.compensation.languages import (
    add_head,
    are_one_program,
    check_reach,
    detect_dialect,
    files_together,
    foreign_robot_notes,
    global_targets,
    read_targets,
)
from planner.compensation.nominal_angles import (
    SearchSeeds,
    problems_summary,
    solve_nominal_angles,
    target_problems,
    turn_notes,
)
from planner.compensation.points import SENTENCE, is_service_name
from planner.compensation.program_text import read_program
from planner.compensation.report import CompensationReport, read_printed_angles, report_of
from planner.compensation.rotations import frame, inverse, to_euler, to_quaternion
from planner.compensation.targets import (
    CartesianTarget,
    CorrectedArm,
    Note,
    Target,
    TargetReading,
    ToolAndBase,
    list_lines,
)
from planner.compensation.tolerances import SAME, SHAPE_BORDER
from planner.kinematics.axes import AxisConvention
from planner.kinematics.robot import Robot
from planner.programs.languages.statements import Slot, write_values

NO_FRAMES = ToolAndBase()


@dataclass(frozen=True)
class CompensatedFile:
    """The corrected text, in the encoding in which it was read, and the report.

    ``targets`` are those that were corrected, as they were, ``q`` the nominal robot's angles there, (n, N) [rad];
    ``left`` and ``q_left`` are the same of those that the arm reaches and that were left as they are;
    ``step`` says what the person does next with ``{file}``, and for which controller its angles are;
    ``others`` are the other files of its program, which are corrected along with it.
    """

    name: str
    text: str
    encoding: str
    report: CompensationReport
    targets: tuple[Target, ...]
    q: Array
    left: tuple[Target, ...]
    q_left: Array
    step: str
    others: tuple[Path, ...] = ()

    @property
    def summary(self) -> str:
        """What was done, for the person at the screen."""
        return self.report.overview(self.name).text()

    @property
    def partly(self) -> bool:
        """Whether targets or moves of the file were left as they were."""
        return bool(self.report.kept)


@dataclass(frozen=True)
class _Source:
    """A file as it was read: name, language, text, the other half of its module, who is to drive it, and what is next.

    ``declared_together``: targets in the other files that are corrected along with it; None where there are none.
    ``robot`` and ``calibrated`` have the axes of the file's controller: their q are the angles that it counts.
    """

    name: str
    dialect: str
    text: str
    encoding: str
    companion: str
    declared_together: frozenset[str] | None
    robot: Robot
    calibrated: FlangeModel
    frames: ToolAndBase
    seeds: SearchSeeds
    axes: AxisConvention
    step: str
    turn_weights: TurnWeights

    def tools(self, targets: Sequence[Target]) -> Array:
        """Return the tools of targets in the flange, (n, 4, 4) [m]: a pose's, the named one, the measured."""
        own = np.eye(4)
        if self.frames.T_FT is not None:
            own = self.frames.T_FT
        elif self.frames.p_FM is not None:
            own[:3, 3] = self.frames.p_FM
        return np.array([own if t.pose is None else t.pose.T_FT for t in targets]).reshape(-1, 4, 4)

    def read(self, text: str) -> TargetReading:
        """Return the targets and moves that ``text`` asks of the robot.

        Raises:
            InputError: the meaning of the whole file is uncertain.
        """
        together = self.declared_together or frozenset()
        reading = TargetReading(
            self.name,
            self.robot,
            self.frames,
            self.companion,
            together,
            pulses_per_deg=self.axes.pulses_per_deg,
            p_MC=self.axes.p_MC,
        )
        read_targets(self.dialect, text, reading)
        reading.check()
        return reading


def compensate_file(
    path: Path,
    nominal: Robot,
    calibrated: FlangeModel,
    *,
    dialect: str | None = None,
    frames: ToolAndBase = NO_FRAMES,
    strict: bool = False,
    mark: CorrectionMark | None = None,
    again: bool = False,
    measuring: bool = False,
    axes_of: str | None = None,
    turn_weights: TurnWeights = ALL_TURNS,
) -> CompensatedFile:
    """Replace every target in a file by its fake target; the text between the numbers stays byte for byte.

    A comment at the head of the file bears the ``mark`` of the model. What cannot be corrected for certain is left
    exactly as it is; the report and the same comment list its lines and the reasons. The corrected text is read again
    as a file of its own: a target that does not come back as it was meant is left as it was.

    Args:
        path: targets (CSV) or a robot program in one of the languages that are corrected.
        nominal: the robot that the controller believes in.
        calibrated: the robot as it is.
        dialect: name of the dialect, or ``csv``, where suffix and content do not tell.
        frames: tool and base of Cartesian targets that the file does not say.
        strict: fail instead of leaving anything as it is.
        mark: of the model; without one the file is neither marked nor looked at for an earlier correction.
        again: correct what another model has corrected before.
        measuring: correct a measuring program, too.
        axes_of: name of the controller whose axes the angles of a table are, where its head does not say it.
        turn_weights: what tilt and spin count on an arm with fewer than six axes.

    Raises:
        InputError: the file cannot be read, the robot's file does not say how its controller counts the axes, it was
            corrected before or is a measuring program, or nothing in it can be corrected for certain (each line is
            named).
        NoSolutionError: no target has a correction, or most are out of the robot's reach.
    """
    refuse_foreign_language(path, by_suffix=dialect is None)
    text, encoding = read_program(path)
    if mark is not None:
        refuse_second_correction(path.name, text, mark, again)
        if not measuring:
            check_no_measuring_program(path.name, text)
    language = dialect or detect_dialect(path, text)
    axes = axes_of_file(path.name, language, text, nominal, axes_of)
    together = files_together(path, language, text)
    notes = [*axes_notes(language, nominal, axes), *foreign_robot_notes(path.name, language, text, nominal)]
    step = next_step(language, nominal, axes)
    nominal, calibrated = nominal.in_axes(axes), FlangeInAxes(calibrated, axes)
    seeds = SearchSeeds(nominal)
    companion, frames = _texts_together(language, together.values(), frames)
    shared = frozenset[str]().union(*map(global_targets, together.values())) if together else None
    source = _Source(
        path.name,
        language,
        text,
        encoding,
        companion,
        shared,
        nominal,
        calibrated,
        frames,
        seeds,
        axes,
        step,
        turn_weights,
    )
    if is_service_name(path.stem):
        raise InputError(f"{path}: the file {SENTENCE}")
    return replace(_correct_source(path, source, notes, strict, mark), others=tuple(together))


def _texts_together(language: str, texts: Iterable[str], frames: ToolAndBase) -> tuple[str, ToolAndBase]:
    """Return what the other files of a program say: as the other half of a KRL module, or as modules beside."""
    if are_one_program(language):
        return "\n".join(texts), frames
    return "", replace(frames, data="\n".join([frames.data, *(t for t in texts if t not in frames.data)]))


def _correct_source(
    path: Path, source: "_Source", notes: Sequence[Note], strict: bool, mark: CorrectionMark | None
) -> CompensatedFile:
    """Solve the targets for the nominal robot, correct them, write them, and read what was written; raises as above."""
    nominal, calibrated = source.robot, source.calibrated
    reading = source.read(source.text)
    targets = _certain_targets(path, reading, strict, may_be_none=source.declared_together is not None)
    q, problems = solve_nominal_angles(targets, source.seeds)
    if foreign := check_reach(path.name, nominal, targets, q, problems):
        raise NoSolutionError("\n".join([foreign, *list_lines(path.name, problems)]))
    done = np.flatnonzero(~np.isnan(q).any(axis=1))
    good, q_new = np.zeros(0, dtype=bool), q[done]
    if done.size:
        chosen = [targets[i] for i in done]
        tools = source.tools(chosen)
        correction = correct_joints(nominal, NominalFlange(nominal), calibrated, q[done], tools, source.turn_weights)
        problems += target_problems([t.line for t in chosen], nominal, correction)
        notes = (*notes, *turn_notes(nominal, chosen, q[done]))
        good, q_new = correction.usable, correction.q
    is_whole = source.declared_together is None  # not one file of several, which may hold no target of its own
    if (is_whole and not good.any()) or (problems and strict):
        said = [*problems, *reading.left]
        raise NoSolutionError("\n".join([problems_summary(path, problems, targets), *list_lines(path.name, said)]))
    written = _write(source, targets, done[good], q[done[good]], q_new[good])
    problems += written.wrong
    if (is_whole and not written.rows.size) or (written.wrong and strict):
        raise NoSolutionError("\n".join([problems_summary(path, problems, targets), *list_lines(path.name, problems)]))
    rest = np.setdiff1d(done, written.rows)
    left = _Left(tuple(targets[i] for i in rest), q[rest], (*reading.left, *problems))
    return _finish(source, written, (*notes, *reading.notes), left, mark)


@dataclass(frozen=True)
class _Left:
    """Targets that the arm reaches and that are left, its angles there, (n, N) [rad], and why what is left is."""

    targets: tuple[Target, ...]
    q: Array
    reasons: tuple[Note, ...]


@dataclass(frozen=True)
class _Written:
    """The corrected text, and the targets ``rows`` that were corrected: as they were, and as they are read again.

    ``q``, ``q_new`` and ``q_printed`` are their nominal angles, the corrected ones, and those that are read again.
    """

    text: str
    rows: np.ndarray
    chosen: list[Target]
    printed: list[Target]
    q: Array
    q_new: Array
    q_printed: Array
    wrong: list[Note]


def _write(source: _Source, targets: list[Target], rows: np.ndarray, q: Array, q_new: Array) -> _Written:
    """Write the corrected numbers, and read them again until every one of them is what was meant."""
    wrong: list[Note] = []
    while rows.size:
        chosen = [targets[i] for i in rows]
        values = _values(source.robot, chosen, q, q_new)
        new_text = write_values(source.text, [*values, *_modal_words(targets, rows)])
        printed = source.read(new_text).take_targets()
        if [t.line for t in printed] != [t.line for t in targets]:
            raise NoSolutionError(f"{source.name}: the corrected file does not read as the same targets")
        q_printed, bad = read_printed_angles(source.seeds, source.calibrated, printed, rows, q, q_new)
        if not bad:
            return _Written(new_text, rows, chosen, [printed[i] for i in rows], q, q_new, q_printed, wrong)
        wrong += [(targets[rows[k]].line, why) for k, why in bad]
        kept = np.setdiff1d(np.arange(len(rows)), [k for k, _ in bad])
        rows, q, q_new = rows[kept], q[kept], q_new[kept]
    return _Written(source.text, rows, [], [], q, q_new, q_new, wrong)


def _modal_words(targets: list[Target], rows: np.ndarray) -> list[tuple[Slot, float]]:
    """Return the angles that a target which is left takes from the block before: that block's are corrected now."""
    left = (targets[i] for i in np.setdiff1d(np.arange(len(targets)), rows))
    both = (pair for t in left if t.q is not None for pair in zip(t.slots, t.q.tolist(), strict=True))
    return [(slot, angle) for slot, angle in both if slot.start == slot.end]


def _finish(
    source: _Source, done: _Written, notes: Sequence[Note], left: _Left, mark: CorrectionMark | None
) -> CompensatedFile:
    """Measure what was done, and say at the head of the file which model did it, and what was not done."""
    tools = source.tools(done.chosen)
    report = report_of(
        source.robot, source.calibrated, done.chosen, done.printed, done.q, done.q_new, done.q_printed, tools
    )
    report = replace(report, notes=(*notes, *report.notes), kept=tuple(sorted(left.reasons)))
    said = [] if mark is None else mark.sentences(source.robot.name)
    said += axes_statement(source.name, source.dialect, source.text, source.axes)
    text = add_head(done.text, source.dialect, source.robot.name, report.corrected, report.kept, said)
    q, q_left = source.axes.to_model(done.q), source.axes.to_model(left.q)
    chosen = tuple(done.chosen)
    return CompensatedFile(source.name, text, source.encoding, report, chosen, q, left.targets, q_left, source.step)


def _certain_targets(path: Path, reading: TargetReading, strict: bool, may_be_none: bool) -> list[Target]:
    """Return the targets whose meaning is certain.

    Raises:
        InputError: there is none, though there must be; or, where all are wanted, one is left.
    """
    targets = reading.take_targets()
    if not has_shapes(reading.robot):
        for t in targets:
            if t.pose is not None and t.pose.start is None:
                reading.refuse(
                    t.line,
                    f"found a pose without joint angles. {reading.robot.title} has no spherical wrist: joint targets "
                    "are allowed, or a table of poses with joint angles to start from",
                )
        reading.check()
    if (not targets and not may_be_none) or (reading.left and strict):
        none = [] if targets else [f"{path}: holds no target that could be compensated"]
        raise InputError("\n".join([*none, *list_lines(path.name, reading.left)]))
    return targets


def _values(robot: Robot, targets: list[Target], q: Array, q_new: Array) -> list[tuple[Slot, float]]:
    """Return the new values and their places in the text."""
    out: list[tuple[Slot, float]] = []
    at = [i for i, t in enumerate(targets) if t.pose is not None]
    for i, t in enumerate(targets):
        if t.pose is None:
            out += zip(t.slots, q_new[i].tolist(), strict=True)
            out += ((slot, float(q_new[i, joint])) for joint, slot in t.ahead)
    if not at:
        return out
    poses = [p for t in targets if (p := t.pose) is not None]
    T = inverse(np.array([p.T_WB for p in poses])) @ frame(*NominalFlange(robot).flange(q_new[at]))
    T = T @ np.array([p.T_FT for p in poses])
    arms = _arms(robot, q[at], q_new[at])
    for k, (i, pose) in enumerate(zip(at, poses, strict=True)):
        numbers = [*T[k, :3, 3], *_orientation_words(T[k : k + 1, :3, :3], pose)]
        if pose.configuration is not None:
            numbers += pose.configuration.correct_numbers(arms[k])
        elif pose.start is not None:
            numbers += q_new[i].tolist()
        out += zip(targets[i].slots, [float(v) for v in numbers], strict=True)
    return out


def _orientation_words(R: Array, pose: CartesianTarget) -> Array:
    """Return the orientation (1, 3, 3) in the words of the pose that it corrects."""
    if pose.spelling == "quaternion":
        return np.asarray(to_quaternion(R, pose.words[None])[0])
    return np.asarray(to_euler(R, pose.words[None], pose.spelling)[0])


def _arms(robot: Robot, q: Array, q_new: Array) -> list[CorrectedArm]:
    """Return how the arm stands at corrected angles q_new, and how near to a border what is written still holds."""
    before, after = (shape_margins(robot, v) if has_shapes(robot) else np.zeros((len(v), 3)) for v in (q, q_new))
    q_slack, margins_slack = (
        np.where(np.abs(new - old) > SAME, SAME, SHAPE_BORDER) for old, new in ((q, q_new), (before, after))
    )
    return [CorrectedArm(*row) for row in zip(q_new, after, q_slack, margins_slack, strict=True)]
