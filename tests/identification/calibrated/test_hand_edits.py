"""What a person changed in a document since edbb wrote it is said; what only looks otherwise is not."""

import json
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from planner.cell.fleet_file import with_fleet
from planner.cell.reading import load_cell
from planner.common.content_hashes import HASHES, hand_edits, with_hashes
from planner.common.errors import InputError
from planner.compensation.compensated_file import compensate_file
from planner.documents.baseline import NAME, joint_noise_of
from planner.documents.calibrated_robot import CalibratedRobot, calibrated_files, calibrated_meshes
from planner.kinematics.robot_hash import robot_hash
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.report.page import report_overview
from planner.session.movable_cell import cell_files
from planner.session.neutral_program import build_program, move_home
from planner.workflow.compensation import compensate
from tests.identification.calibrated.made import calibration, compliances, robot_called, write

FREE = ("title", "sources", "never_meet_reason", "controllers", "dialect", "packages")


def written(name, folder, seed=1):
    """The calibrated robot's file, with effects."""
    robot = robot_called(name, folder)
    made = calibration(robot, seed, compliances(robot))
    write(folder, (*calibrated_files(made), *calibrated_meshes(made)))
    return folder / "robot.toml"


def numbers(value, path=()):
    """Way to every number of a document."""
    if isinstance(value, bool | str):
        return
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(part, (*path, key))
        return
    yield path


def change(content, path, to=lambda v: v + 1e-6):
    """Change the value there."""
    at = content
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = to(at[path[-1]])


@pytest.mark.parametrize("name", [*list_robots(), "panda.urdf", "slanted"])
def test_a_robot_as_it_was_written_was_not_edited(name, tmp_path):
    assert load_robot(str(written(name, tmp_path))).hand_edits == ()


def test_hand_written_robots_and_those_of_earlier_versions_have_nothing_to_say(tmp_path):
    assert all(load_robot(name).hand_edits == () for name in list_robots())
    path = written("ur10", tmp_path)
    content = tomllib.loads(path.read_text())
    before = load_robot(str(path))
    del content[HASHES]
    change(content, ("nominal", next(iter(content["nominal"]))))
    path.write_text(tomli_w.dumps(content))
    assert load_robot(str(path)).hand_edits == ()
    del content["nominal"]
    assert HASHES in tomllib.loads((tmp_path / "robot.toml").read_text()) or before.hand_edits == ()


