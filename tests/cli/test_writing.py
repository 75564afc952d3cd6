"""What a command writes: never over what it read, nor over what others wrote; old or new, whenever it is killed."""

import hashlib
import json
import os
import re
import signal
import stat
import time
from pathlib import Path

import numpy as np
import pytest

from planner.cli.app import main
from planner.cli.terminal import give
from planner.common.errors import InputError, NoSolutionError
from planner.common.files import INPUTS, read_utf8, write_text
from planner.common.result import FolderResult, Result
from planner.common.result_folder import changed_files, draft_folder, move_all
from planner.common.summary import Summary
from planner.programs.rendering import ProgramFile
from planner.workflow.plan_results import write_program_as
from tests.command import edbb
from tests.not_everywhere import resource

MAP = 'schema = "edbb-map/1"\nmeasure = "static"\nheader = false\n[columns]\n' + "".join(
    f"q{j}_deg = {j}\n" for j in range(1, 7)
)
MAP += "length_mm = 7\n"


def _results(folder: Path, force: bool = False, **files: str) -> None:
    with draft_folder(folder) as draft:
        for name, text in files.items():
            write_text(draft / name.replace("_", "."), text)
        move_all(draft, folder, force)


def _content(folder: Path) -> dict[str, str]:
    return {p.name: p.read_text() for p in folder.iterdir() if p.name != "manifest.json"}


def test_results_of_an_earlier_command_give_way_and_files_of_others_stay(tmp_path):
    out = tmp_path / "out"
    _results(out, plan_json="{1}", a_src="one", b_src="one")
    (out / "notes.txt").write_text("mine")
    _results(out, identification_json="{}", robot_toml="one")
    _results(out, plan_json="{2}", a_src="two")
    assert _content(out) == {
        "plan.json": "{2}", "a.src": "two", "notes.txt": "mine", "identification.json": "{}", "robot.toml": "one",
    }  # fmt: skip
    assert changed_files(out, "plan.json") == []
    assert changed_files(out, "identification.json") == []
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_file_that_a_person_changed_or_wrote_is_not_written_over(tmp_path):
    out = tmp_path / "out"
    _results(out, plan_json="{1}", a_src="one")
    (out / "a.src").write_text("my correction")
    with pytest.raises(InputError, match=r"a\.src: was changed since edbb wrote it.*--force"):
        _results(out, plan_json="{2}", a_src="two")
    assert _content(out) == {"plan.json": "{1}", "a.src": "my correction"}
    assert changed_files(out, "plan.json") == ["a.src"]
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "robot.toml").write_text("mine")
    with pytest.raises(InputError, match=r"robot\.toml: was not written by edbb"):
        _results(tmp_path / "own", identification_json="{}", robot_toml="new")
    _results(out, force=True, plan_json="{2}", a_src="two")
    assert _content(out)["a.src"] == "two"


@pytest.mark.posix
def test_what_was_read_is_never_written_over(tmp_path):
    out, run = tmp_path / "out", tmp_path / "run.csv"
    _results(out, plan_json="{1}", cell_toml="cell")
    run.write_text("# plan_id: 0\n")
    with INPUTS.watch():
        read_utf8(out / "cell.toml")
        read_utf8(run)
        with pytest.raises(InputError, match=r"cell\.toml: this command has read it"):
            _results(out, force=True, plan_json="{2}", cell_toml="new")
        (tmp_path / "link.csv").symlink_to(run)
        for path in (run, tmp_path / "link.csv"):
            with pytest.raises(InputError, match="this command has read it"):
                write_text(path, "new", force=True)
    assert _content(out) == {"plan.json": "{1}", "cell.toml": "cell"}
    assert run.read_text() == "# plan_id: 0\n"


def test_a_run_is_known_by_its_mark_behind_the_truth(tmp_path):
    run, truth = tmp_path / "run.csv", "".join(f"# truth: effect{k} = {k / 7}\n" for k in range(300))
    run.write_text(f"{truth}# plan_id: 0\n1,2\n")
    with INPUTS.watch():
        write_text(run, f"# truth: other\n{truth}# plan_id: 0\n3,4\n")
        run.write_text(f"{truth}1,2\n")
        with pytest.raises(InputError, match="was not written by edbb"):
            write_text(run, "# plan_id: 0\n")


