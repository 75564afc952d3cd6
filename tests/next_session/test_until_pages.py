"""The page on measuring until it is good enough, typed as it stands, on small cells with simulated runs."""

import json
import re
import shlex
import time
from pathlib import Path

import polars as pl
import pytest

from planner.cell.reading import load_cell
from planner.cli import cell_commands
from planner.next_session.live_advice import LiveAdvice
from planner.session.planned_session import load_session
from tests.centring.test_live_gauge import Gauge
from tests.command import edbb

PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "until.md"
BATCHES, WIRE, HEAD = re.findall(r"```console\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def commands(block, changed):
    """The commands of a block, with words of the page in the place of which others are typed."""
    for line in block.splitlines():
        if line.startswith("$ edbb "):
            yield [str(changed.get(word, word)) for word in shlex.split(line)[2:]]


def small_cell(path):
    text = load_cell("comau-nj130/edbb").path.read_text().replace('measure = "continuous"', 'measure = "static"')
    path.write_text(text.partition("\n[plan]\n")[0] + "\n[plan]\ncandidates = 250\nrefine = false\nvalidate = 4\n")


@pytest.mark.long
def test_three_batches(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    small_cell(tmp_path / "cell.toml")
    first, found, *others = commands(BATCHES, {"CELL": "cell.toml"})
    assert [c[0] for c in (first, found, *others)] == ["plan", "identify"] * 3
    measure(first)
    identify(found)
    goal = f"{0.7 * limit_mm('known'):.3f}"
    measured = ["first"]
    for plan, evaluate in zip(others[::2], others[1::2], strict=True):
        words = [goal if w == "0.2" else w for w in plan]
        done = measure(words, may_refuse=True)
        if done.returncode:  # the goal is met already, as the page says
            assert "are below" in done.screen
            assert "nothing is to be measured for that" in done.screen
            break
        measured.append(plan[-1])
        assert f"edbb identify BEFORE/run.csv {plan[-1]}/run.csv -o calibrated" in done.screen
        assert done.screen.count("edbb identify BEFORE/run.csv") == 1
        assert "left standing" in (tmp_path / plan[-1] / "plan.json").read_text()
        identify(evaluate)
        assert limit_mm(evaluate[-1]) < limit_mm("known")
    assert len(measured) >= 2


def measure(words, may_refuse=False):
    done = edbb(*words)
    if done.returncode and may_refuse:
        return done
    assert done.returncode == 0, done.stderr
    run = edbb("simulate", f"{words[-1]}/plan.json", "-o", f"{words[-1]}/run.csv", "--seed", "3")
    assert run.returncode == 0, run.stderr
    return done


def identify(words):
    done = edbb(*words, "--no-trace")
    assert done.returncode == 0, done.stderr


def limit_mm(folder):
    return json.loads((Path(folder) / "identification.json").read_text())["release"]["at_most_mm"]


@pytest.mark.long
def test_pose_by_pose_with_a_draw_wire(tmp_path, monkeypatch):
    """The wire shows what the simulated run of the plan holds; the goal is one that this arm reaches."""
    monkeypatch.chdir(tmp_path)
    gauge = Gauge()
    plan, read, found = commands(WIRE, {"CELL": "so101/wire", "120": 45, "COM5": gauge.port})
    done = edbb(*plan)
    assert done.returncode == 0, done.stderr
    assert edbb("simulate", "out/plan.json", "-o", "shown.csv", "--seed", "1").returncode == 0
    table = pl.read_csv("shown.csv", comment_prefix="#")
    shown = dict(zip(table["pose"].to_list(), table["length_mm"].to_list(), strict=True))

    def ask(text):
        gauge.shown = shown[int(text.split()[1])]
        time.sleep(0.1)
        return ""

    monkeypatch.setattr(cell_commands, "_ask", ask)
    goal = f"{limit_after(36, shown):.3g}"
    done = edbb(*(goal if w == "0.2" else w for w in read))
    gauge.on = False
    assert done.returncode == 0, done.stderr
    assert "mm expected, 95 % sure below" in done.screen
    assert f": {goal} mm is reached" in done.screen
    assert "drive on, the goal is reached" in done.screen
    assert Path("run.progress.csv").is_file()
    identify(found)
    assert limit_mm("calibrated") < 3 * float(goal)


def limit_after(count, shown):
    """What 95 of 100 such robots stay below after so many poses [mm], and a little more."""
    session = load_session(Path("out/plan.json"), "measured")
    ids = [p.id for p in session.document.poses if p.role == "calibrate"][:count]
    live = LiveAdvice.of(session.document, session.cell, Path("other.csv"))
    live.resume({pose: (0.0, 1e-3 * shown[pose]) for pose in ids})
    return 1.05e3 * live.estimate.history[-1].at_most


@pytest.mark.long
def test_ball_by_ball(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = load_cell("kuka-kr6-r700/trical").path.read_text()
    text = text.partition("\n[plan]\n")[0]
    text += '\n[plan]\nfree = ["tool"]\nindex = "O1"\ncandidates = 600\nposes = 24\nvalidate = 4\nrepeat = 2\n'
    (tmp_path / "cell.toml").write_text(text)
    plan, centre, found = commands(HEAD, {"kuka-kr6-r700/trical": "cell.toml", "0.1": 0.3})
    at = centre.index("--robot")
    centre[at : at + 4] = ["--simulate"]
    for words in (plan, centre, [*found, "--no-trace"]):
        done = edbb(*words)
        assert done.returncode == 0, done.stderr
        if words is centre:
            assert "0.3 mm is reached" in done.screen
            assert "passed by, the goal is reached" in done.screen
    assert limit_mm("calibrated") < 0.3
