"""What is wrong in a file is told in the words of the person who wrote it, never in a library's."""

import unicodedata

import pytest
from pydantic import Field

from planner.cell.file import CellFile
from planner.common.errors import MOST_SIGNS, InputError, make_printable
from planner.common.schema import StrictModel, read_json, read_toml_again, read_toml_content, validate
from planner.runs.column_map import ColumnMap
from planner.workflow.run_checks import cell_of_run

CELL = {"schema": "edbb-cell/1", "robot": "ur10", "gauge": {"kind": "trical"}}
MAP = {"schema": "edbb-map/1", "columns": {"t_s": 1}}
BOX = {"kind": "box", "at_mm": [0, 0, 0], "size_mm": [1, 1, 1]}
LIBRARY = ("instance of", "tuple", "dictionary", "nput should", "validation", "type=", "function-", ".0", ".1")


class Part(StrictModel):
    """A part of the small file below."""

    rivals: tuple[str, ...]
    weight: float = 1.0


class Small(StrictModel):
    """A small file."""

    schema_: str = Field(default="edbb-small/1", alias="schema")
    parts: tuple[Part, ...] = Field(min_length=1)
    grid: tuple[tuple[int, ...], ...] = ()
    on: bool = False


def test_a_file_that_was_changed_is_read_again(tmp_path):
    path = tmp_path / "small.toml"
    for text in ("on = true", "on = false", "on = true"):
        path.write_text(f"{text}\n[[parts]]\nrivals = []\n")
        assert read_toml_again(path, Small).on == (text == "on = true")
        assert read_toml_again(path, Small) is read_toml_again(path, Small)
    path.write_text("[[parts]]\n")
    for _ in range(2):
        with pytest.raises(InputError, match=r"small\.toml: .*'rivals' is missing"):
            read_toml_again(path, Small)
    path.unlink()
    with pytest.raises(InputError, match=r"small\.toml"):
        read_toml_again(path, Small)


CASES = {
    "a table's missing key": (
        CellFile,
        CELL | {"balls": [{"position_mm": [0, 0, 0]}]},
        "[[balls]] number 1: the key 'name' is missing",
    ),
    "the second table": (
        CellFile,
        CELL | {"obstacles": [BOX, BOX | {"kind": "bx"}]},
        "[[obstacles]] number 2: 'kind' = 'bx': must be 'capsule', 'sphere', 'box' or 'mesh'",
    ),
    "a number in a table": (
        CellFile,
        CELL | {"balls": [{"name": "1", "position_mm": [0, 0, "x"]}]},
        "[[balls]] number 1: 'position_mm' number 3 = 'x': a number is needed",
    ),
    "a number too few": (
        CellFile,
        CELL | {"balls": [{"name": "1", "position_mm": [0, 0]}]},
        "[[balls]] number 1: 'position_mm' number 3 is missing",
    ),
    "a table in a table": (CellFile, CELL | {"gauge": 3}, "'gauge' = 3: a table is needed"),
    "a whole table": (
        ColumnMap,
        MAP | {"traces": [{"skip_rows": 1}]},
        "[[traces]] number 1: either [columns] or a pattern is needed, and not both",
    ),
    "no table": (ColumnMap, MAP | {"traces": [3]}, "'traces' number 1 = 3: a table is needed"),
    "alternatives, all wrong": (
        ColumnMap,
        MAP | {"columns": {"t_s": [3]}},
        "'columns.t_s' = [3]: a whole number or a text in quotation marks or a table is needed",
    ),
    "alternatives, one meant": (
        ColumnMap,
        MAP | {"columns": {"t_s": {"column": 3, "factor": 0}}},
        "'columns.t_s': a factor of 0 leaves nothing of the column",
    ),
    "a key of an alternative": (
        ColumnMap,
        MAP | {"columns": {"t_s": {"column": 1, "facto": 3}}},
        "unknown key 'columns.t_s.facto'; did you mean \"factor\"? (allowed here: clock, column, date, factor, "
        "nanoseconds, offset)",
    ),
    "a file of another kind": (
        CellFile,
        {"schema": "edbb-map/1", "columns": {}},
        "'schema' = 'edbb-map/1': must be 'edbb-cell/1'; the file is of the kind 'map', and one of the kind 'cell' is "
        "needed here",
    ),
    "a file of another version": (
        CellFile,
        {"schema": "edbb-cell/0"},
        "'schema' = 'edbb-cell/0': must be 'edbb-cell/1'; another version of the planner has written it: make it anew "
        "with this one",
    ),
    "no schema": (CellFile, {"columns": {}}, "the key 'schema' is missing ('edbb-cell/1' is expected)"),
    "no list": (Small, {"parts": [{"rivals": 5}]}, "[[parts]] number 1: 'rivals' = 5: a list is needed"),
    "an empty list": (Small, {"parts": []}, "'parts' = []: at least 1 entry is needed"),
    "no switch": (
        Small,
        {"parts": [{"rivals": []}], "on": "perhaps"},
        "'on' = 'perhaps': a switch (true or false) is needed",
    ),
    "a list in a list": (
        Small,
        {"parts": [{"rivals": []}], "grid": [[1], [2, "x"]]},
        "'grid' number 2, number 2 = 'x': a whole number is needed",
    ),
    "not finite": (
        Small,
        {"parts": [{"rivals": [], "weight": float("nan")}]},
        "[[parts]] number 1: 'weight' = nan: a finite number is needed",
    ),
}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_one_sentence_in_plain_words(case):
    model, data, message = CASES[case]
    with pytest.raises(InputError) as caught:
        validate(data, model, "c.toml")
    assert str(caught.value) == f"c.toml: {message}"
    assert not [w for w in LIBRARY if w in message]