def test_a_text_in_another_code_is_refused_with_its_line_and_what_helps(tmp_path):
    """As Notepad saves it in the code of Windows; in UTF-8 with its mark, or in UTF-16, it is read."""
    cell, text = tmp_path / "cell.toml", 'schema = "edbb-cell/1"\n# geändert\n'
    cell.write_bytes(text.encode("cp1252"))
    with pytest.raises(InputError, match=r"cell\.toml, line 2: the byte 0xE4 is no UTF-8; save .* in UTF-8 \(Notepad"):
        read_utf8(cell)
    for code in ("utf-8-sig", "utf-16"):
        cell.write_bytes(text.replace("\n", "\r\n").encode(code))
        assert read_utf8(cell) == text


def test_the_folder_that_one_is_in_is_no_folder_of_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="the one that you are in"), draft_folder(Path()):
        raise AssertionError
    for where in (".", "/", ".."):
        with pytest.raises(InputError, match="the one that you are in"):
            give(lambda stages: pytest.fail("nothing is computed before"), Path(where), False)


@pytest.mark.posix
def test_a_link_is_followed_and_a_device_is_written_to(tmp_path):
    (tmp_path / "real.csv").write_text("plan_id")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    write_text(tmp_path / "link.csv", "new plan_id")
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new plan_id"
    before = os.stat("/dev/null").st_mode
    write_text(Path("/dev/null"), "gone")
    assert os.stat("/dev/null").st_mode == before
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for wrong in (tmp_path / "loop", tmp_path / ("x" * 300), tmp_path / "a\0b"):
        with pytest.raises(InputError, match="cannot be written"):
            write_text(wrong, "x")


@pytest.mark.posix
def test_a_program_of_several_files_follows_a_link_and_replaces_no_device(tmp_path):
    from planner.programs.rendering import ProgramFile

    files = tuple(ProgramFile(f"P.{end}", "; plan_id: 0\n") for end in ("src", "dat"))
    (tmp_path / "p.src").symlink_to(tmp_path / "real.src")
    write_program_as(files, tmp_path / "p.src")
    assert (tmp_path / "p.src").is_symlink()
    assert (tmp_path / "real.src").read_text() == files[0].text
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is no plain file, and the program is 2 files"):
        write_program_as(files, tmp_path / "pipe")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


def test_a_single_file_of_others_is_not_written_over(tmp_path):
    path = tmp_path / "p.src"
    path.write_text("DEF mine ( )\nEND\n")
    with pytest.raises(InputError, match="was not written by edbb"), INPUTS.watch():
        write_text(path, "plan_id")
    trace = tmp_path / "trace.csv"
    trace.write_text("".join(f"{k},{k * 2},3,4,{50 + k},6,{400 + k}\n" for k in range(20)))
    (tmp_path / "map.toml").write_text(MAP)
    words = ("import", trace, "--map", tmp_path / "map.toml", "-o", path.with_suffix(".csv"))
    assert edbb(*words).returncode == 0
    assert edbb(*words).returncode == 0, "the same content is no loss"
    assert edbb(*words[:-1], trace).returncode == 2
    assert edbb(*words[:-1], trace, "--force").returncode == 2
    path.with_suffix(".csv").write_text("mine\n")
    refused = edbb(*words)
    assert refused.returncode == 2
    assert "--force" in refused.screen
    assert edbb(*words, "--force").returncode == 0


def _killed(work, seconds: float) -> None:
    """Do the work in a process of its own, and kill that after a time."""
    child = os.fork()
    if child == 0:
        try:
            work()
        finally:
            os._exit(0)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def kill_time(rng, whole):
    """Return when to kill [s]: now before the end, now after it, also where the machine is thirty times as slow."""
    return whole * (rng.uniform(0.0, 2.0) if rng.random() < 0.7 else rng.uniform(2.0, 30.0))


