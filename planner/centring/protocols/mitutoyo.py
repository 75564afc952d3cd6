"""Mitutoyo: a channel's number and CR ask, ``01A+0000.123`` CR answers: USB input tools, multiplexers.

The answer is that of Mitutoyo's manual 99MAF600B (QM-Height), "USB data output specification": code 0, channel, A,
sign, eight characters, CR. The request, and 91x of a unit that has no data, are those usual for its multiplexers.
"""

import re
from dataclasses import dataclass

from planner.centring.protocols.language import Refused
from planner.units import MM

_VALUE = re.compile(rb"0(\d)A([+-][\d.]{8})")
_REFUSED = re.compile(rb"91[0-9]\d?")


@dataclass(frozen=True)
class Mitutoyo:
    """One indicator a port, or three on channels 1 to 3 of one multiplexer; in millimetres."""

    baudrate: int = 9600
    bytesize: int = 8
    parity: str = "N"
    stopbits: int = 1
    end: bytes = b"\r"
    channels: bool = True

    def request(self, channel: int) -> bytes:
        """Return the bytes that ask ``channel`` for a reading."""
        return b"%d\r" % channel

    def value(self, answer: bytes, channel: int) -> float | None:
        """Return the reading [m], ``None`` where the answer is not a whole one or another channel's."""
        text = answer.strip(b"\n")
        if _REFUSED.fullmatch(text):
            raise Refused(f"no data from the indicator (error {text.decode()})")
        found = _VALUE.fullmatch(text)
        if found is None or int(found[1]) != channel or found[2].count(b".") != 1:
            return None
        return float(found[2]) * MM
