"""Files by their content, named by their SHA-256, there as a whole or not at all; and the names they were sent by.

What people call the cells that they have sent, and what they have written to them.
"""

import errno
import hashlib
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from pydantic import Field

from planner.common.errors import InputError
from planner.common.lazy_modules import psutil
from planner.common.schema import StrictModel
from planner.common.system import hold_lock, sync_folder
from planner.service.answers import StoredFile
from planner.service.database import Database

ID = re.compile(r"[0-9a-f]{64}")
FULL = (errno.ENOSPC, errno.EDQUOT)


class UnknownFileError(InputError):
    """A file that somebody names was never sent."""


class DisturbedTransferError(InputError):
    """A file came otherwise than it was sent."""


class GoneFileError(InputError):
    """A file that the store has a name for is not there."""


class DiskFullError(InputError):
    """The disk of the store has no room left."""

    def __init__(self) -> None:
        super().__init__("the disk of the service is full; nothing was kept")


class ContentDraft:
    """A file that is being received."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file, self._hash, self.size = path.open("xb"), hashlib.sha256(), 0

    def add(self, data: bytes) -> None:
        """Append bytes to the draft."""
        self._file.write(data)
        self._hash.update(data)
        self.size += len(data)

    def finish(self) -> str:
        """Bring it to the disk and return the hash of its content."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        return self._hash.hexdigest()

    def abandon(self) -> None:
        """Close the draft, whose content is given up."""
        self._file.close()


class FileStore:
    """A folder of files named by their content."""

    def __init__(self, folder: Path, reserve: int = 0) -> None:
        self.folder, self._drafts, self._reserve = folder / "files", folder / "drafts", reserve
        self.folder.mkdir(parents=True, exist_ok=True)
        self._drafts.mkdir(exist_ok=True)

    @contextmanager
    def receive(self) -> Iterator[ContentDraft]:
        """A draft to be filled; :meth:`keep` makes a file of it, and whatever else happens nothing stays.

        Raises:
            DiskFullError: there is no room.
        """
        path = self._drafts / f"{os.getpid()}-{secrets.token_hex(8)}"
        try:
            self.check_room()
            draft = ContentDraft(path)
            try:
                yield draft
            finally:
                draft.abandon()
        except OSError as err:
            raise disk_error(err) from err
        finally:
            path.unlink(missing_ok=True)

    @contextmanager
    def hold_files(self) -> Iterator[None]:
        """Hold off others that bring or remove files: what is brought is named before it may be removed.

        It must not be nested.
        """
        with hold_lock(self._drafts.parent / ".hold_files"):
            yield

    def finish(self, draft: ContentDraft, expected: str | None) -> str:
        """Bring what was received to the disk; return its hash, under which :meth:`place` puts it.

        Raises:
            DisturbedTransferError: the hash is not as ``expected``: the transfer was cut or disturbed.
        """
        found = draft.finish()
        if expected is not None and found != expected:
            raise DisturbedTransferError(f"the file came as {found[:12]}…, sent was {expected[:12]}…; send it again")
        return found

    def place(self, draft: ContentDraft, sha256: str) -> None:
        """Move a draft, already written to the disk, to its place in the store."""
        self._move(draft.path, sha256)

    def keep(self, draft: ContentDraft, expected: str | None = None) -> str:
        """Move what was received to its place; return its hash.

        Raises:
            DisturbedTransferError: the hash is not as ``expected``: the transfer was cut or disturbed.
        """
        found = self.finish(draft, expected)
        self.place(draft, found)
        return found

    def take(self, path: Path) -> tuple[str, int]:
        """Move a file of the same disk into the store; return its hash and size."""
        with path.open("rb+") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
            os.fsync(file.fileno())
        size = path.stat().st_size
        self._move(path, found)
        return found, size

    def add(self, data: bytes) -> str:
        """Keep a small file; return its hash."""
        with self.receive() as draft:
            draft.add(data)
            return self.keep(draft)

    def path(self, sha256: str) -> Path:
        """Return where the file of this hash lies, or would lie."""
        assert ID.fullmatch(sha256), sha256
        return self.folder / sha256[:2] / sha256

    def holds(self, sha256: str) -> bool:
        """Tell whether there is a file of this hash."""
        return self.path(sha256).is_file()

    def check_room(self) -> None:
        """Refuse to go on where the disk is nearly full.

        Raises:
            DiskFullError: less than the reserve is free.
        """
        if shutil.disk_usage(self.folder).free < self._reserve:
            raise DiskFullError()

    def clear_drafts(self) -> None:
        """Remove what dead processes were receiving."""
        for path in self._drafts.iterdir():
            pid = path.name.partition("-")[0]
            if pid.isdigit() and int(pid) != os.getpid() and not psutil.pid_exists(int(pid)):
                path.unlink(missing_ok=True)

    def _move(self, path: Path, sha256: str) -> None:
        target = self.path(sha256)
        if not target.parent.is_dir():
            target.parent.mkdir(exist_ok=True)
            sync_folder(self.folder)
        os.replace(path, target)
        sync_folder(target.parent)


