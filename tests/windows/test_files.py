"""Files and folders as Windows has them: held open elsewhere, named otherwise, and two that write at once."""

import hashlib
import shutil
import signal
import subprocess
import time

import pytest

from planner.common.result_folder import changed_files
from tests.windows.wine import PATIENCE_S

pytestmark = pytest.mark.long
STOP_AFTER_S = 15
HOLD = "import sys; f = open(sys.argv[1], 'rb'); print('open', flush=True); sys.stdin.read(1)"
"""Another program that reads a file: while it does, Windows lets nobody replace the file."""
NTFS = """
import os, sys
held = os.path.abspath(sys.argv.pop(1))
def refusing(change):
    def call(a, b, **how):
        if os.path.isdir(a) and held.lower().startswith(os.path.abspath(a).lower() + os.sep):
            raise PermissionError(13, 'Access is denied', a, 5, b)
        return change(a, b, **how)
    return call
os.rename, os.replace = refusing(os.rename), refusing(os.replace)
sys.argv[0] = 'edbb'
from planner.cli.app import main
sys.exit(main())
"""
"""The program on a disk that moves no folder in which a file is open, as NTFS; Wine's moves it."""
LOG_MAP = ("--map", "map.toml")
EXPORT = ("export", "mine/plan.json", "--dialect", "krl", "-o", "p.src", "--force")
CHECK = ("check", "run.csv", "--plan", "mine/plan.json", "--model", "calibrated")
WITHDRAWAL = ("record", "RECORD", "--withdraw", "1", "--reason", "a trial", "-o", "history")
SINGLE = {
    "simulate": ("run.csv", "simulate", "mine/plan.json", "--seed", "5", "-o", "run.csv", "--force"),
    "export": ("p.src", *EXPORT),
    "export, its data": ("p.dat", *EXPORT),
    "compensate": (
        "work_corrected.src", "compensate", "work.src", "--model", "calibrated/robot.toml", "-o", "work_corrected.src",
        "--force",
    ),
    "import": ("imported.csv", "import", "axes.log", "gauge.log", *LOG_MAP, "-o", "imported.csv", "--force"),
    "identify": (
        "calibrated/robot.toml", "identify", "run.csv", "--cell", "mine/cell.toml", "--plan", "mine/plan.json",
        "--geometry", "-o", "calibrated",
    ),
    "check": ("checked/check.json", *CHECK, "--limit-mm", "0.5", "-o", "checked"),
    "record": ("history/report.html", *WITHDRAWAL),
    "record, its manifest": ("history/manifest.json", *WITHDRAWAL),
    "circular": ("circular/report.html", "circular", "ring2.csv", "--plan", "ring/plan.json", "-o", "circular"),
    "loaded": ("loaded/loaded.json", "loaded", "loaded2.csv", "--cell", "abb-irb6700/ldbb", "-o", "loaded"),
    "accuracy": ("accuracy/errors.csv", "accuracy", "v2.csv", "--cell", "kuka-kr6-r700/tracker", "-o", "accuracy"),
    "fleet": ("fleet.toml", "fleet", "calibrated", "second", "-o", "fleet.toml", "--force"),
    "centre": ("balls.csv", "centre", "trical/plan.json", "--simulate", "-o", "balls.csv"),
    "centre, its program": (
        "centring/EDBB_CENTRE.dat", "centre", "trical/plan.json", "--program-to", "centring", "--force",
    ),
}  # fmt: skip
"""A file that is held, and a command that would write something else there."""
DEVICES = ("aux.csv", "NUL", "con.csv", "com1.csv", "LPT9.csv", "ende.", "ende ", "sub/prn.csv", "a:b.csv")
LOST = {
    "aux.csv": ("simulate", "mine/plan.json", "-o"),
    "NUL.src": ("export", "mine/plan.json", "--dialect", "krl", "-o"),
    "Con": (*CHECK, "-o"),
    "prn.toml": ("fleet", "calibrated", "second", "-o"),
}
"""Names that Windows takes for a device, and commands whose result would be lost there."""


@pytest.fixture
def folder(wine, walked, judged):
    """A copy of the folder in which all was done, some files of it as of yesterday."""
    copy = wine.home / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    for made in (walked[0], judged):
        shutil.copytree(made, copy, dirs_exist_ok=True)
    for name in ("p.src", "p.dat", "work_corrected.src", "centring/EDBB_CENTRE.dat"):
        (copy / name).write_text("; edbb: of yesterday\n" + (copy / name).read_text())
    return copy


def contents(folder):
    """Every file with the hash of its bytes."""
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()
    }


