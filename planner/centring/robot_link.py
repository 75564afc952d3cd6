"""The robot at the cell: what a centring needs of it, KUKA's side of it, and the program that runs there."""

import contextlib
import re
import socket
import time
from enum import IntEnum
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from scipy.spatial.transform import Rotation

from planner.centring.settings import RobotSettings
from planner.centring.stop import LinkError, StoppedError, StopRequest
from planner.common.errors import InputError
from planner.common.files import data_folder, encode_text, write_together
from planner.common.units import MM, Array, from_deg, read_only, to_deg, to_mm
from planner.kinematics.axes import AxisConvention

IDLE_TIME = 20.0  # [s] after which the connection is made anew, before the server drops it


class Mode(IntEnum):
    """What a request to KUKAVARPROXY asks for."""

    READ, WRITE = 0, 1


class Order(IntEnum):
    """What the program on the controller is told to do (its EDBB_KIND)."""

    MOVE, SHIFT, GO_ON = 1, 2, 3


class Ended(IntEnum):
    """How the program on the controller ended an order (its EDBB_STATE)."""

    DONE, MOVING, STOPPED, REFUSED, SILENCE = 0, 1, 2, 3, 4


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
        value = self._exchange(Mode.READ, name, _text(name))
        if not value:
            raise LinkError(self._refusal_text("give", name))
        return value

    def write(self, name: str, value: str) -> None:
        """Set a variable to a value, as KRL writes it.

        Raises:
            LinkError: no answer, or the controller does not take it.
        """
        self._exchange(Mode.WRITE, name, _text(name) + _text(value))

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

    def _exchange(self, mode: Mode, name: str, content: bytes) -> str:
        if time.monotonic() - self._spoken > IDLE_TIME:
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
            raise LinkError(
                f"the robot at {self.where} does not answer any more ({err.strerror or err}), asked for '{name}'"
            ) from err
        self._spoken = time.monotonic()
        if found != mode:
            raise LinkError(f"the robot at {self.where} answered with mode {found} for '{name}'; is it KUKAVARPROXY?")
        if status[-1:] != b"\x01":
            raise LinkError(self._refusal_text("set" if mode is Mode.WRITE else "give", name))
        return value.decode("ascii", "replace").strip()

    def _answer(self, until: float) -> tuple[int, bytes, bytes]:
        """Return mode, value and status of the last request's answer; late answers to earlier ones are passed over."""
        while True:
            head = self._bytes(7, until)
            value = self._bytes(int.from_bytes(head[5:7], "big"), until)
            status = self._bytes(3, until)  # bytes of a status
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
            "is the centring program with its .dat on the controller (edbb centre --program-to DIR writes them)?"
        )


def _text(text: str) -> bytes:
    data = text.encode("ascii")
    return len(data).to_bytes(2, "big") + data


class RobotLink(Protocol):
    """A robot that is told where to go, and waits there. Every call returns when the arm stands still.

    All raise LinkError where the robot does not answer or does not do it, StoppedError where a stop was asked for.
    """

    def move(self, q: Array, slow: bool = False) -> None:
        """Go to the joint angles q (N,) [rad] of the model, joint by joint; ``slow`` where tips and ball touch."""

    def shift(self, step: Array) -> None:
        """Move the tool by ``step`` (3,) [m] in its own frame, on a line."""

    def joints(self) -> tuple[Array, Array]:
        """Return the joint angles of the model as read and as commanded, both (N,) [rad]."""

    def orientation(self) -> Array:
        """Return R_BT (3, 3), the tool's axes in the controller's base."""

    def arrive(self) -> int:
        """Wait until the plan's own program stands at a ball, and return the pose's id."""

    def release(self) -> None:
        """Let the program that drives the planned way go on."""

    def stop(self) -> None:
        """Stop the arm now; never raises."""

    def close(self) -> None:
        """Close the connection to the robot."""


DIALECT = "krl"


