"""Programs as integrators write them, in KRL, RAPID and FANUC TP: no motion of them is silently wrong.

Half of the programs are ordinary, half hold a trap each. Every motion's truth was written from the language's manual
before the command was run: it stands fixed (pose or axis angles), or nobody can say from the text where it goes.
"""

import re
import tomllib
from collections import Counter
from pathlib import Path

import pytest

from tests.compensation import foreign_judge
from tests.compensation.foreign_judge import CORRECTED, LISTED, REFUSED, WRONG, compensate, judge, stray_changes
from tests.compensation.foreign_kinematics import arm_of, calibrated

PROGRAMS = Path(__file__).parent / "programs"
SHIPPED = Path(__file__).parents[2] / "robots"
NOMINAL = {
    "krl": SHIPPED / "kuka-kr6-r700" / "robot.toml",
    "rapid": SHIPPED / "abb-irb120" / "robot.toml",
    "fanuc": PROGRAMS / "fanuc" / "robot.toml",
}
ERRORS = {  # mm and degrees, as large as calibrations of such arms find them
    "theta1_deg": 0.03, "theta2_deg": -0.06, "theta3_deg": 0.08, "theta4_deg": -0.07, "theta5_deg": 0.05,
    "theta6_deg": 0.1, "alpha1_deg": -0.03, "alpha2_deg": 0.05, "alpha3_deg": 0.04, "alpha4_deg": -0.06,
    "alpha5_deg": 0.07, "a1_mm": 0.4, "a2_mm": 0.8, "a3_mm": -0.5, "d4_mm": 0.7, "d6_mm": 0.3,
}  # fmt: skip
# A base of its own (alpha0) and a turn between parallel axes (beta) stand in modified DH only.
OF_ONE = {
    "krl": {"alpha0_deg": 0.02, "a4_mm": 0.3, "beta2_deg": -0.04},
    "rapid": {"d1_mm": 0.3},
    "fanuc": {"d1_mm": 0.3},
}
# Motions with a certain target: how many there are, and how many are corrected at the least.
FIXED = {"krl": (199, 143), "rapid": (179, 142), "fanuc": (62, 48)}


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """A calibrated robot file of each language's robot, and one whose errors are all zero."""
    folder = tmp_path_factory.mktemp("models")
    for language, nominal in NOMINAL.items():
        errors = ERRORS | OF_ONE[language]
        for name, changes in ((language, errors), (f"{language}-exact", dict.fromkeys(errors, 0.0))):
            (folder / name).mkdir()
            text = calibrated(nominal.read_text(encoding="utf-8"), changes)
            (folder / name / "robot.toml").write_text(text, encoding="utf-8")
    return folder


def folders_of(language):
    return sorted(truth.parent for truth in (PROGRAMS / language).glob("*/truth.toml"))


def arms(models, name):
    return [arm_of(models / name / "robot.toml", nominal) for nominal in (True, False)]


@pytest.mark.long
@pytest.mark.parametrize("language", NOMINAL)
def test_no_motion_of_foreign_programs_is_silently_wrong(language, models, tmp_path):
    nominal, true = arms(models, language)
    verdicts, strays = [], []
    for folder in folders_of(language):
        truth, outcome = compensate(folder, models / language / "robot.toml", tmp_path)
        verdicts += judge(folder.name, truth, outcome, nominal, true)
        strays += [f"{folder.name}/{stray}" for stray in stray_changes(truth, outcome)]
    assert [v for v in verdicts if v.outcome == WRONG] == []
    assert strays == []
    counts = Counter((v.kind == "unknowable", v.outcome) for v in verdicts)
    assert set(counts) <= {(u, o) for u in (True, False) for o in (LISTED, REFUSED)} | {(False, CORRECTED)}
    fixed, corrected = FIXED[language]
    assert sum(n for (unknowable, _), n in counts.items() if not unknowable) == fixed
    assert counts[False, CORRECTED] >= corrected


@pytest.mark.parametrize("name", ["krl/k03_arc_weld", "rapid/r01_pick_place", "fanuc/f01_pick_joint"])
def test_a_robot_without_errors_leaves_every_number(name, models, tmp_path):
    language = name.split("/", maxsplit=1)[0]
    truth, outcome = compensate(PROGRAMS / name, models / f"{language}-exact" / "robot.toml", tmp_path)
    verdicts = judge(name, truth, outcome, *arms(models, f"{language}-exact"))
    assert {v.outcome for v in verdicts} == {CORRECTED}
    for file, text in outcome.after.items():
        kept = foreign_judge._pairs(outcome.before[file], text)
        assert len(kept) == len(outcome.before[file].split("\n"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("krl/k03_arc_weld", r"(?<=\{X )\S+?(?=,)"),
        ("rapid/r01_pick_place", r"(?<=p20:=\[\[).+?(?=,)"),
        ("fanuc/f01_pick_joint", r"(?<=J2=) *\S+"),
    ],
)
def test_the_judge_sees_a_wrong_correction(name, number, models, tmp_path):
    language = name.split("/", maxsplit=1)[0]
    truth, outcome = compensate(PROGRAMS / name, models / language / "robot.toml", tmp_path)
    before = judge(name, truth, outcome, *arms(models, language))
    for file, text in outcome.after.items():
        outcome.after[file] = re.sub(number, lambda found: f"{float(found[0]) + 0.06:.4f}", text)
    after = judge(name, truth, outcome, *arms(models, language))
    assert WRONG not in {v.outcome for v in before}
    assert WRONG in {v.outcome for v in after}


@pytest.mark.slow
@pytest.mark.parametrize("language", NOMINAL)
def test_the_judge_sees_a_program_that_was_left_and_not_listed(language, models, tmp_path):
    nominal, true = arms(models, language)
    for folder in folders_of(language)[:5]:
        truth, outcome = compensate(folder, models / language / "robot.toml", tmp_path)
        outcome.after = dict(outcome.before)
        outcome.listed, outcome.listed_as_elsewhere, outcome.refused = set(), set(), set()
        assert {v.outcome for v in judge(folder.name, truth, outcome, nominal, true)} == {WRONG}


def test_half_of_the_programs_are_traps():
    for language in NOMINAL:
        truths = [tomllib.loads((folder / "truth.toml").read_text(encoding="utf-8")) for folder in folders_of(language)]
        kinds = Counter(truth["kind"] for truth in truths)
        assert min(kinds["ordinary"], kinds["trap"]) >= 7
