"""The text of a file: its encoding, the lines above the columns, and what these say."""

from pathlib import Path

from planner.errors import InputError

NOTES = ("plan_id", "robot", "measure", "angles", "clocks")  # what comment lines may say


def read_bytes(path: Path) -> bytes:
    """Return what the file holds, without a byte order mark.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes().removeprefix(b"\xef\xbb\xbf")
    except OSError as err:
        raise InputError(f"{path}: cannot be read ({err.strerror or err})") from err


def check_text(data: bytes, file: str) -> None:
    """Check that ``data`` is text.

    Raises:
        InputError: with the line that is not.
    """
    if data.isascii():
        return
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as err:
        line = data.count(b"\n", 0, err.start) + 1
        raise InputError(
            f"{file}, line {line}: the text is not UTF-8; name its encoding in a map of 'edbb import'"
        ) from err


def split_head(data: bytes) -> tuple[list[str], list[str], bytes]:
    """Return the lines before the names of the columns, these names, and the rows below."""
    head: list[str] = []
    start = 0
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        text = data[start:end].decode("utf-8").strip()
        start = end + 1
        if text and not text.startswith("#"):
            return head, [h.strip().strip('"') for h in text.split(",")], data[start:]
        head.append(text)
    return head, [], b""


def notes_in(lines: list[str]) -> tuple[tuple[str, str], ...]:
    """Return what lines such as ``# plan_id: 0123456789ab`` say."""
    pairs = (line.lstrip("# \t").partition(":") for line in lines if line.startswith("#"))
    return tuple((key.strip(), value.strip()) for key, colon, value in pairs if colon and key.strip() in NOTES)
