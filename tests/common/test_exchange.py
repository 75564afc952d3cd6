"""Files are exchanged all together or not at all, whichever operation fails, as Windows lets it."""

import os
import re
import shutil
from pathlib import Path

import pytest
from pydantic import TypeAdapter, ValidationError

import planner.common.exchange as exchange
from planner.common.errors import InputError
from planner.common.file_names import check_names, name_fault
from planner.common.files import write_bytes, write_text, write_together
from planner.common.result_folder import draft_folder, move_all
from planner.programs.dialect import dialect_names, load_dialect
from planner.programs.rendering import program_name
from planner.service.job_folder import FilePath
from tests.command import edbb

MOST = 60  # operations of one command


class Windows:
    """Lets the k-th change of a name fail, once or from then on, or every one of a file that is open elsewhere."""

    def __init__(self, monkeypatch):
        self.count, self.fails, self.for_ever, self.open_file = 0, -1, False, None
        for name in ("replace", "rename", "unlink"):
            monkeypatch.setattr(os, name, self._watched(getattr(os, name)))
        monkeypatch.setattr(exchange, "swap_folders", lambda a, b: False)
        monkeypatch.setattr(exchange.time, "sleep", lambda s: None)

    def _watched(self, function):
        def call(*paths, **how):
            self.count += 1
            if self.count == self.fails or (self.for_ever and self.count > self.fails > 0) or self._is_open(paths):
                err = PermissionError(13, "The process cannot access the file because it is being used")
                setattr(err, "winerror", 32)  # noqa: B010
                raise err
            return function(*paths, **how)

        return call

    def _is_open(self, paths):
        if self.open_file is None:
            return False
        named = [Path(p).absolute() for p in paths if isinstance(p, str | Path)]
        return any(p == self.open_file or p in self.open_file.parents for p in named)


@pytest.fixture
def windows(monkeypatch):
    return Windows(monkeypatch)


