"""Stäubli VAL3: what its manual says, and programs of the planner run by a small controller written from it."""

import re
import xml.etree.ElementTree as ET

import numpy as np

import tests.programs.sessions as sessions
from planner.programs.verification import write_program
from tests.programs.controllers import NUMBER, DialectFacts, Language

# VAL3 reference manual, speed monitoring: setMonitorSpeed() changes the monitor speed, the pendant too
OVERRIDE = Language(
    motion=r"move[jlc]\(.*",
    modal={rf"mMove\.vel={NUMBER}": 100.0},
    knob=r"setMonitorSpeed\((?P<value>.*)\)",
    comment=r"//[^\r\n]*",
    forbidden=r"setMonitorSpeed|getMonitorSpeed|autoConnectMove|setVelCmd",
)
REFUSED = [
    "dOther=true",
    "call other()",
    "movel(jPose[1],flange,mMove)",
    "movej(jPose[1],flange,mMove)",
    "movej(appro(jPose[1],tAway),flange,mMove)",
    "mMove.vel=50.00",
    "mMove.accel=500",
    "jPose[1].j1=5",
    "nStart=5",
    "wait(dOther==true)",
    "if true",
    "resetMotion()",
    "disablePower()",
]
DIALECTS = {
    "val3": DialectFacts(
        given_back=r"mMove(\.\w+)?|dSync|nStart|nKey"
        r"|version|encoding|xmlns|xsi|name|access|type|size|key|j[1-6]|value|link"  # of a tag
        r"|accel|vel|decel|[tr]max|blend|leave|reach",
        targets=1,
        stop=r"^nKey=get\(\)$",
        wait=r"^wait\(dReady==true\)$",
        shown='putln("pose 3 of 4: read the gauge, then press Return")',
    )
}
SPACE = {"p": "http://www.staubli.com/robotics/VAL3/Program/2", "d": "http://www.staubli.com/robotics/VAL3/Data/2"}


def run_application(program, data):
    """Angles, speed and corner of every motion, by an XML parser; no corner where the program waits for the arm."""
    values = ET.fromstring(data).findall(".//d:Data[@name='jPose']/d:Value", SPACE)
    joints = {v.get("key"): [float(v.get(f"j{k}")) for k in range(1, 7)] for v in values}
    (code,) = ET.fromstring(program).findall(".//p:Program/p:Code", SPACE)
    mdesc, driven = {}, []
    for line in code.text.splitlines():
        line = line.partition("//")[0].strip()
        if found := re.fullmatch(r"mMove\.(\w+)=(\S+)", line):
            mdesc[found[1]] = found[2]
        elif found := re.fullmatch(r"movej\(jPose\[(\d+)\],flange,mMove\)", line):
            corner = None if mdesc["blend"] == "off" else (float(mdesc["leave"]), float(mdesc["reach"]))
            driven.append([joints[found[1]], float(mdesc["vel"]), corner])
        elif line == "waitEndMove()":
            driven[-1][2] = None
        elif line.startswith("delay"):
            assert driven[-1][2] is None, "a program that does not wait for the arm dwells while it moves"
    return driven


def test_a_controller_of_its_own_drives_the_plan():
    program = sessions.continuous()
    code, data = write_program(program, "val3", "edbb")
    assert (code.name, data.name) == ("edbb.pgx", "edbb.dtx")
    driven = run_application(code.text, data.text)
    planned = np.array([m.q_deg for m in program.moves])
    assert np.abs(np.array([angles for angles, _, _ in driven]) - planned).max() <= 0.5e-4
    corners = [(m.blend_mm and (m.blend_mm, m.blend_mm)) or None for m in program.moves]
    assert [corner for _, _, corner in driven] == corners
    assert all(0.0 < speed <= m.axis_percent for (_, speed, _), m in zip(driven, program.moves, strict=True))
