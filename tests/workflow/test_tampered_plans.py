"""A plan whose numbers were changed is refused, or what is exported is right and says what was changed."""

import copy
import json
import math
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.common.errors import InputError, NoSolutionError
from planner.common.units import PLAN_DECIMALS
from planner.session import judgement, planned_session
from planner.session.judgement import judge_program
from planner.workflow.plan_use import export
from tests.workflow.driven_check import complaints, map_positions
from tests.workflow.small_plan import proven_tour, write_small_plan

CELL, POSES = "kuka-kr6-r700/edbb", 3
FEW, MANY = 60, 2000


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small")
    plan = write_small_plan(folder, CELL, POSES)
    return folder, plan, _exported(folder)


def _exported(folder: Path) -> str:
    return export(folder / "plan.json", dialect="poses-csv", name="a").programs[0].text


def _once(function, key):
    """The function, called once for all arguments of one key: most changes are of numbers that nothing is driven by."""
    known: dict[object, Any] = {}

    def call(*given):
        this = key(*given)
        if this not in known:
            try:
                known[this] = function(*given)
            except (InputError, NoSolutionError) as err:
                known[this] = err
        if isinstance(known[this], InputError | NoSolutionError):
            raise type(known[this])(str(known[this]))
        return known[this]

    return call


@pytest.fixture
def judged_once(monkeypatch):
    """Read the cell once as long as its text stays, and time and judge every distinct drive once."""
    judge = _once(judge_program, lambda cell, program: (program.home_deg, program.instructions))
    time = _once(planned_session.time_course, lambda cell, *drive: pickle.dumps(drive))
    read = _once(planned_session.read_cell, lambda path, name: (path, path.read_text()))
    monkeypatch.setattr(judgement, "judge_program", judge)
    monkeypatch.setattr(planned_session, "time_course", time)
    monkeypatch.setattr(planned_session, "read_cell", read)


def _numbers(value: object, way: tuple = ()) -> list[tuple]:
    """Ways to every number of a document."""
    if isinstance(value, bool):
        return []
    if isinstance(value, int | float):
        return [way]
    found = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [w for key, item in found for w in _numbers(item, (*way, key))]


def _at(value, way):
    for key in way:
        value = value[key]
    return value


CHANGES = {
    "last digit": lambda x, r: x + 10.0 ** -(PLAN_DECIMALS + 1),
    "tiny": lambda x, r: x + r.choice([-1e-7, 1e-7, 1e-4]),
    "little": lambda x, r: x + r.normal(scale=0.05),
    "degrees": lambda x, r: x + r.normal(scale=6.0),
    "factor": lambda x, r: x * r.uniform(0.5, 2.0),
    "sign": lambda x, r: -x,
    "zero": lambda x, r: 0,
    "huge": lambda x, r: x + 10.0 ** r.integers(3, 300),
    "not a number": lambda x, r: r.choice([math.nan, math.inf, -math.inf]),
    "fraction": lambda x, r: float(x) + 0.5,
    "as a float": lambda x, r: float(x),
    "whole": lambda x, r: round(x),
}


def _change(plan: dict, rng: np.random.Generator) -> tuple[dict, str]:
    """Change one number; every third time each number equal to it too, as whoever moves a pose everywhere."""
    out = copy.deepcopy(plan)
    ways = _numbers(plan)
    way = ways[rng.integers(len(ways))]
    kind = list(CHANGES)[rng.integers(len(CHANGES))]
    old = _at(plan, way)
    new = CHANGES[kind](old, rng)
    new = new if isinstance(new, int) else float(new)
    alike = [w for w in ways if _at(plan, w) == old and w[-1] == way[-1]] if rng.random() < 1 / 3 else [way]
    for each in alike:
        _at(out, each[:-1])[each[-1]] = new
    return out, f"{way}: {kind}, {old} becomes {new}"


def _head(text: str) -> str:
    return " ".join(line.lstrip("# ") for line in text.split("kind,pose,")[0].splitlines())


