"""A corrected file is known again, whatever editors and controllers do to it, and is never corrected twice."""

import json
import os
import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

import tests
import tests.programs.sessions as sessions
from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.compensation.compensated_file import compensate_file
from planner.compensation.correction_mark import CorrectionMark
from planner.kinematics.robot_hash import robot_hash
from planner.kinematics.robot_reader import load_robot
from planner.programs.verification import write_program
from tests.command import edbb
from tests.compensation.robots import half_pulse_deg, unlimited
from tests.compensation.test_formats import CSV, NAMES, shifted
from tests.compensation.test_partial import GOOD, krl
from tests.programs.languages import targets_first
from tests.programs.reading import read_back

HERE = CorrectionMark("ab" * 32, False, date(2026, 3, 31))
OTHER = CorrectionMark("cd" * 32, True, date(2026, 4, 1))
KRL_DAT = "DEFDAT P PUBLIC\r\nDECL E6AXIS X1={A1 10,A2 -80,A3 100,A4 20,A5 40,A6 30}\r\nENDDAT\r\n"


@pytest.fixture(scope="module")
def robot():
    return unlimited(load_robot("kuka-kr6-r700"))


def file_of(folder, name):
    """A program in a dialect that is no measuring program (its plan is not named), and its files as they are read."""
    if name == "csv":
        path = folder / "targets.csv"
        path.write_text(CSV)
        return path, None
    if name == "dat":
        path = folder / "p.dat"
        path.write_bytes(KRL_DAT.encode())
        return path, None
    files = targets_first(name, write_program(replace(sessions.mixed(6, 6), robot="kuka-kr6-r700"), name, "session"))
    for file in files:
        (folder / file.name).write_bytes(re.sub("plan_id", "plan", file.text).encode(file.encoding))
    return folder / files[0].name, files


def upper(text):
    return text.upper()


def other_ends(text):
    return text.replace("\r\n", "\n") if "\r\n" in text else text.replace("\n", "\r\n")


def cut_tail(text):
    return text[: len(text) * 3 // 4]


def head_behind(text):
    """The lines of the head behind all others, as an editor that sorts or a controller that collects remarks leaves."""
    lines = text.splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if "edbb-compensated" in line)
    return "".join(lines[:first] + lines[first + 1 :]) + lines[first]


def indented(text):
    return "".join(f"   {line}" for line in text.splitlines(keepends=True))


def no_blanks(text):
    return "\n".join(line.replace("edbb-compensated ", "edbb-compensated:") for line in text.splitlines())


def correct(name, *args, **more):
    """Correct a file; whether X Y Z are joint angles, somebody has to say."""
    return compensate_file(*args, dialect=name if name == "linuxcnc" else None, **more)


@pytest.mark.parametrize("change", [str, upper, other_ends, cut_tail, head_behind, indented, no_blanks])
@pytest.mark.parametrize("name", [*NAMES, "csv", "dat"])
def test_a_corrected_file_is_never_corrected_by_the_same_model(name, change, robot, tmp_path):
    path, _ = file_of(tmp_path, name)
    done = correct(name, path, robot, shifted(robot), mark=HERE)
    assert done.text.isascii() or name == "csv"
    path.write_bytes(change(done.text).encode(done.encoding))
    for again in (False, True):
        with pytest.raises(InputError, match=rf"{path.name}:\d+: the file was corrected before, by this same model"):
            correct(name, path, robot, shifted(robot), mark=HERE, again=again)
    with pytest.raises(InputError, match="by another model, whose hash begins with abab"):
        correct(name, path, robot, shifted(robot), mark=OTHER)
    if change is str:
        assert correct(name, path, robot, shifted(robot), mark=OTHER, again=True).text != done.text


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NAMES, "csv", "dat"])
def test_the_mark_is_a_comment_that_says_which_model_and_whether_it_was_measured(name, robot, tmp_path):
    path, files = file_of(tmp_path, name)
    plain = correct(name, path, robot, shifted(robot))
    for mark, word in ((HERE, "measured"), (OTHER, "SIMULATED")):
        done = correct(name, path, robot, shifted(robot), mark=mark)
        before, after = plain.text.splitlines(), done.text.splitlines()
        first = next(k for k, (a, b) in enumerate(zip(before, after, strict=False)) if a != b)
        length = len(after) - len(before)
        assert before == after[:first] + after[first + length :]  # lines were added, in one place, and nothing else
        head = " ".join(re.sub(r"^\W*|\W*;?$", "", line) for line in after[first : first + length])
        assert f"edbb-compensated {mark.model_hash[:12]} {word} {mark.day.isoformat()}" in head.replace(",", "")
        above = [line for line in before[:first] if not re.match(r"[CP]\d+=", line)]  # INFORM: positions come first
        assert len(above) < 20
        if files:  # the language's own reader takes it for a remark
            changed = [replace(files[0], text=done.text.replace("plan:", "plan_id:")), *files[1:]]
            angles = read_back(name, changed).joint_path_deg
            expected = read_back(name, files).joint_path_deg - 0.5 * np.eye(6)[3]
            assert (np.abs(angles - expected) <= 1.1e-5 + 2.0 * half_pulse_deg(name)).all()
        path.write_bytes(done.text.encode(done.encoding))
        assert len(correct(name, path, robot, shifted(robot)).targets) == len(plain.targets)
        path.write_bytes(files[0].text.replace("plan_id", "plan").encode(files[0].encoding) if files else b"")
        if not files:
            file_of(tmp_path, name)


