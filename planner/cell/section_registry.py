"""The sections of cell files that extensions declare, by their names; it is loaded without libraries of numbers."""

from collections.abc import Mapping

from planner.common.extensions import load_extensions

_READERS: dict[str, str] = {}


def register_section(key: str, reader: str) -> None:
    """Let cell files have tables ``[[key]]``.

    Args:
        key: the name of the tables.
        reader: their :class:`planner.cell.reading.SectionReader`, as ``module:name``.

    Raises:
        ValueError: another extension has a section of that name.
    """
    if key in _READERS:
        raise ValueError(f"section '{key}' of cell files: another extension has registered it already")
    _READERS[key] = reader


def section_readers() -> Mapping[str, str]:
    """Return where the reader of each section is, as ``module:name``."""
    load_extensions()
    return _READERS
