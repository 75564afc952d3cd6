"""The tutorials are followed to the letter: every command of each, in its order, in one folder.

What a person brings stands ready: a robot that is simulated in place of the real one, the programs that are to be
corrected, and smaller cells in place of those whose plans take minutes. What needs a gauge at a port is passed over.
"""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from tests.command import edbb
from tests.docs.test_pages import PAGES, ROOT, commands
from tests.golden.cases import shipped

FEW = "candidates = 500\nposes = {poses}\nvalidate = 4\nrefine = false"
POSES = {"panda/tracker": 24, "so101/sockets": 42}  # of the small cells, else 36
KR6_POSE, NJ130_POSE = "A1 10,A2 -80,A3 95,A4 5,A5 40,A6 0", "A1 10,A2 10,A3 5,A4 5,A5 -80,A6 0"
KRL = f"DEF part ( )\n  PTP {{{KR6_POSE}}} C_PTP\nEND\n"
UR = "def part():\n  movej([0.1, -1.4, 1.5, -1.6, -1.5, 0.2], a=1.0, v=0.5)\nend\n"
BY_HAND = {"measure"}  # needs a gauge
SLOW = "tests/data/ur5-tracker/run.csv"  # is traced by tests/identification/test_real.py


def small(name, folder):
    """A shipped cell with few candidates and poses, as a file."""
    path = folder / f"{name.replace('/', '-')}.toml"
    path.write_text(shipped(name, plan=FEW.format(poses=POSES.get(name, 36))))
    return str(path)


def prepare(folder):
    """Lay what a person brings."""
    for name in ("tests", "examples"):
        (folder / name).symlink_to(ROOT / name)
    (folder / "work.src").write_text(KRL)
    (folder / "program.src").write_text(KRL.replace(KR6_POSE, NJ130_POSE))
    (folder / "program.script").write_text(UR)
    home = np.rad2deg(load_cell("so101/sockets", planning=False).home)
    titles = ",".join(f"q{k}_deg" for k in range(1, len(home) + 1))
    (folder / "targets.csv").write_text(f"{titles}\n{','.join(f'{v + 3:.3f}' for v in home)}\n")
    data = ROOT / "tests" / "data" / "panda-ball"
    for mine, theirs in (("front", "front_center"), ("left", "front_left"), ("right", "front_right")):
        shutil.copy(data / f"{theirs}.csv", folder / f"{mine}.csv")
    cell = (ROOT / "examples" / "panda_ball.toml").read_text()
    (folder / "panda_ball.toml").write_text(cell.replace("../tests", "tests"))
    rows = [line for line in (ROOT / SLOW).read_text().splitlines() if not line.startswith("#")][:40]
    foreign = [";".join(line.split(",")).replace(".", ",") for line in rows[1:]]
    titles = ";".join(["Nr.", *(f"Achse {k} [°]" for k in range(1, 7)), *(f"Tracker {a} [mm]" for a in "XYZ")])
    (folder / "Messung Halle 3.csv").write_text("\n".join([titles, *foreign]) + "\n", encoding="utf-8")


def typed(words, folder):
    """The words as they are typed here; a run that a person would measure is simulated first."""
    words = [small(w, folder) if re.fullmatch(r"[a-z0-9-]+/(edbb|tracker|sockets)", w) else w for w in words]
    if words[0] == "identify":
        words += [] if words[1] != SLOW else ["--no-trace"]
        if not Path(words[1]).exists():
            simulated = edbb("simulate", words[words.index("--plan") + 1], "-o", words[1], cwd=folder)
            assert simulated.returncode == 0, simulated.stderr
    if words[:2] == ["plan", "cell.toml"]:
        shutil.copy("kuka/cell.toml", "cell.toml")
    return words


@pytest.mark.long
@pytest.mark.parametrize("tutorial", ["kuka-bar", "panda", "so101", "ur5-real-run"])
def test_a_tutorial_is_done_as_it_is_written(tutorial, tmp_path, monkeypatch):
    prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    done = []
    for words in commands(PAGES[f"docs/tutorials/{tutorial}.md"]):
        if words[0] in BY_HAND or words[:2] == ["import", "KUKA_KR6_R700_CELL.dat"]:
            continue
        words = typed(words, tmp_path)
        told = edbb(*words, cwd=tmp_path)
        if words[0] == "import" and not done.count("import"):  # the first time the map is written, to be looked at
            assert (told.returncode, Path("map.toml").exists()) == (2, True), told.stderr
            told = edbb(*words, cwd=tmp_path)
        assert told.returncode == 0, f"edbb {' '.join(words)}: {told.stderr}"
        done.append(words[0])
    assert "identify" in done
    for cell in ("kr10/robot.toml", "kr10/edbb.toml") if tutorial == "kuka-bar" else ():
        assert Path(cell).is_file()


def test_the_screen_of_the_kuka_page_is_what_the_program_says(tmp_path):
    page, said = PAGES["docs/tutorials/kuka-bar.md"], ""
    (shown,) = re.findall(r"^```text\n(  drawn .*?)^```", page, re.MULTILINE | re.DOTALL)
    for words in commands(page):
        if words[0] == "robots":
            done = edbb(*words, cwd=tmp_path)
            assert done.returncode == 0, done.stderr
            said += done.stdout
    assert shown in said
    assert (tmp_path / "kr10.svg").read_text().startswith("<svg")


def test_every_tutorial_is_followed():
    followed = test_a_tutorial_is_done_as_it_is_written.pytestmark[0].args[1]
    assert {f"docs/tutorials/{name}.md" for name in followed} == {p for p in PAGES if p.startswith("docs/tutorials/")}


def test_the_run_that_is_shown_is_the_one_that_lies_there():
    (shown,) = re.findall(r"^```csv\n(t_s,.*?)^```", PAGES["docs/tutorials/ur5-real-run.md"], re.MULTILINE | re.DOTALL)
    assert (ROOT / SLOW).read_text().startswith(shown.rstrip("\n"))