def test_a_remark_of_fanuc_holds_the_mark_whole(robot, tmp_path):
    path, _ = file_of(tmp_path, "fanuc-tp")
    done = compensate_file(path, robot, shifted(robot), mark=HERE)
    (line,) = [line for line in done.text.splitlines() if "edbb-compensated" in line]
    assert "edbb-compensated abababababab" in line
    assert len(line.split("!")[1].rstrip(" ;")) <= 32
    assert done.text.index("/MN") < done.text.index("edbb-compensated") < done.text.index("   1:")


def test_each_half_of_a_module_is_judged_by_itself(robot, tmp_path):
    src, dat = tmp_path / "p.src", tmp_path / "p.dat"
    src.write_text(krl(GOOD, "PTP X1"))
    dat.write_text(KRL_DAT)
    done = compensate_file(src, robot, shifted(robot), mark=HERE)
    src.write_text(done.text)
    half = compensate_file(dat, robot, shifted(robot), mark=HERE)  # its other half is corrected, it is not
    assert "A4 19.5" in half.text
    dat.write_text(half.text)
    for path in (src, dat):
        with pytest.raises(InputError, match="corrected before"):
            compensate_file(path, robot, shifted(robot), mark=HERE)


@pytest.mark.parametrize("said", ["edbb-compensated", "edbb-compensated, measured", "Compensated in part for kr6"])
def test_a_mark_that_names_no_model_is_refused_whatever_is_said(said, robot, tmp_path):
    (tmp_path / "p.src").write_text(krl(f"; {said}", GOOD))
    for again in (False, True):
        with pytest.raises(InputError, match=r"p\.src:2: the file was corrected before, by a model that the mark"):
            compensate_file(tmp_path / "p.src", robot, shifted(robot), mark=HERE, again=again)


def test_the_first_digits_of_a_mark_that_was_cut_tell_the_model(robot, tmp_path):
    (tmp_path / "p.src").write_text(krl("; edbb-compensated abab", GOOD))
    with pytest.raises(InputError, match="by this same model"):
        compensate_file(tmp_path / "p.src", robot, shifted(robot), mark=HERE, again=True)


@pytest.mark.parametrize("name", [*NAMES, "poses-csv"])
def test_a_measuring_program_is_corrected_only_where_that_is_asked_for(name, robot, tmp_path):
    if name == "poses-csv":
        (tmp_path / "run.csv").write_text(
            "# plan_id: 0123456789ab\nq1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n1,-80,90,1,9,1\n"
        )
        path = tmp_path / "run.csv"
    else:
        files = targets_first(
            name, write_program(replace(sessions.mixed(6, 6), robot="kuka-kr6-r700"), name, "session")
        )
        for file in files:
            (tmp_path / file.name).write_bytes(file.text.encode(file.encoding))
        path = tmp_path / files[0].name
    with pytest.raises(
        InputError, match="belongs to the measuring plan 0123456789ab: its poses are nominal on purpose"
    ):
        correct(name, path, robot, shifted(robot), mark=HERE)
    assert "edbb-compensated" in correct(name, path, robot, shifted(robot), mark=HERE, measuring=True).text


