"""Three indicators on serial lines, and readings that have come to rest."""

import sys
import time
from collections import deque
from typing import Protocol

import numpy as np
import serial

from planner.centring.settings import HeadSettings, IndicatorProtocol, RefusedReadingError, RestSettings
from planner.centring.stop import SilentError, StopRequest, UnsettledError
from planner.common.errors import InputError
from planner.common.units import UM, Array, read_only

if sys.platform == "win32":
    LINE_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError)
else:
    from termios import error as LineError

    LINE_ERRORS = (OSError, ValueError, LineError)

INDICATORS = 3  # of a head: one for each direction


class Indicators(Protocol):
    """Three readings at a time."""

    def read(self) -> Array:
        """Return the present readings of the three indicators, (3,) [m]."""

    def close(self) -> None:
        """Close the serial lines."""


class SerialIndicators:
    """Indicators that answer on serial ports: one port each, or one port with three channels."""

    def __init__(self, ports: list[str], language: IndicatorProtocol, head: HeadSettings, stop: StopRequest) -> None:
        self._language, self._head, self._stop = language, head, stop
        self._lines: list[serial.Serial] = []
        try:
            for port in ports:
                self._lines.append(_open_port(port, language))
        except InputError:
            self.close()
            raise
        self._places = [
            (self._lines[k % len(ports)], ports[k % len(ports)], _channel(k, ports)) for k in range(INDICATORS)
        ]

    def read(self) -> Array:
        """Return the present readings of the three indicators, (3,) [m].

        Raises:
            SilentError: one does not answer, or not in its language, or says that it cannot measure.
            StoppedError: a stop was asked for.
        """
        return read_only([self._read_one(*place) for place in self._places])

    def close(self) -> None:
        """Close the serial lines."""
        for line in self._lines:
            line.close()

    def _read_one(self, line: serial.Serial, port: str, channel: int) -> float:
        last = "nothing"
        for _ in range(self._head.tries):
            self._stop.check()
            try:
                answer = self._request(line, channel)
                value = None if answer is None else self._language.value(answer, channel)
            except RefusedReadingError as err:
                last = str(err)
                continue
            except LINE_ERRORS as err:
                raise SilentError(
                    f"the indicator on {port} does not answer any more ({err}). Is its adapter still plugged in?"
                ) from err
            if value is not None:
                return value
            last = "nothing" if answer is None else f"{answer!r}, which is no reading"
        raise SilentError(
            f"the indicator on {port} (channel {channel}) was asked {self._head.tries} times and said {last} "
            f"within {self._head.timeout_s:g} s; is it switched on, and is this its protocol and port?"
        )

    def _request(self, line: serial.Serial, channel: int) -> bytes | None:
        """Ask once; what came before the request is thrown away. ``None`` where no whole answer came in time."""
        longest = 64  # [bytes] of an answer; more is noise
        line.reset_input_buffer()
        line.write(self._language.request(channel))
        answer, until = b"", time.monotonic() + self._head.timeout_s
        while time.monotonic() < until and len(answer) < longest:
            self._stop.check()
            answer += line.read_until(self._language.end, longest)
            if answer.endswith(self._language.end):
                return answer[: -len(self._language.end)]
        return answer or None


def open_indicators(
    ports: list[str], language: IndicatorProtocol, head: HeadSettings, stop: StopRequest
) -> SerialIndicators:
    """Open the ports of the three indicators.

    Raises:
        InputError: neither three ports nor one with channels, or a port cannot be opened.
    """
    if len(ports) not in (1, INDICATORS):
        raise InputError(f"--indicators names {len(ports)} ports; three are needed, or one of a multiplexer")
    if len(ports) == 1 and not language.channels:
        raise InputError(
            f"--indicators names one port ({ports[0]}), but {head.protocol} indicators have no channels: "
            "give three ports, x,y,z"
        )
    if len(set(ports)) < len(ports):
        raise InputError(f"--indicators names a port twice ({', '.join(ports)}); each indicator has its own")
    return SerialIndicators(ports, language, head, stop)


def _open_port(port: str, language: IndicatorProtocol) -> serial.Serial:
    """Open a port; a virtual one may carry whole bytes only, and refuses parity and fewer bits."""
    refused: Exception | None = None
    for bits, parity, stops in ((language.bytesize, language.parity, language.stopbits), (8, "N", 1)):
        try:
            # 0.02: [s] of one look at the line
            return serial.serial_for_url(
                port, language.baudrate, bits, parity, stops, timeout=0.02, write_timeout=1.0, exclusive=True
            )
        except LINE_ERRORS as err:
            refused = err
    raise InputError(f"the indicator's port {port} cannot be opened ({refused})") from refused


def _channel(k: int, ports: list[str]) -> int:
    return k + 1 if len(ports) == 1 else 1


def read_settled_indicators(indicators: Indicators, how: RestSettings, stop: StopRequest) -> Array:
    """Wait for the arm to settle, read until enough readings in a row agree, and return their mean, (3,) [m].

    Raises:
        UnsettledError: they never do.
        SilentError: an indicator does not answer.
        StoppedError: a stop was asked for.
    """
    stop.wait(how.settle_s)
    last: deque[Array] = deque(maxlen=how.readings)
    for _ in range(max(how.most_readings, how.readings)):
        last.append(indicators.read())
        spread = np.ptp(np.array(last), axis=0)
        if len(last) == how.readings and np.all(spread <= how.spread_um * UM):
            return read_only(np.mean(np.array(last), axis=0))
    raise UnsettledError(
        f"after {how.most_readings} readings the last {how.readings} still spread over "
        f"{', '.join(f'{s / UM:.1f}' for s in spread)} µm (x, y, z); {how.spread_um:g} µm are allowed: "
        "does something shake the cell, or is an answer lost now and then?"
    )