def tree(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def results(folder, word):
    """A command's results: some with the same name each time, some not, and one that is the same."""
    with draft_folder(folder) as draft:
        (draft / "pictures").mkdir()
        for name in ("plan.json", "a.src", f"pictures/{word}.png", "pictures/b.png"):
            write_text(draft / name, f"{word} {name}")
        write_text(draft / "same.txt", "the same")
        move_all(draft, folder)


def program(folder, word):
    write_together([(folder / n, f"plan_id {word} {n}".encode()) for n in ("p.src", "p_001.src", "p.dat")])


def one_file(folder, word):
    write_bytes(folder / "run.csv", f"# edbb {word}".encode())


WRITERS = {"results": results, "program": program, "one file": one_file}


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("others", [False, True])
@pytest.mark.parametrize("kind", ["once", "first time"])
def test_the_old_or_the_new_is_there_whichever_operation_fails(tmp_path, monkeypatch, writer, others, kind):
    write = WRITERS[writer]
    outcomes = set()
    for k in range(1, MOST):
        place = tmp_path / str(k) / "out"
        place.mkdir(parents=True)
        if kind == "once":
            write(place, "old")
        if others:
            (place / "mine.txt").write_text("mine")
        before = tree(place)
        with monkeypatch.context() as patch:
            windows = Windows(patch)
            windows.fails = k
            try:
                write(place, "new")
            except InputError:
                outcomes.add("refused")
                assert tree(place) == before, k
            else:
                outcomes.add("written")
                now = {n: d for n, d in tree(place).items() if ".edbb-" not in n}
                assert not any(b"old" in data for data in now.values()), k
                assert ("mine.txt" in now) == others
            reached = windows.count >= k
        write(place, "after")  # nothing refuses for ever
        assert not any(b"old" in d or b"new" in d for d in tree(place).values())
        if not reached:
            break
    else:
        raise AssertionError("the operations have no end")
    assert outcomes == {"refused", "written"}


@pytest.mark.parametrize("name", ["plan.json", "a.src", "pictures/b.png", "pictures/old.png", "manifest.json"])
def test_an_open_file_of_a_folder_is_named_and_all_stays(tmp_path, windows, name):
    out = tmp_path / "out"
    results(out, "old")
    before = tree(out)
    windows.open_file = out / name
    with pytest.raises(
        InputError, match=rf"{re.escape(str(Path(name)))}: another program has it open .*close it there"
    ):
        results(out, "new")
    assert tree(out) == before
    windows.open_file = None
    results(out, "new")
    assert set(tree(out)) == {p.replace("old", "new") for p in before}


@pytest.mark.parametrize("name", ["mine.txt", "same.txt"])
def test_an_open_file_that_stays_as_it_is_disturbs_nobody(tmp_path, windows, name):
    out = tmp_path / "out"
    results(out, "old")
    (out / "mine.txt").write_text("mine")
    windows.open_file = out / name
    results(out, "new")
    assert b"new" in (out / "a.src").read_bytes()


@pytest.mark.parametrize("name", ["p.src", "p_001.src", "p.dat"])
def test_an_open_file_of_a_program_is_named_and_the_good_program_stays(tmp_path, windows, name):
    program(tmp_path, "old")
    before = tree(tmp_path)
    windows.open_file = tmp_path / name
    with pytest.raises(InputError, match=rf"{re.escape(name)}: another program has it open"):
        program(tmp_path, "new")
    assert tree(tmp_path) == before


def test_what_can_be_neither_moved_nor_copied_back_is_named_and_kept(tmp_path, windows, monkeypatch):
    program(tmp_path, "old")
    monkeypatch.setattr(exchange.shutil, "copy2", lambda *_, **__: (_ for _ in ()).throw(OSError(13, "no")))
    windows.fails, windows.for_ever = windows.count + 4, True  # all three are aside
    with pytest.raises(InputError, match=r"p\.dat is now "):
        program(tmp_path, "new")
    kept = {data for name, data in tree(tmp_path).items() if ".edbb-" in name}
    assert {f"plan_id old {n}".encode() for n in ("p.src", "p_001.src", "p.dat")} <= kept


DEVICES = ["CON", "con", "Aux", "NUL", "PRN", "COM1", "lpt9", "COM¹", "aux.csv", "aux.tar.gz", "nul .txt", "CONIN$"]
SIGNS = ["a:b", "c:", "a.csv:stream", "what?", "a*", 'a"b', "a<b", "a|b", "a\tb", "a\\b"]
ENDS = ["run.", "run ", "run.csv.", "run.csv ", "..."]
GOOD = ["con1", "console", "auxiliary.csv", "COM10", "com", "a.aux", "null", ".hidden", "a b.csv", "ü.csv", "LPT"]


@pytest.mark.parametrize("name", [*DEVICES, *SIGNS, *ENDS])
def test_names_that_windows_cannot_have_are_refused_everywhere(tmp_path, monkeypatch, name):
    if os.name == "nt" and name in ("a:b", "c:", "a\\b"):
        pytest.skip("a drive, or a file in a folder")
    monkeypatch.chdir(tmp_path)
    assert name_fault(name)
    for path in (Path(name), Path(name, "run.csv"), tmp_path / name, tmp_path / name / "deep" / "run.csv"):
        with pytest.raises(InputError, match="take another name"):
            check_names(path)
        with pytest.raises(InputError, match="take another name"):
            write_bytes(path, b"x")
        with pytest.raises(InputError, match="take another name"), draft_folder(path):
            raise AssertionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", GOOD)
def test_other_names_are_taken(tmp_path, name):
    write_bytes(tmp_path / name, b"x")
    assert (tmp_path / name).read_bytes() == b"x"


@pytest.mark.posix
def test_folders_that_are_there_from_the_root_are_not_judged(tmp_path):
    (tmp_path / "a:b").mkdir()
    write_bytes(tmp_path / "a:b" / "run.csv", b"x")


@pytest.mark.parametrize("words", [("plan", "ur10/edbb", "-o", "aux"), ("robots", "ur10", "--copy", "x/nul.d")])
def test_a_command_refuses_such_a_name_before_it_works(tmp_path, words):
    done = edbb(*words, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("stem", ["aux", "con", "COM1", "nul"])
def test_programs_are_not_called_like_devices(stem):
    for name in dialect_names():
        assert not name_fault(program_name(stem, load_dialect(name)))


@pytest.mark.parametrize("name", ["aux.csv", "NUL", "com1.tar.gz", "run.", "a/con/run.csv"])
def test_the_service_takes_no_such_name(name):
    with pytest.raises(ValidationError, match=r"take another name|should match pattern"):
        TypeAdapter(FilePath).validate_python(name)
    assert TypeAdapter(FilePath).validate_python("a1/run.csv") == "a1/run.csv"


@pytest.mark.posix
def test_a_draft_that_cannot_be_removed_leaves_what_its_links_lead_to(tmp_path, monkeypatch):
    other, draft = tmp_path / "mine.csv", tmp_path / "draft"
    other.write_text("x")
    other.chmod(0o640)
    draft.mkdir()
    (draft / "link").symlink_to(other)
    (draft / "a.csv").write_text("x")
    (draft / "a.csv").chmod(0o400)
    refused = []

    def refuse(path):
        refused.append(path)
        raise PermissionError

    monkeypatch.setattr(shutil, "rmtree", refuse)
    exchange.remove(draft)
    assert refused
    assert (draft / "a.csv").stat().st_mode & 0o777 == 0o700
    assert other.stat().st_mode & 0o777 == 0o640
