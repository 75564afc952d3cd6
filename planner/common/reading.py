"""The one way in: what a command reads is a plain file of a sensible size, whatever its kind."""

import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from planner.common.errors import InputError


class Inputs:
    """The files that the present command has read; nothing is kept before a command begins to watch them."""

    def __init__(self) -> None:
        self.watching = False
        self._seen: set[tuple[int, int]] = set()
        self._within: tuple[Path, ...] = ()

    def confine(self, folders: Sequence[Path]) -> None:
        """From now on let nothing outside these folders be read: the files may be a stranger's."""
        self._within = tuple(f.resolve() for f in folders)

    def allows(self, path: Path) -> bool:
        """Tell whether the file at ``path`` may be read."""
        return not self._within or any(path.resolve().is_relative_to(f) for f in self._within)

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Keep what is read while a command runs."""
        self.watching, self._seen = True, set()
        try:
            yield
        finally:
            self.watching, self._seen = False, set()

    def add(self, found: os.stat_result) -> None:
        """Note that a file was read."""
        if self.watching:
            self._seen.add((found.st_dev, found.st_ino))

    def holds(self, path: Path) -> bool:
        """Tell whether the file at ``path`` was read, by whatever name."""
        try:
            found = path.stat()
        except OSError:
            return False
        return (found.st_dev, found.st_ino) in self._seen


INPUTS = Inputs()
MOST_TEXT = 100_000_000  # bytes of a settings, plan or program file
MOST_TOML = 20_000_000


def check_readable(path: Path, most_bytes: int = MOST_TEXT, advice: str = "") -> None:
    """Refuse what is no plain file (a folder, a device, a pipe), or is larger than it can be in earnest.

    Raises:
        InputError: naming the file, its size and what is allowed.
    """
    try:
        if not INPUTS.allows(path):
            raise InputError(f"{path}: lies outside the folder of this job; send the file along and name it alone")
        found = os.stat(path)
    except (OSError, ValueError) as err:
        reason = err.strerror if isinstance(err, OSError) and err.strerror else str(err)
        raise InputError(f"{path}: cannot be read ({reason})") from err
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
        raise InputError(f"{path}: cannot be read (it is {kind}, and a file is needed)")
    if found.st_size > most_bytes:
        raise InputError(f"{path}: has {found.st_size} bytes, at most {most_bytes} are read{advice and '; '}{advice}")
    INPUTS.add(found)


def read_bytes(path: Path, most_bytes: int = MOST_TEXT, advice: str = "") -> bytes:
    """Return the content of a plain file.

    Raises:
        InputError: as :func:`check_readable`, or the file may not be read.
    """
    check_readable(path, most_bytes, advice)
    try:
        return path.read_bytes()
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err


def read_utf8(path: Path, most_bytes: int = MOST_TEXT) -> str:
    """Return the text of a plain file in UTF-8, its line ends as any program reads them, without a byte order mark.

    Raises:
        InputError: as :func:`read_bytes`, or the bytes are no UTF-8.
    """
    try:
        text = read_bytes(path, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as err:
        raise InputError(f"{path}: is no text in UTF-8 (byte {err.start})") from err
    return text.replace("\r\n", "\n").replace("\r", "\n")