def copy_verified_file(source: Path, sha256: str, target: Path) -> None:
    """Copy a file of the store, and check its content against its hash.

    Raises:
        GoneFileError: it is gone.
        InputError: its content has changed.
    """
    found = hashlib.sha256()
    try:
        with source.open("rb") as read, target.open("xb") as written:
            while data := read.read(1 << 20):  # bytes at a time
                found.update(data)
                written.write(data)
    except FileNotFoundError as err:
        raise GoneFileError(f"{target.name}: is not in the store any more. Send it again") from err
    if found.hexdigest() != sha256:
        raise InputError(f"{target.name}: its content in the store has changed; send it again")


def disk_error(err: OSError) -> InputError:
    """Return the message for an error of the disk."""
    if err.errno in FULL:
        return DiskFullError()
    return InputError(f"the store of the service cannot be written ({err.strerror or err})")


class UploadList:
    """The names under which files were sent."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def add(self, file: StoredFile, kind: str, person: str = "") -> None:
        """Note a file that a person has sent; the same again changes nothing."""
        with self._db.write() as db:
            row = (file.id, file.name, file.size, kind, time.time(), person)
            db.execute("INSERT OR IGNORE INTO uploads VALUES (?, ?, ?, ?, ?, ?)", row)

    def list_files(self, kind: str, most: int = 200) -> list[StoredFile]:
        """Return the latest files of a kind."""
        return self._find("kind = ? ORDER BY at DESC LIMIT ?", kind, most)

    def find(self, sha256: str) -> StoredFile | None:
        """Return an uploaded file, by the first name it had."""
        return next(iter(self._find("sha256 = ? ORDER BY at LIMIT 1", sha256)), None)

    def sender(self, sha256: str, kind: str) -> str:
        """Return who has sent a file first; empty where nobody had to say."""
        rows = self._db.read("SELECT person FROM uploads WHERE sha256 = ? AND kind = ? ORDER BY at", sha256, kind)
        return str(rows[0]["person"]) if rows else ""

    def _find(self, which: str, *values: object) -> list[StoredFile]:
        rows = self._db.read(f"SELECT sha256, name, size FROM uploads WHERE {which}", *values)
        return [StoredFile(id=sha256, name=name, size=size) for sha256, name, size in rows]


class CellNote(StrictModel):
    """Name and note of a cell."""

    title: str = Field(default="", description="empty: the name of its file")
    note: str = ""


class CellChanges(StrictModel):
    """What is changed of a cell; what is not given stays."""

    title: Annotated[str, Field(max_length=120, pattern=r"^[^\x00-\x1f]*$")] | None = None
    note: Annotated[str, Field(max_length=2000)] | None = None


class CellNotes:
    """Names and notes of the cells of a database."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def find(self, cell: str) -> CellNote:
        """Return the notes about a cell."""
        rows = self._db.read("SELECT title, note FROM cell_notes WHERE sha256 = ?", cell)
        return CellNote(title=rows[0]["title"], note=rows[0]["note"]) if rows else CellNote()

    def change(self, cell: str, changes: CellChanges) -> CellNote:
        """Change what is given; return what is known then."""
        with self._db.write() as db:
            db.execute("INSERT OR IGNORE INTO cell_notes VALUES (?, '', '')", (cell,))
            for name, value in changes.model_dump(exclude_none=True).items():
                db.execute(f"UPDATE cell_notes SET {name} = ? WHERE sha256 = ?", (value, cell))  # names of the model
        return self.find(cell)
