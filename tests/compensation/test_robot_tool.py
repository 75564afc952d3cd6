"""The tool that belongs to a calibrated robot stands in its file; compensation takes it, and warns of another one."""

import json
import re
from hashlib import sha256

import numpy as np
import pytest

from planner.common.files import data_folder
from planner.kinematics.robot_hash import model_text_hash
from planner.kinematics.robot_reader import load_robot
from tests.command import edbb
from tests.compensation.robots import exact, flange_pose
from tests.compensation.test_cartesian import abc_of

NAME = "kuka-kr6-r700"
TOOL = np.array([12.0, -7.5, 151.412])  # [mm]
POINT = """
[[tool_points]]
position_mm = [12.0, -7.5, 151.412]
std_mm = [0.5, 0.5, 0.8]
std_beside_robot_mm = [0.004, 0.004, 0.003]
"""
Q = np.radians([[10, -80, 100, 20, 40, 30], [-20, -60, 80, 10, 50, 0]])
JOINTS = ",".join(f"q{k}_deg" for k in range(1, 7))


@pytest.fixture
def model(tmp_path):
    text = (data_folder("robots") / NAME / "robot.toml").read_text()
    text = text.replace("a_mm = 315.0", "a_mm = 315.4") + "[nominal]\na2_mm = 315.0\n" + POINT
    (tmp_path / "robot.toml").write_text(text)
    return tmp_path / "robot.toml"


def poses(path, tool):
    """A table of the poses of a tool [mm] at the angles Q, by pinocchio."""
    rows = []
    for q in Q:
        T = flange_pose(exact(load_robot(NAME)), q)
        T[:3, 3] += T[:3, :3] @ tool * 1e-3
        rows.append([*abc_of(T), *np.degrees(q)])
    np.savetxt(path, rows, "%.6f", ",", header=f"x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,{JOINTS}", comments="")
    return path


def table_of(text):
    return np.loadtxt([line for line in text.splitlines() if not line.startswith("#")], delimiter=",", skiprows=1)


def wanted(model):
    """Joint angles at which the calibrated arm stands where the nominal one should, by a plain table."""
    table = model.with_name("q.csv")
    np.savetxt(table, np.degrees(Q), "%.6f", ",", header=JOINTS, comments="")
    return table_of(edbb("compensate", table, "--model", model, "-o", "-").stdout)


def test_a_table_of_the_tools_poses_is_taken_for_what_its_angles_say(model, tmp_path):
    for tool, says in ((TOOL, True), (np.zeros(3), False)):
        done = edbb("compensate", poses(tmp_path / "t.csv", tool), "--model", model, "-o", "-")
        assert done.returncode == 0, done.stderr
        np.testing.assert_allclose(table_of(done.stdout)[:, 6:], wanted(model), atol=2e-5)
        assert ("these are poses of the measured tool point" in " ".join(done.screen.split())) == says


def test_the_word_model_stands_for_the_tool_of_the_file(model, tmp_path):
    table = poses(tmp_path / "t.csv", TOOL)
    by_word, by_number = (
        edbb("compensate", table, "--model", model, "--tool", tool, "-o", "-")
        for tool in ("model", "12,-7.5,151.412,0,0,0")
    )
    assert by_word.returncode == 0, by_word.stderr
    assert by_word.stdout == by_number.stdout
    assert "warning" not in by_word.screen + by_number.screen
    model.write_text(model.read_text().replace(POINT, ""))
    none = edbb("compensate", table, "--model", model, "--tool", "model", "-o", "-")
    assert (none.returncode, "has no [[tool_points]]" in " ".join(none.screen.split())) == (2, True)
    named = "".join(POINT.replace("pos", f'name = "{name}"\npos') for name in "AB")
    model.write_text(model.read_text() + named)
    several = edbb("compensate", table, "--model", model, "--tool", "model", "-o", "-")
    assert (several.returncode, "several tool points (A, B)" in " ".join(several.screen.split())) == (2, True)


@pytest.mark.parametrize(
    ("z", "said"),
    [
        (151.412, ""),
        (151.420, ""),  # within three deviations
        (151.425, "0.013 mm off the tool point"),
        (153.042, "1.630 mm off the tool point"),  # nearly as likely by itself, and wrong with this robot
        (251.412, "another tool (100 mm away)"),
    ],
)
def test_a_tool_that_is_off_by_more_than_its_deviation_is_warned_of(z, said, model, tmp_path):
    table = poses(tmp_path / "t.csv", np.array([12.0, -7.5, z]))
    done = edbb("compensate", table, "--model", model, "--tool", f"12,-7.5,{z},0,0,0", "-o", "-")
    told = " ".join(done.screen.split())
    assert done.returncode == 0, told
    assert bool(re.search(r"warning: --tool", told)) == bool(said)
    assert said in told