def _state(path: Path) -> dict[str, str]:
    files = sorted(p for p in path.rglob("*") if p.is_file() and not any(q.startswith(".edbb-") for q in p.parts))
    return {str(p.relative_to(path)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("kills", [10, pytest.param(140, marks=pytest.mark.long)])
def test_a_kill_leaves_the_old_folder_or_the_new(tmp_path, kills):
    rng, big = np.random.default_rng(kills), "x" * 200_000
    texts = [{f"f{k}_txt": version * 3 + big for k in range(8)} | {"plan_json": version} for version in "ab"]
    states = []
    for text in texts:
        _results(tmp_path / "out", **text)
        states.append(_state(tmp_path / "out"))
    start = time.perf_counter()
    _results(tmp_path / "out", **texts[0])
    whole = time.perf_counter() - start
    seen = set()
    for k in range(kills):
        _killed(lambda k=k: _results(tmp_path / "out", **texts[k % 2]), kill_time(rng, whole))
        found = _state(tmp_path / "out")
        assert found in states
        seen.add(states.index(found))
    assert seen == {0, 1} or kills < 100, "both were met"
    _results(tmp_path / "out", **texts[0])
    assert [p.name for p in tmp_path.iterdir()] == ["out"], "drafts of the killed are cleared"


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("kills", [6, pytest.param(60, marks=pytest.mark.long)])
def test_a_kill_leaves_no_mixture_of_a_program(tmp_path, kills):
    from planner.programs.rendering import ProgramFile

    rng = np.random.default_rng(kills)
    plans = [
        tuple(ProgramFile(f"p.{end}", f"; plan_id: {i:012x}\n" + "x" * 300_000) for end in ("src", "dat"))
        for i in (1, 2)
    ]
    start = time.perf_counter()
    write_program_as(plans[0], tmp_path / "p.src")
    whole = time.perf_counter() - start
    for k in range(kills):
        _killed(lambda k=k: write_program_as(plans[k % 2], tmp_path / "p.src"), kill_time(rng, whole))
        heads = {(tmp_path / n).read_bytes()[:23] for n in ("p.src", "p.dat") if (tmp_path / n).exists()}
        assert len(heads) == 1 or not (tmp_path / "p.src").exists()


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "r" * 300 + "/cell"])
def test_names_that_no_file_can_have_are_told(tmp_path, name):
    cell = tmp_path / "c.toml"
    cell.write_text(f"schema = 'edbb-cell/1'\nrobot = {json.dumps(name)}\n[gauge]\nkind = 'tracker'\n")
    for words in (("plan", name, "-o", tmp_path), ("plan", cell, "-o", tmp_path), ("plan", "x/y", "-o", name)):
        done = edbb(*words)
        assert done.returncode == 2
        assert len(done.screen) < 2700
    mapped = tmp_path / "map.toml"
    mapped.write_text(f"{MAP}[units]\n".replace("measure", 'encoding = "zlib"\nmeasure'))
    assert "is no encoding of text" in edbb("import", cell, "--map", mapped, "-o", tmp_path / "r.csv").screen


@pytest.mark.parametrize("name", ["x" * 300 + ".src", "a\0b.src", "r" * 300 + "/p.src"])
def test_programs_of_names_that_no_file_can_have_are_told(tmp_path, name):
    with pytest.raises(InputError, match="cannot be written"):
        write_program_as((ProgramFile("p.src", "text"), ProgramFile("p.dat", "text")), tmp_path / name)


@pytest.mark.parametrize(
    ("output", "said"),
    [("missing/out", "the folder .* is missing"), ("file.txt/out", "is a file"), ("there", "is a folder"),
     ("theirs.src", "was not written by edbb"), ("aux.src", "name of a device")],
)  # fmt: skip
def test_a_command_refuses_a_file_that_it_cannot_write_before_it_works(tmp_path, output, said):
    """Each command that writes one file; what it is to read is not there, so that it cannot have begun."""
    (tmp_path / "there").mkdir()
    (tmp_path / "file.txt").write_text("text")
    (tmp_path / "theirs.src").write_text("DEF theirs ( )\nEND\n")
    nothing = tmp_path / "nothing"
    commands = {
        "simulate": (nothing,), "export": (nothing, "--dialect", "krl"), "fleet": (nothing, nothing),
        "import": (nothing, "--map", nothing), "compensate": (nothing, "--model", nothing),
    }  # fmt: skip
    for verb, words in commands.items():
        if (verb, output) in {("compensate", "there"), ("export", "there"), ("import", "theirs.src")}:
            continue  # a folder may be named; a run bears no mark
        done = edbb(verb, *words, "-o", tmp_path / output)
        assert done.returncode == 2
        assert re.search(said, " ".join(done.stderr.split())), (verb, done.stderr)
        assert not (tmp_path / "missing").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("words", [["--help"], ["dialects"], ["dialects", "--json"], ["plan", "--help"]], ids=" ".join)
