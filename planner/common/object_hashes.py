"""The hash of a loaded object: of every number and text in it, and of what the files that it names hold.

Where the object was read from does not count: fields called ``path`` are labels for messages.

Hashes of what a document says, part by part: by them a reader knows what a person changed since edbb wrote it.

Comments, line ends, the order of keys and the spelling of numbers (1 and 1.0) do not count. A document without hashes
was written by hand, or by an earlier version: nothing is said of it.
"""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, fields, is_dataclass
from hashlib import file_digest, sha256
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from pydantic import BaseModel

from planner.common.determinism import round_significant

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
    match value:
        case Mapping():
            return {str(key): _with_floats(v) for key, v in value.items()}
        case list() | tuple():
            return [_with_floats(v) for v in value]
        case bool() | str():
            return value
        case int() | float() if abs(value) < 1e300:  # what no quantity reaches, and a whole number may overflow
            return float(value) + 0.0  # -0.0 becomes 0.0
        case _:
            return str(value)


LABELS = frozenset({"path"})  # fields that name where an object was read from


def object_hash(*values: object) -> str:
    """Return the SHA-256, hexadecimal, of objects made of dataclasses, models, arrays, numbers, texts and paths.

    A path counts by what its file holds. A class or function from outside the package counts by its code, so that an
    effect or gauge that a notebook defines anew has another hash.

    Raises:
        TypeError: a value is of a kind whose content is not known.

    Example:
        >>> object_hash({"a": 1.0}, [2, 3]) == object_hash({"a": 1.0}, [2, 3])
        True
    """
    digest = sha256()
    for part in _parts(values):
        digest.update(len(part).to_bytes(8, "big"))  # so that no two lists of parts give the same bytes
        digest.update(part)
    return digest.hexdigest()


def _parts(value: object) -> Iterator[bytes]:
    match value:
        case np.generic():
            yield from _parts(value.item())
        case np.ndarray():
            yield f"array {value.dtype.kind} {value.shape}".encode()
            yield np.ascontiguousarray(round_significant(value) + 0.0 if value.dtype.kind == "f" else value).tobytes()
        case Path():
            yield _file_hash(value)
        case BaseModel():
            yield from _parts(value.model_dump(mode="json", by_alias=True))
        case type() | FunctionType():
            yield from _code_parts(value)
        case _ if is_dataclass(value):
            yield from _code_parts(type(value))
            yield from _parts({f.name: getattr(value, f.name) for f in fields(value) if f.name not in LABELS})
        case Mapping() | Set() | list() | tuple():
            yield from _parts_of_many(value)
        case float():
            # 11 digits, as in round_significant: processors differ in the last bits of a sine; -0.0 becomes 0.0
            yield f"float {value + 0.0:.11g}".encode()
        case None | bool() | int() | str() | bytes():
            yield f"{type(value).__name__} {value!r}".encode()
        case _:
            raise TypeError(f"the content of a {type(value).__module__}.{type(value).__name__} is not known")


def _parts_of_many(value: Any) -> Iterator[bytes]:
    kind, ordered = "list", value
    if isinstance(value, Mapping):
        kind, ordered = "mapping", [each for key in sorted(value, key=repr) for each in (key, value[key])]
    elif isinstance(value, Set):
        kind, ordered = "set", sorted(value, key=repr)
    yield f"{kind} {len(ordered)}".encode()
    for each in ordered:
        yield from _parts(each)


def _file_hash(path: Path) -> bytes:
    if not path.is_file():
        return b"no file"
    with path.open("rb") as file:
        return file_digest(file, "sha256").digest()


def _code_parts(what: Any, seen: frozenset[int] = frozenset()) -> Iterator[bytes]:
    """Yield the name of a class or function and, of one from outside the package, its code."""
    yield f"{what.__module__}.{what.__qualname__}".encode()
    if str(what.__module__).partition(".")[0] == __name__.partition(".")[0] or id(what) in seen:
        return
    for part in vars(what).values() if isinstance(what, type) else (what,):
        function = getattr(part, "__func__", getattr(part, "fget", getattr(part, "func", part)))
        if isinstance(function, FunctionType):
            yield from _code_of(function.__code__)
            for name in function.__code__.co_names:
                yield from _used_parts(function.__globals__.get(name), what.__module__, seen | {id(what)})


def _used_parts(used: object, module: str, seen: frozenset[int]) -> Iterator[bytes]:
    """Yield a global that code uses: functions and classes of the same module, and numbers and texts."""
    if isinstance(used, type | FunctionType) and used.__module__ == module:
        yield from _code_parts(used, seen)
    elif isinstance(used, bool | int | float | str | np.ndarray):
        yield from _parts(used)


def _code_of(code: CodeType) -> Iterator[bytes]:
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_of(constant)
        else:
            yield repr(constant).encode()
