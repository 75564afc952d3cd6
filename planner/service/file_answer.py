"""A file of the store as an answer: it is opened before the answer begins, so that it goes out whole or not at all."""

import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import anyio
from fastapi.responses import FileResponse
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send


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
