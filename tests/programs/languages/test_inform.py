"""Yaskawa INFORM: what its manuals say, and programs of the planner run by a small controller written from them."""

import re

import numpy as np

import tests.programs.sessions as sessions
from planner.programs.verification import write_program
from tests.programs.controllers import NUMBER, DialectFacts, Language

# FS100 and DX200 manuals for INFORM: SPEED sets default speeds, OVRSPD or the pendant changes the override
OVERRIDE = Language(
    motion=r"MOV[JLCS] .*VJ=(?P<v>[\d.]+).*",
    knob=rf"OVRSPD {NUMBER.replace('(', '(?P<value>', 1)}",
    comment=r"(?m)^'.*",
    forbidden=r"\b(OVRSPD|SPEED|SETREG|ADJUST)\b|S[123]C\d",
)
REFUSED = [
    "DOUT OT#(9) ON",
    "CALL JOB:OTHER",
    "MOVL C00001 V=10.0 PL=0",
    "MOVJ C00001 VJ=1.00",
    "SFTON P001",
    "MOVJ P001 VJ=1.00 PL=0",
    "JUMP *L1",
    "SET I099 5",
    "WAIT IN#(9)=ON",
    "C00001=0,0,0,0,0,0",
    "PULSE OT#(9) T=0.10",
    "///TOOL 7",
]
DIALECTS = {
    "inform": DialectFacts(
        given_back=r"DOUT|PULSE|I099|C\d+|T|VJ|PL|IN#\(7\)",
        stop=r"^PAUSE$",
        wait=r"^WAIT IN#\(7\)=ON$",
        shown="'pose 3 of 4: read the gauge,",
    )
}


def run_job(text):
    """Pulses of every move in order, by the job data format: positions are taken by their names as the moves come."""
    head, body = text.split("//INST")
    positions = dict(re.findall(r"^(C\d+)=(.*?)\r?$", head, re.MULTILINE))
    assert int(re.search(r"///NPOS (\d+),0,0,0,0,0", head)[1]) == len(positions)
    assert "///POSTYPE PULSE" in head
    names = re.findall(r"^MOVJ (C\d+) VJ=[\d.]+ PL=0\r?$", body, re.MULTILINE)
    assert set(names) == set(positions), "a position that no move uses is an error of the controller (3190)"
    return np.array([[int(cell) for cell in positions[name].split(",")] for name in names])


def test_a_controller_of_its_own_drives_the_pulses_of_the_plan():
    program = sessions.static()
    (file,) = write_program(program, "inform", "edbb nj-130")
    pulses = run_job(file.text)
    planned = np.array([m.q_deg for m in program.moves]) * sessions.PULSES[:6]
    assert np.abs(pulses - planned).max() <= 0.5
    assert file.name == "EDBB_NJ_130.JBI"
    remarks = [line for line in file.text.splitlines() if line.startswith("'")]
    assert max(map(len, remarks)) <= 32