@pytest.mark.parametrize("verb", SINGLE)
def test_a_file_that_is_held_is_named_and_all_stays_as_it_was(wine, folder, verb):
    held, *words = SINGLE[verb]
    before = contents(folder)
    holder = wine.start(wine.python, "-c", HOLD, folder / held, stdin=subprocess.PIPE)
    try:
        assert b"open" in holder.stdout.readline()
        code, said = wine.run(wine.python, "-c", NTFS, folder / held, *words, cwd=folder, timeout=600)
        assert code == 2, said
        assert held.rpartition("/")[2] in said.replace("\n", "")
        assert "Traceback" not in said
        if words[0] == "record":  # the entry is withdrawn; what shows it is named
            before |= {name: made for name, made in contents(folder).items() if name.startswith("RECORD")}
            words = ("record", "RECORD", "-o", "history")
            assert " ".join(words) in " ".join(said.split())
        assert contents(folder) == before
    finally:
        holder.communicate(b"\n", timeout=60)
    wine.edbb(*words, cwd=folder, timeout=600)
    assert verb == "import" or contents(folder) != before  # what is imported is the same again


def test_a_file_that_is_held_and_would_be_the_same_is_no_obstacle(wine, folder):
    before, held = contents(folder), folder / "history" / "report.html"
    holder = wine.start(wine.python, "-c", HOLD, held, stdin=subprocess.PIPE)
    try:
        assert b"open" in holder.stdout.readline()
        code, said = wine.run(wine.python, "-c", NTFS, held, "record", "RECORD", "-o", "history", cwd=folder)
        assert code == 0, said
        assert contents(folder) == before
    finally:
        holder.communicate(b"\n", timeout=60)


def test_names_of_devices_and_names_that_windows_changes_are_refused(wine, folder):
    before = contents(folder)
    for name in DEVICES:
        said = wine.edbb("import", "axes.log", "gauge.log", *LOG_MAP, "-o", name, cwd=folder, code=2)
        assert name.strip(" /").rpartition("/")[2] in said
    assert contents(folder) == before


@pytest.mark.parametrize("name", LOST)
def test_no_result_is_written_to_a_device(wine, folder, name):
    before = contents(folder)
    assert name in wine.edbb(*LOST[name], name, cwd=folder, code=2)
    assert contents(folder) == before


def test_line_ends_marks_and_letters_of_windows_are_read(wine, folder):
    """CR LF and the mark before UTF-8 in a run, a cell and a map; names in other cases; umlauts in a file's name."""
    for name in ("run.csv", "mine/cell.toml", "map.toml"):
        path = folder / name
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\r\n", b"\n").replace(b"\n", b"\r\n"))
    wine.edbb("import", "AXES.LOG", "Gauge.log", "--map", "MAP.toml", "-o", "Prüfung.csv", cwd=folder)
    assert (folder / "Prüfung.csv").read_bytes() == (folder / "imported.csv").read_bytes()
    words = (
        "identify",
        "Run.CSV",
        "--cell",
        "MINE/Cell.toml",
        "--plan",
        "mine/plan.json",
        "--geometry",
        "-o",
        "größer",
    )
    wine.edbb(*words, cwd=folder, timeout=600)
    assert (folder / "größer" / "report.html").is_file()


def test_a_bracket_in_a_name_stands_for_itself_and_a_star_for_files(wine, folder):
    """Browsers call their second ``axes.log`` so; the shell of Windows leaves both to the program."""
    shutil.copy(folder / "axes.log", folder / "axes[1].log")
    (folder / "axes1.log").write_text("other\n")
    wine.edbb("import", "axes[1].log", "gaug*.log", *LOG_MAP, "-o", "second.csv", cwd=folder)
    assert (folder / "second.csv").read_bytes() == (folder / "imported.csv").read_bytes()


def test_a_folder_that_may_not_be_written_is_refused_at_once(wine, folder):
    """Names for a draft are not tried for ever, as Python does it there."""
    drive = wine.prefix / "dosdevices" / "y:"
    drive.unlink(missing_ok=True)
    drive.symlink_to("/sys/kernel")  # not even root makes files there
    said = wine.edbb("import", "axes.log", "gauge.log", *LOG_MAP, "-o", "Y:\\run.csv", cwd=folder, code=2)
    assert "may not be written" in said
    code = (
        "import sys, pathlib; from planner.common.files import write_text\n"
        "try: write_text(pathlib.Path(sys.argv[1]), '1')\n"
        "except Exception as err: print(type(err).__name__)"
    )
    assert wine.run(wine.python, "-c", code, "Y:\\run.csv")[1].strip() == "InputError"


