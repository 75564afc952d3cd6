"""Where a command writes when nobody names a place: a new folder or file, named after what the command works on."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

NAMED_BY_COMMAND = re.compile(r"^(plan|simulate|measure|centre|import|identify|check|plan-check)-(?=\w)")
FILES_BY_ROLE = {"plan", "cell", "run", "robot", "identification"}  # these names say nothing: the folder's name does


def new_folder(verb: str, subject: object) -> Path:
    """Return a folder that is not there yet, named after the command and its subject."""
    return Path(_free_name(f"{verb}{_subject_name(subject)}", ""))


def new_folder_of_files(verb: str, subject: object) -> str:
    """Return the same folder as text with a slash, for commands that take a file or a folder."""
    return f"{new_folder(verb, subject)}/"


def new_file(suffix: str) -> Callable[[str, object], str]:
    """Return the function that names a file that is not there yet; ``suffix`` begins with a dot."""
    return lambda verb, subject: _free_name(f"{verb}{_subject_name(subject)}", suffix)


def file_of(suffix: str) -> Callable[[str, object], str]:
    """Return the function that names a file, there or not: a session that was begun in it goes on."""
    return lambda verb, subject: f"{verb}{_subject_name(subject)}{suffix}"


def _free_name(base: str, suffix: str) -> str:
    number = 1
    while Path(name := f"{base}{f'-{number}' if number > 1 else ''}{suffix}").exists():
        number += 1
    return name


def _subject_name(subject: Any) -> str:
    """Return ``-NAME`` of a cell, run or plan; empty if there is none. A folder named by a command loses its verb."""
    first = subject[0] if isinstance(subject, list | tuple) and subject else subject
    if not first:
        return ""
    path = Path(str(first))
    if not path.exists() and not path.suffix:  # a shipped cell: robot/cell
        named = "-".join(path.parts)
    else:
        named = path.name if path.is_dir() else path.stem
        parent = path.resolve().parent.name
        named = parent if named in FILES_BY_ROLE and parent and path.parent != Path() else named
    named = re.sub(r"[^\w.-]+", "-", named).strip("-.")
    own = NAMED_BY_COMMAND.sub("", named)
    return f"-{own[:60]}" if own else ""  # 60: letters of a name
