"""Hashes of what a document says, part by part: by them a reader knows what a person changed since edbb wrote it.

Comments, line ends, the order of keys and the spelling of numbers (1 and 1.0) do not count. A document without hashes
was written by hand, or by an earlier version: nothing is said of it.
"""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

HASHES = "hashes"  # key of a document under which its hashes stand


@dataclass(frozen=True)
class HandEdit:
    """A document that a person changed after edbb wrote it.

    Attributes:
        path: of its file.
        parts: the keys whose values are others.
    """

    path: Path
    parts: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The sentence for the screen, with the path."""
        return self._sentence(str(self.path))

    @property
    def remark(self) -> str:
        """The sentence for the head of a program or page, in ASCII and without the folder."""
        return self._sentence(re.sub(r"[^ -~]", "_", self.path.name))

    def _sentence(self, name: str) -> str:
        return (
            f"{name} was changed by hand since edbb wrote it ({name_parts(self.parts)}): "
            "no measurement stands behind the changed values"
        )


def name_parts(parts: Iterable[str]) -> str:
    """Return the names of changed parts for a sentence; of many the first ones, and how many more there are."""
    named = 6  # parts that a sentence names
    every = [re.sub(r"[^ -~]", "_", part) for part in parts]
    more = f" and {len(every) - named} more" if len(every) > named else ""
    return f"{', '.join(every[:named])}{more}"


def canonical_hash(value: object) -> str:
    """Return the SHA-256, hexadecimal, of a value of TOML or JSON, with all numbers as floats."""
    return sha256(json.dumps(_with_floats(value), sort_keys=True).encode()).hexdigest()


def part_hashes(content: Mapping[str, object], uncounted: Iterable[str] = ()) -> dict[str, str]:
    """Return a short hash of each key of a document.

    Args:
        content: of the document.
        uncounted: keys that a person may change.
    """
    digits = 8  # hexadecimal, of a part's hash: enough to tell that the part was changed
    free = {HASHES, *uncounted}
    return {key: canonical_hash(value)[:digits] for key, value in content.items() if key not in free}


def with_hashes(content: Mapping[str, object], uncounted: Iterable[str] = ()) -> dict[str, object]:
    """Return a document with the hashes of its parts behind it."""
    return {**content, HASHES: part_hashes(content, uncounted)}


def changed_parts(written: object, found: Mapping[str, str]) -> tuple[str, ...]:
    """Return the parts whose hashes differ from those that were ``written``; none of a document without hashes."""
    if not isinstance(written, Mapping) or not written:
        return ()
    return tuple(sorted(name for name in found.keys() | written.keys() if found.get(name) != written.get(name)))


def hand_edits(path: Path, content: object, uncounted: Iterable[str] = ()) -> tuple[HandEdit, ...]:
    """Return the edit of the document at ``path``; empty where it is as it was written, or has no hashes."""
    if not isinstance(content, Mapping):
        return ()
    parts = changed_parts(content.get(HASHES), part_hashes(content, uncounted))
    return (HandEdit(path, parts),) if parts else ()


def _with_floats(value: object) -> object:
    """Return a value of TOML with all numbers as floats, which have one spelling."""
    largest = 1e300  # no quantity reaches it, and a whole number beyond may overflow
    match value:
        case Mapping():
            return {str(key): _with_floats(v) for key, v in value.items()}
        case list() | tuple() if set(map(type, value)) == {float}:  # rows of a matrix: quick
            return [v + 0.0 if abs(v) < largest else str(v) for v in value]
        case list() | tuple():
            return [_with_floats(v) for v in value]
        case bool() | str():
            return value
        case int() | float() if abs(value) < largest:
            return float(value) + 0.0  # -0.0 becomes 0.0
        case _:
            return str(value)
