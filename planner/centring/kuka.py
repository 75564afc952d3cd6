"""A KUKA robot behind KUKAVARPROXY: the program ``g-code/krl/centring.src.j2`` runs there and does what it is told.

An order is written (target, kind) and then numbered; the program does it and reports the number and how it ended.
"""

import contextlib
import re
import time

import numpy as np
from scipy.spatial.transform import Rotation

from planner.centring.errors import LinkError, StoppedError
from planner.centring.kukavarproxy import VarProxy
from planner.centring.settings import RobotFile
from planner.centring.stopping import Stop
from planner.units import Array, from_deg, frozen, to_deg, to_mm

MOVE, SHIFT, GO_ON = 1, 2, 3
DONE, MOVING, STOPPED, REFUSED, SILENCE = 0, 1, 2, 3, 4
LARGEST = 30000  # of an order's number: it stays in an INT of any controller
_PART = re.compile(r"\b([A-Z]\d?)\s+(-?\d+\.?\d*(?:[eE][-+]?\d+)?)")


class KukaLink:
    """Moves a KUKA robot; see :class:`planner.centring.link.RobotLink`."""

    def __init__(self, host: str, port: int, n_joints: int, how: RobotFile, stop: Stop, follow: bool = False) -> None:
        self._n, self._how, self._stop = n_joints, how, stop
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
        """Go to the controller angles q (N,) [rad], joint by joint; ``slow`` where tips and ball touch."""
        target = to_deg(q)
        self._proxy.write("EDBB_VEL", str(self._how.touch_percent if slow else self._how.ptp_percent))
        axes = [f"A{j} {angle:.6f}" for j, angle in enumerate(target, start=1)]
        self._proxy.write("EDBB_AX", "{E6AXIS: " + ", ".join([*axes, *self._beside]) + "}")
        self._do(MOVE)
        off = np.abs(to_deg(self.joints()[1]) - target)
        if off.max() > self._how.arrived_deg:
            raise LinkError(f"axis {off.argmax() + 1} stands {off.max():.3f} deg away from where it was sent")

    def shift(self, step: Array) -> None:
        """Move the tool by ``step`` (3,) [m] in its own frame, on a line."""
        parts = ", ".join(f"{axis} {v:.5f}" for axis, v in zip("XYZ", to_mm(step), strict=True))
        self._proxy.write("EDBB_BY", "{FRAME: " + parts + ", A 0.0, B 0.0, C 0.0}")
        self._do(SHIFT)

    def joints(self) -> tuple[Array, Array]:
        """Return the controller angles as read and as commanded, both (N,) [rad]."""
        return self._angles("$AXIS_ACT_MEAS"), self._angles("$AXIS_ACT")

    def orientation(self) -> Array:
        """Return R_BT (3, 3): KUKA's A, B, C turn about z, y, x of the tool in turn."""
        return frozen(Rotation.from_euler("ZYX", from_deg(self._parts("$POS_ACT", "ABC"))).as_matrix())

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
        """Let that program go on."""
        self._do(GO_ON)

    def stop(self) -> None:
        """Stop the arm now; where the link is lost, the robot's own program stops it."""
        with contextlib.suppress(LinkError):
            self._proxy.write("EDBB_STOP", "TRUE")

    def close(self) -> None:
        """Let the robot go."""
        self._proxy.close()

    def _do(self, kind: int) -> None:
        """Give an order and wait until it is done."""
        self._stop.check()
        self._proxy.write("EDBB_KIND", str(kind))
        self._alive()
        self._order = self._order % LARGEST + 1
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
        if ended == STOPPED:
            raise StoppedError("the robot's program was told to stop")
        if ended != DONE:
            raise LinkError(f"the robot's program did not do the move ({_ENDED.get(ended, f'state {ended}')})")

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
            "wait (edbb centre --program DIR writes it)"
        )

    def _angles(self, name: str) -> Array:
        return from_deg(self._parts(name, [f"A{j}" for j in range(1, self._n + 1)]))

    def _parts(self, name: str, wanted: str | list[str]) -> Array:
        """Return parts of a structure, ``{E6AXIS: A1 -12.5, A2 …}``."""
        text = self._proxy.read(name)
        parts = dict(_PART.findall(text))
        try:
            return frozen([float(parts[key]) for key in wanted])
        except KeyError as err:
            raise LinkError(f"the controller gives '{name}' as {text!r}, without {err}") from err

    def _number(self, name: str) -> float:
        text = self._proxy.read(name)
        try:
            return float(text)
        except ValueError as err:
            raise LinkError(f"the controller gives '{name}' as {text!r}, which is no number") from err


_ENDED = {
    MOVING: "it was left half way",
    REFUSED: "a shift beyond 5 mm, or an order that it does not know",
    SILENCE: "the planner was silent for too long",
}
