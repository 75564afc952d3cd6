"""Wine with the unzipped folder, once for all tests here. ``EDBB_WINE`` names a folder in which it stays."""

import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.command import edbb
from tests.docs.test_pages import PAGES, commands
from tests.windows.wine import ROOT, Wine, build_folder, require_wine

PLAN = ROOT / "tests" / "data" / "kr6-plan"
PART = "DEF part ( )\n  PTP {A1 10,A2 -80,A3 95,A4 5,A5 40,A6 0} C_PTP\nEND\n"
TRUTH = """schema = "edbb-truth/1"
[errors]
a2_mm = 0.8
theta3_deg = 0.05
d4_mm = -0.4
[[effects]]
kind = "encoder once a turn"
on = "joint 3"
value = 300
unit = "urad"
[noise]
gauge_um = 1.0
repeatability_mm = 0.01
"""
"""A robot with the fault that ``edbb demo`` hides: what that command does after it has planned."""
MORE = (
    ("export", "mine/plan.json", "--dialect", "krl", "-o", "p.src"),
    ("check", "run.csv", "--plan", "mine/plan.json", "--model", "calibrated", "-o", "checked"),
    ("import", "axes.log", "gauge.log", "--map", "map.toml", "-o", "imported.csv"),
)


@pytest.fixture(scope="session")
def wine(tmp_path_factory):
    """The program for Windows, unzipped; skips where there is no Wine."""
    require_wine()
    kept = os.environ.get("EDBB_WINE")
    folder = Path(kept) if kept else tmp_path_factory.mktemp("wine")
    folder.mkdir(exist_ok=True)
    of_before = (folder / "prefix").is_dir()
    made = Wine(folder, next(folder.glob("edbb-*-windows.zip"), None) or build_folder(folder))
    if of_before:
        made.renew()
    yield made
    made.stop()


@pytest.fixture(scope="session")
def folders(wine, tmp_path_factory):
    """Two folders with the same files, of Windows and of Linux: a plan that was made elsewhere, and a program."""
    there, here = wine.home / "Köln Zelle 3", tmp_path_factory.mktemp("linux")
    shutil.rmtree(there, ignore_errors=True)
    for folder in (there, here):
        shutil.copytree(PLAN, folder / "mine")
        (folder / "work.src").write_text(PART)
        (folder / "truth.toml").write_text(TRUTH)
        (folder / "axes.log").write_text("".join(f"0.{k};{k};-90;90;0;45;{k}\n" for k in range(10)))
        (folder / "gauge.log").write_text("".join(f"0.{k};300.{k}\n" for k in range(10)))
        (folder / "map.toml").write_text(release_map())
    return there, here


def release_map():
    """The column map with which the release is tried."""
    return re.search(r"<<'MAP'\n(.*?)^MAP$", (ROOT / ".ci" / "release").read_text(), re.DOTALL | re.MULTILINE)[1]


@pytest.fixture(scope="session")
def walked(wine, folders):
    """Both folders after all that the page does, in its order; the run is simulated in place of the gauge."""
    there, here = folders
    page = [
        words for words in commands(PAGES["docs/how-to/windows.md"]) if words[0] in ("identify", "compensate", "record")
    ]
    assert [words[0] for words in page] == ["identify", "compensate", "record"]
    simulated = ("simulate", "mine/plan.json", "--truth", "truth.toml", "--seed", "1", "-o", "run.csv")
    for words in [simulated, *page, *MORE]:
        wine.edbb(*words, cwd=there, timeout=1200)
        done = edbb(*words, cwd=here)
        assert done.returncode == 0, done.screen
    return there, here


@pytest.fixture(scope="session")
def judged(tmp_path_factory):
    """A folder of what other commands judge, their paths planned on Linux, and what they wrote of an earlier run."""
    from tests.accuracy.worlds import poses, tracker_run
    from tests.circular.conftest import ARC, cell_file
    from tests.loaded import world

    folder, arm = tmp_path_factory.mktemp("judged"), world.arm()
    cell_file(folder, ARC + "speed_mm_s = 150\n")
    way = world.course(arm, repeats=1)
    for k in (1, 2):
        readings = world.readings(arm, world.World(), way, np.random.default_rng(k))[0]
        (folder / f"loaded{k}.csv").write_text(world.run_text(way, readings))
        (folder / f"v{k}.csv").write_text(tracker_run(poses(seed=k)))
    second = (PLAN / "cell.toml", "--plan", PLAN / "plan.json", "--geometry")
    for words in (
        ("plan", "circular.toml", "--dialect", "krl", "-o", "ring"),
        *(("simulate", "ring/plan.json", "--seed", str(k), "-o", f"ring{k}.csv") for k in (1, 2)),
        ("circular", "ring1.csv", "--plan", "ring/plan.json", "-o", "circular"),
        ("loaded", "loaded1.csv", "--cell", "abb-irb6700/ldbb", "-o", "loaded"),
        ("accuracy", "v1.csv", "--cell", "kuka-kr6-r700/tracker", "-o", "accuracy"),
        ("simulate", PLAN / "plan.json", "--seed", "2", "-o", "second.csv"),
        ("identify", "second.csv", "--cell", *second, "-o", "second"),
        ("plan", "kuka-kr6-r700/trical", "--poses", "32", "-o", "trical"),
        ("centre", "trical/plan.json", "--program-to", "centring"),
        ("centre", "trical/plan.json", "--simulate", "-o", "balls.csv"),
    ):
        done = edbb(*words, cwd=folder)
        assert done.returncode == 0, done.stderr
    (folder / "fleet.toml").write_text("# of yesterday\n")
    journal = folder / "balls.csv.journal"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-1]))  # one ball is left
    return folder
