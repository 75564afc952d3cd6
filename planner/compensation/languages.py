"""Which language a file is in, by its suffix or by what it says; who reads it; and how it says what was left in it.

Files that are one program: halves and applications as the dialects say, and the RAPID modules that share targets.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import numpy as np

import planner.compensation.formats as formats
import planner.compensation.formats.csv as csv
from planner.common.errors import InputError, did_you_mean
from planner.common.remarks import CELL_ENDS, remark_of
from planner.common.units import Array
from planner.compensation.nominal_angles import UNREACHED
from planner.compensation.program_text import read_program
from planner.compensation.targets import Note, Target, TargetReading, line_ranges
from planner.compensation.tolerances import OVER_LIMIT
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import list_robots
from planner.programs.controller_axes import missing_pulses
from planner.programs.dialect import CommentStyle, Dialect, dialect_names, dialects, load_dialect, plain_text
from planner.programs.languages.declared import DeclaredExecution
from planner.programs.languages.statements import Lines, mask_comments
from planner.programs.verification import EXECUTIONS

TABLE = "csv"  # stands for a table of targets among the names of dialects
_RAPID_SUFFIXES = (".mod", ".modx", ".sys", ".prg")
_DATA = r"^[ \t]*+{}(?:TASK\s+)?(?:CONST|PERS|VAR)\s+(?:robtarget|jointtarget)\s+(\w+)"
_DECLARED = re.compile(_DATA.format(r"(?:LOCAL\s+)?"), re.IGNORECASE | re.MULTILINE)
_SHARED = re.compile(_DATA.format(""), re.IGNORECASE | re.MULTILINE)  # seen by other modules

_WORD = re.compile(r"[A-Za-z]\w*")


@cache
def halves() -> dict[str, str]:
    """Return the suffixes of files that are one program with one of the same name, each with the other's."""
    pairs = (d.extensions for d in dialects() if d.files.together == "stem")
    return {a: b for one, other in pairs for a, b in ((one, other), (other, one))}


def are_one_program(language: str) -> bool:
    """Tell whether files of a language say together what the program does, ``csv`` being none."""
    return language != TABLE and load_dialect(language).files.together != ""


def files_together(path: Path, language: str, text: str) -> dict[Path, str]:
    """Return the other files of the program that a file belongs to, in its folder, each with its text.

    Args:
        path: of the file.
        language: name of its dialect, or ``csv``.
        text: its content.

    Raises:
        InputError: it is not certain which files these are.
    """
    dialect = None if language == TABLE else load_dialect(language)
    if dialect is None or dialect.reading.family == "rapid":
        return {} if dialect is None else _rapid_modules(path, text)
    if dialect.files.together == "folder":
        return {p: read_program(p)[0] for p in _beside(path) if p.suffix.lower() in dialect.extensions}
    return _other_half(path) if dialect.files.together else {}


def _beside(path: Path) -> list[Path]:
    return [p for p in sorted(path.parent.iterdir()) if p.is_file() and not p.samefile(path)]


def other_program_files(path: Path) -> list[Path]:
    """Return the other files of the program of a file whose suffix says its language; see :func:`files_together`."""
    suffix = path.suffix.lower()
    known = (d.name for d in dialects() if suffix in d.extensions and d.files.together)
    language = "rapid" if suffix in _RAPID_SUFFIXES else next(known, TABLE)
    return [] if language == TABLE else list(files_together(path, language, read_program(path)[0]))


def _other_half(path: Path) -> dict[Path, str]:
    """Return the other half of a KRL module; a controller does not tell capitals from small letters."""
    wanted = path.stem + halves().get(path.suffix.lower(), "")
    beside = [p for p in sorted(path.parent.iterdir()) if p.name.casefold() == wanted.casefold() and p.is_file()]
    found = [p for p in beside if p.stem == path.stem] or beside
    if path.suffix.lower() not in halves() or not found:
        return {}
    if len(found) > 1:
        names = " and ".join(p.name for p in found)
        raise InputError(f"{path}: its other half may be {names}, which a controller does not tell apart; leave one")
    return {found[0]: read_program(found[0])[0]}


def global_targets(text: str) -> set[str]:
    """Return the names, in small letters, of the targets of a RAPID module that other modules can drive to."""
    return _names(_SHARED, _code(text))


