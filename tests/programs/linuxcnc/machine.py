"""A machine of six joints under LinuxCNC's own motion controller, in simulation: its INI, its HAL, and a drive.

The joints are X Y Z A B C of ``trivkins``; each motor's command is looped back as its feedback. A sampler logs
the six joints and the output that marks the poses in each cycle of the motion controller: where the computer is busy,
the cycles come late, but each is still a millisecond of the motion.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

JOINTS = 6
CYCLE_S = 0.001
KEPT = 20  # one cycle of so many is kept of the log
SAMPLE_S = KEPT * CYCLE_S
OUTPUT = INPUT = 1  # motion.digital-out-01 marks the poses, motion.digital-in-01 says that the gauge is ready
AXES = "XYZABC"

INI = """[EMC]
VERSION = 1.1
MACHINE = robot
[DISPLAY]
DISPLAY = ./operator_program.py
[TASK]
TASK = milltask
CYCLE_TIME = 0.001
[RS274NGC]
PARAMETER_FILE = machine.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = {cycle}
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.1
TOOL_TABLE = tool.tbl
[HAL]
HALFILE = machine.hal
[KINS]
KINEMATICS = trivkins coordinates=XYZABC
JOINTS = 6
[TRAJ]
COORDINATES = X Y Z A B C
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = 10
MAX_LINEAR_VELOCITY = {speed}
MAX_LINEAR_ACCELERATION = {acceleration}
"""
JOINT = """[AXIS_{axis}]
MIN_LIMIT = {low}
MAX_LIMIT = {high}
MAX_VELOCITY = {speed}
MAX_ACCELERATION = {acceleration}
[JOINT_{number}]
TYPE = {kind}
MIN_LIMIT = {low}
MAX_LIMIT = {high}
MAX_VELOCITY = {speed}
MAX_ACCELERATION = {acceleration}
HOME = {home}
HOME_OFFSET = {home}
HOME_SEARCH_VEL = 0
HOME_LATCH_VEL = 0
HOME_SEQUENCE = 0
FERROR = 5
MIN_FERROR = 1
"""
HAL = f"""loadrt [KINS]KINEMATICS
loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS]JOINTS
loadrt sampler depth=30000 cfg=ffffffb
addf motion-command-handler servo-thread
addf motion-controller servo-thread
addf sampler.0 servo-thread
setp motion.digital-in-0{INPUT} 1
net mark motion.digital-out-0{OUTPUT} => sampler.0.pin.{JOINTS}
net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
net prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared
net change iocontrol.0.tool-change => iocontrol.0.tool-changed
{{loops}}
loadusr halsampler -c 0 -t log.txt
"""


@dataclass(frozen=True)
class JointLimits:
    """What one joint of the machine may do: range [deg], speed [deg/s], acceleration [deg/s2]."""

    low: float
    high: float
    speed: float
    acceleration: float


@dataclass(frozen=True)
class Log:
    """What the machine drove: joints (n, 6) [deg] and the pose mark (n,), every ``SAMPLE_S``; its file, its words.

    ``cycles_deg`` (20 n, 6) [deg] has each cycle of the motion controller: where a person only goes on, the axes rest
    for a few of them, however long that took by the clock on the wall.
    """

    file: Path
    q_deg: np.ndarray
    mark: np.ndarray
    cycles_deg: np.ndarray
    words: str


def installed() -> bool:
    """Return whether LinuxCNC with its motion controller is there, and may write its lock and its log into /tmp."""
    there = all(shutil.which(name) for name in ("linuxcnc", "milltask", "halsampler"))
    write = 'file=$(mktemp /tmp/linuxcnc.XXXXXX) && rm "$file"'
    return there and subprocess.run([*_user(), "sh", "-c", write], check=False, capture_output=True).returncode == 0


def _user() -> list[str]:
    """Return the words that start a command as the user ``nobody``, if root asks: LinuxCNC refuses root.

    It writes into /tmp, which is not everybody's on each machine: the user may write where root may.
    """
    if os.geteuid() != 0:
        return []
    nobody = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"]
    return [*nobody, "--inh-caps=+dac_override", "--ambient-caps=+dac_override"]


def write_machine(folder: Path, limits: list[JointLimits], program: str) -> None:
    """Write INI, HAL, tool table, program and the stand-in for the operator into ``folder``."""
    largest = {"speed": max(j.speed for j in limits[:3]), "acceleration": max(j.acceleration for j in limits[:3])}
    joints = [
        JOINT.format(
            axis=AXES[i], number=i, kind="LINEAR" if i < 3 else "ANGULAR", low=j.low, high=j.high, speed=j.speed,
            acceleration=j.acceleration, home=min(max(0.0, j.low), j.high),
        )
        for i, j in enumerate(limits)
    ]  # fmt: skip
    loops = [f"net j{i} joint.{i}.motor-pos-cmd => joint.{i}.motor-pos-fb sampler.0.pin.{i}" for i in range(JOINTS)]
    (folder / "machine.ini").write_text(INI.format(cycle=round(CYCLE_S * 1e9), **largest) + "".join(joints))
    (folder / "machine.hal").write_text(HAL.format(loops="\n".join(loops)))
    (folder / "tool.tbl").write_text("")
    (folder / "program.ngc").write_text(program)
    shutil.copy(Path(__file__).with_name("operator_program.py"), folder)
    (folder / "operator_program.py").chmod(0o755)


def drive(program: str, limits: list[JointLimits], kept: Path, seconds: float) -> Log:
    """Run a program on the machine in real time, ``seconds`` at most; the log is kept in the file ``kept``.

    LinuxCNC's realtime part refuses root, so root runs it as the user ``nobody``, in a folder of that user.
    """
    folder = Path(tempfile.mkdtemp(prefix="linuxcnc-", dir="/tmp"))
    try:
        write_machine(folder, limits, program)
        _run(folder, seconds)
        assert (folder / "log.txt").exists(), (folder / "words.txt").read_text()[-4000:]
        rows = np.loadtxt(folder / "log.txt")
        assert np.all(np.diff(rows[:, 0]) == 1.0), "the sampler lost cycles"
        cycles_deg, rows = rows[:, 1 : 1 + JOINTS], rows[::KEPT]
        np.savetxt(kept, rows, fmt=["%d", *["%.6f"] * JOINTS, "%d"])
        said = "".join(p.read_text() for p in [folder / "words.txt", *folder.glob("operator.txt")])
        return Log(kept, rows[:, 1 : 1 + JOINTS], rows[:, 1 + JOINTS], cycles_deg, said)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _run(folder: Path, seconds: float) -> None:
    """Start LinuxCNC and wait until its operator leaves; one that does not end is killed with all that it started."""
    user = _user()
    if user:
        for one in (folder, *folder.iterdir()):
            shutil.chown(one, "nobody")
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV", "DISPLAY")}
    environment["HOME"] = str(folder)
    with (folder / "words.txt").open("w") as words:
        machine = subprocess.Popen(
            [*user, "linuxcnc", str(folder / "machine.ini")], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
            stdout=words, stderr=words, start_new_session=True,
        )  # fmt: skip
        try:
            machine.wait(seconds)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(machine.pid, signal.SIGKILL)
            subprocess.run([*user, "halrun", "-U"], cwd=folder, env=environment, stdout=words, stderr=words, timeout=60)
