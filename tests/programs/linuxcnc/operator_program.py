#!/usr/bin/python3
"""Stand in for the person at LinuxCNC's screen: home, open the program, start it, go on at each stop.

LinuxCNC starts this file as its ``DISPLAY``, with the python of Debian, for which its module ``linuxcnc`` is built.
"""

import sys
import time

import linuxcnc

AXES = 6
PATIENCE_S = 60.0  # for a state of the machine that comes within a second

# LinuxCNC takes away what its display prints, where it runs without a terminal
words = open("operator.txt", "w")  # noqa: SIM115
command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()


def wait_for(reached, what):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        status.poll()
        if reached():
            return
        time.sleep(0.02)
    print(f"the machine never was {what}", file=words, flush=True)
    sys.exit(1)


def start():
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.wait_complete()
    command.state(linuxcnc.STATE_ON)
    wait_for(lambda: status.task_state == linuxcnc.STATE_ON, "on")
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    for joint in range(AXES):
        command.home(joint)
    wait_for(lambda: all(status.homed[:AXES]), "homed")
    command.teleop_enable(1)
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open("program.ngc")
    command.auto(linuxcnc.AUTO_RUN, 0)
    wait_for(lambda: status.interp_state != linuxcnc.INTERP_IDLE, "running")


def attend():
    """Go on at each stop until the program has ended and the machine rests; what the machine says is printed."""
    while status.interp_state != linuxcnc.INTERP_IDLE or not status.inpos:
        status.poll()
        message = errors.poll()
        if message:
            print("message:", message[1], file=words, flush=True)
        if status.paused:
            command.auto(linuxcnc.AUTO_RESUME)
            time.sleep(0.5)
        time.sleep(0.02)


try:
    start()
    attend()
    print("ended", file=words, flush=True)
finally:
    command.state(linuxcnc.STATE_OFF)
