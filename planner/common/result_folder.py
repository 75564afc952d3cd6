"""A folder of results, exchanged as a whole, with its manifest: which kind of command wrote what there."""

import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from planner.common.errors import InputError
from planner.common.exchange import draft_prefix, exchange_folders, files_in
from planner.common.file_names import check_names
from planner.common.files import INPUTS, document_text, has_hash
from planner.common.lazy_modules import psutil

MANIFEST = "manifest.json"
SCHEMA = "edbb-manifest/1"
UNHASHED = "timings.json"  # differs from run to run

Hashes = dict[str, str]


@contextmanager
def draft_folder(folder: Path) -> Iterator[Path]:
    """A folder beside ``folder`` in which to write what is moved there once all of it is right.

    Raises:
        InputError: ``folder`` is a file, or the folder that the command runs in, or its parent cannot be made.
    """
    check_names(folder)
    folder = folder.resolve()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; results need a folder")
    check_not_inside(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        _clear_dead_drafts(folder.parent)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=draft_prefix(), ignore_cleanup_errors=True) as name:
            draft = Path(name) / folder.name
            draft.mkdir()
            yield draft
    except OSError as err:
        raise InputError(f"{folder}: cannot be written ({err.strerror or err})") from err


def check_not_inside(folder: Path) -> None:
    """Refuse a folder of results in which the command runs.

    Raises:
        InputError: naming it.
    """
    if Path.cwd().is_relative_to(folder.resolve()):
        raise InputError(
            f"{folder}: results are exchanged as a whole folder, which cannot be the one that you are in; "
            "name a folder of their own with -o"
        )


def move_all(draft: Path, folder: Path, force: bool = False) -> list[Path]:
    """Put the files of ``draft`` in the place of the results that ``folder`` holds; return them.

    What an earlier command of the same kind wrote there and this one does not is cleared; files of others stay.
    A kill leaves the old folder or the new one. ``force``: a person allows to write over files of others.

    Raises:
        InputError: it would write over a file that the command has read, or that somebody else has written or changed.
    """
    most_others = 2000  # files of others that a folder of results may hold
    folder, kind = folder.resolve(), _kind(draft)
    files = files_in(draft)
    known = read_manifest(folder)
    check_overwriting(folder, files, force)
    others = [f for f in files_in(folder) if f not in files and f != MANIFEST]
    stale = [f for f in others if f in known.get(kind, {}) and _is_unchanged(folder, f, known[kind][f])]
    kept = [f for f in others if f not in stale]
    if len(kept) > most_others:
        raise InputError(f"{folder}: holds {len(kept)} files of others; name a folder of its own with -o")
    for name in kept:
        _link(folder / name, draft / name)
    there = {k: {f: h for f, h in hashes.items() if f in kept} for k, hashes in known.items() if k != kind}
    results = {k: h for k, h in there.items() if h} | {kind: {f: file_hash(draft / f) for f in files}}
    manifest = {"schema": SCHEMA, "results": dict(sorted(results.items()))}
    (draft / MANIFEST).write_text(document_text(manifest), encoding="utf-8")
    exchange_folders(draft, folder, MANIFEST)
    return [folder / name for name in files]


def check_overwriting(folder: Path, names: list[str], force: bool = False) -> None:
    """Refuse to write files of these names over what this command read, or what is not as this tool wrote it.

    Raises:
        InputError: naming the file.
    """
    known = {f: h for hashes in read_manifest(folder).values() for f, h in hashes.items()}
    for name in names:
        path = folder / name
        if INPUTS.holds(path):
            raise InputError(
                f"{path}: this command has read it and does not write over it; name another folder with -o"
            )
        if path.exists() and not force and not _is_unchanged(folder, name, known.get(name)):
            because = "was changed since edbb wrote it" if name in known else "was not written by edbb"
            raise InputError(f"{path}: {because}; name another folder with -o, or add --force")


def read_manifest(folder: Path) -> Mapping[str, Hashes]:
    """Return what the folder's manifest says: of each kind of result its files and their hashes; else nothing."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        results = content["results"] if content["schema"] == SCHEMA else {}
        return {str(kind): {str(f): str(h) for f, h in files.items()} for kind, files in results.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def changed_files(folder: Path, kind: str) -> list[str] | None:
    """Return which results of a kind are not as they were written; nothing where no manifest tells of them."""
    files = read_manifest(folder).get(kind)
    return None if files is None else [f for f, h in files.items() if not _is_unchanged(folder, f, h)]


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file; nothing for the one that differs from run to run."""
    return "" if path.name == UNHASHED else hashlib.sha256(path.read_bytes()).hexdigest()


def _kind(draft: Path) -> str:
    """Return the result that a folder holds: the name of its main document."""
    beside = (UNHASHED, MANIFEST, "expected_error.json")  # the last stands beside a calibrated robot, if there is one
    names = sorted(p.name for p in draft.glob("*.json") if p.name not in beside)
    return names[0] if names else "files"


def _is_unchanged(folder: Path, name: str, written: str | None) -> bool:
    try:
        path = folder / name
        return written is not None and (written == file_hash(path) or has_hash(path.read_bytes(), written))
    except OSError:
        return False


def _link(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    if os.link in os.supports_follow_symlinks:  # Windows cannot be told whether a link is followed
        with suppress(OSError):  # not every disk has hard links
            os.link(source, target, follow_symlinks=False)
            return
    shutil.copy2(source, target, follow_symlinks=False)


def _clear_dead_drafts(parent: Path) -> None:
    """Remove the drafts of commands on this machine that were killed."""
    own = draft_prefix().rpartition(f"{os.getpid()}-")[0]
    for path in parent.glob(f"{own}*"):
        found = re.match(r"(\d+)-", path.name[len(own) :])
        if found is None or psutil.pid_exists(int(found[1])):
            continue
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
