"""Sessions as the planner plans them: its fixtures, its poses in its order, and the time that its path takes."""

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from planner.cell.reading import load_cell
from planner.common.progress import Stages
from planner.session.options import PlanOptions
from planner.session.plan_types import Plan
from planner.workflow.planning import plan_cell
from tests.reproduction.truth import TOOL_COM_MM, TOOL_KG

SECOND_POINT = 'points = [{ name = "2", map_mm = [-60, 40, 90] }]'
QUIET = Stages(lambda *_: None)


@dataclass(frozen=True)
class Stop:
    """Poses at one place of the gauge in the order in which they are driven, (n, N) [rad]; where the gauge is there."""

    q: np.ndarray
    fixture: str
    fixture_mm: tuple
    point: str
    map_mm: tuple


def of_bar(fixtures, points, poses, aim) -> Plan:
    """Plan a session with a bar of 300 to 520 mm about ``fixtures`` fixtures, at ``points`` tool points."""
    text = _shipped("edbb")
    text = text.replace("mass_kg = 1.3", f"mass_kg = {TOOL_KG}").replace(
        "com_mm = [10, 0, 45]", f"com_mm = {TOOL_COM_MM}"
    )
    if points > 1:
        text = text.replace("[tool]\n", f"[tool]\n{SECOND_POINT}\n")
    text = text.replace("[controller]", "[plan]\ncandidates = 6000\nvalidate = 0\n\n[controller]")
    return _planned(text, PlanOptions(poses=poses, fixtures=fixtures, aim=aim))


@cache
def of_tracker(poses, validate) -> Plan:
    """Plan ``poses`` chosen and ``validate`` random poses of a reflector in the head's socket, all of them in sight."""
    text = _shipped("tracker").replace("validate = 500", f"validate = {validate}")
    return _planned(text.replace("candidates = 20000", "candidates = 6000"), PlanOptions(poses=poses))


def stops(made: Plan, *roles) -> list[Stop]:
    """The poses of a plan that are there for ``roles``, place by place."""
    out = []
    for drive in made.drives:
        q = np.array([v.q for v in drive.visits if v.role in roles])
        here, place = made.cell.at(drive.mounting), made.cell.fixtures[drive.mounting.fixture]
        at = (_mm(place.p_BX), made.cell.names_of(drive.mounting)[1], _mm(here.tool.p_FM))
        if len(q):
            out.append(Stop(q, place.name, *at))
    return out


def _mm(p):
    return tuple(round(float(v) * 1e3, 6) for v in p)


def _shipped(name):
    return load_cell(f"kuka-kr6-r700/{name}").path.read_text()


def _planned(text, options) -> Plan:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cell.toml"
        path.write_text(text)
        return plan_cell(load_cell(str(path)), options, QUIET)