def test_in_json_an_object_is_an_object():
    for data, message in (
        ([1, 2], "i.json: [1, 2]: an object { … } is needed"),
        ({"parts": [3]}, "i.json: 'parts' number 1 = 3: an object { … } is needed"),
        ({"parts": [{"rivals": {}}]}, "i.json: 'parts' number 1: 'rivals' = an object: a list is needed"),
    ):
        with pytest.raises(InputError) as caught:
            validate(data, Small, "i.json")
        assert str(caught.value) == message


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"parts": [{"rivals": [], "weight": True}]}, "[[parts]] number 1: 'weight'"),
        ({"parts": [{"rivals": []}], "grid": [[1, 2], [3, False]]}, "'grid' number 2, number 2"),
    ],
)
def test_a_switch_is_no_number(data, key):
    with pytest.raises(InputError) as caught:
        validate(data | {"on": True}, Small, "c.toml")
    assert str(caught.value) == f"c.toml: {key} is a switch (true or false): a number is needed"


@pytest.mark.parametrize(("read", "text"), [(read_toml_content, "a = {}"), (read_json, '{{"a": {}}}')])
def test_a_byte_order_mark_is_passed_over_and_a_number_of_thousands_of_digits_told(tmp_path, read, text):
    (tmp_path / "f").write_text("\ufeff" + text.format(1), encoding="utf-8")
    assert read(tmp_path / "f") == {"a": 1}
    (tmp_path / "f").write_text(text.format("9" * 5000))
    with pytest.raises(InputError, match="it holds a whole number of thousands of digits"):
        read(tmp_path / "f")


def test_what_is_right_is_read():
    assert validate({"parts": [{"rivals": ["a"]}]}, Small, "c.toml").parts[0].rivals == ("a",)


def test_a_long_message_loses_whole_lines_and_says_how_many():
    lines = [f"a.src:{k}: " + "word " * 40 for k in range(30)]
    said = make_printable("\n".join([*lines, "add --strict"])).split("\n")
    assert sum(map(len, said)) <= MOST_SIGNS
    assert said[-1] == "add --strict"
    shown = len(said) - 2
    assert said[:shown] == lines[:shown]
    assert said[-2] == f"… {30 - shown} lines left out …"
    assert shown > 8
    assert len(make_printable("x y " * 5000)) <= MOST_SIGNS


@pytest.mark.parametrize("text", ["\x1b[2Jcleared", "\u202ereversed", "a" * 100_000, "\x07\x9b31m", "x\ry"])
def test_no_message_steers_the_terminal_or_echoes_a_long_run(text):
    said = str(InputError(f"file.toml: found '{text}'"))
    assert len(said) <= 400
    assert not [c for c in said if unicodedata.category(c) in ("Cc", "Cf")]


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("plan.json", "", "the file is empty"),
        ("plan.json", '{"schema": "edbb-plan/1", "poses": [{"id": 1', "its end is missing: copy it again"),
        ("cell.toml", 'schema = "edbb-cell/1"', "a .json file is needed here, and 'cell.toml' is called like a cell"),
        ("run.csv", "q1_deg,length_mm", "a .json file is needed here, and 'run.csv' is called like a run"),
    ],
)
def test_what_stands_in_the_place_of_a_plan_is_said(name, text, words, tmp_path):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="is not valid JSON: ") as caught:
        read_json(tmp_path / name)
    assert words in str(caught.value)


def test_a_folder_in_the_place_of_a_file_names_what_it_holds(tmp_path):
    (tmp_path / "plan.json").write_text("{}")
    with pytest.raises(InputError) as caught:
        read_json(tmp_path)
    assert str(caught.value).endswith(f"(it is a folder, and a file is needed); it holds {tmp_path / 'plan.json'}")
    with pytest.raises(InputError, match="it holds"):
        cell_of_run(None, tmp_path)
