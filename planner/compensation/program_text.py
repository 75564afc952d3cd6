"""The text of a program or of a table of targets, in the encoding in which it is written back."""

from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import UTF_16_MARKS, read_bytes


def read_program(path: Path) -> tuple[str, str]:
    """Return the text and the encoding that gives the same bytes back; a byte order mark is a part of the text.

    Raises:
        InputError: it is no text, or has a line that no program has.
    """
    most_signs = 20_000  # of a line: the longest of 585 real programs has 1 248
    data = read_bytes(path)
    text, encoding = _decode(data)
    if "\0" in text:
        raise InputError(
            f"{path}: holds zero bytes and is no text; UTF-8, UTF-16 with its mark and Latin-1 are allowed"
        )
    for line, content in enumerate(text.splitlines(), 1):
        if len(content) > most_signs:
            raise InputError(f"{path}:{line}: the line has {len(content)} signs; at most {most_signs} are read")
    return text, encoding


def _decode(data: bytes) -> tuple[str, str]:
    order = dict(zip(UTF_16_MARKS, ("utf-16-le", "utf-16-be"), strict=True)).get(data[:2])
    for encoding in filter(None, (order, "utf-8")):
        try:
            return data.decode(encoding), encoding
        except UnicodeDecodeError:
            continue
    return data.decode("latin-1"), "latin-1"