def test_a_robot_that_left_its_folder_still_says_that_it_was_simulated(model, tmp_path):
    table = poses(tmp_path / "t.csv", TOOL)
    text = model.read_text()
    for line, word in (("simulated = true", "SIMULATED"), ("simulated = false", "measured"), ("", "unknown")):
        model.write_text(text.replace("schema =", f"{line}\nschema ="))
        done = edbb("compensate", table, "--model", model, "-o", "-")
        assert word in done.stdout.splitlines()[0]
        assert ("SIMULATED" in done.screen) == (word == "SIMULATED")


FAR = TOOL + np.array([0.0, 0.0, 158.0])
ANGLES = "10, -80, 100, 20, 40, 30"
RADIANS = ", ".join(f"{v:.6f}" for v in Q[0])
PROGRAMS = {  # one joint target each, driven with the tool that is filled in [mm, m for URScript]
    "t.src": (
        "DEF t()\n$TOOL = {{X {0},Y {1},Z {2},A 0,B 0,C 0}}\n$BASE = $NULLFRAME\n"
        "PTP {{A1 10,A2 -80,A3 100,A4 20,A5 40,A6 30}}\nEND\n"
    ),
    "t.mod": (
        "MODULE t\nPERS tooldata tGrip := [TRUE,[[{0},{1},{2}],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\nPROC main()\n"
        f"MoveAbsJ [[{ANGLES}],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tGrip;\nENDPROC\nENDMODULE\n"
    ),
    "t.pdl": (
        f"PROGRAM t\nBEGIN\n  $TOOL := POS({{0}}, {{1}}, {{2}}, 0, 0, 0, '')\n  MOVE TO {{{{{ANGLES}}}}}\nEND t\n"
    ),
    "t.script": f"def t():\n  set_tcp(p[{{3}}, {{4}}, {{5}}, 0, 0, 0])\n  movej([{RADIANS}], a=1, v=1)\nend\n",
}


def with_known_errors(model, digest=model_text_hash):
    """The file of expected errors beside a model: 0.3 mm with the measured tool, 1.8 mm with any other."""
    content = {
        "schema": "edbb-expected-error/1", "robot": NAME, "tool_mm": TOOL.tolist(), "parameters": [{"name": "a2"}],
        "robot_sha256": digest(model.read_text()), "nominal": [0.02], "geometry": [0.0],
        "released": [0.0], "spread": [[1e-9]], "rest_mm": 0.3, "rest_other_mm": 1.8,
        "states_deg": np.degrees(Q).tolist(),
    }  # fmt: skip
    model.with_name("expected_error.json").write_text(json.dumps(content))


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_error_of_joint_targets_is_that_of_the_tool_that_their_program_says(name, model, tmp_path):
    with_known_errors(model)
    for tool, after in ((TOOL, 0.3), (FAR, 1.8)):
        (tmp_path / name).write_text(PROGRAMS[name].format(*tool, *(tool * 1e-3)))
        done = edbb("compensate", tmp_path / name, "--model", model, "-o", "-")
        told = " ".join(done.screen.split())
        assert done.returncode == 0, told
        assert float(re.search(r"tool error \S+ → (\S+) mm", told)[1]) == after
        off = "the program's tool (12.0, -7.5, 309.4) mm on 1 line ({}) is another tool (158 mm away)"
        line = PROGRAMS[name][: re.search(r"PTP|Move|MOVE|movej", PROGRAMS[name]).start()].count("\n") + 1
        assert (off.format(line) in told) == (tool is FAR)


SELECTED = {  # two joint targets with tool 2 of the controller, or one that another module declares
    "t.src": "DEF t()\nBAS(#TOOL,2)\nBAS(#BASE,0)\nPTP {A1 10,A2 -80,A3 100,A4 20,A5 40,A6 30}\n"
    "PTP {A1 -20,A2 -60,A3 80,A4 10,A5 50,A6 0}\nEND\n",
    "t.ls": "/PROG  T\n/MN\n   1:  UTOOL_NUM=2 ;\n   2:J P[1] 50% FINE ;\n   3:J P[2] 50% FINE ;\n/POS\n"
    + "".join(
        f"P[{k}]{{\n   GP1:\n\tUF : 0, UT : 2,\n\t"
        + ",\t".join(f"J{j}= {v:.3f} deg" for j, v in enumerate(np.degrees(q), 1))
        + "\n};\n"
        for k, q in enumerate(Q, 1)
    )
    + "/END\n",
    "t.mod": "MODULE t\nPROC main()\n"
    + "".join(
        f"MoveAbsJ [[{','.join(f'{v:.4f}' for v in np.degrees(q))}],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tGrip;\n"
        for q in Q
    )
    + "ENDPROC\nENDMODULE\n",
}
CONFIG = "DEFDAT $CONFIG\nTOOL_DATA[2]={{X {},Y {},Z {},A 0.0,B 0.0,C 0.0}}\nENDDAT\n"


