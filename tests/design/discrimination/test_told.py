"""What a plan says of findings and rivals is true in the terms of its statistic, and names what it costs."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tests.identification.rigs as rigs
from planner.cell.placement import FREEABLE
from planner.common.errors import InputError
from planner.design.assumptions import SURE_POWER
from planner.design.discrimination.findings import read_identification
from planner.design.discrimination.power import Discrimination, PairPower
from planner.design.observability.information import INDEX_RULES
from planner.effects.catalogue import catalogue, check_effect_name, effect_kinds
from planner.effects.nonparametric import GEAR_CURVE, NONPARAMETRIC
from planner.effects.steps import SLIP, STEP
from planner.session.notes import discrimination_notes
from planner.session.tolerances import MUCH_WORSE
from tests.command import edbb
from tests.design.discrimination.test_refusals import LAG, file
from tests.design.discrimination.worlds import NJ, cell, usual
from tests.effects.catalogue.test_phis import everything
from tests.kinematics.sliding_arms import write_rail

SHAPES = {
    "a list": ("[1, 2]", "[1, 2]: an object { … } is needed"),
    "empty": ("{}", "the key 'schema' is missing ('edbb-identification/1' is expected)"),
    "a plan": (
        '{"schema": "edbb-plan/1", "poses": []}',
        "'schema' = 'edbb-plan/1': must be 'edbb-identification/1'; the file is of the kind 'plan', and one of the "
        "kind 'identification' is needed here",
    ),
    "a number": ("3", "3: an object { … } is needed"),
}


@pytest.mark.parametrize("case", SHAPES, ids=str)
def test_json_of_another_shape_is_told_in_plain_words(case, tmp_path):
    text, message = SHAPES[case]
    path = tmp_path / "i.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_identification(path, NJ, 6)
    assert str(caught.value) == f"{path}: {message}"


def test_rivals_that_are_no_list(tmp_path):
    path = file(tmp_path, (*LAG, []))
    path.write_text(path.read_text().replace('"rivals": []', '"rivals": 5'))
    with pytest.raises(InputError, match="'findings' number 1: 'rivals' = 5: a list is needed"):
        read_identification(path, NJ, 6)


@pytest.mark.parametrize(
    ("rival", "words"),
    [
        (
            "witchcraft, joint 2",
            r"'findings' number 2: 'witchcraft, joint 2' is no effect.* \(known kinds: joint compl",
        ),
        ("encoder one a turn, joint 2", 'is no effect; did you mean "encoder once a turn"'),
        ("encoder once a turn, joint 9", "'encoder once a turn, joint 9': the robot has joints 1 to 6"),
        ("coupling, joint 2 by joint 0", "the robot has joints 1 to 6"),
        ("link bending, link 8", "the robot has links 1 to 7"),
        ("backlash", "it is called KIND, PLACE, like 'backlash, joint 2'"),
    ],
)
def test_an_effect_that_there_is_not_is_wrong_input(rival, words, tmp_path):
    path = file(tmp_path, (*LAG, []), (*LAG, ["servo lag, all joints", rival]))
    with pytest.raises(InputError, match=words):
        read_identification(path, NJ, 6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"probability": 1.7}, "'findings' number 1: 'probability' = 1.7: must be less than or equal to 1"),
        ({"rival_probabilities": [-0.2]}, "'findings' number 1.*-0.2.*greater than or equal to 0"),
        ({"rival_probabilities": [0.2, 0.3]}, "'findings' number 1: 'rival_prob.*one for each of the 1 rival"),
        ({"grade": "certain"}, "'findings' number 1: grade must be 'found', 'likely' or 'doubtful', not 'certain'"),
        ({"effect": "backlash", "on": "joints 9"}, "number 1: 'backlash, joints 9': the robot has joints 1 to 6"),
        ({"effect": "backlash", "on": "joints 2, 7"}, "'backlash, joints 2, 7': the robot has joints 1 to 6"),
    ],
)  # fmt: skip
def test_a_finding_that_cannot_be_is_refused_by_key_and_what_is_allowed(changes, words, tmp_path):
    path = file(tmp_path, (*LAG, ["servo lag, joint 2"]))
    document = json.loads(path.read_text())
    for sound in ({"probability": 1.0, "grade": "found"}, {"effect": "backlash", "on": "joints 1, 6"}):
        path.write_text(json.dumps(document | {"findings": [document["findings"][0] | sound]}))
        read_identification(path, NJ, 6)
    path.write_text(json.dumps(document | {"findings": [document["findings"][0] | changes]}))
    with pytest.raises(InputError, match=words) as refused:
        read_identification(path, NJ, 6)
    assert str(path) in str(refused.value)


def test_an_error_without_a_sign_is_refused_with_one(tmp_path):
    """Release errors of -1 mm went into a robot's record."""
    path = file(tmp_path, (*LAG, ["servo lag, joint 2"]))
    document = json.loads(path.read_text())
    document["stages"][-1]["held_out"]["max_mm"] = -1.0
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"'held_out\.max_mm' = -1\.0: must be greater than or equal to 0"):
        read_identification(path, NJ, 6)


