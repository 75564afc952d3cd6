"""Sections of a cell file that extensions declare, such as ``[[name]]``: how they are written, and what was read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import create_model

from planner.cell.file import CellFile
from planner.cell.section_content import SectionContent
from planner.cell.section_registry import section_readers
from planner.common.errors import InputError
from planner.common.extensions import section_owner
from planner.common.schema import StrictModel, read_toml_content, validate


@dataclass(frozen=True)
class SectionReader:
    """How the tables ``[[key]]`` of a cell file are read.

    Attributes:
        table: the keys of one table, with their defaults.
        read: makes what stands in the cell of the path of a cell file, the file, and its tables.
    """

    table: type[StrictModel]
    read: Callable[[Path, CellFile, Sequence[Any]], SectionContent]


def _load_reader(key: str) -> SectionReader:
    module, name = section_readers()[key].split(":")
    reader: SectionReader = getattr(import_module(module), name)
    return reader


def cell_file_of(content: object, where: str) -> CellFile:
    """Check what a cell file says; ``where`` names the file in the message.

    Raises:
        InputError: with the first wrong keys, or the extension that a section needs.
    """
    readers = section_readers()
    for key in content if isinstance(content, dict) else ():
        if key not in readers and (owner := section_owner(key)):
            raise InputError(f"{where}: [[{key}]] is read by the extension '{owner}', which is not installed here")
    return validate(content, _model_with(tuple(sorted(readers))), where)


def read_cell_file(path: Path) -> CellFile:
    """Read a cell file.

    Raises:
        InputError: it is missing, no TOML, a key is wrong, or no extension reads one of its sections.
    """
    return cell_file_of(read_toml_content(path), str(path))


class _ExtendedFile(CellFile):
    """A cell file with sections of extensions; pickled by their names, since its class is made where it is used."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the call that rebuilds the object (pickle)."""
        return _restore, (self.ADDED, self.__getstate__())


def _restore(keys: tuple[str, ...], state: dict[Any, Any]) -> CellFile:
    model = _model_with(keys)
    file = model.__new__(model)
    file.__setstate__(state)
    return file


@cache
def _model_with(keys: tuple[str, ...]) -> type[CellFile]:
    """Return the model of a cell file that may have these sections of extensions."""
    if taken := CellFile.model_fields.keys() & set(keys):
        raise InputError(f"an extension declares the section '{min(taken)}' of cell files, which the core has already")
    tables: dict[str, Any] = {key: (tuple[_load_reader(key).table, ...], ()) for key in keys}  # type: ignore[misc]
    model = create_model(CellFile.__name__, __base__=_ExtendedFile, **tables)
    model.ADDED = keys
    return model


def read_sections(path: Path, file: CellFile) -> Mapping[str, SectionContent]:
    """Return the contents of the extensions' sections by their keys; missing sections are left out.

    Raises:
        InputError: a key is wrong, missing, or contradicts another.
    """
    written = {key: rows for key in file.ADDED if (rows := getattr(file, key))}
    return {key: _load_reader(key).read(path, file, rows) for key, rows in written.items()}
