"""``edbb centre`` as a person runs it."""

import json
import signal
import subprocess
import sys
import time

import pytest
from typer.testing import CliRunner

from planner.cli.app import app
from planner.common.errors import InputError
from planner.runs.loader import load_run
from tests.centring.test_session import angles, rows_of

QUICK = """
schema = "edbb-centring/1"
[rest]
settle_s = 0.0
[robot]
poll_s = 0.002
"""


def words(made, folder, *more):
    (folder / "quick.toml").write_text(QUICK)
    where = ["--robot", made.controller.address, "--indicators", ",".join(made.ports), "-o", made.output]
    return [str(w) for w in ("centre", made.plan, *where, "--settings", folder / "quick.toml", *more)]


def started(command):
    command = [sys.executable, "-m", "planner.cli", *command]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def invoked(*command):
    return CliRunner().invoke(app, [str(w) for w in command], catch_exceptions=False)


@pytest.mark.slow
def test_a_session_with_ctrl_c_in_between(cell, tmp_path):
    made = cell(count=4, tilt=2.0, faults={"slow": 0.05})
    first = started(words(made, tmp_path, "--stop-file", tmp_path / "stop"))
    while not made.output.exists():
        time.sleep(0.01)
        assert first.poll() is None, first.stderr.read()
    first.send_signal(signal.SIGINT)
    _, said = first.communicate(timeout=120)
    assert first.returncode == 3
    assert "stopped by Ctrl-C" in said
    assert "Traceback" not in said
    kept = rows_of(made.output)["pose"].to_list()
    assert 1 <= len(kept) < 4
    assert made.controller.values["EDBB_STOP"] is True

    made.revive()
    done = invoked(*words(made, tmp_path, "--json"))
    assert done.exit_code == 0
    assert json.loads(done.stdout)["measured"] == 4
    run = load_run(made.output, 6)
    assert run.samples.pose.tolist() == [1, 3, 5, 7]
    assert max(made.world.miss(q) for q in angles(rows_of(made.output))) < 0.0055


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--robot", "192.168.1.10"], "an address is tcp://HOST"),
        (["--robot", "tcp://127.0.0.1:99999"], "an address is tcp://HOST"),
        (["--settings", "/nothing.toml"], "cannot be read"),
        (["-o", "run.parquet"], r"writes a \.csv"),
    ],
)
def test_bad_input(cell, tmp_path, more, says):
    made = cell(count=1)
    with pytest.raises(InputError, match=says):
        invoked(*words(made, tmp_path, *more))
    assert not made.output.exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[head]\nprotocl = 'sylvac'", "unknown key 'head.protocl'; did you mean \"protocol\""),
        ("[head]\nmatrix = [[1, 0, 0], [1, 0, 0], [0, 0, 1]]", "do not span space"),
        ("[head]\ntool_frame = 'flange'", "'gauge.head.indicators' is missing"),
        ("[head]\nprotocol = 'mitutojo'", 'no indicator protocol .* did you mean "mitutoyo"'),
        (
            '[head]\nprotocol = "x\\ny"',
            r"'head.protocol' = 'x.ny': no indicator protocol .*there are: mitutoyo, sylvac",
        ),
        ("[head]\nusable_mm = 1e6", "'head.usable_mm' = 1000000.0: must be less than or equal to 25"),
        ("[moves]\ntolerance_um = -1", "'moves.tolerance_um' = -1"),
        ("[moves]\ntolerance_um = 1e6", "'moves.tolerance_um' = 1000000.0: must be less than or equal to 500"),
        ("[robot]\ntool = true", "'robot.tool' is a switch .true or false.: a number is needed"),
    ],
)
def test_bad_settings(cell, tmp_path, text, says):
    made = cell(count=1)
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(InputError, match=says):
        invoked(*words(made, tmp_path, "--settings", tmp_path / "bad.toml"))


def test_a_session_needs_robot_and_indicators(cell):
    with pytest.raises(InputError, match="needs --robot and --indicators"):
        invoked("centre", cell(count=1).plan)


def test_a_stop_file_that_is_there_already(cell, tmp_path):
    (tmp_path / "stop").touch()
    with pytest.raises(InputError, match="is there already"):
        invoked(*words(cell(count=1), tmp_path, "--stop-file", tmp_path / "stop"))


def test_the_robots_program_is_written_with_the_cells_numbers(cell, tmp_path):
    made = cell(count=1)
    (tmp_path / "cell.toml").write_text('robot = "x"\n[controller]\ntool = 4\nbase = 2\n')
    assert invoked("centre", made.plan, "--program-to", tmp_path / "out").exit_code == 0
    src = (tmp_path / "out" / "EDBB_CENTRE.src").read_bytes()
    assert b"BAS (#TOOL,4 )\r\nBAS (#BASE,2 )\r\n" in src
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["EDBB_CENTRE.dat", "EDBB_CENTRE.src"]
