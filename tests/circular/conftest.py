"""A small circular test, planned once: a circle and a half circle about the fixture of the NJ-130's shipped cell."""

import pytest

from planner.cell.reading import load_cell
from planner.circular.planning import plan_circles
from planner.common.progress import Stages
from planner.session.options import PlanOptions

ARC = """
[[circles]]
name = "arc"
plane = "XZ"
radius_mm = 350
start_deg = 60
sweep_deg = 60
"""


def cell_text(circles):
    """The shipped cell with other circles."""
    text = load_cell("comau-nj130/circular").path.read_text()
    begin, end = text.index("[[circles]]"), text.index("[motion]")
    return text[:begin] + circles + text[end:]


def cell_file(folder, circles, *changes):
    text = cell_text(circles)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "circular.toml"
    path.write_text(text)
    return path


def quiet():
    return Stages(lambda *_: None)


@pytest.fixture(scope="session")
def planned(tmp_path_factory):
    circles = (
        '\n[[circles]]\nname = "round"\nradius_mm = 350\nstart_deg = 180\nspeed_mm_s = 100\novershoot_deg = 10\n' + ARC
    )
    path = cell_file(tmp_path_factory.mktemp("cell"), circles)
    return plan_circles(load_cell(str(path)), PlanOptions(dialect=("krl", "rapid", "din66025", "bnr")), quiet())
