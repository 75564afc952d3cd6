"""Files appear whole or not at all, and the data folders robots and g-code are found here."""

import json
import os
import platform
import re
import tempfile
from contextlib import suppress
from pathlib import Path

from planner.common.errors import InputError
from planner.common.reading import INPUTS


class Overwriting:
    """Whether a command may write over what somebody else has written; ``--force`` allows it."""

    def __init__(self) -> None:
        self.allowed = False


OVERWRITING = Overwriting()


def draft_prefix() -> str:
    """Return how the name of a draft begins: by it a later command knows whether its writer still lives."""
    host = re.sub(r"\W+", "_", platform.node())[:40]
    return f".edbb-{host}-{os.getpid()}-"


def short_path(path: Path) -> str:
    """Return a path for a message, its middle left out where it is very long."""
    text = str(path)
    return text if len(text) <= 300 else f"{text[:150]}…{text[-100:]}"


def write_text(path: Path, text: str, encoding: str = "utf-8", own: bool = False) -> None:
    """Write ``text`` to ``path`` as it is (line ends are kept), replacing what was there in one step.

    Raises:
        InputError: the folder does not exist, or may not be written, or the text does not fit ``encoding``.
    """
    try:
        data = text.encode(encoding)
    except UnicodeEncodeError as err:
        raise InputError(f"{path}: the character {text[err.start]!r} does not exist in {encoding}") from err
    write_bytes(path, data, own)


def document_text(content: object) -> str:
    """Return the text of a JSON file as all are written: one space for each level, letters as they are."""
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def write_bytes(path: Path, data: bytes, own: bool = False) -> None:
    """Write ``data`` to ``path``; a failure leaves the old file, or none, and no temporary file.

    A link is followed, a device is written to. ``own``: the file is the caller's, whatever it holds.

    Raises:
        InputError: the folder does not exist, or may not be written; this command has read the file, or somebody else
            has written it, and overwriting was not asked for.
    """
    try:
        path = path.resolve()
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_bytes(data)
            return
        if not own:
            _check_overwriting(path, data)
        handle, name = tempfile.mkstemp(prefix=draft_prefix(), dir=path.parent)
    except (OSError, RuntimeError, ValueError) as err:
        raise _unwritable(path, err) from err
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(name, _file_mode(path))
        os.replace(name, path)
    except OSError as err:
        Path(name).unlink(missing_ok=True)
        raise _unwritable(path, err) from err
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def check_writing(path: Path, data: bytes = b"") -> None:
    """Refuse a file that :func:`write_bytes` would refuse, before anything is changed; ``data``: what is to be written.

    Raises:
        InputError: this command has read it, or somebody else has written it, or it is the name of no file.
    """
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # a name that no file can have
        if path.is_file():
            _check_overwriting(path.resolve(), data)
    except (OSError, ValueError) as err:
        raise _unwritable(path, err) from err


def _unwritable(path: Path, err: Exception) -> InputError:
    return InputError(f"{short_path(path)}: cannot be written ({getattr(err, 'strerror', None) or err})")


OWN_MARKS = (b"plan_id", b"edbb")  # one of them stands at the head of every single file that is written
HEAD_BYTES = 4096


def _check_overwriting(path: Path, data: bytes) -> None:
    """Refuse to write over what was read, or what neither is the same nor bears a mark of this tool."""
    if INPUTS.holds(path):
        raise InputError(f"{path}: this command has read it and does not write over it; name another file with -o")
    if not INPUTS.watching or OVERWRITING.allowed or not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if head and not data.startswith(head) and not any(mark in head for mark in OWN_MARKS):
        raise InputError(f"{path}: is there already, and was not written by edbb; name another file, or add --force")


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
