"""``edbb --server``: what is sent, what is refused, and that the results are those of the command here."""

import pytest

from planner.cell.reading import load_cell
from planner.cli.remote import RemoteWords
from tests.command import edbb
from tests.service.conftest import upload

PLAN = ("plan-check", "comau-nj130/edbb", "--model", "known", "-o", "here/out")


def test_words_that_are_files_are_sent_with_what_belongs_to_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("known/robot.toml", "known/posterior.json", "known/report.html", "run.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    (tmp_path / "mine.toml").write_text(load_cell("ur10/edbb").path.read_text())
    made = RemoteWords.of(PLAN)
    assert made.words == ["plan-check", "comau-nj130/edbb", "--model", "a1", "-o", "out"]
    assert sorted(made.files) == ["a1/posterior.json", "a1/robot.toml"]
    made = RemoteWords.of(["identify", "run.csv", "--cell", "mine.toml", "-o", "x"])
    assert made.words == ["identify", "a1/run.csv", "--cell", "c2/cell.toml", "-o", "out"]
    assert sorted(made.files) == ["a1/run.csv", "c2/cell.toml"]
    assert RemoteWords.of(["simulate", "run.csv", "-o", "a/b.csv"]).words[-1] == "out/b.csv"


@pytest.mark.parametrize("named", ["pick.src", "PICK.dat"])
def test_a_program_is_sent_with_all_its_files(named, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("pick.src", "PICK.dat", "place.dat", "robot.toml"):
        (tmp_path / name).write_text("x")
    made = RemoteWords.of(["compensate", named, "--model", "known", "-o", "new/"])
    assert made.words == ["compensate", f"a1/{named}", "--model", "known", "-o", "out/"]
    assert sorted(made.files) == ["a1/PICK.dat", "a1/pick.src"]
    assert RemoteWords.of(["compensate", named, "-o", "new.src"]).words[-1] == "out/new.src"


@pytest.mark.parametrize(
    ("words", "because"),
    [
        (["serve"], "does not run on a server"),
        (["plan", "/etc/passwd"], "leads out of the folder"),
        (["identify", "a", "--cell=/etc/x"], "leads out of the folder"),
        (["plan", "a", "-o", "../x"], "leads out of the folder"),
    ],
)
def test_what_must_not_run_there_is_refused(client, words, because):
    answer = client.post("/api/commands", json={"words": words})
    assert answer.status_code == 403
    assert because in answer.json()["detail"]


def test_files_lie_in_the_folder_of_the_job_alone(client):
    sent = upload(client, "files", b"x", "run.csv")
    for name in ("../run.csv", "/run.csv", "a/../../x", "a//b", ".hidden"):
        body = {"words": ["robots"], "files": [{"id": sent["id"], "name": name}]}
        assert client.post("/api/commands", json=body).status_code == 422


def test_nobody_there_and_a_wrong_address_are_said(monkeypatch):
    assert edbb("--server", "http://127.0.0.1:9", "robots").returncode == 4
    wrong = edbb("--server", "here", "robots")
    assert (wrong.returncode, "an address such as" in wrong.screen) == (2, True)


TARGETS = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,-60,80,-90,-80,20\n"


@pytest.mark.long
def test_a_command_gives_there_what_it_gives_here(service, tmp_path):
    """Files sent and fetched, what is printed, and what is refused, all as here."""
    address, _ = service
    (tmp_path / "targets.csv").write_text(TARGETS)
    robot = load_cell("ur10/edbb").robot.path.read_text()
    (tmp_path / "robot.toml").write_text(
        robot.replace("a_mm = -612.0", "a_mm = -612.5") + "\n[nominal]\na2_mm = -612.0\n"
    )
    for name, how in (("a", ("--server", address)), ("b", ())):
        words = ("compensate", tmp_path / "targets.csv", "--model", tmp_path / "robot.toml")
        done = edbb(*how, *words, "-o", tmp_path / f"{name}.csv")
        assert done.returncode == 0, done.stderr
    there, here = ((tmp_path / f"{name}.csv").read_text() for name in "ab")
    assert there == here
    assert "10,-60," not in there
    for words in (("robots", "--json"), ("plan", "ur10/nothing", "-o", tmp_path / "none")):
        there, here = edbb("--server", address, *words), edbb(*words)
        assert (there.returncode, there.stdout, there.stderr) == (here.returncode, here.stdout, here.stderr)
    assert not (tmp_path / "none").exists()
