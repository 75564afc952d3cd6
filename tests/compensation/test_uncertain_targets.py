"""PDL2, FANUC TP and URScript: targets whose meaning is not certain stay as they are and are named by line."""

import re

import pytest

from planner.common.errors import InputError
from tests.compensation.test_partial import changed, reasons, run

ANGLES = "10,-20,10,20,30,5"
MOVE = f"MOVE TO {{{ANGLES}}}"
AXES = "J1= 10 deg, J2= -20 deg, J3= 10 deg,\n\tJ4= 20 deg, J5= 30 deg, J6= 5 deg"


LEFT_PDL2 = {
    "other arm": ([f"MOVE ARM[2] TO {{{ANGLES}}}"], {4: "moves arm 2; the program's own arm is 1"}),
    "computed arm": ([f"MOVE ARM[i] TO {{{ANGLES}}}"], {4: "lines of their own"}),
    "condition": ([f"IF x THEN {MOVE}", "ENDIF"], {4: "'IF x THEN MOVE TO"}),
    "case": ([f"CASE x OF (1): {MOVE}", "ENDCASE"], {4: r"'CASE x OF \(1\): MOVE TO"}),
    "value": ([f"j1 := {{{ANGLES}}}"], {4: "'j1 := "}),
    "continued": (["MOVE TO {10,-20, &", "10,20,30,5}"], {4: "6 plain angles", 5: "'10,20,30,5}' found"}),
    "open brace": (["MOVE TO {10,-20,", MOVE, MOVE], {4: "MOVE TO", 5: "MOVE TO", 6: "MOVE TO", 7: "MOVE TO"}),
    "open clause": ([f"{MOVE},", "WITH $FLY_PER = 5,", MOVE], {4: "MOVE TO", 6: "MOVE TO", 7: "MOVE TO"}),
    "via": ([f"{MOVE} VIA p1"], {4: "VIA p1"}),
}


@pytest.mark.parametrize("name", LEFT_PDL2)
def test_pdl2_moves_of_uncertain_meaning_are_left(name, abb, tmp_path):
    rows, left = LEFT_PDL2[name]
    text = "\n".join(["PROGRAM p", "BEGIN", f"MOVE ARM[1] TO {{{ANGLES}}}", *rows, MOVE, "END p", ""])
    done = run(tmp_path / "p.pdl", text, abb)
    assert reasons(done).keys() == left.keys()
    assert all(re.search(why, reasons(done)[line]) for line, why in left.items())
    before = text.splitlines()
    after = done.text.splitlines()[-len(before) :]
    assert [n for n, row in enumerate(before, 1) if row != after[n - 1]] == [
        n for n in (3, 4 + len(rows)) if n not in left
    ]


@pytest.mark.parametrize(
    "row",
    [
        f"  EXECUTE 'MOVE TO {{{ANGLES}}}'",
        f"IF tool = 'it''s' THEN {MOVE}   -- {{1}}",
        f"MOVE TO {{{ANGLES}}} VIA points('f')",
        f"\t{MOVE} VIA p('', '')",
    ],
)
def test_what_is_left_of_pdl2_is_quoted_as_it_is_written(row, abb, tmp_path):
    text = "\r\n".join(["PROGRAM p", "BEGIN", MOVE, row, MOVE, "END p", ""])
    done = run(tmp_path / "p.pdl", text, abb)
    code = row.split("--")[0].strip()
    assert reasons(done).keys() == {4}
    assert f"'{code[:60]}' found" in reasons(done)[4]


def position(label, axes=AXES, group="GP1"):
    return f"P[{label}]{{\n   {group}:\n\tUF : 0, UT : 1,\n\t{axes}\n}};\n"


