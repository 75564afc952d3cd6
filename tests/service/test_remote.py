"""``edbb --server``: what is sent, what is refused, and that the results are those of the command here."""

import pytest

from planner.cell.reading import load_cell
from planner.cli.remote import RemoteWords
from tests.command import edbb
from tests.service.conftest import upload

PLAN = ("plan-check", "comau-nj130/edbb", "--baseline", "known", "-o", "here/out")


def test_words_that_are_files_are_sent_with_what_belongs_to_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("known/robot.toml", "known/posterior.json", "known/report.html", "run.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("x")
    (tmp_path / "mine.toml").write_text(load_cell("ur10/edbb").path.read_text())
    made = RemoteWords.of(PLAN)
    assert made.words == ["plan-check", "comau-nj130/edbb", "--baseline", "a1", "-o", "out"]
    assert sorted(made.files) == ["a1/posterior.json", "a1/robot.toml"]
    made = RemoteWords.of(["identify", "run.csv", "--cell", "mine.toml", "-o", "x"])
    assert made.words == ["identify", "a1/run.csv", "--cell", "c2/cell.toml", "-o", "out"]
    assert sorted(made.files) == ["a1/run.csv", "c2/cell.toml"]
    assert RemoteWords.of(["simulate", "run.csv", "-o", "a/b.csv"]).words[-1] == "out/b.csv"


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
    assert answer.status_code == 422
    assert because in answer.json()["detail"]


def test_files_lie_in_the_folder_of_the_job_alone(client):
    sent = upload(client, "files", b"x", "run.csv")
    for name in ("../run.csv", "/run.csv", "a/../../x", "a//b", ".hidden"):
        body = {"words": ["robots"], "files": [{"id": sent["id"], "name": name}]}
        assert client.post("/api/commands", json=body).status_code == 422


def test_nobody_there_and_a_wrong_address_are_said(monkeypatch):
    assert edbb("--server", "http://127.0.0.1:9", "robots").returncode == 4
    wrong = edbb("--server", "here", "robots")
    assert (wrong.returncode, "an address such as" in wrong.stderr) == (2, True)


@pytest.mark.long
def test_a_command_gives_there_what_it_gives_here(service, tmp_path):
    """A simulated run of a small plan: the plan made there, sent back there, byte for byte as here."""
    address, _ = service
    words = ("plan", "ur10/edbb", "--poses", 26, "--dialect", "urscript")
    there = edbb("--server", address, *words, "-o", tmp_path / "there")
    assert there.returncode == 0, there.stderr
    plan = tmp_path / "there" / "plan.json"
    for name, how in (("a", ("--server", address)), ("b", ())):
        done = edbb(*how, "simulate", plan, "-o", tmp_path / f"{name}.csv")
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    wrong = edbb("--server", address, "plan", "ur10/nothing", "-o", tmp_path / "none")
    here = edbb("plan", "ur10/nothing", "-o", tmp_path / "none")
    assert (wrong.returncode, wrong.stderr) == (here.returncode, here.stderr)
    assert not (tmp_path / "none").exists()
