"""KRL stays inside the subset that every KRC and the public grammar of the language take."""

import re
import tomllib
from itertools import pairwise

import pytest

from planner.program import ProgramFile, import_map, write_program
from tests.program import sessions

_NUMBER = r"-?\d+\.\d+"
_PTP = rf"PTP \{{A1 {_NUMBER}(,[AE]\d {_NUMBER})+\}}( C_PTP)?"
_SOURCE = (
    _PTP,
    r"HALT",
    r"WAIT SEC (0|\d+\.\d+)",
    r"WAIT FOR \$IN\[\d+\]",
    r"BAS \(#(INITMOV|VEL_PTP|ACC_PTP|TOOL|BASE),\d+ \)",
    r"\$(OV_PRO|ADVANCE|APO\.CPTP)=\d+",
    r"\$OUT\[\d+\]=(TRUE|FALSE)",
    r"\$LOAD=LOAD_DATA\[\d+\]",
    r"(TRIGGER WHEN DISTANCE=1 DELAY=0 DO )?PULSE \(\$OUT\[\d+\],TRUE,0\.\d+\)",
    r"GLOBAL INTERRUPT DECL 3 WHEN \$STOPMESS==TRUE DO IR_STOPM \( \)",
    r"INTERRUPT ON 3",
    r"LOG_[0-9A-F]{12}\[\d+\]\.AX=\$AXIS_ACT",
    r"[A-Z]\w{0,23} \( \)",
)
_DATA = (
    r"GLOBAL STRUC ROW_[0-9A-F]{12} INT POSE,E6AXIS AX",
    r"DECL GLOBAL ROW_[0-9A-F]{12} LOG_[0-9A-F]{12}\[\d+\]",
    r"LOG_[0-9A-F]{12}\[\d+\]=\{POSE \d+,AX \{A1 0\.0(,[AE]\d 0\.0){11}\}\}",
)


def _body(file: ProgramFile, begin: str, end: str) -> list[str]:
    """Return the statements between the frame lines; the frame must be the first three lines and the last."""
    lines = file.text.split("\r\n")
    name = file.name.partition(".")[0]
    assert lines[:2] == ["&ACCESS RVP", "&REL 1"]
    assert re.fullmatch(begin.replace("NAME", name), lines[2])
    assert lines[-2:] == [end, ""]
    assert len(name) <= 24
    return [line for line in lines[3:-2] if not line.startswith(";")]


@pytest.mark.parametrize(
    "program",
    [sessions.static(6), sessions.static(7), sessions.continuous(6), sessions.dense(6, 2500)],
    ids=["static", "seven joints", "continuous", "in parts"],
)
def test_only_statements_of_the_subset(program) -> None:  # type: ignore[no-untyped-def]
    for file in write_program(program, "krl", "edbb nj130, a long name for a small controller"):
        source = file.name.endswith(".src")
        begin, end = (r"DEF NAME \( \)", "END") if source else ("DEFDAT NAME PUBLIC", "ENDDAT")
        allowed = _SOURCE if source else _DATA
        for line in _body(file, begin, end):
            assert any(re.fullmatch(pattern, line) for pattern in allowed), line
        assert all(len(name) <= 24 for name in re.findall(r"[A-Za-z_$]\w*", file.text.partition("DEF")[2]))


def test_log_row_is_read_by_the_import_map() -> None:
    data = write_program(sessions.static(), "krl", "a")[1].text
    assert data.count("POSE ") == 4
    after_run = data.replace("AX {A1 0.0,A2 0.0", "AX {E6AXIS: A1 -12.34567,A2 1.5E-04")
    pattern = tomllib.loads(import_map("krl", 6))["pattern"]
    rows = [m.groupdict() for m in re.finditer(pattern, after_run)]
    assert [row["pose"] for row in rows] == ["1", "2", "3", "4"]
    assert float(rows[0]["q1_deg"]) == -12.34567
    assert float(rows[0]["q2_deg"]) == 1.5e-4
    assert set(rows[0]) == {"pose", *(f"q{i}_deg" for i in range(1, 7))}


def test_override_changes_only_at_a_stop_and_is_given_back() -> None:
    text = write_program(sessions.continuous(), "krl", "a")[0].text
    lines = [x for x in text.split("\r\n") if x and not x.startswith(";")]
    moves = [x for x in lines if x.startswith(("PTP", "$OV_PRO"))]
    for before, line in pairwise(moves):
        if line.startswith("$OV_PRO"):
            assert not before.endswith("C_PTP")
    overrides = [x for x in moves if x.startswith("$OV_PRO")]
    assert overrides[0] != "$OV_PRO=100"
    assert overrides[-1] == "$OV_PRO=100"
