"""Files appear whole or not at all."""

import os
from pathlib import Path

import pytest

from planner.common.errors import InputError
from planner.common.files import write_bytes, write_text


def test_line_ends_are_kept(tmp_path: Path) -> None:
    write_text(tmp_path / "a.src", "DEF A ( )\r\nEND\r\n", "ascii")
    assert (tmp_path / "a.src").read_bytes() == b"DEF A ( )\r\nEND\r\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.src"]


@pytest.mark.posix
def test_replaces_in_one_step_and_keeps_permissions(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    path.chmod(0o640)
    inode = path.stat().st_ino
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o640
    assert path.stat().st_ino != inode


@pytest.mark.posix
def test_a_new_file_is_readable_as_usual(tmp_path: Path) -> None:
    old = os.umask(0o022)
    try:
        write_text(tmp_path / "a", "x")
    finally:
        os.umask(old)
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o644


def test_failure_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    path.write_text("old")

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(InputError, match="No space left"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_wrong_characters_and_folders_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="'ü' does not exist in ascii"):
        write_text(tmp_path / "a", "für", "ascii")
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "none" / "a", "x")
    assert list(tmp_path.iterdir()) == []
