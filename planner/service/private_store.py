"""The store of the service is for its user alone: it holds passwords' hashes, programs and measured robots."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from planner.service.file_store import disk_error

DATABASE = "jobs.sqlite3"


def keep_private(folder: Path, database: bool = True) -> tuple[str, ...]:
    """Make the folder of a store, its database and what lies in it for its user alone.

    Windows has no such permissions: there the folder is as private as the one above it.

    Args:
        folder: of the store, or of its copy.
        database: whether its database is made where there is none.

    Returns:
        A sentence on what others could read before.

    Raises:
        InputError: the folder cannot be made, or is another user's.
    """
    if os.name != "posix":
        folder.mkdir(parents=True, exist_ok=True)
        return ()
    others = stat.S_IRWXG | stat.S_IRWXO
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=stat.S_IRWXU)
        open_before = [path for path in _parts(folder) if stat.S_IMODE(path.stat().st_mode) & others]
        for path in open_before:
            path.chmod(stat.S_IMODE(path.stat().st_mode) & ~others)
        if database:  # SQLite's further files get its permissions
            (folder / DATABASE).touch(mode=stat.S_IRUSR | stat.S_IWUSR)
    except OSError as err:
        raise disk_error(err) from err
    if not open_before:
        return ()
    return (f"{folder}: other users of this machine could open {len(open_before)} of its files and folders; now none",)


def _parts(folder: Path) -> Iterator[Path]:
    """Yield the folder and what lies directly in it: nobody gets deeper past them."""
    yield folder
    yield from sorted(path for path in folder.iterdir() if not path.is_symlink())
