"""Routes of files, runs and cells.

A file of the store as an answer: it is opened before the answer begins, so that it goes out whole or not at all.
"""

import asyncio
import os
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import anyio
from fastapi import APIRouter, Query, Request
from fastapi.responses import FileResponse
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from planner import __version__, load_robot
from planner.cell.reading import load_cell, shipped_cells
from planner.common.errors import InputError
from planner.kinematics.robot_reader import list_robots
from planner.programs.dialect import dialects
from planner.service.answers import CellEntry, DialectEntry, Health, RobotEntry, StoredFile
from planner.service.callers import CALLER
from planner.service.context import Context, ServiceContext
from planner.service.file_store import CellChanges, ContentDraft, FileStore
from planner.service.job_folder import FileName, Sha256
from planner.service.settings import Role


class StoredFileResponse(FileResponse):
    """The content of a file, also where the file is deleted while it goes out.

    Raises:
        HTTPException: it is gone.
    """

    def __init__(self, path: Path, **named: Any) -> None:
        try:
            self._opened = path.open("rb")
        except FileNotFoundError as err:
            raise HTTPException(404, f"there is no file {path.name[:12]}…; it was deleted") from err
        super().__init__(path, stat_result=os.fstat(self._opened.fileno()), **named)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it, and let go of it."""
        with self._opened:
            await super().__call__(scope, receive, send)

    @asynccontextmanager
    async def _open_file(self) -> AsyncIterator[Any]:  # as FileResponse opens what it sends
        yield anyio.wrap_file(self._opened)


FILES = APIRouter(prefix="/api", tags=["files"])
STALL_S = 60.0  # without a byte, after which a client is taken for gone
# an empty file is none
BINARY: Mapping[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary", "minLength": 1}}},
    }
}
# nor is an empty cell
TOML: Mapping[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "text/plain": {
                "schema": {"type": "string", "minLength": 1},
                "example": 'schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\nkind = "tracker"\n',
            }
        },
    }
}
Name = Annotated[FileName, Query(description="name that the file has in the folder of a job", examples=["run.csv"])]
Hash = Annotated[Sha256 | None, Query(description="SHA-256 of the content; the transfer is checked by it")]


@FILES.post("/files", status_code=201, openapi_extra=dict(BINARY))
async def upload_file(request: Request, context: Context, name: Name, sha256: Hash = None) -> StoredFile:
    """Send a file (body: its bytes), to be named in requests by its identifier; the same content is the same file."""
    return await _receive(request, context, name, sha256, "file")


@FILES.get("/files/{id}")
def download_file(id: Sha256, context: Context) -> FileResponse:
    """Get the content of a file that was sent."""
    found = context.uploads.find(id)
    if found is None:
        raise HTTPException(404, f"there is no file {id[:12]}…")
    return file_answer(context, id, found.name)


@FILES.delete("/files/{id}", status_code=204)
def delete_file(id: Sha256, context: Context) -> None:
    """Delete a file, run or cell that was sent, unless a job starts from it; what others have sent too stays theirs."""
    caller = CALLER.get()
    context.keeper.delete_upload(id, None if caller.role is Role.ADMINISTER else caller.name)


@FILES.get("/contents/{sha256}")
def download_content(sha256: Sha256, context: Context) -> FileResponse:
    """Get a file that was sent or written by a job, by its SHA-256; workers fetch what jobs start from."""
    return file_answer(context, sha256, sha256)


@FILES.post("/runs", status_code=201, openapi_extra=dict(BINARY))
async def upload_run(request: Request, context: Context, name: Name, sha256: Hash = None) -> StoredFile:
    """Send a measured run, CSV or Parquet, up to 1 GB; ``run-checks`` read it, ``identifications`` use it."""
    return await _receive(request, context, name, sha256, "run")


@FILES.get("/runs")
def list_runs(context: Context) -> list[StoredFile]:
    """List the runs that were sent, the latest first."""
    return context.uploads.list_files("run")


@FILES.post("/cells", status_code=201, openapi_extra=dict(TOML))
async def upload_cell(request: Request, context: Context, name: Name) -> StoredFile:
    """Send a cell file (body: its TOML); ``cell-checks`` check it."""
    return await _receive(request, context, name, None, "cell")


@FILES.get("/cells")
def list_cells(context: Context) -> list[CellEntry]:
    """List the shipped cells and those that were sent."""
    sent = [describe_cell(context, f) for f in context.uploads.list_files("cell")]
    return [*(CellEntry(id=c, name=c) for c in _shipped_names()), *sent]


def describe_cell(context: ServiceContext, file: StoredFile) -> CellEntry:
    """Return a cell that was sent, as lists show it."""
    known = context.cells.find(file.id)
    return CellEntry(id=file.id, name=known.title or file.name, note=known.note)


@FILES.patch("/cells/{id}")
def change_cell(id: Sha256, changes: CellChanges, context: Context) -> CellEntry:
    """Give a cell that was sent another name or a note; what is not given stays."""
    found = context.uploads.find(id)
    if found is None:
        raise HTTPException(404, f"there is no file {id[:12]}…")
    CALLER.get().check_owner(context.uploads.sender(id, "cell"))
    context.cells.change(id, changes)
    return describe_cell(context, found)


@FILES.get("/cells/{robot}/{cell}")
def get_shipped_cell(robot: str, cell: str) -> FileResponse:
    """Get the file of a shipped cell."""
    if f"{robot}/{cell}" not in _shipped_names():
        raise HTTPException(404, f"there is no shipped cell {robot}/{cell}")
    return FileResponse(load_cell(f"{robot}/{cell}").path, media_type="application/toml")


async def receive_body(
    request: Request, files: FileStore, name: str, sha256: str | None, note: Callable[[StoredFile], None]
) -> StoredFile:
    """Write the body of a request to the store while it comes in; ``note`` keeps its name before anybody removes it.

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
                await run_in_threadpool(files.check_room)
        if draft.size == 0:
            raise InputError(f"'{name}': the file is empty")
        found = await run_in_threadpool(files.finish, draft, sha256)  # a large file takes seconds to reach the disk
        file = StoredFile(id=found, name=name, size=draft.size)
        await run_in_threadpool(_place_and_note, files, draft, file, note)
        return file