def _code(text: str) -> str:
    return mask_comments(text, r"![^\r\n]*")


def _names(pattern: re.Pattern[str], code: str) -> set[str]:
    return {name.lower() for name in pattern.findall(code)}


def _rapid_modules(path: Path, text: str) -> dict[Path, str]:
    """Return the modules in the folder that share targets with one, or with one of these."""
    texts = {path: text} | dict(_readable(path))
    codes = {p: _code(t) for p, t in texts.items()}
    shared = {p: _names(_SHARED, code) for p, code in codes.items()}
    needed = {p: _names(_WORD, code) - _names(_DECLARED, code) for p, code in codes.items()}
    group = [path]
    for member in group:
        group += [p for p in texts if p not in group and (needed[member] & shared[p] or needed[p] & shared[member])]
    for member in group:
        for name in sorted(needed[member]):
            if len(holders := [p.name for p in group if name in shared[p]]) > 1:
                names = " and ".join(sorted(holders))
                raise InputError(
                    f"{path}: {name} is declared in {names}, and {member.name} uses it; lay the modules of one program "
                    "into a folder of their own"
                )
    return {p: texts[p] for p in group[1:]}


def _readable(path: Path) -> Iterator[tuple[Path, str]]:
    """Yield the other RAPID modules of the folder of a file that are text, with their texts."""
    for other in sorted(path.parent.iterdir()):
        if other.suffix.lower() in _RAPID_SUFFIXES and other.is_file() and not other.samefile(path):
            try:
                yield other, read_program(other)[0]
            except InputError:
                continue


def output_paths(output: Path, is_folder: bool, names: Sequence[str]) -> list[Path]:
    """Return where the corrected files of one program are written, the first of which is the one that was named.

    Args:
        output: a folder, in which all keep their names; or the first file, whose name the other half of a KRL module
            takes too, and beside which other modules keep theirs.
        is_folder: which of the two.
        names: of the files.

    Raises:
        InputError: the files would get the same name, or a suffix of another half.
    """
    if is_folder:
        return [output / name for name in names]
    first, paths = Path(names[0]), [output]
    for name in map(Path, names[1:]):
        is_half = halves().get(first.suffix.lower()) == name.suffix.lower()
        if is_half and output.suffix.lower() != first.suffix.lower():
            raise InputError(
                f"{output}: {first} and {name} are written together; name a folder, or a file that ends in "
                f"{first.suffix}"
            )
        paths.append(output.with_suffix(name.suffix) if is_half else output.parent / name)
    if len({str(p).casefold() for p in paths}) < len(paths):
        raise InputError(f"{output}: {' and '.join(names)} are written together; name a folder")
    return paths


TABLE_CONTENT = r"^[^\n]*\bq1_(deg|rad)\b"
Reader = Callable[[str, Dialect, TargetReading], None]


@cache
def _reader_of(family: str) -> Reader | None:
    """Return what reads the targets of a family of languages, or None where nothing does: a module of ``formats``."""
    own = {m.name for m in iter_modules(formats.__path__)}
    name = "declared" if issubclass(EXECUTIONS[family], DeclaredExecution) else family
    reader: Reader | None = import_module(f"{formats.__name__}.{name}").read if name in own else None
    return reader


def corrected_dialects() -> tuple[Dialect, ...]:
    """Return the dialects whose programs are corrected."""
    return tuple(d for d in dialects() if _reader_of(d.reading.family) is not None)


def corrected_languages() -> str:
    """Return what is corrected, for a sentence: ``KRL, RAPID and tables (CSV)``."""
    return f"{', '.join(sorted({d.language for d in corrected_dialects()}))} and tables (CSV)"


def detect_dialect(path: Path, text: str) -> str:
    """Return the name of the dialect of a file, or ``csv``.

    Raises:
        InputError: neither suffix nor content tells, or X Y Z may be a place as well as joint angles.
    """
    suffix = path.suffix.lower()
    read = corrected_dialects()
    known = {end.lower(): d.name for d in read for end in (*d.extensions, *d.reading.suffixes)} | {".csv": TABLE}
    if suffix in known:
        _check_axis_words(path, text, known[suffix])
        return known[suffix]
    for name, pattern in (*((d.name, d.reading.content) for d in read), (TABLE, TABLE_CONTENT)):
        if pattern and re.search(pattern, text, re.IGNORECASE | re.MULTILINE):
            return name
    raise InputError(
        f"{path}: neither the suffix '{suffix}' nor the content tells the language; suffixes that do: "
        f"{', '.join(sorted(known))}; or name the dialect (csv, {', '.join(dialect_names())})"
    )


