"""A screen of a fit has eight lines whatever there is to say: few causes and many, notes, failed, validated."""

import dataclasses
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from planner.cli.terminal import screen_text
from planner.common.summary import SCREEN_LINES, Aside
from planner.model.finding import Finding
from planner.model.identification_document import ErrorParts, Metrics, WorkToolError
from planner.model.misfit_place import MisfitPlace, MisfitRange
from planner.workflow import identification
from tests.golden.wire import fitted_wire

MM, UM = 1e-3, 1e-6
SURE, LIKELY, DOUBTFUL = 0.99, 0.7, 0.02
WITHIN = MisfitRange(there=MM, joint=6, range=(-2.1, -1.8))
# values of each trait of a fit; the first is that of the fit itself
TRAITS = {
    "causes": (None, [], [SURE], [SURE] * 3, [DOUBTFUL] * 4, [SURE] * 3 + [DOUBTFUL] * 9, [LIKELY] * 2),
    "parts": (None, ErrorParts(seen=UM, unseen=UM, misfit=MM), ErrorParts(seen=UM, unseen=UM, misfit=0, drift=MM)),
    "validated": (False, True),
    "tools": (1, 2),
    "notes": ((), ("the tip is loose",), tuple(f"note {k * 'x'} is to be read" for k in range(12))),
    "state": ("sound", "worse", "failed"),
    "two steps": (False, True),
}


@pytest.fixture(scope="module")
def fitted():
    return fitted_wire()


def with_traits(result, causes, parts, validated, tools, notes, state):
    """The result of another run, as its document would be."""
    found = result.calibration
    known = found.release
    changes = {"warnings": (*found.warnings, *notes)}
    if causes is not None:
        names = (f"joint {k % 6 + 1}" for k in range(len(causes)))
        changes["findings"] = tuple(
            Finding(
                effect=f"effect {k}", on=on, value=UM, unit="rad", gain=UM / (k + 1), probability=p,
                rivals=("a", "b"), note=f"{on}: gives way under load, 5.02 ± 0.40 µrad/Nm",
            )
            for k, (p, on) in enumerate(zip(causes, names, strict=True))
        )  # fmt: skip
        changes["tried"] = 300
    release = {}
    if parts is not None:
        release |= {
            "parts": parts,
            "misfit_place": MisfitPlace(
                anywhere=MM,
                there=MM,
                joint=3,
                range=(-1.0, 1.0),
                within=WITHIN,
                elsewhere=MM,
                like="a turn behind joint 3 by joint 6",
            ),
        }
    if validated:
        judged = Metrics(rms=MM, mean=MM, largest=MM)
        release["validation"] = judged
        stage = found.stages[1].model_copy(update={"validation": judged})
        changes["stages"] = (found.stages[0], stage, *found.stages[2:])
    if tools == 2:
        release["work_tool"] = WorkToolError(position=(0.0, 0.0, 0.3), anywhere=MM, nominal_anywhere=MM)
    changes["release"] = known.model_copy(update=release)
    changes |= {"worse_than_nominal": "WORSE than the nominal robot"} if state == "worse" else {}
    changes |= {"problems": ("the fit got worse",)} if state == "failed" else {}
    changes["summary"] = None  # is made anew
    return dataclasses.replace(result, calibration=found.model_copy(update=changes))


@pytest.mark.slow
def test_every_screen_of_a_fit_has_eight_lines(fitted, monkeypatch):
    each: Iterable[tuple[Any, ...]] = product(*TRAITS.values())
    for *traits, two_steps in each:
        monkeypatch.setattr(identification, "can_be_told_apart", lambda _, told=two_steps: told)
        made = with_traits(fitted, *traits)
        lines = screen_text(made, Path("calibrated")).splitlines()
        causes, _, _, _, notes, state = traits
        assert len(lines) <= SCREEN_LINES == 8, (traits, lines)
        keys = [line[2:14].strip() for line in lines]
        wanted = ["written to"]
        wanted += ["verdict", *(() if notes else ["better"])] if state == "sound" else ["verdict"]
        wanted += ["note"] if notes else []
        assert set(wanted) <= set(keys), (traits, lines)
        assert state != "sound" or any("95 % sure" in line for line in lines), lines
        assert keys.count("next") == (state == "sound")
        if state != "sound":  # of what is not to be used nothing is a cause, and no error is what it leaves
            assert not {"found", "likely", "doubtful", "within"} & set(keys), (traits, lines)
            assert "do not use it" in lines[0] or "WORSE" in lines[0]
            continue
        sure = (causes or []).count(SURE)
        leading = next((p for p in causes or [] if p >= LIKELY), None)
        assert leading is None or {SURE: "found", LIKELY: "likely"}[leading] in keys, (traits, lines)
        room = not notes and not two_steps and state == "sound" and tuple(traits[1:4]) == (None, False, 1)
        assert not room or keys.count("found") >= min(sure, 2)
        assert not room or keys.count("likely") >= min((causes or []).count(LIKELY), 1)
        facts = [line for line in lines if line[2:14].strip() not in ("next", "note")]
        assert max(map(len, facts)) <= 165, max(facts, key=len)


