"""Dialects are data: found on disk, checked key by key, extended by a folder."""

import dataclasses
import re
import shutil
from pathlib import Path

import pytest

import planner.programs.dialect as dialect_module
import tests.programs.sessions as sessions
from planner.common.errors import InputError
from planner.programs.dialect import CommentStyle, comment_text, dialect_names, dialects, load_dialect
from planner.programs.verification import import_map, write_program
from tests.programs.reading import read_back, verify


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the dialects that a test may change."""
    copy = tmp_path / "g-code"
    shutil.copytree(dialect_module.dialect_root(), copy)
    monkeypatch.setattr(dialect_module, "data_folder", lambda _name: copy)
    return copy


def _change(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_shipped() -> None:
    found = {d.name: d for d in dialects()}
    assert len(found) >= 13
    assert found["krl"].extensions == (".src", ".dat")
    assert found["linuxcnc"].wants_dense_path
    assert not found["rapid"].wants_dense_path
    assert tuple(found["din66025"].options) == ("rounding",)


@pytest.mark.parametrize("name", [d.name for d in dialects()])
def test_a_pose_that_a_person_leads_the_arm_to_is_written_and_read_back(name: str) -> None:
    program = sessions.led_by_hand()
    verify(program, name, write_program(program, name, "led"))


def test_unknown_dialect_names_the_nearest() -> None:
    with pytest.raises(InputError, match="no dialect 'rapdi'; did you mean \"rapid\""):
        write_program(sessions.static(), "rapdi", "a")


def test_unknown_option_names_those_there_are() -> None:
    with pytest.raises(InputError, match=r"din66025\+rounding"):
        write_program(sessions.static(), "din66025+roundig", "a")


@pytest.mark.parametrize(("name", "joints"), [("linuxcnc", 7), ("krl", 5), ("rapid", 5)])
def test_joint_count_that_the_dialect_does_not_carry(name: str, joints: int) -> None:
    with pytest.raises(InputError, match=f"carries . to .*joints, comau-nj130 has {joints}"):
        write_program(sessions.static(joints), name, "a")


def test_a_new_dialect_is_a_folder(folder: Path) -> None:
    shutil.copytree(folder / "bnr", folder / "mine")
    toml = folder / "mine" / "dialect.toml"
    toml.write_text(toml.read_text().replace("Q", "J"))
    assert "mine" in {d.name for d in dialects()}
    program = sessions.continuous()
    files = write_program(program, "mine", "a")
    assert "J1=" in files[0].text
    assert "Q1=" not in files[0].text
    assert verify(program, "mine", files).joint_path_deg.shape[1] == 6


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("decimals = 4", "decimls = 4", "unknown key 'decimls'; did you mean \"decimals\""),
        ('kind = "mm"', 'kind = "miles"', "'blend.kind' = 'miles'"),
        ("max_line = 250", "max_line = 3", "'max_line' = 3"),
        ('title = "B&R', "title = B&R", "not valid TOML"),
        ('pause = ["M00"]\n', "", "the key 'pause' is missing"),
        ('main = "{name}.cnc"', 'main = "{nam}.cnc"', "a file is called {name} and an extension"),
        ('sync = "M100"', 'sync = "M100("', "no regular expression"),
    ],
)
def test_a_wrong_dialect_file_is_named(folder: Path, old: str, new: str, message: str) -> None:
    _change(folder / "bnr" / "dialect.toml", old, new)
    with pytest.raises(InputError, match=r"dialect\.toml") as error:
        write_program(sessions.static(), "bnr", "a")
    assert message in str(error.value)


def test_a_family_without_a_reader_is_named(folder: Path) -> None:
    _change(folder / "bnr" / "dialect.toml", 'family = "gcode"', 'family = "g-code"')
    with pytest.raises(InputError, match=r"'bnr': reading\.family = 'g-code' has no reader; did you mean \"gcode\""):
        write_program(sessions.static(), "bnr", "a")


def test_a_wrong_template_is_named(folder: Path) -> None:
    _change(folder / "bnr" / "program.j2", "m.speed_changed", "m.speed_chnged")
    with pytest.raises(InputError, match=r"program\.j2: .*speed_chnged"):
        write_program(sessions.static(), "bnr", "a")


def test_a_template_without_a_macro_is_named(folder: Path) -> None:
    _change(folder / "bnr" / "program.j2", "macro main(parts)", "macro mainly(parts)")
    with pytest.raises(InputError, match=r"program\.j2: .*main"):
        write_program(sessions.static(), "bnr", "a")


def test_a_line_too_long_for_the_controller(folder: Path) -> None:
    _change(folder / "bnr" / "dialect.toml", "max_line = 250", "max_line = 60")
    with pytest.raises(InputError, match="takes 60"):
        write_program(sessions.static(), "bnr", "a")


@pytest.mark.parametrize("name", ["bnr", "din66025"])
def test_no_log_no_map(name: str) -> None:
    with pytest.raises(InputError, match="keeps no log"):
        import_map(name, 6)


@pytest.mark.parametrize(
    ("name", "stem", "file"),
    [
        ("krl", "comau-nj130/edbb tour with a long name", "COMAU_NJ130_EDBB_TOUR_WI.src"),
        ("krl", "1st", "PR_1ST.src"),
        ("sinumerik", "q6", "PR_Q6.MPF"),
        ("pdl2", "program", "PR_program.pdl"),
        ("rapid", "", "PR_.mod"),
    ],
)
def test_names_that_the_controller_takes(name: str, stem: str, file: str) -> None:
    assert write_program(sessions.static(), name, stem)[0].name == file.replace("PR_.", "PR.")


def test_pulses_that_would_run_together_are_refused() -> None:
    program = sessions.dense(6, 150)
    both = list(program.instructions)
    marked = next(i for i, x in enumerate(both) if type(x).__name__ == "Sync")
    both.insert(marked + 3, both[marked])
    changed = dataclasses.replace(program, instructions=tuple(both))
    with pytest.raises(InputError, match="one after the other"):
        write_program(changed, "linuxcnc", "a")


def test_read_back_of_nothing() -> None:
    with pytest.raises(InputError):
        read_back("krl", [])


@pytest.mark.parametrize("name", dialect_names())
def test_a_long_remark_keeps_its_commas_where_a_line_ends(name: str) -> None:
    words = [f"word{k}" for k in range(60)]
    program = dataclasses.replace(sessions.static(), cautions=(", ".join(words) + " (the last)",))
    last = "," if "(" in load_dialect(name).comment.forbid else ""
    wanted = [(word, "," if word != words[-1] else last) for word in words]
    said = [re.findall(r"(word\d+)(,?)", text) for text in [f.text for f in write_program(program, name, "a")]]
    assert all(words == wanted for words in said if words)
    assert any(said)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a (b); c", "a, b, c"),
        ("the first; (second)", "the first, second"),
        ("a line, cut after its comma,", "a line, cut after its comma,"),
        ("()", ""),
    ],
)
def test_a_comma_stands_for_what_may_not_stand_in_a_comment(text: str, said: str) -> None:
    assert comment_text(text, CommentStyle(start="(", end=")", forbid="();")) == said