@pytest.mark.parametrize("console", ["cp1252", "cp437"])
def test_a_console_of_windows_shows_its_own_letters(wine, folder, console):
    """What a person sees is in the letters of the console, and the others are spelt plainly."""
    code = (
        "import os, sys\n"
        "for s in (sys.stdout, sys.stderr): s.reconfigure(encoding=sys.argv[1])\n"
        "os.isatty = lambda n: True\n"  # a pipe here: a screen there
        "del sys.argv[1]; sys.argv[0] = 'edbb'\n"
        "from planner.cli.app import main; sys.exit(main())"
    )
    words = ("import", "axes.log", "gauge.log", *LOG_MAP, "-o", "Prüfung.csv")
    process = wine.start(wine.python, "-c", code, console, *words, cwd=folder)
    said = process.communicate(timeout=300)[0]
    assert process.returncode == 0, said
    assert "Prüfung.csv".encode(console) in said
    assert "Prüfung.csv".encode() not in said


def test_a_share_of_another_computer_is_read_and_written(wine, folder, tmp_path):
    """A run, and a folder of results beside it, on a drive that has no letter."""
    shares, at = wine.prefix / "dosdevices" / "unc" / "office", "\\\\office\\cell\\"
    shares.mkdir(parents=True, exist_ok=True)
    (shares / "cell").unlink(missing_ok=True)
    (shares / "cell").symlink_to(shutil.copytree(folder, tmp_path / "cell"))
    words = ("--map", at + "map.toml", "-o", at + "new.csv")
    wine.edbb("import", at + "axes.log", at + "gauge.log", *words)
    assert (tmp_path / "cell" / "new.csv").read_bytes() == (folder / "imported.csv").read_bytes()
    words = ("--plan", at + "mine/plan.json", "--model", at + "calibrated", "-o", at + "new")
    wine.edbb("check", at + "run.csv", *words, timeout=600)
    assert changed_files(tmp_path / "cell" / "new", "check.json") == []
    wine.edbb("import", "axes.log", "gauge.log", *LOG_MAP, "-o", at + "aux.csv", cwd=folder, code=2)


def test_a_name_in_the_long_form_is_written_to(wine, folder):
    name = "\\\\?\\" + wine.windows(folder / "network.csv")
    wine.edbb("import", "axes.log", "gauge.log", *LOG_MAP, "-o", name, cwd=folder)
    assert (folder / "network.csv").read_bytes() == (folder / "imported.csv").read_bytes()


def test_a_long_path_is_written_to_or_refused_in_a_sentence(wine, folder):
    """Wine 8 does not name a folder so far down."""
    deep = folder.joinpath(*["a folder with a long name of forty letters"] * 6)
    deep.mkdir(parents=True)
    assert len(wine.windows(deep)) > 260
    words = ("import", "axes.log", "gauge.log", *LOG_MAP, "-o", deep / "out.csv")
    code, said = wine.run(wine.program / "edbb.exe", *words, cwd=folder)
    assert "Traceback" not in said
    if code:
        assert (code, "cannot be used" in said, list(deep.iterdir())) == (2, True, [])
    else:
        assert (deep / "out.csv").read_bytes() == (folder / "imported.csv").read_bytes()


def test_two_processes_write_one_file_and_it_is_whole(wine, folder):
    made = {}
    for seed in ("1", "2"):
        wine.edbb("simulate", "mine/plan.json", "--seed", seed, "-o", f"{seed}.csv", cwd=folder)
        made[seed] = (folder / f"{seed}.csv").read_bytes()
    words = ("simulate", "mine/plan.json", "-o", "both.csv", "--force", "--seed")
    both = [wine.start(wine.program / "edbb.exe", *words, seed, cwd=folder) for seed in made]
    said = [process.communicate(timeout=600)[0] for process in both]
    assert 0 in [process.returncode for process in both], said
    assert (folder / "both.csv").read_bytes() in made.values()
    assert not list(folder.glob(".edbb*"))


def test_two_processes_write_one_folder_and_it_is_whole(wine, folder):
    words = ("check", "run.csv", "--plan", "mine/plan.json", "--model", "calibrated", "-o", "both", "--limit-mm")
    both = [wine.start(wine.program / "edbb.exe", *words, limit, cwd=folder) for limit in ("0.5", "5")]
    said = [process.communicate(timeout=600)[0] for process in both]
    codes = {process.returncode for process in both}
    assert 0 in codes, said
    assert codes <= {0, 2}, said  # the other one may have met a folder that was just exchanged
    assert changed_files(folder / "both", "check.json") == []
    assert not [p for p in folder.rglob("*") if p.name.startswith(".edbb")]


def test_control_c_ends_a_command_and_leaves_what_was_there(wine, folder):
    before = contents(folder)
    words = ("identify", "run.csv", "--cell", "mine/cell.toml", "--plan", "mine/plan.json", "-o", "calibrated")
    process = wine.start(wine.program / "edbb.exe", *words, cwd=folder)
    time.sleep(STOP_AFTER_S)
    if process.poll() is None:  # a fast machine may have ended
        wine.end("identify", signal.SIGINT)
        said = process.communicate(timeout=PATIENCE_S)[0].decode(errors="replace")
        assert process.returncode == 130
        assert "Traceback" not in said
        assert contents(folder) == before