def test_a_full_standard_output_is_told_in_one_sentence(monkeypatch, capfd, words):
    monkeypatch.setattr("sys.argv", ["edbb", *words])
    monkeypatch.setattr("sys.stdout", os.fdopen(os.open("/dev/full", os.O_WRONLY), "w"))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capfd.readouterr().err == "edbb: the output cannot be written (No space left on device)\n"


def test_a_reader_that_goes_away_is_not_told(monkeypatch, capfd):
    reading, writing = os.pipe()
    os.close(reading)
    monkeypatch.setattr("sys.argv", ["edbb", "dialects"])
    monkeypatch.setattr("sys.stdout", os.fdopen(writing, "w"))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code
    assert capfd.readouterr().err == ""


def test_a_result_that_is_written_says_what_comes_next_and_one_that_must_not_be_used_does_not(tmp_path, capfd):
    class Written(Result):
        problems = ()

        def overview(self):
            return Summary("done")

        def content(self):
            return {}

        def write(self, folder, force=False):
            return []

        def next_step(self, folder):
            return f"look into {folder}"

    give(lambda stages: Written(), tmp_path / "out", False)
    assert f"next        look into {tmp_path / 'out'}" in capfd.readouterr().out
    Written.problems = ("the fit failed",)
    with pytest.raises(NoSolutionError, match="the fit failed"):
        give(lambda stages: Written(), tmp_path / "out", False)
    assert "next" not in capfd.readouterr().out


def test_a_file_where_a_folder_of_results_is_written_stays(tmp_path):
    class Written(FolderResult):
        main_file = "done.json"

        def overview(self):
            return Summary("done")

        def content(self):
            return {}

        def fill(self, draft):
            pass

    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        Written().write(tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"
    assert Written().write(tmp_path / "out") == [tmp_path.resolve() / "out" / "done.json"]
    (tmp_path / "out" / "done.json").write_text("corrected by hand")
    with pytest.raises(InputError, match="was changed since edbb wrote it"):
        Written().write(tmp_path / "out")
    Written().write(tmp_path / "out", force=True)
    assert (tmp_path / "out" / "done.json").read_text() == "{}\n"


def _fill_disk_at(size):
    """Let no file grow beyond ``size`` bytes, as on a disk that fills up."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))


@pytest.mark.parametrize("before", [None, "an older program, plan_id: 0123456789ab\n"])
def test_a_full_disk_leaves_no_file_of_a_program_without_the_others(tmp_path, before):
    names = ["p.src", "p_001.src", "p.dat"]
    files = tuple(
        ProgramFile(n, f"plan_id {n}\n" + size * "x") for n, size in zip(names, (10, 50_000, 10), strict=True)
    )
    for name in names if before else ():
        (tmp_path / name).write_text(before)
    _fill_disk_at(20_000)
    try:
        with pytest.raises(InputError, match=r"p_001.src: cannot be written \(File too large\)"):
            write_program_as(files, tmp_path / "p.src")
    finally:
        _fill_disk_at(resource.RLIM_INFINITY)
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == dict.fromkeys(names if before else (), before)
    write_program_as(files, tmp_path / "p.src")
    assert {p.name: p.read_text() for p in tmp_path.iterdir()} == {f.name: f.text for f in files}


@pytest.mark.parametrize("failing", [0, 1, 2])
def test_a_name_that_cannot_be_taken_leaves_none_of_the_new_files(tmp_path, monkeypatch, failing):
    files = tuple(ProgramFile(n, f"plan_id new {n}") for n in ("p.src", "p_001.src", "p.dat"))
    calls, replace_file = [], os.replace

    def refuse(source, target):
        calls.append(target)
        if len(calls) == failing + 1:
            raise OSError(28, "No space left on device")
        replace_file(source, target)

    monkeypatch.setattr("planner.common.files.os.replace", refuse)
    with pytest.raises(InputError, match="cannot be written"):
        write_program_as(files, tmp_path / "p.src")
    assert list(tmp_path.iterdir()) == []


def test_line_ends_of_windows_are_no_change_of_a_result(tmp_path):
    out = tmp_path / "out"
    _results(out, plan_json='{"a":\n1}\n', a_src="one\ntwo\n")
    (out / "a.src").write_bytes(b"one\r\ntwo\r\n")
    (out / "plan.json").write_bytes(b'{"a":\r\n1}\r\n')
    assert changed_files(out, "plan.json") == []
    (out / "a.src").write_bytes(b"one\r\ntwo \r\n")
    assert changed_files(out, "plan.json") == ["a.src"]
