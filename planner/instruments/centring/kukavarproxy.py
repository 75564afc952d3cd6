"""KUKAVARPROXY: variables of a KUKA controller read and written over TCP, one message for each.

Request: id (2 bytes), length of the rest (2), 0 read or 1 write (1), length of the name (2), name; for a write the
length of the value (2) and the value. Answer: id (2), length (2), mode (1), length of the value (2), value, and three
bytes of status, of which the last is 1 where it was done; some versions count these three in the length, some do not.
A variable that does not exist reads as nothing, done. Numbers are big-endian, text is ASCII. A client that is idle for
30 s is dropped. Source: the published source of KUKAVARPROXY (IMTS), basMain.bas and frmMain.frm.
"""

import socket
import time

from planner.instruments.centring.stop import LinkError

PORT = 7000
READ, WRITE = 0, 1
IDLE = 20.0  # [s] after which the connection is made anew, before the server drops it
STATUS = 3  # bytes


class VarProxy:
    """One connection to KUKAVARPROXY on a controller."""

    def __init__(self, host: str, port: int, answer_s: float) -> None:
        self.where = f"{host}:{port}"
        self._address, self._answer_s, self._id = (host, port), answer_s, 0
        self._connect()

    def read(self, name: str) -> str:
        """Return the value of a variable, as KRL writes it.

        Raises:
            LinkError: no answer, or there is no such variable.
        """
        value = self._exchange(READ, name, _text(name))
        if not value:
            raise LinkError(self._refusal_text("give", name))
        return value

    def write(self, name: str, value: str) -> None:
        """Set a variable to a value, as KRL writes it.

        Raises:
            LinkError: no answer, or the controller does not take it.
        """
        self._exchange(WRITE, name, _text(name) + _text(value))

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _connect(self) -> None:
        try:
            self._socket = socket.create_connection(self._address, self._answer_s)
        except OSError as err:
            raise LinkError(
                f"no robot at tcp://{self.where} ({err.strerror or err}); is KUKAVARPROXY running on the controller, "
                "and its port open in the controller's network settings?"
            ) from err
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer, self._spoken = b"", time.monotonic()

    def _exchange(self, mode: int, name: str, content: bytes) -> str:
        if time.monotonic() - self._spoken > IDLE:
            self.close()
            self._connect()
        self._id = self._id % 0xFFFF + 1
        body = bytes([mode]) + content
        try:
            self._socket.sendall(self._id.to_bytes(2, "big") + len(body).to_bytes(2, "big") + body)
            found, value, status = self._answer(time.monotonic() + self._answer_s)
        except TimeoutError as err:
            raise LinkError(f"the robot at {self.where} gave no answer for '{name}' in {self._answer_s:g} s") from err
        except OSError as err:
            raise LinkError(f"the robot at {self.where} is gone ({err.strerror or err}), asked for '{name}'") from err
        self._spoken = time.monotonic()
        if found != mode:
            raise LinkError(f"the robot at {self.where} answered with mode {found} for '{name}'; is it KUKAVARPROXY?")
        if status[-1:] != b"\x01":
            raise LinkError(self._refusal_text("set" if mode == WRITE else "give", name))
        return value.decode("ascii", "replace").strip()

    def _answer(self, until: float) -> tuple[int, bytes, bytes]:
        """Return mode, value and status of the last request's answer; late answers to earlier ones are passed over."""
        while True:
            head = self._bytes(7, until)
            value = self._bytes(int.from_bytes(head[5:7], "big"), until)
            status = self._bytes(STATUS, until)
            if int.from_bytes(head[:2], "big") == self._id:
                return head[4], value, status

    def _bytes(self, count: int, until: float) -> bytes:
        while len(self._buffer) < count:
            left = until - time.monotonic()
            if left <= 0.0:
                raise TimeoutError
            self._socket.settimeout(left)
            more = self._socket.recv(4096)
            if not more:
                raise ConnectionError("it closed the connection")
            self._buffer += more
        found, self._buffer = self._buffer[:count], self._buffer[count:]
        return found

    def _refusal_text(self, verb: str, name: str) -> str:
        return (
            f"the controller at {self.where} does not {verb} '{name}': "
            "is the centring program with its .dat on the controller (edbb centre --program DIR writes them)?"
        )


def _text(text: str) -> bytes:
    data = text.encode("ascii")
    return len(data).to_bytes(2, "big") + data
