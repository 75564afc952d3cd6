"""Files appear whole or not at all, and the data folders robots and g-code are found here."""

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from planner.common.errors import InputError


def write_text(path: Path, text: str, encoding: str = "utf-8") -> None:
    """Write ``text`` to ``path`` as it is (line ends are kept), replacing what was there in one step.

    Raises:
        InputError: the folder does not exist, or may not be written, or the text does not fit ``encoding``.
    """
    try:
        data = text.encode(encoding)
    except UnicodeEncodeError as err:
        raise InputError(f"{path}: the character {text[err.start]!r} does not exist in {encoding}") from err
    write_bytes(path, data)


def document_text(content: object) -> str:
    """Return the text of a JSON file as all are written: one space for each level, letters as they are."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path``; a failure leaves the old file, or none, and no temporary file.

    Raises:
        InputError: the folder does not exist, or may not be written.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as err:
        raise InputError(f"{path}: cannot be written ({err.strerror or err})") from err
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(name, _file_mode(path))
        os.replace(name, path)
    except OSError as err:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({err.strerror or err})") from err
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _file_mode(path: Path) -> int:
    """Return the permissions that the file has, or that a newly opened one would get."""
    if path.exists():
        return path.stat().st_mode & 0o777
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask


_PACKAGE = Path(__file__).resolve().parents[1]


def data_folder(name: str) -> Path:
    """Return the packaged data folder ``name`` if it is there, else the checkout's.

    Raises:
        FileNotFoundError: the installation holds neither.
    """
    for candidate in (_PACKAGE / "_data" / name, _PACKAGE.parent / name):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the data folder '{name}' is missing from this installation")


@contextmanager
def draft_folder(folder: Path) -> Iterator[Path]:
    """A folder beside ``folder`` in which to write what is moved there once all of it is right."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".edbb-") as name:
        yield Path(name)


def move_all(draft: Path, folder: Path) -> list[Path]:
    """Move every file of ``draft`` into ``folder``, which is made where it is not there."""
    folder.mkdir(exist_ok=True)
    moved = []
    for path in sorted(p for p in draft.rglob("*") if p.is_file()):
        target = folder / path.relative_to(draft)
        target.parent.mkdir(parents=True, exist_ok=True)
        path.replace(target)
        moved.append(target)
    return moved
