"""Sylvac: ``?`` CR asks; sign, digits, point, decimals, CR answer: over cable, Bluetooth or V-MUX's virtual ports.

Sylvac, instruction manuals of the Opto-RS and Power instruments, "Data format" and "Remote commands".
"""

import re
from dataclasses import dataclass

from planner.centring.protocols.language import Refused
from planner.units import MM

_VALUE = re.compile(rb"[+\- ]?(\d+\.\d{2,5})")
_SAID = {
    b"ERR0": "sensor error (too fast, or the scale)",
    b"ERR1": "it does not know the request",
    b"ERR2": "parity error on its line",
    b"ERR3": "out of its measuring range",
}


@dataclass(frozen=True)
class Sylvac:
    """One indicator a port, in millimetres (as set on the instrument: the answer names no unit)."""

    baudrate: int = 4800
    bytesize: int = 7
    parity: str = "E"
    stopbits: int = 2
    end: bytes = b"\r"
    channels: bool = False

    def request(self, channel: int) -> bytes:
        """Return the bytes that ask for a reading."""
        return b"?\r"

    def value(self, answer: bytes, channel: int) -> float | None:
        """Return the reading [m], ``None`` where the answer is not a whole one."""
        text = answer.strip(b"\n")
        if text in _SAID:
            raise Refused(_SAID[text])
        if not _VALUE.fullmatch(text):
            return None
        return float(text.replace(b" ", b"")) * MM
