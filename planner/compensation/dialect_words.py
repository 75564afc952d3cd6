"""What compensation needs of ``g-code/<name>/dialect.toml``: names of the axes, remarks, and the word of a move."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from planner.common.errors import InputError, did_you_mean
from planner.common.files import data_folder
from planner.common.schema import read_toml


class _Part(BaseModel):
    """A section of which only some keys matter here; the program room checks the others."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class FileNames(_Part):
    """Names of the dialect's files, from which their suffixes come."""

    main: str
    data: str | None = None


class CommentMarks(_Part):
    """How a remark begins and ends."""

    start: str
    end: str = ""


class ReaderPatterns(_Part):
    """Family of the reader, and the pattern of a joint move in G-code."""

    family: str
    motion: str = ""


class DialectWords(_Part):
    """The part of a dialect that tells where its axis angles stand."""

    axes: tuple[str, ...]
    files: FileNames
    comment: CommentMarks
    reading: ReaderPatterns

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Suffixes of the dialect's files, in lower case, with the dot."""
        return tuple(Path(name).suffix.lower() for name in (self.files.main, self.files.data) if name)


def dialect_words() -> dict[str, DialectWords]:
    """Return the words of every dialect on disk, by name.

    Raises:
        InputError: a dialect's file lacks a key.
    """
    files = sorted(data_folder("g-code").glob("*/dialect.toml"))
    return {path.parent.name: read_toml(path, DialectWords) for path in files}


def dialect_named(name: str) -> DialectWords:
    """Return the words of one dialect.

    Raises:
        InputError: no such dialect.
    """
    known = dialect_words()
    if name not in known:
        raise InputError(f"no dialect '{name}'{did_you_mean(name, list(known))} (known: csv, {', '.join(known)})")
    return known[name]
