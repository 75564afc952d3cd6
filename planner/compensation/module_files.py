"""Files that are one program: halves and applications as the dialects say, and the RAPID modules that share targets."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

from planner.common.errors import InputError
from planner.compensation.program_text import read_program
from planner.programs.dialect import dialects, load_dialect
from planner.programs.languages.statements import mask_comments

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