def _check_axis_words(path: Path, text: str, name: str) -> None:
    """Refuse words that are joint angles on one machine and a place on another, unless the planner wrote the file.

    Raises:
        InputError: nobody has said which of the two they are.
    """
    if (
        name == TABLE
        or "X" not in load_dialect(name).axes
        or _OWN_HEAD.search("\n".join(text.splitlines()[:HEAD_LINES]))
    ):
        return
    axes = " ".join(load_dialect(name).axes)
    raise InputError(
        f"{path}: {axes} are joint angles only on a machine whose INI says KINEMATICS = trivkins; elsewhere they are a "
        f"place, and the program does not say which: name the dialect (--dialect {name}) if they are joint angles; "
        "places are not corrected in this language"
    )


def _comment_style(name: str) -> CommentStyle:
    """Return how a remark is written in a dialect, or in a table."""
    if name == TABLE:
        return CommentStyle(start="# ")
    dialect = load_dialect(name)
    return dialect.reading.remark or dialect.comment


def read_targets(name: str, text: str, reading: TargetReading) -> None:
    """Note the targets of ``text`` in the dialect ``name`` (or ``csv``).

    Raises:
        InputError: no such dialect, or it has no words for so many joints.
    """
    if name == TABLE:
        csv.read(text, reading)
        return
    if name not in dialect_names():
        known = dialect_names()
        raise InputError(f"no dialect '{name}'{did_you_mean(name, known)} (known: {TABLE}, {', '.join(known)})")
    dialect, n = load_dialect(name), reading.robot.n_joints
    read = _reader_of(dialect.reading.family)
    if read is None:
        raise InputError(f"{reading.name}: {name} is a list of a session's moves; give the targets as a table (csv)")
    if dialect.max_joints < n:
        raise InputError(f"{reading.name}: {name} has words for {dialect.max_joints} axes, the robot has {n}")
    if dialect.pulses and not reading.pulses_per_deg:
        raise InputError(f"{reading.name}: {missing_pulses(reading.robot.title, name)}")
    reading.axes = dialect.axes[:n]
    read(text, dialect, reading)


_SPELLED = str.maketrans({"µ": "u", "°": " deg", "…": "...", "−": "-"})


def add_head(
    text: str, dialect: str, robot: str, corrected: Sequence[int], left: Sequence[Note], said: Sequence[str] = ()
) -> str:
    """Return ``text`` with a comment: what is ``said``, and where lines were left those that were corrected, and why.

    Lines are as counted in the text that is returned; with nothing said and nothing left it is ``text`` itself.
    """
    style = _comment_style(dialect)
    first = "(?!)" if dialect == TABLE else load_dialect(dialect).reading.before_head
    at, before = _place(text, re.compile(first, re.IGNORECASE))
    shift, head = -1, [""] * 0
    while shift != len(head):  # the head's own length moves the lines
        shift = len(head)
        head = [
            f"{style.start}{row}{style.end}"
            for sentence in (*said, *([*_sentences(robot, corrected, left, before, shift)] * bool(left)))
            for row in style.wrap(plain_text(sentence.translate(_SPELLED), style))
        ]
    if not head:
        return text
    end = "\r\n" if "\r\n" in text else "\n"
    gap = end if at and not text[:at].endswith(("\n", "\r")) else ""
    return text[:at] + gap + "".join(row + end for row in head) + text[at:]


def _sentences(robot: str, corrected: Sequence[int], left: Sequence[Note], before: int, shift: int) -> Iterator[str]:
    most_reasons = 20  # that are told; the lines are all told

    def lines(numbers: Sequence[int]) -> str:
        """Return the ranges of line numbers as they are once the head stands in the file."""
        return line_ranges(n + shift if n > before else n for n in numbers)

    yield f"Compensated in part for {robot}. Lines are counted in this file."
    yield f"Corrected lines: {lines(corrected) or 'none'}."
    reasons: dict[str, list[int]] = {}
    for line, why in left:
        here = re.sub(r"\bline (\d++)(?! of (?:the other|module))", lambda m: f"line {lines([int(m[1])])}", why)
        reasons.setdefault(_shorten(here), []).append(line)
    for count, (why, where) in enumerate(reasons.items(), start=1):
        if count > most_reasons:
            rest = [n for group in list(reasons.values())[most_reasons:] for n in group]
            yield f"Left as they were for other reasons: {lines(rest)}."
            break
        yield f"Left as written, lines {lines(where)}: {why}."


