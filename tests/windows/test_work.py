"""The page on the PC at the robot, walked to its end in the unzipped folder: its commands, and Linux's figures."""

import json
import os
import re
import threading
import time

import numpy as np
import pytest

from tests.not_everywhere import tty
from tests.test_planning_packages import edbb_without
from tests.windows.wine import PATIENCE_S

pytestmark = pytest.mark.long
HASH = re.compile(r'"[0-9a-f]{8,}"|(?<![.\d])\b[0-9a-f]{12,}\b')
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SAME_BYTES = ("run.csv", "calibrated/residuals.csv", "p.dat", "imported.csv", "history/history.csv")
"""What is written from the plan alone; elsewhere two libraries of linear algebra differ in the last digits."""
WITHIN = 1e-4  # of each number of identification.json, relative
DRAWN, OF_DRAWS = 5e-3, (".release.", ".summary.")  # of what is stated by random draws, whose own error is 2 %
OF_STD = 1e-3  # of its standard deviation: a value that the run does not determine is no zero to the last digit
DIGITS = 1e-5  # relative, and mm or deg: two files of results


def results(folder):
    """What was written into a folder, by its name."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def test_the_walk_writes_the_same_files(walked):
    there, here = walked
    assert results(there) == results(here)
    assert {"calibrated/report.html", "calibrated/robot.toml", "history/report.html", "checked/report.html"} <= results(
        here
    )


@pytest.mark.parametrize("name", SAME_BYTES)
def test_what_follows_from_the_plan_alone_is_the_same_to_the_byte(walked, name):
    there, here = walked
    assert (there / name).read_bytes() == (here / name).read_bytes()


def test_a_program_is_that_of_linux_but_for_what_it_says_of_its_proof(walked):
    """Linux judges the drive anew; without the packages of planning the head says that nobody did."""
    there, here = ((folder / "p.src").read_text(encoding="utf-8") for folder in walked)
    assert "not judged anew" in there.replace("\n; ", " ")
    code = [[line for line in text.splitlines() if not line.startswith(";")] for text in (there, here)]
    assert code[0] == code[1]
    assert len(code[0]) > 100


@pytest.mark.parametrize("name", ["calibrated/robot.toml", "work_corrected.src"])
def test_results_are_those_of_linux(walked, name):
    there, here = (re.sub(HASH, "", (f / name).read_text(encoding="utf-8")) for f in walked)
    assert NUMBER.sub("", there) == NUMBER.sub("", here)
    theirs, ours = (np.array([float(n) for n in NUMBER.findall(text)]) for text in (there, here))
    np.testing.assert_allclose(theirs, ours, rtol=DIGITS, atol=DIGITS)


def std_of(key, entry):
    """Standard deviation of a value of an entry; 0 where it has none."""
    name, _, unit = key.rpartition("_")
    named = ["std"] if key == "value" else [f"std_{unit}", f"{name}_std_{unit}"]
    return next((entry[n] for n in named if n in entry), 0.0)


def differences(theirs, ours, place="", std=0.0):
    """Places where two documents differ: texts, counts and verdicts in any way, numbers by more than they may."""
    if isinstance(ours, dict) and isinstance(theirs, dict) and theirs.keys() == ours.keys():
        for key in ours:
            yield from differences(theirs[key], ours[key], f"{place}.{key}", std_of(key, ours))
    elif isinstance(ours, list) and isinstance(theirs, list) and len(theirs) == len(ours):
        stds = std if isinstance(std, list) else [std] * len(ours)
        for n, parts in enumerate(zip(theirs, ours, stds, strict=True)):
            yield from differences(*parts[:2], f"{place}.{n}", parts[2])
    elif isinstance(ours, float) and isinstance(theirs, float):
        within = DRAWN if place.startswith(OF_DRAWS) else WITHIN
        if abs(theirs - ours) > max(within * abs(ours), OF_STD * std):
            yield place, theirs, ours
    elif theirs != ours:
        yield place, theirs, ours


def test_differences_are_found():
    ours = {"n": 3, "parameters": [{"value": 0.0, "std": 0.1}], "frames": {"at_mm": [1.0, 2.0], "std_mm": [0.1, 0.0]}}
    ours |= {"release": {"at_most_mm": 1.0}}
    assert not list(differences(ours | {"release": {"at_most_mm": 1.004}}, ours))
    for changed, place in (
        ({"n": 4}, ".n"),
        ({"parameters": [{"value": 2e-4, "std": 0.1}]}, ".parameters.0.value"),
        ({"parameters": [{"value": 0.0, "std": 0.1001}]}, ".parameters.0.std"),
        ({"frames": {"at_mm": [1.00009, 2.001], "std_mm": [0.1, 0.0]}}, ".frames.at_mm.1"),
        ({"release": {"at_most_mm": 1.006}}, ".release.at_most_mm"),
    ):
        assert [found[0] for found in differences(ours | changed, ours)] == [place]


def document(folder):
    """What was identified."""
    return json.loads((folder / "calibrated" / "identification.json").read_text(encoding="utf-8"))


def test_the_identification_is_that_of_linux(walked):
    assert list(differences(*map(document, walked))) == []


class ComPort:
    """A gauge at COM5 of Wine: a pseudo-terminal of this machine that sends a length all the time."""

    def __init__(self, wine, length_mm):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        port = wine.prefix / "dosdevices" / "com5"
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(slave))
        self.line, self.on = f"L={length_mm:+10.3f} mm\r\n".encode(), True
        threading.Thread(target=self._send, daemon=True).start()

    def _send(self):
        while self.on:
            os.write(self.master, self.line)
            time.sleep(0.02)


def test_a_gauge_at_a_com_port_is_read(wine, folders):
    """Two poses, and what was measured is in the run; it goes on where it stopped."""
    there, _ = folders
    lengths = {p["id"]: p["length_mm"] for p in json.loads((there / "mine" / "plan.json").read_text())["poses"]}
    first = min(lengths)
    port = ComPort(wine, lengths[first] + 0.25)
    words = ("measure", "mine/plan.json", "--serial-port", "COM5", "-o", "measured.csv")
    try:
        said = wine.edbb(*words, cwd=there, input=b"\r\nq\r\n", timeout=300)
    finally:
        port.on = False
    assert f"{lengths[first] + 0.25:.3f} mm" in said
    assert f"{lengths[first] + 0.25:.3f}" in (there / "measured.csv").read_text()


def test_planning_says_what_to_do(wine, folders):
    there, _ = folders
    said = wine.edbb("plan", "kuka-kr6-r700/edbb", "-o", "no", cwd=there, code=4)
    assert "--server URL" in said
    assert "WSL" in said
    assert not (there / "no").exists()


@pytest.mark.skipif(not os.environ.get("EDBB_ALL_TRIALS"), reason="a quarter of an hour, with EDBB_ALL_TRIALS")
def test_the_demo_walks_from_the_shipped_plan(wine, folders):
    """As on Linux where the packages of planning cannot be imported."""
    there, here = (folder / "trial" for folder in folders)
    for folder in (there, here):
        folder.mkdir()
    said = wine.edbb("demo", "--no-open", cwd=there, timeout=3 * PATIENCE_S)
    assert "packages of planning are not installed here" in said
    done = edbb_without("demo", "--no-open", cwd=here)
    assert done.returncode == 0, done.stderr
    assert results(there) == results(here)
    runs = [(f / "demo" / "run.csv").read_text("utf-8") for f in (there, here)]
    numbers = [np.array(re.findall(r"-?\d+\.\d+", run), dtype=float) for run in runs]
    np.testing.assert_allclose(*numbers, atol=2e-6)  # the last digit of a reading
    assert list(differences(*(document(f / "demo") for f in (there, here)))) == []


def test_a_linux_pc_plans_for_it(wine, folders, tmp_path):
    """``--server``: the plan of a Linux PC lies in the folder of the PC that asked."""
    from tests.service.test_cell_side import Service
    from tests.workflow.conftest import FEWER, small_cell

    there, _ = folders
    small_cell("kuka-kr6-r700/edbb", there / "mine", *FEWER)
    service = Service(tmp_path).begin()
    words = ("plan", "mine/edbb.toml", "--poses", "30", "-o", "far")
    try:
        wine.edbb("--server", service.address, *words, cwd=there, timeout=900)
    finally:
        service.cut()
    assert {"plan.json", "report.html", "cell.toml"} <= {p.name for p in (there / "far").iterdir()}


def test_the_folder_has_the_licences_of_all_that_is_in_it(wine):
    site, licences = wine.python.parent / "Lib" / "site-packages", wine.program / "licences"
    names = [info.name.removesuffix(".dist-info") for info in site.glob("*.dist-info")]
    assert len(names) > 40
    texts = {name: "".join(p.read_text(errors="replace") for p in (licences / name).iterdir()) for name in names}
    assert [name for name, text in texts.items() if len(text) < 500] == []  # the shortest licence has 30 lines
    assert "PYTHON SOFTWARE FOUNDATION LICENSE" in (licences / "Python.txt").read_text()
    assert list(licences.glob("distlib-*/*"))  # of the launcher
