"""Files that clients have sent: content in the store, names in the database once the content is on the disk."""

import asyncio
import time

from starlette.exceptions import HTTPException
from starlette.requests import Request

from planner.common.errors import InputError
from planner.service.answers import StoredFile
from planner.service.database import Database
from planner.service.file_store import FileStore

STALL_S = 60.0  # without a byte, after which a client is taken for gone


class UploadList:
    """The names under which files were sent."""

    def __init__(self, database: Database) -> None:
        self._db = database

    def add(self, file: StoredFile, kind: str) -> None:
        """Note a file; the same again changes nothing."""
        with self._db.write() as db:
            db.execute(
                "INSERT OR IGNORE INTO uploads VALUES (?, ?, ?, ?, ?)",
                (file.id, file.name, file.size, kind, time.time()),
            )

    def list_files(self, kind: str, most: int = 200) -> list[StoredFile]:
        """Return the latest files of a kind."""
        rows = self._db.connection.execute(
            "SELECT * FROM uploads WHERE kind = ? ORDER BY at DESC LIMIT ?", (kind, most)
        )
        return [StoredFile(id=r["sha256"], name=r["name"], size=r["size"]) for r in rows]

    def find(self, sha256: str) -> StoredFile | None:
        """Return an uploaded file, by the first name it had."""
        row = self._db.connection.execute(
            "SELECT * FROM uploads WHERE sha256 = ? ORDER BY at LIMIT 1", (sha256,)
        ).fetchone()
        return None if row is None else StoredFile(id=row["sha256"], name=row["name"], size=row["size"])


async def receive_body(request: Request, files: FileStore, name: str, sha256: str | None) -> StoredFile:
    """Write the body of a request to the store while it comes in.

    Raises:
        InputError: nothing was sent, or not what ``sha256`` says.
        DiskFullError: there is no room.
    """
    with files.receive() as draft:
        room = 0
        chunks = request.stream().__aiter__()
        while True:
            try:
                chunk = await asyncio.wait_for(anext(chunks), STALL_S)
            except StopAsyncIteration:
                break
            except TimeoutError as err:
                raise HTTPException(408, f"nothing came for {STALL_S:g} s; send the file again") from err
            draft.add(chunk)
            if draft.size - room > 16 << 20:
                room = draft.size
                files.check_room()
        if draft.size == 0:
            raise InputError(f"'{name}': the file is empty")
        found = files.keep(draft, expected=sha256)
        return StoredFile(id=found, name=name, size=draft.size)