def _shorten(text: str) -> str:
    """Return a reason in 160 letters at most, cut between two words."""
    said = " ".join(text.split())
    return said if len(said) <= 160 else f"{said[:157].rpartition(' ')[0]} ..."


_LINE_END = re.compile(r"\r\n|\n|\r|")


def _place(text: str, behind: re.Pattern[str]) -> tuple[int, int]:
    """Return where the head goes, and how many lines stand before it."""
    place = (1, 0) if text.startswith("\ufeff") else (0, 0)
    for line, start, said in Lines.of(text):
        found = behind.match(said.lstrip("\ufeff"))
        if not found:
            if said.strip():
                break
            continue
        end = start + len(said)
        end += len(_LINE_END.match(text, end)[0])  # type: ignore[index]
        place = end, line
        if found.groupdict().get("last"):
            break
    return place


HEAD_LINES = 60  # in which a program says what it is
_OWN_HEAD = re.compile(r"^[ \t]*\([ \t]*plan_id:", re.MULTILINE)  # of a program that this planner wrote
_OWN = re.compile(r"\brobot:\s*(?P<name>[^\r\n)]*)")
_MODEL = re.compile(r"\b(?:KR[ _-]?\d{1,4}(?:[ _-]?R\d{3,4})?|IRB[ _-]?\d{3,5}|NJ[ _-]?\d{2,3}|UR\d{1,2}e?)(?!\w)")


def foreign_robot_notes(name: str, language: str, text: str, robot: Robot) -> Iterator[Note]:
    """Yield the lines of the head that name another robot.

    Raises:
        InputError: a table, or a program of this planner, says that it is for another robot; or a program names
            another one of the shipped robots.
    """
    own = language == TABLE or "plan_id:" in text
    for line, _, said in list(Lines.of(text))[:HEAD_LINES]:
        match = _OWN.search(said if language != TABLE else (remark_of(said) or ""))
        if match and not _is_name_of(match["name"], robot):
            if own or match["name"].strip() in list_robots():
                raise InputError(
                    f"{name}:{line}: the {'table' if language == TABLE else 'program'} is for the robot "
                    f"'{match['name'].strip(CELL_ENDS)}', the model is of '{robot.title}' ({robot.name})"
                )
            yield line, f"'{match[0].strip()}' is said here, the model is of {robot.title}: is it another robot's?"
        for model in _MODEL.findall(said):
            if not _is_name_of(model, robot):
                yield line, f"{model} is named here, the model is of {robot.title}: is it a program of another robot?"


def _is_name_of(said: str, robot: Robot) -> bool:
    """Return whether ``said`` is the robot's name, or a part of it that ends where a number ends."""
    short = re.sub(r"[^A-Z0-9]", "", said.upper())
    names = (re.sub(r"[^A-Z0-9]", "", name.upper()) for name in (robot.name, robot.title))
    return bool(short) and any(re.search(rf"{short}(?!\d)", name) for name in names)


def check_reach(name: str, robot: Robot, targets: Sequence[Target], q: Array, problems: Sequence[Note]) -> str:
    """Return a warning if the nominal robot does not reach most targets of a file; else nothing."""
    lines = {line for line, why in problems if UNREACHED in why or "are allowed" in why}
    for target, angles in zip(targets, q, strict=True):
        if target.q is not None and (np.maximum(robot.q_lower - angles, angles - robot.q_upper) > OVER_LIMIT).any():
            lines.add(target.line)
    if len(lines) < 2 or 2 * len(lines) <= len({t.line for t in targets}):
        return ""
    return (
        f"{name}: {len(lines)} of {len({t.line for t in targets})} targets are out of reach of {robot.title}: is it a "
        "program of another robot, or are tool and base not the program's own (--tool, --base, --frames)?"
    )
