"""Pages without their pictures where no test looks at one: drawing them takes longer than most of what is tested."""

import os
import struct
import zlib

from planner.report import standby
from planner.report.standby import draw_pictures

PRINTED = (
    "tests/docs/", "tests/report/", "tests/reproduction/", "tests/service/", "tests/studies/",
    "tests/circular/test_command.py", "tests/loaded/test_both.py",
)  # fmt: skip


def leave_out_pictures() -> None:
    """Put a white point in place of each picture of a page, but in the tests that look at them.

    Must be called before :mod:`planner.report.page` is imported.
    """
    standby.draw_pictures = lambda pictures, small: (
        draw_pictures(pictures, small)
        if os.environ.get("PYTEST_CURRENT_TEST", "").startswith(PRINTED)
        else {p.name: WHITE for p in pictures}
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


WHITE = b"".join([
    b"\x89PNG\r\n\x1a\n",
    _chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)),
    _chunk(b"IDAT", zlib.compress(b"\0\xff")),
    _chunk(b"IEND", b""),
])  # fmt: skip