@pytest.fixture
def model(tmp_path):
    """The folder of a calibrated robot, with the identification that says that nobody measured it."""
    folder = tmp_path / "found"
    folder.mkdir()
    text = (data_folder("robots") / "kuka-kr6-r700" / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace("a_mm = 315.0", "a_mm = 315.4") + "[nominal]\na2_mm = 315.0\n")
    (folder / "identification.json").write_text(json.dumps({"simulated": True}))
    (tmp_path / "p.src").write_text(krl(GOOD))
    return folder


@pytest.mark.slow
def test_the_command_marks_refuses_and_writes_over_its_own_result(model, tmp_path):
    words = ("compensate", tmp_path / "p.src", "--model", model / "robot.toml", "-o", tmp_path / "out.src")
    first = edbb(*words)
    assert first.returncode == 0, first.stderr
    text = (tmp_path / "out.src").read_text()
    assert re.search(r"edbb-compensated [0-9a-f]{12}, SIMULATED, ", text)
    second = edbb(*words)  # the same command again gives the same file
    assert second.returncode == 0, second.stderr
    assert (tmp_path / "out.src").read_text() == text
    twice = ("compensate", tmp_path / "out.src", *words[2:4], "-o", tmp_path / "twice.src")
    for more in ((), ("--again",)):
        done = edbb(*twice, *more)
        assert done.returncode == 2
        assert "out.src:2: the file was corrected before, by this same model" in " ".join(done.screen.split())
    with (model / "robot.toml").open("a") as file:
        file.write("a1_mm = 24.9\n")
    assert edbb(*twice).returncode == 2
    assert "--again" in edbb(*twice).screen
    done = edbb(*twice, "--again")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "twice.src").read_text().count("edbb-compensated") == 2


def test_a_folder_stands_for_the_robot_in_it(model, tmp_path):
    by_file, by_folder = (
        edbb("compensate", tmp_path / "p.src", "--model", path, "-o", "-") for path in (model / "robot.toml", model)
    )
    assert by_file.returncode == by_folder.returncode == 0
    assert by_file.stdout == by_folder.stdout
    assert by_file.stderr == by_folder.stderr
    assert "SIMULATED" in by_folder.screen


def test_the_date_is_the_one_that_is_named_or_of_a_build_or_of_the_model(model, tmp_path, monkeypatch):
    words = ("compensate", tmp_path / "p.src", "--model", model, "-o", "-")
    os.utime(model / "robot.toml", (1_700_000_000, 1_700_000_000))  # 2023-11-14
    assert ", 2023-11-14." in edbb(*words).stdout
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1000000000")
    assert ", 2001-09-09." in edbb(*words).stdout
    assert ", 2026-03-31." in edbb(*words, "--date", "2026-03-31").stdout
    wrong = edbb(*words, "--date", "31.3.2026")
    assert (wrong.returncode, "allowed" in wrong.screen) == (2, True)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "today")
    wrong = edbb(*words)
    assert (wrong.returncode, "seconds since 1970 is allowed" in wrong.screen) == (2, True)


def test_a_model_without_its_identification_says_that_its_origin_is_unknown(model, tmp_path):
    (model / "identification.json").unlink()
    assert "origin of the model unknown" in edbb("compensate", tmp_path / "p.src", "--model", model, "-o", "-").stdout


def with_crlf(text):
    return text.replace("\n", "\r\n")


def with_comment(text):
    return f"# fetched from the store\n{text}\n   # end\n".replace("a_mm = 315.4", "a_mm = 315.4   # measured")


def reordered(text):
    nominal = "[nominal]\na2_mm = 315.0\n"
    return text.replace(nominal, "").replace("[[joints]]", f"{nominal}\n[[joints]]", 1)


def spelled(text):
    return text.replace("a2_mm = 315.0", "a2_mm = 3.15e2").replace("a_mm = 315.4", "a_mm = +315.40")


def whole_numbers(text):
    return re.sub(r"(= -?\d+)\.0$", r"\1", text, flags=re.MULTILINE)


