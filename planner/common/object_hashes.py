"""The hash of a loaded object: of every number and text in it, and of what the files that it names hold.

Where the object was read from does not count: fields called ``path`` are labels for messages.
"""

from collections.abc import Iterator, Mapping, Set
from dataclasses import fields, is_dataclass
from hashlib import file_digest, sha256
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from pydantic import BaseModel

from planner.common.determinism import round_significant

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