def _try(written, number: int) -> bool:
    """Change a plan at random; tell whether it was exported."""
    folder, plan, plain = written
    changed, what = _change(plan, np.random.default_rng([29, number]))
    (folder / "plan.json").write_text(json.dumps(changed))
    try:
        text = _exported(folder)
    except (InputError, NoSolutionError) as err:
        said = str(err)
    else:
        said = ""
    if said:
        assert "\n" not in said, what
        assert str(folder / "plan.json") in said, what
        return False
    if text == plain:  # nothing that is driven or stated differs
        assert _differ_by(plan, changed) < 10.0**-PLAN_DECIMALS, what
        return True
    assert "not as it was planned: changed since it was planned" in _head(text), what
    part = re.match(r"\('(\w+)'", what)[1]
    assert part in _head(text), what
    assert "were those of the plan as it was written" in _head(text), what
    found = complaints(folder, text)
    assert not found, f"{what}: {found}"
    return True


def _differ_by(plan, changed) -> float:
    pairs = [(_at(plan, w), _at(changed, w)) for w in _numbers(plan)]
    return max(abs(a - b) for a, b in pairs)


@pytest.mark.slow
def test_the_plan_as_written_holds_by_the_independent_check(written):
    folder, plan, plain = written
    assert complaints(folder, plain) == []
    assert "not as it was planned" not in plain
    q = proven_tour(CELL, POSES)
    length = [p["length_mm"] for p in plan["poses"]]
    p_BX = np.array([430.0, 330.0, 60.0])
    assert np.allclose(np.linalg.norm(1e3 * map_positions(folder, q) - p_BX, axis=1), length, atol=1e-6)
    there = next(line for line in plain.splitlines() if line.startswith("move") and line.split(",")[1])
    elsewhere = there.split(",")
    elsewhere[3] = f"{float(elsewhere[3]) + 30.0:.4f}"  # the check tells a pose that is not the planned one
    assert complaints(folder, plain.replace(there, ",".join(elsewhere))) != []


@pytest.mark.long
def test_changed_numbers_are_refused_or_said_and_right(written):
    exported = [_try(written, k) for k in range(FEW)]
    assert 0.2 < np.mean(exported) < 0.9


@pytest.mark.long
def test_two_thousand_changed_numbers_are_refused_or_said_and_right(written, judged_once):
    exported = [_try(written, k) for k in range(FEW, FEW + MANY)]
    assert 0.2 < np.mean(exported) < 0.9


def test_ways_that_do_not_join_are_refused(written):
    folder, plan, _ = written
    changed = copy.deepcopy(plan)
    changed["drives"][0]["travel"][1]["q_deg"][2] -= 6.0
    (folder / "plan.json").write_text(json.dumps(changed))
    with pytest.raises(InputError, match=r"the drive at fixture A does not join: .* joint 3 at .*°, what follows"):
        _exported(folder)
    with pytest.raises(InputError, match="does not join"):
        export(folder / "plan.json", dialect="krl")


@pytest.mark.slow
def test_a_pose_that_a_person_moves_everywhere_is_driven_where_it_is_proven(written):
    """A support pose may be moved by hand; far off it is not proven, and the sentence says which move."""
    folder, plan, _ = written

    def with_support(share: float, lift_deg: float) -> str:
        changed = copy.deepcopy(plan)
        points = changed["drives"][0]["waypoints"]
        a, b = (np.array(points[k]["q_deg"]) for k in (1, 2))
        middle = a + share * (b - a) + np.array([0.0, lift_deg, 0.0, 0.0, 0.0, 0.0])
        points.insert(2, {"q_deg": middle.tolist(), "visit": -1, "blend_mm": 0.0})
        (folder / "plan.json").write_text(json.dumps(changed))
        return _exported(folder)

    text = with_support(0.5, 0.0)
    assert "changed since it was planned: drives[0].waypoints;" in _head(text)
    assert complaints(folder, text) == []
    with pytest.raises(NoSolutionError, match=r"the program is not released: coal does not prove .* \(move \d+: "):
        with_support(0.5, 60.0)