@pytest.mark.slow
def test_what_a_fit_is_made_of_shows_itself_in_one_line(fitted):
    found = fitted.calibration
    parts = (found, found.fit, found.fit.model, found.setup, found.released, found.run, fitted.cell, fitted.parameters)
    assert all(len(repr(part)) < 200 and "\n" not in repr(part) for part in parts)


@pytest.mark.slow
def test_what_does_not_stand_on_the_screen_is_said_where_more_is_asked(fitted):
    made = with_traits(fitted, [SURE] * 3, None, False, 1, ("the tip is loose",), "sound")
    more = made.full_summary(verbose=True)
    for said in ("zeros", "stages", "parameters", "set these zeros", "the tip is loose", "rest"):
        assert said in more
    each = [line for line in more.splitlines() if "gives way under load" in line]
    assert [line.split()[:3] for line in each] == [["found", "joint", f"{j}:"] for j in (1, 2, 3)]  # once, with rivals
    assert all("(99 %)" in line for line in each)
    assert more.count("or a, or b: this run cannot tell which") == 3
    nothing = with_traits(fitted, [], None, False, 1, (), "sound").full_summary(verbose=True)
    assert nothing.count("no cause beyond the geometry") == 1


@pytest.mark.slow
def test_a_note_that_asks_nothing_is_not_on_the_screen(fitted):
    aside = "the links have no masses"
    found = fitted.calibration
    made = dataclasses.replace(
        fitted, calibration=found.model_copy(update={"warnings": (aside,), "asides": frozenset({aside})})
    )
    assert aside not in made.full_summary()
    assert aside in made.full_summary(verbose=True)
    assert [note for note in made.overview().notes if isinstance(note, Aside)] == [aside]


@pytest.mark.slow
def test_a_fit_that_failed_says_first_what_is_probably_wrong_and_no_parameter(fitted):
    changes = {"problems": ("perhaps joint 2 counts the other way: give it sense = -1; held-out poses are 90 mm off",)}
    made = dataclasses.replace(fitted, calibration=fitted.calibration.model_copy(update=changes))
    lines = screen_text(made, None).splitlines()
    assert lines[0] == "NOT CALIBRATED, do not use it: perhaps joint 2 counts the other way: give it sense = -1"
    assert "moved most" not in "".join(lines)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "separable", "foreseen", "commands"),
    [
        (0.5, False, True, ["compensate"]),
        (0.5, True, True, ["compensate", "--separate"]),
        (0.96, True, True, ["--separate"]),
        (0.96, False, True, ["--after"]),
        (0.96, False, False, ["compensate"]),  # no poses of this gauge are chosen by the error
    ],
)
def test_a_correction_that_leaves_the_error_is_not_the_next_step(
    fitted, monkeypatch, share, separable, foreseen, commands
):
    monkeypatch.setattr(identification, "can_be_told_apart", lambda _: separable)
    found = fitted.calibration
    release = found.release.model_copy(update={"nominal_anywhere": found.workspace_error / share})
    more = found.more if foreseen else None
    made = dataclasses.replace(fitted, calibration=found.model_copy(update={"release": release, "more": more}))
    steps = made.next_step(Path("calibrated")).splitlines()
    assert found.more is not None
    assert len(steps) == len(commands)
    assert all(command in step for command, step in zip(commands, steps, strict=True))


@pytest.mark.slow
def test_the_next_step_says_what_a_robot_lacks_whose_file_names_no_controller(fitted):
    """Its programs would be refused: it is said before one is."""
    lacks = "once robot.toml says how its controller counts ([controllers])"
    assert lacks not in fitted.next_step(Path("calibrated"))
    silent = dataclasses.replace(fitted.cell, robot=dataclasses.replace(fitted.cell.robot, conventions=()))
    assert lacks in dataclasses.replace(fitted, cell=silent).next_step(Path("calibrated"))
