"""What the system does for a process, and that files are exchanged as a whole in the manner of each system."""

import ctypes
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
import serial

from planner.centring.indicators import SerialIndicators
from planner.centring.live_session import LiveGauge
from planner.centring.settings import PROTOCOLS
from planner.common import exchange, system
from planner.common.errors import InputError
from planner.common.result_folder import MANIFEST, changed_files, draft_folder, move_all
from tests.test_planning_packages import EXAMPLES, edbb_without


def test_a_star_stands_for_files_on_windows_and_brackets_for_themselves(tmp_path, monkeypatch):
    for name in ("run[1].csv", "run1.csv", "run2.csv", "~home.csv"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path)
    words = ["identify", "run[1].csv", "r*[1].csv", "run?.csv", "no*.csv", "~home.csv", "$HOME", "100 %"]
    monkeypatch.setattr(sys, "platform", "linux")
    assert system.expand_stars(words) == words
    monkeypatch.setattr(sys, "platform", "win32")
    files = ["run[1].csv", "run[1].csv", "run1.csv", "run2.csv", "no*.csv", "~home.csv"]
    assert system.expand_stars(words) == ["identify", *files, "$HOME", "100 %"]


def test_what_is_read_only_is_removed_where_the_system_asks_for_that(tmp_path, monkeypatch):
    draft, remove_folder = tmp_path / "draft", exchange.shutil.rmtree
    (draft / "old").mkdir(parents=True)
    (draft / "old" / "robot.toml").touch(mode=0o400)

    def as_windows_does(folder):
        if [p for p in Path(folder).rglob("*") if not p.stat().st_mode & 0o200]:
            raise PermissionError(13, "Access denied")
        remove_folder(folder)

    monkeypatch.setattr(exchange.shutil, "rmtree", as_windows_does)
    exchange.remove(draft)
    assert not draft.exists()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do so by themselves, and tell otherwise")
def test_memory_that_is_free_between_what_lives_on_goes_back():
    program = (
        "from planner.common import system; import os; there = lambda: system.group_memory(os.getpgid(0))\n"
        "few = [bytearray(100_000) for _ in range(2000)]; full = there(); few = few[::50]; before = there()\n"
        "system.give_back_memory(); print(full - before, before - there())"
    )
    end = {"capture_output": True, "text": True, "start_new_session": True, "check": True}
    by_itself, given = map(int, subprocess.run([sys.executable, "-c", program], **end).stdout.split())
    assert by_itself + given > 150e6
    assert given > 100e6


def test_a_group_ends_with_all_that_it_has_started(tmp_path):
    child = "import time; time.sleep(60)"
    parent = (
        f"import subprocess, sys; p = subprocess.Popen([sys.executable, '-c', {child!r}]); "
        "open('pid', 'w').write(str(p.pid)); p.wait()"
    )
    group = system.start_in_own_group([sys.executable, "-c", parent], cwd=tmp_path)
    until = time.monotonic() + 120.0
    while not (tmp_path / "pid").is_file() or not (tmp_path / "pid").read_text():
        assert time.monotonic() < until
        time.sleep(0.02)
    system.kill_group(group)
    group.wait()
    pid = (tmp_path / "pid").read_text()
    stat = Path("/proc", pid, "stat")  # a killed one that nobody waits for may stay as Z
    while stat.read_text().rpartition(")")[2].split()[0] != "Z" if stat.exists() else psutil.pid_exists(int(pid)):
        assert time.monotonic() < until
        time.sleep(0.02)


def test_a_lock_holds_off_others(tmp_path):
    order = []

    def enter():
        with system.hold_lock(tmp_path / "lock"):
            order.append("second")

    other = threading.Thread(target=enter)
    with system.hold_lock(tmp_path / "lock"):
        other.start()
        other.join(0.2)
        order.append("first")
    other.join()
    assert order == ["first", "second"]


def _results(folder, text):
    """Write results of one kind into a folder as commands do."""
    with draft_folder(folder) as draft:
        (draft / "plan.json").write_text("{}", encoding="utf-8")
        (draft / text).write_text(text, encoding="utf-8")
        move_all(draft, folder)


@pytest.fixture
def like_windows(monkeypatch):
    """No exchange in one step, no choice about links, no C library of the process."""
    link = os.link

    def plain_link(source, target, follow_symlinks=True):
        if not follow_symlinks:
            raise NotImplementedError("link: follow_symlinks unavailable on this platform")
        link(source, target)

    def no_library(name, *_, **__):
        raise TypeError(f"no library {name}")

    monkeypatch.setattr(os, "link", plain_link)
    monkeypatch.setattr(ctypes, "CDLL", no_library)
    monkeypatch.setattr(exchange, "swap_folders", lambda a, b: False)


