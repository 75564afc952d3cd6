"""Tables that MATLAB has saved (``.mat`` up to version 7), as the lines of a text."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from planner.common.errors import InputError
from planner.common.files import check_readable

PLACE = ("x", "y", "z")
PLACES = ("xyz", "pos", "position", "p", "tracker", "point", "points", "target", "smr")  # names of three coordinates


def mat_lines(path: Path) -> list[str]:
    """Return titles and rows of the arrays in a file, between commas: those with the most common number of rows.

    Columns of a matrix are called after it and their number, those of a place ``x``, ``y``, ``z``.

    Raises:
        InputError: it is no such file, is of version 7.3, or holds no table.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    most_bytes = 250_000_000  # of a file, packed and unpacked, as of a text
    check_readable(path, most_bytes)
    _check_unpacked_size(path, most_bytes)
    try:
        content = loadmat(path, squeeze_me=True, simplify_cells=True)
    except NotImplementedError as err:
        raise InputError(f"{path}: is a .mat of version 7.3: save it by save('{path.name}', '-v7') in MATLAB") from err
    except (MatReadError, ValueError, TypeError, OSError, EOFError, KeyError, IndexError) as err:
        raise InputError(f"{path}: cannot be read as a .mat file ({(str(err).splitlines() or ['empty'])[0]})") from err
    arrays = dict(_arrays({key: v for key, v in content.items() if not key.startswith("__")}))
    counts = [len(a) for a in arrays.values() if len(a) > 1]
    if not counts:
        raise InputError(
            f"{path}: holds no array of numbers; a table of MATLAB is saved by its columns: "
            "save them as arrays, or writetable(T, 'log.csv')"
        )
    rows = max(set(counts), key=lambda n: (counts.count(n), n))
    columns = [column for name, a in arrays.items() if len(a) == rows for column in _columns(name, a)]
    left = [f"# {name} is left out: it has not {rows} rows" for name, a in arrays.items() if len(a) != rows]
    titles = ",".join(title for title, _ in columns)
    return [*left, titles, *(",".join(map(repr, row)) for row in np.column_stack([v for _, v in columns]).tolist())]


def _check_unpacked_size(path: Path, most_bytes: int) -> None:
    """Refuse a file whose packed arrays grow beyond what is read of a text; they are unpacked piece by piece.

    Raises:
        InputError: naming the size that is allowed.
    """
    head, tag, packed, chunk = 128, 8, 15, 1 << 20  # bytes, bytes, the type of a packed element, bytes
    unpacked, data = 0, path.read_bytes()
    order = "<" if data[126:128] == b"IM" else ">"
    at = head
    while at + tag <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        if kind == packed:
            unpacker, rest = zlib.decompressobj(), data[at + tag : at + tag + size]
            try:
                while rest and not unpacker.eof and unpacked <= most_bytes:
                    unpacked += len(unpacker.decompress(rest, chunk))
                    rest = unpacker.unconsumed_tail
            except zlib.error:
                return  # loadmat says what is wrong
        if unpacked > most_bytes:
            raise InputError(f"{path}: its arrays have more than {most_bytes} bytes once unpacked; save fewer columns")
        at += tag + size


def _arrays(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of numbers of a file, (n,) or (n, k), those in structures by the name within."""
    for name, value in content.items():
        if isinstance(value, Mapping):
            yield from _arrays(value, name)
        array = np.asarray(value)
        if array.dtype.kind in "fiub" and array.ndim in (1, 2) and array.size:
            yield name, array.astype(float)


def _columns(name: str, array: np.ndarray) -> list[tuple[str, np.ndarray]]:
    if array.ndim == 1:
        return [(name, array)]
    if array.shape[1] == len(PLACE) and name.lower() in PLACES:
        return list(zip(PLACE, array.T, strict=True))
    return [(f"{name}{k}", column) for k, column in enumerate(array.T, start=1)]