@pytest.mark.parametrize(("name", "tool"), [("t.src", "TOOL_DATA[2]"), ("t.ls", "UTOOL 2"), ("t.mod", "tGrip")])
def test_the_stated_error_of_a_tool_that_the_files_do_not_hold_is_the_measured_ones_alone(name, tool, model, tmp_path):
    with_known_errors(model)
    path = tmp_path / name
    path.write_text(SELECTED[name])

    def told(*words):
        done = edbb("compensate", path, "--model", model, *words, "-o", "-")
        assert done.returncode == 0, done.stderr
        return " ".join(done.screen.split()).replace("└", "").replace("│", "")

    said = told()
    assert re.search(r"joint targets on 2 lines \(.*?\) are of a tool that the files do not hold", said), said
    assert f"({tool}): the error stated is that of the measured tool alone" in said
    assert float(re.search(r"tool error \S+ → (\S+) mm", said)[1]) == 0.3
    assert "do not hold" not in told("--tool", "model")
    if name == "t.src":  # what that tool is decides how good the program becomes: 1.8 mm with any but the measured one
        for place, after in ((TOOL, 0.3), (FAR, 1.8)):
            (tmp_path / "config.dat").write_text(CONFIG.format(*place))
            said = told("--frames", tmp_path / "config.dat")
            assert "do not hold" not in said
            assert float(re.search(r"tool error \S+ → (\S+) mm", said)[1]) == after


ADDED = '[controllers.urscript]\nsame = true\nsource = "jogged at the robot on 2026-03-02"\n'


def test_how_a_controller_counts_makes_no_other_robot_and_a_length_does(model, tmp_path):
    """What the refusal of a program advises to add leaves the statement of the error, and the mark, as they are."""
    with_known_errors(model)
    (tmp_path / "t.script").write_text(PROGRAMS["t.script"].format(*TOOL, *(TOOL * 1e-3)))
    words = ("compensate", tmp_path / "t.script", "--model", model, "-o", "-")
    first, text = edbb(*words), model.read_text()
    assert "urscript" not in text
    model.write_text(text + ADDED)
    again = edbb(*words)
    for done in (first, again):
        assert (done.returncode, bool(re.search(r"tool error  \S+ → 0.300 mm", done.stderr))) == (0, True), done.stderr
    assert again.stdout == first.stdout
    model.write_text(text.replace("a_mm = 315.4", "a_mm = 315.5"))
    assert "expected_error.json belongs to another robot.toml" in " ".join(edbb(*words).screen.split())


@pytest.mark.parametrize("added", ["", ADDED])
def test_a_statement_of_an_earlier_version_holds_for_the_bytes_that_it_was_written_with(added, model, tmp_path):
    with_known_errors(model, lambda text: sha256(text.encode()).hexdigest())
    (tmp_path / "t.src").write_text(PROGRAMS["t.src"].format(*TOOL))
    model.write_text(model.read_text() + added)
    told = " ".join(edbb("compensate", tmp_path / "t.src", "--model", model, "-o", "-").screen.split())
    assert ("→ 0.300 mm" in told) == (not added)
    assert ("to the byte: identify again" in told) == bool(added)


def test_a_table_of_a_german_spreadsheet_is_read_and_written_with_its_commas(model, tmp_path):
    plain = wanted(model)
    text = model.with_name("q.csv").read_text().replace(",", ";").replace(".", ",")
    (tmp_path / "german.csv").write_text(text)
    done = edbb("compensate", tmp_path / "german.csv", "--model", model, "-o", "-")
    assert done.returncode == 0, done.stderr
    body = "\n".join(line for line in done.stdout.splitlines() if not line.startswith("#"))
    assert "." not in body
    np.testing.assert_allclose(table_of(body.replace(",", ".").replace(";", ",")), plain, atol=1e-9)
    (tmp_path / "mixed.csv").write_text(text.replace(",", ".", 1))
    mixed = edbb("compensate", tmp_path / "mixed.csv", "--model", model, "-o", "-")
    assert (mixed.returncode, "a number with a point is allowed" in " ".join(mixed.screen.split())) == (2, True)
