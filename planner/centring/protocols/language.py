"""What an indicator's language must say: how the line is set, what asks for a reading, what the answer means."""

from typing import Protocol


class Refused(Exception):
    """The indicator answered that it cannot measure; the message says why."""


class Language(Protocol):
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