def titled(text):
    return re.sub(r'^title = ".*"', 'title = "the one in hall 3"', text, flags=re.MULTILINE)


@pytest.mark.parametrize("change", [with_crlf, with_comment, reordered, spelled, whole_numbers, titled])
def test_the_same_robot_in_other_bytes_is_the_same_model(change, model, tmp_path):
    out, file = tmp_path / "out.src", model / "robot.toml"
    assert edbb("compensate", tmp_path / "p.src", "--model", model, "-o", out).returncode == 0
    data = file.read_bytes()
    file.write_bytes(change(data.decode()).encode())
    assert file.read_bytes() != data
    assert load_robot(str(file)).n_joints == 6
    done = edbb("compensate", out, "--model", model, "--again", "-o", tmp_path / "twice.src")
    assert (done.returncode, "by this same model" in " ".join(done.stderr.split())) == (2, True), done.stderr


@pytest.mark.parametrize("digit", [("a_mm = 315.4", "a_mm = 315.5"), ("a2_mm = 315.0", "a2_mm = 315.0000001")])
def test_a_changed_digit_is_another_model(digit, model, tmp_path):
    out, file = tmp_path / "out.src", model / "robot.toml"
    assert edbb("compensate", tmp_path / "p.src", "--model", model, "-o", out).returncode == 0
    file.write_text(file.read_text().replace(*digit))
    assert "by another model" in " ".join(edbb("compensate", out, "--model", model, "-o", "-").screen.split())
    assert edbb("compensate", out, "--model", model, "--again", "-o", "-").returncode == 0


URDF = 'schema = "edbb-robot/1"\nname = "arm"\nconvention = "urdf"\nurdf = "arm.urdf"\ntip = "panda_link8"\n'
CHANGED_URDF = {  # what is done to the URDF beside robot.toml, and whether it is the same robot then
    "line ends": (lambda s: s.replace("\n", "\r\n"), True),
    "comment": (lambda s: s.replace("</robot>", "<!-- as built -->\n</robot>"), True),
    "order of attributes": (lambda s: re.sub(r'<origin (rpy="[^"]*") (xyz="[^"]*")', r"<origin \2  \1", s), True),
    "spelling of numbers": (lambda s: s.replace('"0 0 0"', '"0.0  0 -0e0"'), True),
    "a digit": (lambda s: s.replace("0.333", "0.3331", 1), False),
}


@pytest.mark.parametrize("name", CHANGED_URDF)
def test_the_urdf_of_a_robot_counts_by_what_it_says(name, tmp_path):
    change, same = CHANGED_URDF[name]
    text = (Path(tests.__file__).parent / "data" / "panda-ball" / "panda.urdf").read_text()
    text = re.sub(r"<(visual|collision)>.*?</\1>", "", text, flags=re.DOTALL)
    assert change(text) != text
    (tmp_path / "robot.toml").write_text(URDF)
    hashes = set()
    for urdf in (text, change(text)):
        (tmp_path / "arm.urdf").write_text(urdf, newline="")
        hashes.add(robot_hash(load_robot(str(tmp_path / "robot.toml"))))
    assert len(hashes) == (1 if same else 2)


def test_a_shipped_robot_is_no_calibrated_one(tmp_path):
    (tmp_path / "p.src").write_text(krl(GOOD))
    done = edbb("compensate", tmp_path / "p.src", "--model", "comau-nj130", "-o", "-")
    said = " ".join(done.screen.split())
    assert done.returncode == 2
    assert "--model comau-nj130: a shipped robot is the nominal one and not calibrated" in said
    assert "give the robot.toml that 'edbb identify' wrote, or its folder" in said
    assert "did you mean" not in said


@pytest.mark.parametrize("name", ["comau-nj13", "empty", "empty/robot.toml"])
def test_a_model_that_is_not_there_is_said_with_what_to_give(name, tmp_path):
    (tmp_path / "p.src").write_text(krl(GOOD))
    (tmp_path / "empty").mkdir()
    done = edbb("compensate", tmp_path / "p.src", "--model", tmp_path / name, "-o", "-")
    assert done.returncode == 2
    assert "found; give the robot.toml that 'edbb identify' wrote, or its folder" in " ".join(done.screen.split())