@pytest.mark.slow
def test_every_number_of_a_calibrated_robot_counts(tmp_path):
    path = written("kuka-kr6-r700", tmp_path)
    whole = path.read_text()
    ways = [p for p in numbers(tomllib.loads(whole)) if p[0] not in (*FREE, HASHES)]
    assert len(ways) > 150
    for way in ways[:: max(1, len(ways) // 60)]:
        content = tomllib.loads(whole)
        change(content, way)
        path.write_text(tomli_w.dumps(content))
        try:
            edits = load_robot(str(path)).hand_edits
        except InputError:  # no such robot can be
            continue
        assert [e.parts for e in edits] == [(way[0],)], way
        assert "robot.toml was changed by hand" in edits[0].sentence


def test_simulated_may_not_be_taken_out_unsaid(tmp_path):
    path = written("ur10", tmp_path)
    path.write_text("simulated = true\n" + re.sub(r"(?m)^simulated.*\n", "", path.read_text()))
    assert load_robot(str(path)).hand_edits[0].parts == ("simulated",)


def test_looks_and_what_a_person_may_say_do_not_count(tmp_path):
    path = written("kuka-kr6-r700", tmp_path)
    digest = robot_hash(load_robot(str(path)))
    content = tomllib.loads(path.read_text())
    content |= {"title": "cell 4", "sources": {"all": "me"}}
    turned = {key: content[key] for key in reversed(list(content))}
    text = "# mine\n" + tomli_w.dumps(turned).replace("\n", "\r\n")
    path.write_bytes(re.sub(r"= (-?\d+)\.0\b", r"= \1", text).encode())
    assert path.read_bytes().count(b".0\r") < text.count(".0\r")
    found = load_robot(str(path))
    assert found.hand_edits == ()
    assert robot_hash(found) == digest


def test_a_number_of_the_urdf_counts_too(tmp_path):
    path = written("slanted", tmp_path)
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(urdf.read_text().replace("\n", "\r\n"))
    assert load_robot(str(path)).hand_edits == ()
    found = re.search(r'xyz="([-\d.e]+) ', urdf.read_text())
    urdf.write_text(urdf.read_text().replace(found[0], f'xyz="{float(found[1]) + 1e-5!r} ', 1))
    assert load_robot(str(path)).hand_edits[0].parts == ("robot.urdf",)


@pytest.mark.parametrize("name", ["panda.urdf", "slanted", "ur10"])
def test_a_copy_beside_a_plan_says_the_same_of_the_robot(name, tmp_path):
    path = written(name, tmp_path)
    (tmp_path / "copy").mkdir()
    cell = load_cell("ur10/edbb", planning=False)

    def copied():
        """The robot beside a plan of a cell with this robot."""
        for file, data in cell_files(replace(cell, robot=load_robot(str(path)))).items():
            (tmp_path / "copy" / file).parent.mkdir(exist_ok=True)
            (tmp_path / "copy" / file).write_bytes(data)
        return load_robot(str(tmp_path / "copy" / "robot.toml"))

    assert copied().hand_edits == ()
    content = tomllib.loads(path.read_text())
    change(content, ("effects", 0, "value"), lambda v: 2 * v)
    path.write_text(tomli_w.dumps(content))
    assert [e.parts for e in copied().hand_edits] == [("effects",)]


def test_programs_and_pages_made_with_an_edited_robot_say_so(tmp_path):
    path = written("ur10", tmp_path)
    content = tomllib.loads(path.read_text())
    change(content, ("effects", 0, "value"), lambda v: 2 * v)
    path.write_text(tomli_w.dumps(content))
    cell = replace(load_cell("ur10/edbb", planning=False), robot=load_robot(str(path)))
    program = build_program(cell, "0" * 12, [move_home(cell)])
    assert program.cautions[0].startswith("robot.toml was changed by hand since edbb wrote it (effects)")
    assert "robot.toml was changed by hand" in report_overview("a study", cell, "text", (), (), {}).html()


def test_corrected_programs_say_it_at_their_head_and_on_the_screen(tmp_path):
    path = written("kuka-kr6-r700", tmp_path)
    (tmp_path / "a.src").write_text("DEF a()\nPTP {A1 0,A2 -80,A3 90,A4 0,A5 30,A6 0}\nEND\n")
    before = compensate(targets=tmp_path / "a.src", model=path)
    assert "by hand" not in before.file.text + before.full_summary()
    content = tomllib.loads(path.read_text())
    change(content, ("nominal", "a2_mm"))
    path.write_text(tomli_w.dumps(content))
    after = compensate(targets=tmp_path / "a.src", model=path)
    head = after.file.text.partition("PTP")[0].replace("\n;", "")
    assert "robot.toml was changed by hand since edbb wrote it (nominal)" in re.sub(r"\s+", " ", head)
    assert "robot.toml was changed by hand since edbb wrote it (nominal)" in after.full_summary()
    robot = load_robot(str(path))
    again = compensate_file(tmp_path / "a.src", robot.nominal_robot, CalibratedRobot(robot))
    assert len(again.targets) == 1


def fleet_text():
    sizes = [{"group": "lengths, joint 3", "factor": 1.5, "log_std": 0.2, "seen": 4.0}]
    return tomli_w.dumps(with_hashes({"schema": "edbb-fleet/1", "robot": "kuka-kr6-r700", "robots": 2, "sizes": sizes}))


def test_an_edited_fleet_is_said_with_the_robot_that_takes_it(tmp_path):
    path, cell = tmp_path / "fleet.toml", load_cell("kuka-kr6-r700/edbb")
    path.write_text("# two robots\n" + fleet_text())
    assert with_fleet(cell, path).robot.hand_edits == ()
    path.write_text(fleet_text().replace("1.5", "1.6"))
    edits = with_fleet(cell, path).robot.hand_edits
    assert [e.parts for e in edits] == [("sizes",)]
    assert "fleet.toml was changed by hand" in edits[0].sentence


def test_a_posterior_that_was_edited_is_refused(tmp_path):
    content = {
        "schema": "edbb-posterior/1", "robot": "ur10", "robot_sha256": "", "gauge": "bar", "fixtures": {}, "points": {},
        "noise": [1.0, 2.0], "freedom": 9.0, "rest": 0.0, "parameters": [], "spread": [],
    }  # fmt: skip
    path = tmp_path / NAME
    path.write_text(json.dumps(content))  # of an earlier version
    assert joint_noise_of(tmp_path) == 2.0
    path.write_text(json.dumps(with_hashes(content), indent=3))
    assert joint_noise_of(tmp_path) == 2.0
    path.write_text(json.dumps(with_hashes(content) | {"noise": [1.0, 1.0]}))
    with pytest.raises(InputError, match=r"posterior\.json was changed by hand since edbb wrote it \(noise\)"):
        joint_noise_of(tmp_path)


def test_numbers_that_no_float_holds_have_a_hash(tmp_path):
    content = with_hashes({"a": 10**400, "b": np.float64(-0.0), "c": [1, 2.0, True, None]})
    assert hand_edits(tmp_path, content) == ()
    assert hand_edits(tmp_path, content | {"a": 10**400 + 1})[0].parts == ("a",)
    assert hand_edits(tmp_path, content | {"c": [1.0, 2, True, None], "b": 0}) == ()
    assert hand_edits(tmp_path, content | {"d": 1})[0].parts == ("d",)
