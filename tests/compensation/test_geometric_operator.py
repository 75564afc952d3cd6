"""KRL's geometric operator between frames: the exact product, or the lines that hang on it are left and named."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.compensation.targets import ToolAndBase
from tests.compensation.robots import exact, flange_pose
from tests.compensation.test_cartesian import abc_of
from tests.compensation.test_formats import krl
from tests.compensation.test_partial import changed, pose, reasons, run

F1, F2 = (100.0, -20.0, 30.0, 40.0, 10.0, -5.0), (7.0, 300.0, -11.0, -90.0, 20.0, 15.0)
Q_DEG = (10, -80, 100, 20, 40, 30)


def spelled(numbers):
    return "{" + ",".join(f"{k} {v:.9f}" for k, v in zip("XYZABC", numbers, strict=True)) + "}"


def matrix(numbers):
    """X, Y, Z in mm, and turns about Z, Y' and X" in degrees, by scipy."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZYX", numbers[3:], degrees=True).as_matrix()
    T[:3, 3] = numbers[:3]
    return T


PRODUCTS = {  # what stands behind $BASE=, lines before it, and the product
    "literals": ("{1}:{2}", [], matrix(F1) @ matrix(F2)),
    "with spaces": ("{1} : {2}", [], matrix(F1) @ matrix(F2)),
    "three": ("{2}:{1}:{2}", [], matrix(F2) @ matrix(F1) @ matrix(F2)),
    "in brackets": ("({1}:{2})", [], matrix(F1) @ matrix(F2)),
    "of nothing": ("$NULLFRAME:{2}", [], matrix(F2)),
    "of a table": ("BASE_DATA[1]:{2}", ["BASE_DATA[1]={1}"], matrix(F1) @ matrix(F2)),
    "of itself": ("$BASE:{2}", ["$BASE={1}"], matrix(F1) @ matrix(F2)),
    "of a product": ("BASE_DATA[1]:{1}", ["BASE_DATA[1]={1}:{2}"], matrix(F1) @ matrix(F2) @ matrix(F1)),
    "inverse": ("INV_POS({1}):{2}", [], np.linalg.inv(matrix(F1)) @ matrix(F2)),
    "inverse of a product": ("INV_POS({1}:{2})", [], np.linalg.inv(matrix(F1) @ matrix(F2))),
}


def fill(text):
    return text.replace("{1}", spelled(F1)).replace("{2}", spelled(F2))


@pytest.mark.parametrize("name", PRODUCTS)
def test_a_product_is_the_base_that_its_own_numbers_are(name, kuka, tmp_path):
    value, before, product = PRODUCTS[name]
    at = np.linalg.inv(product) @ _flange_mm(kuka[0])
    target = f"LIN {{{','.join(f'{k} {v:.5f}' for k, v in zip('XYZABC', _numbers(at), strict=True))},S 2,T 0}}"
    target = re.sub(r"S 2,T 0", re.search(r"S \d+,T \d+", pose(kuka[0]))[0], target)
    start = f"PTP {{{','.join(f'A{i} {q}' for i, q in enumerate(Q_DEG, start=1))}}}"
    corrected = []
    for rows in ([*before, f"$BASE={value}"], [f"$BASE={spelled(_numbers(product))}"]):
        text = krl("$TOOL=$NULLFRAME", *map(fill, rows), start, target)
        done = run(tmp_path / "p.src", text, kuka)
        assert not done.partly
        line = next(row for row in done.text.splitlines() if row.startswith("LIN"))
        corrected.append([float(v) for v in re.findall(r"[XYZABC] (-?[\d.]+)", line)])
    assert np.abs(np.subtract(*corrected)).max() < 2e-4
    assert np.abs(np.array(corrected[0]) - _numbers(at)).max() > 0.01


def _flange_mm(robot):
    T = np.array(flange_pose(exact(robot), np.radians(Q_DEG)))
    T[:3, 3] *= 1e3
    return T


def _numbers(T):
    metres = np.array(T)
    metres[:3, 3] /= 1e3
    return np.array(abc_of(metres))


UNCERTAIN = {  # lines behind tool and base, and what is said of the last
    "target of a line": (["LIN {P}:{1}"], r"a position in braces or the name of one is allowed"),
    "target of a PTP": (["PTP {P}:{1}"], r"a position in braces or the name of one is allowed"),
    "named target": (["XP1={P}", "LIN XP1 : {1}"], r"a position in braces or the name of one is allowed"),
    "auxiliary point": (["CIRC {P}:{1},{P}"], r"a position in braces or the name of one is allowed"),
    "end of a circle": (["CIRC {P},{P}:{1}"], r"a position in braces or the name of one is allowed"),
    "point that is a product": (["XP1={P}:{1}", "PTP XP1"], r"XP1 is computed while the program runs"),
    "declared point that is a product": (["DECL POS XP1={P}:{1}", "PTP XP1"], r"plain numbers are allowed"),
    "angles that are a product": (["XJ={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}:{1}", "PTP XJ"], r"XJ is computed"),
    "unknown factor": (["$BASE={1}:FOUND", "PTP {P}"], r"\$BASE is changed in line 5"),
    "function": (["$BASE={1}:FIND(1)", "PTP {P}"], r"\$BASE is changed in line 5"),
    "incomplete factor": (["$BASE={1}:{X 5}", "PTP {P}"], r"\$BASE is changed in line 5"),
    "table without a value": (["$BASE=BASE_DATA[7]:{1}", "PTP {P}"], r"BASE_DATA\[7\] is not in the files"),
    "in a branch": (["IF $IN[1] THEN", "$BASE=$BASE:{1}", "ENDIF", "PTP {P}"], r"does not say the base of this pose"),
    "in a loop": (["LOOP", "PTP {P}", "$BASE=$BASE:{1}", "ENDLOOP"], r"does not say the tool"),
    "interrupt that sets a base": (
        ["INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO $BASE.X=100", "$BASE=$NULLFRAME", "PTP {P}"],
        r"the interrupt of line 5 may set another \('\$BASE.X=100'\)",
    ),
    "interrupt that sets a row of the table": (
        ["BASE_DATA[1]={1}", "INTERRUPT DECL 3 WHEN $IN[1] DO BASE_DATA[1].X=9", "BAS(#BASE,1)", "PTP {P}"],
        r"the interrupt of line 6 may set another",
    ),
    "interrupt that sets a point": (
        ["INTERRUPT DECL 3 WHEN $IN[1]==TRUE DO XP1.X=100", "XP1={P}", "PTP XP1"],
        r"XP1 is set in line 5 while the program runs",
    ),
}


@pytest.mark.parametrize("name", UNCERTAIN)
def test_what_is_no_certain_product_is_left_and_named(name, kuka, tmp_path):
    rows, why = UNCERTAIN[name]
    good = "PTP {A1 10,A2 -80,A3 100,A4 20,A5 40,A6 30}"
    rows = [fill(row).replace("{P}", pose(kuka[0])) for row in rows]
    text = krl("$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", good, *rows)
    done = run(tmp_path / "p.src", text, kuka, frames=ToolAndBase())
    assert changed(done, text) == [4]
    assert re.search(why, " ".join(reasons(done).values()))
