"""Serial protocols of indicators; another one is a function here and its line in ``PROTOCOLS``."""

import re
from collections.abc import Callable
from dataclasses import dataclass

from planner.common.errors import InputError, did_you_mean
from planner.common.units import MM


class RefusedReadingError(Exception):
    """The indicator answered that it cannot measure; the message says why."""


@dataclass(frozen=True)
class IndicatorProtocol:
    """How indicators are asked and how they answer.

    Attributes:
        baudrate, bytesize, parity, stopbits: of the line, in pyserial's words.
        request: channel (from 1) → the bytes that ask for its reading.
        value: an answer without its end, and the channel → the reading [m]; ``None`` where it is not a whole one.
        end: last byte of an answer.
        channels: whether several indicators may share one port.
    """

    baudrate: int
    bytesize: int
    parity: str
    stopbits: int
    request: Callable[[int], bytes]
    value: Callable[[bytes, int], float | None]
    end: bytes = b"\r"
    channels: bool = False


SYLVAC_VALUE = re.compile(rb"[+\- ]?(\d+\.\d{2,5})")
SYLVAC_ERRORS = {
    b"ERR0": "sensor error (too fast, or the scale)",
    b"ERR1": "it does not know the request",
    b"ERR2": "parity error on its line",
    b"ERR3": "out of its measuring range",
}
MITUTOYO_VALUE = re.compile(rb"0(\d)A([+-][\d.]{8})")
MITUTOYO_ERROR = re.compile(rb"91[0-9]\d?")


def _sylvac_value(answer: bytes, channel: int) -> float | None:
    text = answer.strip(b"\n")
    if text in SYLVAC_ERRORS:
        raise RefusedReadingError(SYLVAC_ERRORS[text])
    return float(text.replace(b" ", b"")) * MM if SYLVAC_VALUE.fullmatch(text) else None


def _mitutoyo_value(answer: bytes, channel: int) -> float | None:
    """Another channel's answer is no reading either."""
    text = answer.strip(b"\n")
    if MITUTOYO_ERROR.fullmatch(text):
        raise RefusedReadingError(f"no data from the indicator (error {text.decode()})")
    found = MITUTOYO_VALUE.fullmatch(text)
    if found is None or int(found[1]) != channel or found[2].count(b".") != 1:
        return None
    return float(found[2]) * MM


PROTOCOLS = {
    # one indicator a port, in millimetres as set on the instrument: the answer names no unit; ``?`` CR asks; over
    # cable, Bluetooth or V-MUX (Sylvac, manuals of the Opto-RS and Power instruments, "Data format", "Remote commands")
    "sylvac": IndicatorProtocol(4800, 7, "E", 2, lambda channel: b"?\r", _sylvac_value),
    # one a port, or three on channels 1 to 3 of a multiplexer; a channel's number and CR ask, 01A+0000.123 CR answers
    # (Mitutoyo manual 99MAF600B, QM-Height, "USB data output specification"); the request, and 91x of a unit that has
    # no data, are those usual for its multiplexers
    "mitutoyo": IndicatorProtocol(9600, 8, "N", 1, lambda channel: b"%d\r" % channel, _mitutoyo_value, channels=True),
}


def find_protocol(name: str) -> IndicatorProtocol:
    """Return the language called ``name``.

    Raises:
        InputError: there is no such one.
    """
    if name not in PROTOCOLS:
        known = sorted(PROTOCOLS)
        raise InputError(f"no indicator protocol {name!r}{did_you_mean(name, known)} (there are: {', '.join(known)})")
    return PROTOCOLS[name]