def test_results_are_exchanged_as_a_whole_where_no_folders_can_be_swapped(tmp_path, like_windows):
    out = tmp_path / "out"
    _results(out, "old.txt")
    (out / "mine.txt").write_text("of a person", encoding="utf-8")
    _results(out, "new.txt")
    assert {p.name for p in out.iterdir()} == {"plan.json", "new.txt", "mine.txt", MANIFEST}
    assert changed_files(out, "plan.json") == []
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_what_was_there_stays_where_the_new_folder_cannot_take_its_place(tmp_path, like_windows, monkeypatch):
    out, rename = tmp_path / "out", os.rename
    _results(out, "old.txt")

    def refuse_the_draft(a, b):
        if Path(b) == out and Path(a).name != "old":
            raise PermissionError(13, "the folder is open in another program", str(b))
        rename(a, b)

    monkeypatch.setattr(os, "rename", refuse_the_draft)
    with pytest.raises(InputError, match="the folder is open in another program"):
        _results(out, "new.txt")
    assert {p.name for p in out.iterdir()} == {"plan.json", "old.txt", MANIFEST}
    assert changed_files(out, "plan.json") == []


PLAIN = {**os.environ, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C", "OMP_NUM_THREADS": "1"}
"""Without UTF-8 anywhere but where a file is told to be in it: stricter than a Western Windows, whose µ is a byte."""


@pytest.mark.long
def test_a_run_is_identified_where_nothing_is_utf_8_by_itself(tmp_path):
    words = ["identify", EXAMPLES / "measured_run.csv", "--cell", EXAMPLES / "measured_run.toml", "-o", "out", "--json"]
    done = edbb_without(*words, cwd=tmp_path, env=PLAIN, flags=("-X", "warn_default_encoding"), text=False)
    assert done.returncode == 0, done.stderr
    assert b"EncodingWarning" not in done.stderr or b"planner" not in done.stderr.split(b"EncodingWarning")[0][-300:]
    assert "±" in (tmp_path / "out" / "report.html").read_bytes().decode("utf-8")
    assert done.stdout.decode("utf-8").startswith("{")


@pytest.mark.skipif(sys.flags.ignore_environment, reason="this Python asks no variable how its streams are encoded")
def test_letters_that_a_console_does_not_have_are_spelt_plainly():
    text = ascii("σ of 5 µm → ≤ 3 … 漢")
    script = f"from planner.common.console import encode_output; encode_output(); print({text})"
    for name, said in (("ascii", "sigma of 5 um -> <= 3 ... ?"), ("cp1252", "sigma of 5 µm -> <= 3 … ?")):
        env = {**PLAIN, "PYTHONIOENCODING": name}
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, env=env, check=True)
        assert done.stdout.decode(name).strip() == said


@pytest.mark.slow
def test_what_goes_into_a_pipe_is_utf_8(tmp_path):
    """Messages too, whatever letters the system has by itself."""
    done = edbb_without("check", "run.csv", cwd=tmp_path, env=PLAIN, text=False)
    assert done.returncode == 2
    assert "─ Error ─" in done.stderr.decode("utf-8")


def test_line_ends_of_results_are_those_that_were_written(tmp_path):
    """A program for a controller that wants CR LF has them once, whatever the system adds to text."""
    script = (
        "import sys; from planner.common.quiet import results_alone\n"
        "with results_alone(): sys.stdout.write('a\\r\\nb\\n')"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    assert done.stdout == b"a\r\nb\n"


@pytest.mark.parametrize("name", ["COM5", "COM12", "/dev/ttyUSB0", "/dev/cu.usbserial-1"])
def test_a_serial_port_is_opened_under_the_name_that_its_system_gives_it(name, monkeypatch):
    opened = []
    monkeypatch.setattr(serial, "serial_for_url", lambda port, *_, **__: opened.append(port))
    LiveGauge(name, 9600)
    SerialIndicators([name], PROTOCOLS["sylvac"], None, None)
    assert opened == [name, name]


GLIBC = sys.platform == "linux" and hasattr(ctypes.CDLL(None), "mallopt")
FAULTS = """
import resource, sys
import numpy as np
from planner.common.system import keep_freed_memory
if sys.argv[1:]:
    keep_freed_memory()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    many = [np.ones(250_000) for _ in range(40)]  # 2 MB each
    del many
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not GLIBC, reason="elsewhere the system's own ways stand")
def test_large_arrays_take_the_place_of_those_that_were_freed():
    """The system has to clear far fewer pages for them."""

    def faults(*options):
        """Pages that the system had to bring for twenty times forty arrays of 2 MB."""
        return int(subprocess.check_output([sys.executable, "-c", FAULTS, *options], text=True))

    assert faults("kept") < 0.2 * faults()