LEFT_TP = {  # instructions, positions behind the good P[1], lines that are left counted from the second position
    "increment": (
        "J P[2] 100% FINE INC",
        position(2),
        {0: r"is not certain: 'J P\[2\] 100% FINE INC' in line 4"},
    ),
    "offset": ("L P[2:b] 9mm/sec CNT50 Offset,PR[1]", position('2:"a}b"'), {0: r"Offset,PR\[1\]' in line 4"}),
    "tool offset": ("J P[2] 50% CNT50 ACC80 Tool_Offset,PR[2]", position(2), {0: "may shift it"}),
    "of two": ("C P[2]\n  : P[3] 9mm/sec FINE INC", position(2) + position(3), {0: "may shift it", 6: "may shift it"}),
    "copied": ("PR[1]=P[2]", position(2), {0: r"'PR\[1\]=P\[2\]' in line 4 uses it too"}),
    "group": ("J P[2] 9% FINE", position(2, group="GP2"), {0: "is not of group 1 alone"}),
    "groups": ("J P[2] 9% FINE", position(2, AXES + "\n   GP2:\n\tUF : 0, UT : 1,\n\tJ1= 1 deg"), {0: "group 1 alone"}),
    "five joints": ("J P[2] 9% FINE", position(2, AXES.rpartition(",")[0]), {0: "has the axes J1, J2, J3, J4, J5,"}),
    "axis twice": ("J P[2] 9% FINE", position(2, AXES.replace("J6", "J1")), {0: "holds 'J1= 5 deg'"}),
    "number": ("J P[2] 9% FINE", position(2, AXES.replace("20 deg", "2.0.0 deg", 1)), {0: r"holds 'J2= -2\.0\.0 deg'"}),
    "twice": ("J P[2] 9% FINE", position(2) + position(2), {0: "stands 2 times", 6: "stands 2 times"}),
    "small letters": ("J P[1] 9% FINE", "p[2]{\n gp1: };\n", {0: r"'p\[2\]\{' is not understood"}),
    "unclosed": ("J P[1] 9% FINE", position(2).replace("}", "") + position(3), {0: r"'P\[2\]\{' is not understood"}),
}


@pytest.mark.parametrize("name", LEFT_TP)
def test_tp_positions_of_uncertain_meaning_are_left(name, abb, tmp_path):
    instruction, positions, left = LEFT_TP[name]
    head = f"/PROG T\n/MN\n   1:J P[1:home] 100% FINE ACC50 ;\n   2:{instruction} ;\n   3:  !P[1] offset ;\n/POS\n"
    first, last = head + position(1), "/END\n"
    start = first.count("\n") + 1
    done = run(tmp_path / "p.ls", first + positions + last, abb)
    assert reasons(done).keys() == {start + row for row in left}
    assert all(re.search(why, reasons(done)[start + row]) for row, why in left.items())
    assert (positions.partition("P[3]")[0] if name == "unclosed" else positions) in done.text
    assert position(1) not in done.text  # it is corrected


def test_tp_joints_are_read_by_their_labels(abb, tmp_path):
    swapped = AXES.replace("J1", "J0").replace("J6", "J1").replace("J0", "J6")
    text = "/MN\n:J P[1] 9% FINE ;\n/POS\n{}/END\n"
    done = run(tmp_path / "p.ls", text.format(position(1, swapped)), abb).text
    plain = AXES.replace("10 deg", "5 deg", 1).replace("J6= 5", "J6= 10")
    other = run(tmp_path / "q.ls", text.format(position(1, plain)), abb).text
    angles = [dict(re.findall(r"(J\d)= *(\S+)", t)) for t in (done, other)]
    assert angles[0] == angles[1]


@pytest.mark.parametrize(
    ("instruction", "why"),
    [
        ("J P[R[1]] 9% FINE INC", "may shift it"),
        ("Touch Offset PR[1]", "may shift every target"),
        ("Independent GP", "uses it too"),
        ("j p[1] 9% fine inc", "uses it too"),
    ],
)
def test_tp_instructions_that_concern_every_position(instruction, why, abb, tmp_path):
    more = "\n:GP1 J P[1] 9% FINE" if instruction == "Independent GP" else ""
    with pytest.raises(InputError, match=why):
        run(tmp_path / "p.ls", f"/MN\n:{instruction}{more} ;\n:J P[1] 9% FINE ;\n/POS\n{position(1)}/END\n", abb)


@pytest.mark.parametrize(
    "said", ["movej([0.1,-0.2,0.1,0.2,0.5,0.1]+[0,0,0,0,0,1])", "movej([0.1,-0.2,0.1,0.2,0.5,0.1]) movej(q1)",
             "movej([0.1,-0.2,0.1,0.2,0.5,0.1], a=1) movej(q1)", "movej([0.1,-0.2,0.1,0.2,0.5,0.1]*2, v=1)"],
)  # fmt: skip
def test_urscript_targets_with_more_than_numbers_are_left(said, abb, tmp_path):
    text = f"def p():\n movej([0.1,-0.2,0.1,0.2,0.5,0.1] , a=1, v=d2r(9))\n {said}\nend\n"
    done = run(tmp_path / "p.script", text, abb)
    assert reasons(done).keys() == {3}
    assert changed(done, text) == [2]