def centring_program(how: RobotSettings) -> dict[str, str]:
    """Return the files of the robot's program, by name; lines end as the controller wants them."""
    environment = Environment(
        loader=FileSystemLoader(data_folder("g-code") / DIALECT),
        undefined=StrictUndefined,
        trim_blocks=True,
        autoescape=False,  # a robot program is no HTML
    )
    context = {
        "name": how.program,
        "tool": how.tool,
        "base": how.base,
        "speed_m_s": how.speed_mm_s * MM,
        "silence_ms": round(1e3 * how.silence_s),
        "timer": how.timer,
        "largest_mm": 5.0,  # [mm] the robot takes no longer shift, whatever the planner says
    }
    texts = {e: environment.get_template(f"centring.{e}.j2").render(context) for e in ("src", "dat")}
    return {f"{how.program}.{e}": "\r\n".join(text.splitlines()) + "\r\n" for e, text in texts.items()}


def write_centring_program(how: RobotSettings, out: Path, force: bool = False) -> list[Path]:
    """Write the robot's program into a folder, and return its files; with ``force`` files of others are replaced.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise InputError(f"{out}: cannot be made ({err.strerror or err})") from err
    files = [(out / name, encode_text(out / name, text, "ascii")) for name, text in centring_program(how).items()]
    write_together(files, force=force)
    return [path for path, _ in files]


_PART = re.compile(r"\b([A-Z]\d?)\s+(-?\d+\.?\d*(?:[eE][-+]?\d+)?)")


class KukaLink:
    """Moves a KUKA robot, whose axes count as ``axes`` says; see :class:`RobotLink`."""

    def __init__(
        self, host: str, port: int, axes: AxisConvention, how: RobotSettings, stop: StopRequest, follow: bool = False
    ) -> None:
        self._axes, self._how, self._stop = axes, how, stop
        self._proxy = VarProxy(host, port, how.answer_s)
        try:
            self._order = int(self._number("EDBB_GO"))
            if not follow:  # the plan's program counts only while it stands at a ball
                self._runs()
            stands = _PART.findall(self._proxy.read("$AXIS_ACT"))
            self._beside = [f"{axis} {value}" for axis, value in stands if axis[0] == "E"]  # external axes stay there
            self._proxy.write("EDBB_STOP", "FALSE")
        except BaseException:
            self._proxy.close()
            raise

    def move(self, q: Array, slow: bool = False) -> None:
        """Go to the joint angles q (N,) [rad] of the model, joint by joint; ``slow`` where tips and ball touch."""
        target = to_deg(self._axes.to_controller(q))
        self._proxy.write("EDBB_VEL", str(self._how.touch_percent if slow else self._how.ptp_percent))
        axes = [f"A{j} {angle:.6f}" for j, angle in enumerate(target, start=1)]
        self._proxy.write("EDBB_AX", "{E6AXIS: " + ", ".join([*axes, *self._beside]) + "}")
        self._do(Order.MOVE)
        off = np.abs(to_deg(self._angles("$AXIS_ACT")) - target)
        if off.max() > self._how.arrived_deg:
            raise LinkError(f"axis {off.argmax() + 1} stands {off.max():.3f} deg away from where it was sent")

    def shift(self, step: Array) -> None:
        """Move the tool by ``step`` (3,) [m] in its own frame, on a line."""
        parts = ", ".join(f"{axis} {v:.5f}" for axis, v in zip("XYZ", to_mm(step), strict=True))
        self._proxy.write("EDBB_BY", "{FRAME: " + parts + ", A 0.0, B 0.0, C 0.0}")
        self._do(Order.SHIFT)

    def joints(self) -> tuple[Array, Array]:
        """Return the joint angles of the model as read and as commanded, both (N,) [rad]."""
        read, commanded = (self._axes.to_model(self._angles(name)) for name in ("$AXIS_ACT_MEAS", "$AXIS_ACT"))
        return read_only(read), read_only(commanded)

    def orientation(self) -> Array:
        """Return R_BT (3, 3): KUKA's A, B, C turn about z, y, x of the tool in turn."""
        return read_only(Rotation.from_euler("ZYX", from_deg(self._parts("$POS_ACT", "ABC"))).as_matrix())

    def arrive(self) -> int:
        """Wait until the plan's own program stands at a ball, and return the pose's id."""
        until = time.monotonic() + self._how.arrive_s
        while (pose := int(self._number("EDBB_POSE"))) < 0:
            self._stop.wait(self._how.poll_s)
            if time.monotonic() > until:
                raise LinkError(f"the plan's program came to no ball within {self._how.arrive_s:g} s; does it run?")
        self._runs()
        return pose

    def release(self) -> None:
        """Let the program that drives the planned way go on."""
        self._do(Order.GO_ON)

    def stop(self) -> None:
        """Stop the arm now; where the link is lost, the robot's own program stops it."""
        with contextlib.suppress(LinkError):
            self._proxy.write("EDBB_STOP", "TRUE")

    def close(self) -> None:
        """Close the connection to the robot."""
        self._proxy.close()

    def _do(self, kind: Order) -> None:
        """Give an order and wait until it is done."""
        self._stop.check()
        self._proxy.write("EDBB_KIND", str(int(kind)))
        self._alive()
        self._order = self._order % 30000 + 1  # it stays in an INT of any controller
        self._proxy.write("EDBB_GO", str(self._order))
        until = time.monotonic() + self._how.move_s
        while int(self._number("EDBB_DONE")) != self._order:
            self._stop.wait(self._how.poll_s)
            self._alive()
            if time.monotonic() > until:
                raise LinkError(
                    f"the robot did not finish a move within {self._how.move_s:g} s: is the centring program running, "
                    "are the drives on, is the operating mode right?"
                )
        ended = int(self._number("EDBB_STATE"))
        if ended == Ended.STOPPED:
            raise StoppedError("the robot's program was told to stop")
        if ended != Ended.DONE:
            raise LinkError(f"the robot's program did not do the move ({_END_STATES.get(ended, f'state {ended}')})")

    def _alive(self) -> None:
        """Wind up the controller's timer, which stops a move when it runs out."""
        self._proxy.write(f"$TIMER[{self._how.timer}]", str(-round(1e3 * self._how.silence_s)))

    def _runs(self) -> None:
        """Make sure that the program counts."""
        first = self._proxy.read("EDBB_BEAT")
        until = time.monotonic() + self._how.answer_s
        while time.monotonic() < until:
            self._stop.wait(self._how.poll_s)
            if self._proxy.read("EDBB_BEAT") != first:
                return
        raise LinkError(
            f"the program {self._how.program} does not run on the controller: select it, drive to its start and let it "
            "wait (edbb centre --program-to DIR writes it)"
        )

    def _angles(self, name: str) -> Array:
        return from_deg(self._parts(name, [f"A{j}" for j in range(1, self._axes.n_axes + 1)]))

    def _parts(self, name: str, wanted: str | list[str]) -> Array:
        """Return parts of a structure, ``{E6AXIS: A1 -12.5, A2 …}``."""
        text = self._proxy.read(name)
        parts = dict(_PART.findall(text))
        try:
            return read_only([float(parts[key]) for key in wanted])
        except KeyError as err:
            raise LinkError(f"the controller gives '{name}' as {text!r}, without {err}") from err

    def _number(self, name: str) -> float:
        text = self._proxy.read(name)
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise LinkError(f"the controller gives '{name}' as {text!r}, which is no number")
        return value


_END_STATES: dict[int, str] = {
    Ended.MOVING: "it was left half way",
    Ended.REFUSED: "a shift beyond 5 mm, or an order that it does not know",
    Ended.SILENCE: "the planner was silent for too long",
}


def open_link(
    address: str, axes: AxisConvention, how: RobotSettings, stop: StopRequest, follow: bool = False
) -> RobotLink:
    """Connect to the robot at ``tcp://HOST[:PORT]``, a KUKA controller with KUKAVARPROXY (port 7000).

    ``axes`` says how that controller counts the robot's axes. With ``follow`` the plan's own program drives the robot.

    Raises:
        InputError: no such form of address.
        LinkError: nobody answers there, or the centring program does not run.
    """
    default_port = 7000  # of KUKAVARPROXY
    try:
        url = urlsplit(address)
        host, port = url.hostname, url.port
    except ValueError:
        url, host, port = urlsplit(""), None, None
    if url.scheme != "tcp" or not host or url.path not in ("", "/"):
        raise InputError(
            f"--robot {address}: an address is tcp://HOST or tcp://HOST:PORT (KUKAVARPROXY, port {default_port})"
        )
    return KukaLink(host, port or default_port, axes, how, stop, follow)
