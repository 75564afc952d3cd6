"""Formats that are no controller's language: read by foreign readers, and edits that are found."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

import tests.programs.sessions as sessions
from planner.programs.instructions import Dwell, Program
from planner.programs.rendering import ProgramFile
from planner.programs.verification import ProgramMismatchError
from tests.programs.reading import verify, write_program

NAMED = replace(sessions.static(), joint_names=("pan", "lift", "elbow", "flex", "roll", "wrist"))
PLANNED = np.array([m.q_deg for m in NAMED.moves])


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def test_the_trajectory_is_a_message_of_ros() -> None:
    files = write_program(NAMED, "ros2-trajectory", "s")
    assert [f.name for f in files] == ["s_001.yaml", "s_002.yaml", "s_003.yaml"]  # a person acts between them
    found = []
    for file in files:
        message = yaml.safe_load(file.text)
        assert set(message) == {"joint_names", "points"}
        assert message["joint_names"] == list(NAMED.joint_names)
        times = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in message["points"]]
        assert times[0] > 0.0
        assert min(np.diff(times), default=1.0) > 0.0
        found += [p["positions"] for p in message["points"] if "accelerations" not in p]
    np.testing.assert_allclose(np.rad2deg(found), PLANNED, atol=1e-4)


def test_the_cubic_between_two_points_at_rest_is_no_faster_than_planned() -> None:
    """Peak of the Hermite cubic with no speed at its ends, which a trajectory controller drives."""
    file = write_program(NAMED, "ros2-trajectory", "s")[1]
    points = [p for p in yaml.safe_load(file.text)["points"] if "accelerations" not in p]
    first, second = (p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points[:2])
    dwells = sum(i.seconds for i in NAMED.instructions if isinstance(i, Dwell)) / 4
    s = np.linspace(0.0, 1.0, 1001)
    peak = np.diff(3 * s**2 - 2 * s**3).max() / (s[1] * (second - first - dwells))
    assert peak <= 1.0 / 7.3 * 1.0001


def test_frames_of_lerobot_have_its_keys_and_an_even_rate() -> None:
    rows = [r for f in write_program(NAMED, "lerobot", "s") for r in _rows(f.text)]
    keys = [f"{n}.pos" for n in NAMED.joint_names]
    assert list(rows[0]) == ["timestamp", *keys, "event"]
    ends = np.array([[float(r[k]) for k in keys] for r in rows if r["event"] == "move"])
    np.testing.assert_allclose(ends, PLANNED, atol=6e-4)
    q = np.array([[float(r[k]) for k in keys] for r in rows])
    allowed = 30.0 / 7.3 * np.abs(np.diff(PLANNED, axis=0)).max() / 30.0 / 30.0 * 7.3 / 4.0
    assert np.abs(np.diff(q[1:], axis=0)).max() <= allowed * 1.01


@pytest.mark.parametrize("name", ["poses-csv", "poses-json"])
def test_a_list_is_read_by_anybody(name: str) -> None:
    (file,) = write_program(NAMED, name, "s")
    if name == "poses-csv":
        moves = [r for r in _rows(file.text) if r["kind"] == "move"]
        q = [[float(r[f"q{i}_deg"]) for i in range(1, 7)] for r in moves]
        said = [r["text"] for r in _rows(file.text) if r["kind"] == "pause"]
    else:
        steps = json.loads(file.text)["steps"]
        q = [s["q_deg"] for s in steps if s["kind"] == "move"]
        said = [s["text"] for s in steps if s["kind"] == "pause"]
    np.testing.assert_allclose(q, PLANNED, atol=1e-4)
    assert [text.split()[0] for text in said] == ["attach", "take"]


EDITS = [
    ("poses-csv", r"-60\.0000", "-60.0010", "off by 0.0010"),
    ("poses-csv", r"^move.*-60\.0000.*\n", "", "planned are"),
    ("poses-csv", r"^(?=move.*-60\.0000)", "grip,,,,,,,,,,,\n", "does not know"),
    ("poses-csv", r"^(?=move.*-60\.0000)", "pause,,1,1,1,1,1,1,,,,\n", "does not know"),
    ("poses-csv", r"q1_deg,q2_deg", "q2_deg,q1_deg", "do not follow"),
    ("poses-json", r"-60\.0000", "-60.0010", "off by 0.0010"),
    ("poses-json", r'^\{"kind": "move".*-60\.0000.*\n', "", "planned are"),
    ("poses-json", r'"kind": "dwell"', '"kind": "run"', "does not know"),
    ("poses-json", r'"q_deg": \[40', '"q_deg": [1], "q_deg": [40', "stands twice"),
    ("ros2-trajectory", r"-1\.0471976", "-1.0472976", "off by 0.00"),
    ("ros2-trajectory", "pan, lift", "lift, pan", "name the joints"),
    ("ros2-trajectory", "points:", "points:\n- {}", "does not know"),
    ("ros2-trajectory", r"sec: 36", "sec: 31", "of the planned speed"),
    ("lerobot", r"-60\.000,0\.000,45\.000,1\.000,move", "-60.010,0.000,45.000,1.000,move", "straight line"),
    ("lerobot", "pan.pos,lift.pos", "lift.pos,pan.pos", "have the columns"),
    ("lerobot", r"^0\.2000,.*\n", "", "is at"),
    ("lerobot", r"^(0\.2000),-?[\d.]+", r"\1,90.000", "straight line"),
    ("fanuc-tp", r"J3 = -60\.000", "J3 = -60.010", "off by 0.01"),
    ("fanuc-tp", r"^.*J P\[2\].*\r?\n", "", "planned are"),
    ("fanuc-tp", r"^(?=.*J P\[2\])", "  20:  QUUX 5 ;\n", "does not know"),
    ("fanuc-tp", r"J P\[2\]", "L P[2]", "no joint move"),
    ("fanuc-tp", r"P\[2\]\{", "P[1]{", "there twice"),
    ("fanuc-tp", r"4\.5sec", "2.5sec", "of the planned speed"),
    ("fanuc-tp", r"4\.5sec", "100%", "no joint move"),
]


@pytest.mark.parametrize(("name", "old", "new", "because"), EDITS)
def test_an_edit_is_found(name: str, old: str, new: str, because: str) -> None:
    first, *rest = write_program(NAMED, name, "s")
    text, changes = re.subn(old, new, first.text, count=1, flags=re.MULTILINE)
    assert changes
    with pytest.raises(ProgramMismatchError, match=because):
        verify(NAMED, name, (ProgramFile(first.name, text), *rest))


@pytest.mark.parametrize("name", ["ros2-trajectory", "lerobot", "poses-csv", "poses-json", "fanuc-tp"])
def test_a_file_that_is_missing_or_other_dwells(name: str) -> None:
    files = write_program(NAMED, name, "s")
    if len(files) > 1:
        with pytest.raises(ProgramMismatchError, match="planned are"):
            verify(NAMED, name, files[:-1])
    still: Program = replace(NAMED, instructions=tuple(i for i in NAMED.instructions if not isinstance(i, Dwell)))
    with pytest.raises(ProgramMismatchError, match="dwells"):
        verify(still, name, files)