def test_effects_that_came_again_are_the_same_effects(tmp_path):
    path = file(tmp_path, ("gear ripple (2)", "joint 1", 0.01, "deg", ["backlash, joint 1", "warm-up (3), arm"]))
    (found,) = read_identification(path, NJ, 6).found
    assert (found.name, found.rivals) == ("gear ripple, joint 1", ("backlash, joint 1", "warm-up, arm"))


def test_the_command_ends_with_two_before_it_plans(tmp_path):
    path = file(tmp_path, (*LAG, ["witchcraft, joint 2"]))
    done = edbb("plan", f"{NJ}/edbb", "-o", tmp_path / "out", "--separate", path)
    assert done.returncode == 2
    assert "'witchcraft, joint 2' is no effect" in done.screen
    assert not (tmp_path / "out").exists()


def test_every_kind_that_an_identification_can_name_is_known(tmp_path):
    rng = np.random.default_rng(4)
    found = {GEAR_CURVE, NONPARAMETRIC, STEP, SLIP}
    for kind in rigs.KINDS:
        setup = rigs.setup(NJ, kind, rng)
        robot = replace(setup.robot, gear_ratio=(101.0,) * 6)
        setup = setup if kind == "sockets" else replace(setup, p_GS=np.zeros((0, 3)), ball_names=())
        looked = everything(setup, 60, rng)
        entries = catalogue(replace(setup, robot=robot), looked)
        entries += catalogue(replace(setup, robot=robot, fixed=FREEABLE), looked)  # nothing free
        found |= {e.kind for e in entries}
        for e in entries:
            check_effect_name(e.name, 6, "here")
    rail = rigs.setup(str(write_rail(tmp_path, "mdh")), "position", rng)
    found |= {e.kind for e in catalogue(rail, everything(rail, 12, rng))}
    assert found == set(effect_kinds())


def told(named, power=0.99, rival="servo lag, joint 2"):
    return PairPower("gauge lag, gauge", rival, named, 150.0, power, 36.3, 500.0)


def separation(*pairs, alone=70.0):
    return Discrimination(pairs, (), 60, 0.02, True, 1e-5, alone)


def test_rivals_that_nobody_named_are_told_as_what_they_are():
    (own,) = separation(told(True)).texts()
    assert own.startswith("gauge lag, gauge from servo lag, joint 2: power 99 %")
    _, one = separation(told(True), told(False)).texts()
    assert one.startswith(
        "1 more effect that nobody named and that poses chosen without a look at it would tell with a"
    )
    assert f"below {100 * SURE_POWER:.0f} %" in one
    _, two = separation(told(True), told(False), told(False, 0.9, "drift, joint 1")).texts()
    assert two.startswith("2 more effects")
    assert "least surely now gauge lag, gauge from drift, joint 1: power 90 %" in two
    assert "mixed up" not in one + two


def judged(index, value):
    """A choice of which an index says so much."""
    choice = replace(usual(), certificate=replace(usual().certificate, index=index))
    vars(choice)["raw_indices"] = {index: value}
    return choice


@pytest.mark.parametrize(("index", "value", "alone"), [("O2", 221.9, 69.1), ("O1", 0.2, 0.7)])
def test_poses_that_are_much_worse_for_the_geometry_say_so(index, value, alone):
    choice = judged(index, value)
    (note,) = discrimination_notes(cell(), separation(told(True), alone=alone), choice, ())[-1:]
    times = max(value / alone, alone / value)
    assert f"{times:.1f} times worse than poses chosen by {index} alone ({index} {value:.4g} instead of" in note
    assert "together with the one before" in note


@pytest.mark.parametrize("index", INDEX_RULES)
def test_poses_that_are_little_worse_say_nothing(index):
    for factor in (1.0, MUCH_WORSE * 0.99, 1 / (MUCH_WORSE * 0.99)):
        choice = judged(index, factor)
        assert not [n for n in discrimination_notes(cell(), separation(alone=1.0), choice, ()) if "times worse" in n]
