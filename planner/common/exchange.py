"""Files take the place of others all together, or none does.

What stands there is moved aside first, so that a file which another program has open is met before anything is lost
(Windows neither moves nor replaces such a file). A failure undoes every move.
"""

import errno
import filecmp
import os
import platform
import re
import secrets
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from planner.common.errors import InputError
from planner.common.system import is_open_elsewhere, swap_folders

DRAFT = ".edbb-"  # how the name of everything begins that is there only while files are written
if sys.platform == "win32":  # in a folder that may not be written it would try two thousand million names
    tempfile.TMP_MAX = 20  # type: ignore[misc]


def draft_prefix() -> str:
    """Return how the name of a draft begins: by it a later command knows whether its writer still lives."""
    host = re.sub(r"\W+", "_", platform.node())[:40]
    return f"{DRAFT}{host}-{os.getpid()}-"


def check_place(folder: Path) -> None:
    """Write a file in a folder, and remove it.

    Raises:
        OSError: the folder may not be written.
    """
    trial = folder / f"{draft_prefix()}{secrets.token_hex(8)}"
    trial.touch(exist_ok=False)
    remove(trial)


def short_path(path: Path) -> str:
    """Return a path for a message, its middle left out where it is very long."""
    text = str(path)
    return text if len(text) <= 300 else f"{text[:150]}…{text[-100:]}"


def writing_error(path: Path, err: Exception) -> InputError:
    """Return the error of a file that cannot be written, or is open in another program."""
    because = getattr(err, "strerror", None) or err
    if isinstance(err, OSError) and is_open_elsewhere(err):
        return InputError(
            f"{short_path(path)}: another program has it open ({because}), so it was not replaced; "
            "close it there and run the command again"
        )
    return InputError(f"{short_path(path)}: cannot be written ({because})")


class NotPutBackError(InputError):
    """A failure could not be undone; the message says where the files lie."""


