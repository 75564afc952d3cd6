"""Serial protocols of indicators; another one is a class here and its line in ``PROTOCOLS``."""

import re
from dataclasses import dataclass
from typing import Protocol

from planner.common.errors import InputError, did_you_mean
from planner.common.units import MM


class RefusedReadingError(Exception):
    """The indicator answered that it cannot measure; the message says why."""


class IndicatorProtocol(Protocol):
    """One indicator's language.

    Attributes:
        baudrate, bytesize, parity, stopbits: of the line, in pyserial's words.
        end: last byte of an answer.
        channels: whether several indicators may share one port.
    """

    @property
    def baudrate(self) -> int:
        """Baud rate of the line."""

    @property
    def bytesize(self) -> int:
        """Data bits."""

    @property
    def parity(self) -> str:
        """``N``, ``E`` or ``O``."""

    @property
    def stopbits(self) -> int:
        """Stop bits."""

    @property
    def end(self) -> bytes:
        """Last byte of an answer."""

    @property
    def channels(self) -> bool:
        """Whether several indicators may share one port."""

    def request(self, channel: int) -> bytes:
        """Return the bytes that ask ``channel`` (from 1) for its reading."""

    def value(self, answer: bytes, channel: int) -> float | None:
        """Return the reading [m] in an answer without its end; ``None`` where it is not a whole one.

        Raises:
            Refused: the indicator says that it cannot measure.
        """


_MITUTOYO_VALUE = re.compile(rb"0(\d)A([+-][\d.]{8})")
_MITUTOYO_REFUSED = re.compile(rb"91[0-9]\d?")


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
        if _MITUTOYO_REFUSED.fullmatch(text):
            raise RefusedReadingError(f"no data from the indicator (error {text.decode()})")
        found = _MITUTOYO_VALUE.fullmatch(text)
        if found is None or int(found[1]) != channel or found[2].count(b".") != 1:
            return None
        return float(found[2]) * MM


_SYLVAC_VALUE = re.compile(rb"[+\- ]?(\d+\.\d{2,5})")
_SYLVAC_ERRORS = {
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
        if text in _SYLVAC_ERRORS:
            raise RefusedReadingError(_SYLVAC_ERRORS[text])
        if not _SYLVAC_VALUE.fullmatch(text):
            return None
        return float(text.replace(b" ", b"")) * MM


PROTOCOLS: dict[str, IndicatorProtocol] = {"sylvac": Sylvac(), "mitutoyo": Mitutoyo()}


def find_protocol(name: str) -> IndicatorProtocol:
    """Return the language called ``name``.

    Raises:
        InputError: there is no such one.
    """
    if name not in PROTOCOLS:
        known = sorted(PROTOCOLS)
        raise InputError(f"no indicator protocol '{name}'{did_you_mean(name, known)} (there are: {', '.join(known)})")
    return PROTOCOLS[name]
