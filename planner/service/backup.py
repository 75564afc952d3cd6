"""A copy of a service's store, made while it runs, and brought back into an empty folder.

Files are named by their content and never change, so a copy is whole once all that the copied database names are there;
what an earlier copy holds is not copied again.
"""

import shutil
import sqlite3
import tempfile
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from planner.common.errors import InputError
from planner.common.exchange import exchange_folders
from planner.common.system import hold_lock, sync_folder
from planner.service.database import NAMED, Database, damage_text
from planner.service.file_store import FileStore, GoneFileError, copy_verified_file
from planner.service.private_store import DATABASE, keep_private

RECORDS, FILES = "records", "files"


@dataclass(frozen=True)
class CopiedStore:
    """What a copy holds: numbers of jobs, files and robots."""

    jobs: int
    files: int
    robots: int


def back_up(store: Path, copy: Path) -> CopiedStore:
    """Copy the store of a service, which may go on meanwhile, into a folder: a new one, or that of an earlier copy.

    Raises:
        InputError: there is no store, the folder holds something else, or a file of the store is damaged.
    """
    if not (store / DATABASE).is_file():
        raise InputError(f"{store} is no store of a service: it has no {DATABASE}")
    if copy.exists() and any(copy.iterdir()) and not (copy / DATABASE).is_file():
        raise InputError(f"{copy} holds other files; name a new folder, or that of an earlier backup")
    keep_private(copy, database=False)
    (copy / FILES).mkdir(parents=True, exist_ok=True)
    draft, tries = copy / f"{DATABASE}.draft", 5
    for left in reversed(range(tries)):
        draft.unlink(missing_ok=True)
        _copy_database(store / DATABASE, draft)
        try:
            _copy_files(store, copy, draft)
            break
        except GoneFileError:  # deleted with its job since the database was copied: what is there is not copied again
            if not left:
                raise
    _copy_records(store / RECORDS, copy / RECORDS)
    draft.replace(copy / DATABASE)  # last: until then the earlier copy stands
    sync_folder(copy)
    return _count(copy)


def restore(copy: Path, store: Path) -> CopiedStore:
    """Bring a copy back as the store of a service, into a folder that is empty or not there.

    Raises:
        InputError: there is no copy, the folder is not empty, or a file of the copy is damaged.
    """
    if not (copy / DATABASE).is_file():
        raise InputError(f"{copy} is no backup of a service: it has no {DATABASE}")
    if store.exists() and any(store.iterdir()):
        raise InputError(f"{store} is not empty; restore into a new folder, and serve that with --data")
    keep_private(store, database=False)
    (store / FILES).mkdir(parents=True, exist_ok=True)
    _copy_files(copy, store, copy / DATABASE)
    if (copy / RECORDS).is_dir():
        shutil.copytree(copy / RECORDS, store / RECORDS)
    _copy_database(copy / DATABASE, store / DATABASE)  # last: a folder without it is no store
    Database(store / DATABASE)  # of an earlier version: brought up to this one
    return _count(store)


def _copy_database(source: Path, target: Path) -> None:
    """Copy a database as it stands at one moment, whoever writes to it."""
    try:
        with closing(sqlite3.connect(source, timeout=30)) as read, closing(sqlite3.connect(target)) as written:
            read.backup(written)
    except sqlite3.Error as err:
        raise InputError(f"{source}: {damage_text(err)}") from err


def _copy_files(source: Path, target: Path, database: Path) -> None:
    """Copy the files that a database names and the target lacks, each as a whole."""
    there = FileStore(target)
    with closing(sqlite3.connect(database)) as db:
        names = [name for (name,) in db.execute(NAMED)]
    for name in names:
        if there.holds(name):
            continue
        path = source / FILES / name[:2] / name
        place = there.path(name)
        place.parent.mkdir(exist_ok=True)
        draft = place.with_suffix(".draft")
        draft.unlink(missing_ok=True)
        copy_verified_file(path, name, draft)
        draft.replace(place)


def _copy_records(source: Path, target: Path) -> None:
    """Copy all records of robots while nobody adds to them."""
    if not source.is_dir():
        return
    with tempfile.TemporaryDirectory(dir=target.parent) as draft:
        with hold_lock(source / ".lock"):
            shutil.copytree(source, Path(draft, RECORDS))
        exchange_folders(Path(draft, RECORDS), target, ".lock")


def _count(folder: Path) -> CopiedStore:
    with closing(sqlite3.connect(folder / DATABASE)) as db:
        (jobs,), (files,) = (db.execute(f"SELECT count(*) FROM {what}").fetchone() for what in ("jobs", f"({NAMED})"))
    return CopiedStore(jobs, files, len(list((folder / RECORDS).glob("*/record.toml"))))