class _Moves:
    """Moves of files that can be undone."""

    def __init__(self) -> None:
        self._done: list[tuple[Path, Path]] = []
        self._made: list[Path] = []

    def make_folder(self, folder: Path) -> None:
        """Make a folder, and those above it."""
        missing = [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        self._made += missing[::-1]

    def move(self, source: Path, target: Path, named: Path) -> None:
        """Move a file; ``named`` is the one that a failure names.

        Raises:
            InputError: it cannot be moved.
        """
        try:
            if named.is_dir() and not named.is_symlink():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            self.make_folder(target.parent)
            os.replace(source, target)
        except OSError as err:
            raise writing_error(named, err) from err
        self._done.append((source, target))

    def undo(self) -> None:
        """Bring everything back, the last move first.

        Raises:
            NotPutBackError: a file can be neither moved nor copied back.
        """
        lost = [(source, target) for source, target in reversed(self._done) if not put_back(target, source)]
        for folder in reversed(self._made):
            with suppress(OSError):
                folder.rmdir()
        if lost:
            said = "; ".join(f"what was {short_path(path)} is now {short_path(aside)}" for path, aside in lost)
            raise NotPutBackError(f"the files could not be exchanged, and not all be put back: {said}")


def _trials() -> Iterator[None]:
    """Wait longer before each trial, a second in all: a scanner looks into a file just after it was moved."""
    for wait in (0.0, 0.05, 0.2, 0.75):  # [s]
        time.sleep(wait)
        yield


def remove(path: Path) -> None:
    """Remove a draft, or a folder of them, if the system lets it go within a second."""
    for _ in _trials():
        with suppress(OSError):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
            return
        for part in (path, *path.rglob("*")):  # Windows removes no file that is read-only
            with suppress(OSError):
                if not part.is_symlink():  # what it leads to is no part of the draft
                    os.chmod(part, 0o700)


def put_back(aside: Path, target: Path) -> bool:
    """Move back what was moved aside, or copy it where it cannot be moved; return whether it is there again."""
    for _ in _trials():
        try:
            os.replace(aside, target)
            return True
        except OSError:
            continue
    with suppress(OSError):
        if aside.is_dir():
            shutil.copytree(aside, target, symlinks=True, dirs_exist_ok=True)
        else:
            shutil.copy2(aside, target, follow_symlinks=False)
        return True
    return False


@contextmanager
def _aside_folder(parent: Path) -> Iterator[Path]:
    """A folder for what is moved aside; it goes at the end, unless something in it could not be put back."""
    folder = Path(tempfile.mkdtemp(prefix=draft_prefix(), dir=parent))
    try:
        yield folder
    except NotPutBackError:
        raise
    except BaseException:
        remove(folder)
        raise
    remove(folder)


def place_files(drafts: Sequence[tuple[Path, Path]], aside: Path, stale: Sequence[Path] = ()) -> None:
    """Let drafts take the names of files; the first is the one that tells a person, or a program, that all are there.

    It is moved aside first and takes its name last, so it never stands beside files of another writing. What is there
    already, byte for byte, stays as it is.

    Args:
        drafts: draft and name of each file.
        aside: folder on the same disk, for what is moved aside.
        stale: files that go.

    Raises:
        InputError: one of the files is open in another program, or cannot be written; all are as they were.
    """
    changed = [(draft, path) for draft, path in drafts[1:] if not _is_same(draft, path)]
    if changed or stale or not _is_same(*drafts[0]):
        changed.insert(0, drafts[0])
    moves = _Moves()
    try:
        for k, path in enumerate((*(path for _, path in changed), *stale)):
            if os.path.lexists(path):
                moves.move(path, aside / str(k), path)
        for draft, path in reversed(changed):
            moves.move(draft, path, path)
    except BaseException:
        moves.undo()
        raise


def replace_together(drafts: Sequence[tuple[Path, Path]]) -> None:
    """Let drafts beside them take the names of files, as :func:`place_files`; one alone does so in one step.

    Raises:
        InputError: as :func:`place_files`.
    """
    if len(drafts) > 1:
        with _aside_folder(drafts[0][1].parent) as aside:
            place_files(drafts, aside)
        return
    for draft, path in drafts:
        try:
            os.replace(draft, path)
        except OSError as err:
            raise writing_error(path, err) from err


def _is_same(draft: Path, path: Path) -> bool:
    try:
        return not path.is_symlink() and path.is_file() and filecmp.cmp(draft, path, shallow=False)
    except OSError:
        return False


def files_in(folder: Path) -> list[str]:
    """Return the files of a folder and of those in it, by their names from there; drafts do not count."""
    names = (Path(root, name).relative_to(folder) for root, _, names in os.walk(folder) for name in names)
    return sorted(name.as_posix() for name in names if not name.parts[0].startswith(DRAFT))


def exchange_folders(draft: Path, folder: Path, first: str) -> None:
    """Let a draft take the place of a folder: in one step where the system can, else file by file or not at all.

    What was there is left in the draft, or is gone.

    Args:
        draft: the new folder, beside the old one.
        folder: the old one, if there is one.
        first: name of the file that tells that all are there.

    Raises:
        InputError: a file is open in another program, or cannot be written; all are as they were.
        OSError: the folder cannot be made.
    """
    if not folder.exists():
        os.rename(draft, folder)
        return
    os.chmod(draft, folder.stat().st_mode & 0o777)
    if swap_folders(draft, folder):
        return
    aside = draft.with_name("old")
    try:
        os.rename(folder, aside)
    except OSError as err:  # a disk is mounted there, or, on Windows, another program has a file of it open
        if err.errno not in (errno.EBUSY, errno.EXDEV, errno.EACCES, errno.EPERM):
            raise
        _exchange_files(draft, folder, first)
        return
    try:
        os.rename(draft, folder)
    except BaseException:
        put_back(aside, folder)
        raise


def _exchange_files(draft: Path, folder: Path, first: str) -> None:
    """Exchange file by file, within the folder: a disk of its own may be mounted there."""
    names = sorted(files_in(draft), key=lambda name: name != first)
    stale = [folder / name for name in sorted(set(files_in(folder)) - set(names))]
    with _aside_folder(folder) as aside:
        for name in names:
            (aside / "new" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(draft / name, aside / "new" / name, follow_symlinks=False)
        place_files([(aside / "new" / name, folder / name) for name in names], aside / "old", stale)
    for parent in {p for path in stale for p in path.parents if p.is_relative_to(folder) and p != folder}:
        with suppress(OSError):
            parent.rmdir()
