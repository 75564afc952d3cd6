"""``edbb compensate``: corrected targets from the calibrated robot and the nominal one that it was calibrated from."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from datetime import date as Day
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.cell.reading import load_cell
from planner.common.calls import called_with
from planner.common.content_hashes import HandEdit
from planner.common.determinism import on_one_thread
from planner.common.errors import InputError, NoSolutionError
from planner.common.files import check_writing, encode_text, is_folder, is_new_folder, write_together
from planner.common.numbers import parse_number
from planner.common.result import Result
from planner.common.schema import read_json
from planner.common.summary import Summary
from planner.common.units import Array, from_deg, from_mm, read_only
from planner.compensation.compensated_file import CompensatedFile
from planner.compensation.compensated_program import compensate_program
from planner.compensation.correction_mark import CorrectionMark
from planner.compensation.few_axes import TurnWeights
from planner.compensation.languages import halves, output_paths
from planner.compensation.program_error import ProgramError, program_error, uncorrected_errors
from planner.compensation.program_text import read_program
from planner.compensation.rotations import frame, from_abc
from planner.compensation.targets import ToolAndBase
from planner.compensation.tool_notes import tool_warnings
from planner.documents.calibrated_robot import CalibratedRobot
from planner.documents.expected_error import NAME as EXPECTED_ERROR
from planner.documents.expected_error import ExpectedError
from planner.documents.zeros_set import set_zeros
from planner.kinematics.robot import Robot
from planner.kinematics.robot_hash import robot_hash
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.model.identification_document import Identification
from planner.workflow.compensate_call import CompensateCall

if TYPE_CHECKING:
    from planner.workflow.identification import CalibrationResult


@dataclass(frozen=True)
class CompensationResult(Result):
    """A corrected file, and the others of its program.

    Attributes:
        file: the text and what was done.
        others: the other files of the same program, corrected along with it.
        expected: how good the robot is expected to be at its targets, or why that is not known.
        left_out: which effects of the robot targets cannot be corrected for.
        warnings: what a person should know of the tools that were named, or that the program says.
        simulated: whether nobody measured the robot that it is corrected for.
        model_edits: what a person changed in the model since edbb wrote it.

    Example:
        >>> compensate("program.src", model="calibrated").write("corrected.src")  # doctest: +SKIP
    """

    file: CompensatedFile
    expected: ProgramError | str
    left_out: str | None = None
    simulated: bool = False
    warnings: tuple[str, ...] = ()
    others: tuple[CompensatedFile, ...] = ()
    model_edits: tuple[HandEdit, ...] = ()

    @property
    def partly(self) -> bool:
        """Whether targets or moves of the program were left as they were."""
        return any(f.partly for f in (self.file, *self.others))

    @property
    def hand_edits(self) -> tuple[HandEdit, ...]:
        """Return what a person changed in the model."""
        return self.model_edits

    def overview(self) -> Summary:
        """Return the overview: corrections, expected errors, and every line to look at."""
        known = self.expected
        expected = [("tool error", f"unknown: {known}")] if isinstance(known, str) else known.facts
        done = [f.report.overview(f.name) for f in (self.file, *self.others)]
        left = () if self.left_out is None else (self.left_out,)
        facts = [*expected, *done[0].facts]
        details = [*done[0].details, *([] if isinstance(known, str) else known.details)]
        for other in done[1:]:
            facts += [("and", other.title), *other.facts]
            details += other.details
        return Summary(done[0].title, facts, details, (*(n for d in done for n in d.notes), *left, *self.warnings))

    def content(self) -> Mapping[str, Any]:
        """Return the corrections and the corrected text."""
        return {
            **_content_of(self.file),
            "summary": self.overview().text(),
            "expected_error": None if isinstance(self.expected, str) else self.expected.content(),
            "other_files": [_content_of(file) for file in self.others],
        }

    def paths(self, output: Path | str) -> list[Path]:
        """Return where the files of the program are written: in a folder, or beside the path of the named one.

        Raises:
            InputError: they cannot be told apart there.
        """
        return output_paths(Path(output), is_folder(output), [f.name for f in (self.file, *self.others)])

    def check(self, output: Path | str, force: bool = False) -> None:
        """Refuse what :meth:`write` would refuse, before anything is written; raises as that does."""
        for path, data in self._files(output):
            check_writing(path, data, force)

    def write(self, folder: Path | str, force: bool = False) -> list[Path]:
        """Write the corrected files, all or none, each in the encoding in which it was read; return their paths.

        Args:
            folder: a folder (there already, or with a slash at its end), or the path of the file that was named.
            force: over files of others too.

        Raises:
            InputError: a file cannot be written, or is not to be written over.
        """
        files = self._files(folder)
        if is_new_folder(folder):
            files[0][0].parent.mkdir(parents=True, exist_ok=True)
        write_together(sorted(files, key=lambda file: file[0].suffix.lower() == ".dat"), force=force)
        return [path for path, _ in files]

    def _files(self, output: Path | str) -> list[tuple[Path, bytes]]:
        done = (self.file, *self.others)
        return [(p, encode_text(p, f.text, f.encoding)) for p, f in zip(self.paths(output), done, strict=True)]

    def next_step(self, folder: Path | str) -> str:
        """Say what a person does next with what is written at a path.

        A program that is corrected in part is not driven: it would go to corrected targets and to others.
        """
        paths = self.paths(folder)
        names = " and ".join(map(str, paths))
        if self.partly:
            return (
                f"see to the lines that were left as they were: with {names} the robot drives to targets of both kinds"
            )
        step = self.file.step.format(file=names)
        renamed = [p for p, f in zip(paths, (self.file, *self.others), strict=True) if p.stem != Path(f.name).stem]
        if self.others and renamed and paths[0].suffix.lower() in halves():
            step += f"; the controller wants both under the name of the module, {Path(self.file.name).stem}"
        return step


def _content_of(file: CompensatedFile) -> dict[str, Any]:
    """Return the machine-readable form of one corrected file."""
    report = file.report
    return {
        "file": file.name,
        "corrected_lines": list(report.corrected),
        "left_lines": [{"line": line, "because": why} for line, why in report.kept],
        "few_axes": None if report.turns_left is None else report.turns_left.content(),
        "text": file.text,
    }


@called_with(CompensateCall)
@on_one_thread
def compensate(asked: CompensateCall) -> CompensationResult:
    """Correct the targets of a file so that the calibrated robot stands where the nominal one should.

    Tool and base are x, y, z in mm and A, B, C (Z-Y'-X") in degrees, of poses that do not say them. The model's tool is
    the measured tool point of the robot's file, turned as the flange is. Points that were taught with the accuracy
    model of the controller (KUKA's status bit 4) are corrected only where a cell says that it is off. The date in the
    mark is by default that of ``SOURCE_DATE_EPOCH``, or of the model's file. For zeros that were set in the controller
    by as much as this identification stated, programs are not corrected once more.

    Raises:
        InputError: the model is not calibrated, the controller already corrects it, or the file is not understood, was
            corrected before, or belongs to a measuring plan.
        NoSolutionError: no target has a fake target near the nominal one, most are out of the robot's reach, or the
            corrected robot is expected to be worse than the nominal one.

    Example:
        >>> compensate("program.src", model="calibrated").write("corrected.src")  # doctest: +SKIP
    """
    found = _find_model(asked.model, asked.force, asked.despite_change)
    robot, known, mark = found.robot, found.known, found.mark
    if asked.date is not None:
        mark = replace(mark, day=_day(asked.date))
    if asked.zeros_set:
        robot, known = set_zeros(robot, known, asked.zeros_set)
        mark = replace(mark, zeros=tuple(asked.zeros_set))
    uncorrected = asked.cell is not None and _check_controller(asked.cell, robot.name)
    calibrated = CalibratedRobot(robot)
    data = "" if asked.frames is None else read_program(Path(asked.frames))[0]
    own = robot.tool_points[0].p_FM if len(robot.tool_points) == 1 else None
    T_FT = _tool_of_model(robot) if asked.tool == MODEL_TOOL else _frame("--tool", asked.tool)
    given = ToolAndBase(T_FT, _frame("--base", asked.base), data, uncorrected, own)
    files = compensate_program(
        Path(asked.targets),
        robot.nominal_robot,
        calibrated,
        dialect=asked.dialect,
        frames=given,
        strict=asked.strict,
        mark=mark,
        again=asked.again,
        measuring=asked.measuring,
        axes_of=asked.axes_of,
        turn_weights=_turn_weights(asked.turn_weights),
    )
    named = None if given.T_FT is None else given.T_FT[:3, 3]
    warnings = tuple(tool_warnings(robot, named, [t for f in files for t in (*f.targets, *f.left)]))
    expected = _expect(files, known, named)
    return CompensationResult(
        files[0], expected, calibrated.sentence, bool(mark.simulated), warnings, files[1:], mark.hand_edits
    )


MODEL_TOOL = "model"  # word that stands for the tool point of the robot's file


def _tool_of_model(robot: Robot) -> Array:
    """Return the measured tool point of a calibrated robot as a tool, turned as the flange is, (4, 4) [m].

    Raises:
        InputError: its file has no such point, or several.
    """
    points = robot.tool_points
    if len(points) != 1:
        said = f"several tool points ({', '.join(p.name for p in points)})" if points else "no [[tool_points]]"
        raise InputError(f"--tool {MODEL_TOOL}: {robot.path} has {said}; name the tool: --tool X,Y,Z,A,B,C")
    T = np.eye(4)
    T[:3, 3] = points[0].p_FM
    return read_only(T)


@dataclass(frozen=True)
class _Model:
    """A calibrated robot, what is known of its errors or why nothing is, and what is said of it in corrected files."""

    robot: Robot
    known: ExpectedError | str
    mark: CorrectionMark


def _find_model(model: "CalibrationResult | Path | str", force: bool, despite_change: bool) -> _Model:
    """Read the calibrated robot from its file, from the folder that holds it, or from an identification in memory.

    ``force``: one of which its identification says not to use it, and one of unknown error, too. Only a server knows
    ``despite_change``, and takes the word away.
    """
    if despite_change:
        raise InputError("--despite-change: only a server (edbb --server URL) knows of failed checks; leave it out")
    if isinstance(model, Path | str):
        return _read_model(_model_file(Path(model).absolute(), str(model)), force)
    with TemporaryDirectory() as folder:
        model.write_robot(Path(folder))
        found = _read_model(Path(folder) / "robot.toml", force)
    return replace(found, mark=replace(found.mark, simulated=model.simulated, day=_build_day()))


def _model_file(path: Path, said: str) -> Path:
    """Return the ``robot.toml`` that is meant by a path, which was ``said`` to be the model.

    Raises:
        InputError: there is none; or the name of a shipped robot was said.
    """
    wanted = "give the robot.toml that 'edbb identify' wrote, or its folder"
    if not path.exists() and said in list_robots():
        raise InputError(
            f"--model {said}: a shipped robot is the nominal one and not calibrated, so that nothing is known to "
            f"correct by; {wanted}"
        )
    file = path / "robot.toml" if path.is_dir() else path
    if not file.is_file():
        if (beside := file.parent / "identification.json").is_file():
            Identification.read_usable(beside)
        raise InputError(f"--model {said}: no file {file} found; {wanted}")
    return file


def _read_model(path: Path, force: bool) -> _Model:
    robot = load_robot(str(path), force=force)
    if robot.nominal_robot is robot:
        raise InputError(
            f"{path}: is no calibrated robot, it has neither [nominal] values nor [[effects]]; "
            "give the robot.toml that 'edbb identify' wrote"
        )
    known = ExpectedError.read(robot, path)
    if isinstance(known, str) and (path.parent / EXPECTED_ERROR).is_file() and not force:
        raise InputError(
            f"{path.parent / EXPECTED_ERROR}: {known}; without it nobody knows whether the correction does more harm "
            "than good, and --force corrects all the same"
        )
    day = _build_day() or datetime.fromtimestamp(robot.path.stat().st_mtime, UTC).date()
    mark = CorrectionMark(robot_hash(robot), _is_simulated(robot), day, hand_edits=robot.hand_edits)
    return _Model(robot, known, mark)


def _is_simulated(robot: Robot) -> bool | None:
    """Tell whether a calibrated robot, or the identification beside it, says that nobody measured it.

    ``None``: neither tells. Any identification of that name tells, of whatever version.
    """
    beside = robot.path.parent / "identification.json"
    content = read_json(beside) if beside.is_file() else None
    said = content.get("simulated") is True if isinstance(content, dict) else None
    return said if robot.simulated is None else robot.simulated or bool(said)


def _day(said: str) -> Day:
    try:
        return Day.fromisoformat(said)
    except ValueError as err:
        raise InputError(f"--date {said}: a day such as 2026-03-31 is allowed") from err


def _build_day() -> Day | None:
    """Return the day of ``SOURCE_DATE_EPOCH``, by which a build says the date of everything that it makes.

    Raises:
        InputError: it is no number of seconds since 1970.
    """
    said = os.environ.get("SOURCE_DATE_EPOCH")
    if not said:
        return None
    try:
        return datetime.fromtimestamp(int(said), UTC).date()
    except (ValueError, OverflowError, OSError) as err:
        raise InputError(f"SOURCE_DATE_EPOCH = '{said}': a number of seconds since 1970 is allowed") from err


def _expect(files: Sequence[CompensatedFile], known: ExpectedError | str, p_FM: Array | None) -> ProgramError | str:
    """Return the expected errors at the corrected targets of all files.

    Raises:
        NoSolutionError: the corrected robot is expected to be worse than it is.
    """
    if isinstance(known, str):
        return known
    targets, left = [t for f in files for t in f.targets], [t for f in files for t in f.left]
    found = program_error(known, targets, np.concatenate([f.q for f in files]), p_FM)
    if found.is_worse:
        raise NoSolutionError(f"{files[0].name}: {found.refusal}")
    return replace(found, left=uncorrected_errors(known, left, np.concatenate([f.q_left for f in files]), p_FM))


def _check_controller(reference: str, robot: str) -> bool:
    """Return whether the cell itself says that the controller's accuracy model is off."""
    cell = load_cell(reference, planning=False)
    if cell.robot.name != robot:
        raise InputError(f"{cell.path}: has the robot '{cell.robot.name}', but the model is of '{robot}'")
    if cell.controller.accuracy_model == "on":
        raise InputError(
            f"{cell.path}: controller.accuracy_model = 'on': the controller already corrects the robot, and "
            "compensation would do it twice; switch it off, measure again with it off, and compensate then"
        )
    return "accuracy_model" in cell.controller.model_fields_set


def _turn_weights(text: str | None) -> TurnWeights:
    """Return the weights of tilt and spin of a tool from the text ``AXIS,TURN``."""
    if text is None:
        return TurnWeights()
    try:
        axis, spin = (parse_number(word) for word in text.split(","))
    except ValueError:
        axis = spin = -1.0
    if not (np.isfinite([axis, spin]).all() and min(axis, spin) >= 0.0):
        raise InputError(f"--turn-weights '{text}': two numbers that are not negative are needed, such as 1,0.3")
    return TurnWeights(axis, spin)


def _frame(option: str, text: str | None) -> Array | None:
    """Return the transform (4, 4) [m] of ``x,y,z,a,b,c`` in mm and degrees."""
    if text is None:
        return None
    try:
        numbers = np.array([parse_number(word) for word in text.split(",")])
    except ValueError:
        numbers = np.empty(0)
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(f"{option} = '{text}': six numbers x,y,z,A,B,C are needed, in mm and degrees (Z-Y'-X\")")
    return read_only(frame(from_mm(numbers[None, :3]), from_abc(from_deg(numbers[None, 3:])))[0])
