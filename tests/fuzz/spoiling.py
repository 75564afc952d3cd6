"""Ways to spoil a file: numbers that no file should hold, lines twice or not at all, nesting, junk, other bytes."""

import re

from hypothesis import strategies as st

NUMBERS = ("1e308", "-1e308", "1e18", "nan", "inf", "-inf", "0", "-1", "1e-300", "99999999999999999999", "0.1", "-0",
           "1e12", "3.7", "true", '"5"', "[]", "{}", "1_0", "0x10", "null")  # fmt: skip
JUNK = ("\x00", "\x1b[2J\x1b]0;x\x07", "\u202e", "[" * 3000, "{" * 3000, '{"a":' * 2000, "x" * 300_000,
        ",", ",,,,", "\n\n", "\ufeff",
        "'", '"', "\\", "<a>",
        "</robot>", "&lol;", "E" * 5000, "-" * 2000, "(" * 4000, "𝟙", "\r", "G1 " * 50_000, "é")  # fmt: skip
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])")
WORD = re.compile(rb"\w+")


@st.composite
def spoiled(draw: st.DrawFn, seed: bytes) -> bytes:
    """A sound file after one to four changes."""
    data = seed
    for _ in range(draw(st.integers(1, 4))):
        data = draw(st.sampled_from((_number, _number, _number, _line, _junk, _word, _bytes, _cut)))(draw, data)
    return data


def _one(draw: st.DrawFn, found: list[re.Match[bytes]]) -> re.Match[bytes] | None:
    return found[draw(st.integers(0, len(found) - 1))] if found else None


def _number(draw: st.DrawFn, data: bytes) -> bytes:
    match = _one(draw, list(NUMBER.finditer(data[:200_000])))
    new = draw(st.sampled_from(NUMBERS)).encode()
    return data if match is None else data[: match.start()] + new + data[match.end() :]


def _word(draw: st.DrawFn, data: bytes) -> bytes:
    words = list(WORD.finditer(data[:50_000]))
    old, new = _one(draw, words), _one(draw, words)
    return data if old is None or new is None else data[: old.start()] + new[0] + data[old.end() :]


def _line(draw: st.DrawFn, data: bytes) -> bytes:
    lines = data.split(b"\n")
    k, times = draw(st.integers(0, len(lines) - 1)), draw(st.sampled_from((0, 2, 2, 500)))
    return b"\n".join([*lines[:k], *[lines[k]] * times, *lines[k + 1 :]])


def _junk(draw: st.DrawFn, data: bytes) -> bytes:
    at = draw(st.integers(0, len(data)))
    return data[:at] + draw(st.sampled_from(JUNK)).encode() + data[at:]


def _bytes(draw: st.DrawFn, data: bytes) -> bytes:
    at = draw(st.integers(0, max(len(data) - 1, 0)))
    return data[:at] + draw(st.binary(min_size=1, max_size=8)) + data[at + draw(st.integers(0, 8)) :]


def _cut(draw: st.DrawFn, data: bytes) -> bytes:
    start, length = draw(st.integers(0, len(data))), draw(st.integers(0, 400))
    return data[:start] + data[start + length :]