def _place_and_note(
    files: FileStore, draft: ContentDraft, file: StoredFile, note: Callable[[StoredFile], None]
) -> None:
    with files.hold_files():
        files.place(draft, file.id)
        note(file)


async def _receive(request: Request, context: ServiceContext, name: str, sha256: str | None, kind: str) -> StoredFile:
    person = CALLER.get().name
    await run_in_threadpool(context.check_quota, person, 0)
    return await receive_body(request, context.files, name, sha256, lambda f: context.uploads.add(f, kind, person))


@cache
def _shipped_names() -> tuple[str, ...]:
    return shipped_cells()


def file_answer(context: ServiceContext, sha256: str, name: str, media_type: str | None = None) -> FileResponse:
    """Return a file of the store as something to be saved: a browser shows nothing of it as a page.

    Raises:
        HTTPException: it is gone.
    """
    return StoredFileResponse(
        context.files.path(sha256),
        filename=name,
        media_type=media_type or "application/octet-stream",
        headers={"etag": f'"{sha256}"', "cache-control": "private, max-age=31536000, immutable"},
    )


LISTS = APIRouter(prefix="/api", tags=["lists"])


@LISTS.get("/health")
def get_health(context: Context) -> Health:
    """Tell that the service is there, and how much it has to do."""
    running, waiting = context.jobs.count_open_states()
    return Health(version=__version__, jobs_running=running, jobs_waiting=waiting)


@LISTS.get("/robots")
def get_robots() -> list[RobotEntry]:
    """List the robots that come with the planner, and their cells."""
    return list(robot_entries())


@LISTS.get("/robots/{name}")
def get_robot(name: str) -> RobotEntry:
    """Get one robot."""
    found = next((r for r in robot_entries() if r.name == name), None)
    if found is None:
        raise HTTPException(
            404, f"there is no robot of that name (there: {', '.join(r.name for r in robot_entries())})"
        )
    return found


@LISTS.get("/dialects")
def get_dialects() -> list[DialectEntry]:
    """List the robot languages that programs can be written in."""
    return list(dialect_entries())


@cache
def robot_entries() -> tuple[RobotEntry, ...]:
    """Return the robots that come with the planner."""
    cells, out = shipped_cells(), []
    for name in list_robots():
        r = load_robot(name)
        own = [c for c in cells if c.startswith(f"{name}/")]
        out.append(RobotEntry(name=name, title=r.title, joints=r.n_joints, payload_kg=r.payload, cells=own))
    return tuple(out)


def robot_title(name: str) -> str:
    """Return the title of a robot that comes with the planner; of another one its name."""
    return next((r.title for r in robot_entries() if r.name == name and r.title), name)


@cache
def dialect_entries() -> tuple[DialectEntry, ...]:
    """Return the robot languages."""
    return tuple(
        DialectEntry(name=d.name, title=d.title, units=str(d.units), max_joints=d.max_joints) for d in dialects()
    )
