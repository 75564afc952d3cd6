"""A path that is called proven drives no link into another: all links, by pinocchio and coal from the URDF alone."""

import csv
import json
from itertools import pairwise

import numpy as np
import pytest

from tests.command import edbb
from tests.not_everywhere import pin
from tests.workflow.test_unchecked_links import cell_of, fixed, whole_arm

pytestmark = pytest.mark.long  # a whole plan


STEP = np.deg2rad(0.1)  # of the axis that moves most, between two states that are checked
BOX = '<link name="{}"><collision><origin xyz="{}"/><geometry><box size="{}"/></geometry></collision></link>'
LIMITS = '<limit lower="{}" upper="{}" velocity="1" effort="1"/>'
SECOND = (  # an arm beside the fixture, parked upright: folded, as at 0, it would lie across the table
    '<link name="column"/>'
    f"{fixed('stand', 'l0', 'column')}"
    + BOX.format("second_arm", "0.35 0 0", "0.7 0.08 0.08")
    + '<joint name="shoulder2" type="revolute"><parent link="column"/><child link="second_arm"/>'
    '<origin xyz="0.95 0.4 0.05"/><axis xyz="0 1 0"/>' + LIMITS.format(-3, 3) + "</joint>"
)
HAND = (
    BOX.format("hand", "-0.06 0 0.03", "0.04 0.12 0.06") + fixed("wrist", "tip", "hand")
    + BOX.format("left", "-0.06 0 0.11", "0.02 0.02 0.12") + BOX.format("right", "-0.06 0 0.11", "0.02 0.02 0.12")
    + '<joint name="grip" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>'
    + LIMITS.format(0, 0.1)
    + '</joint><joint name="grip2" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>'
    + LIMITS.format(0, 0.1) + '<mimic joint="grip"/></joint>'
)  # fmt: skip
PARKED = "\n[parked]\nshoulder2_deg = -90\ngrip_mm = 50\n"
STANDS = {"shoulder2": -np.pi / 2, "grip": 0.05, "grip2": 0.05}


NEXT_TO_EACH_OTHER = [{f"l{k}_0", f"l{k + 1}_0"} for k in range(1, 6)]  # as pinocchio calls the links' shapes
HAND_LINKS = {"l6_0", "hand_0", "left_0", "right_0"}  # which do not move against each other


def crowded_text() -> str:
    return whole_arm().replace("</robot>", SECOND + HAND + "</robot>")


def driven_states(path) -> np.ndarray:
    """The driven path, at steps of 0.1 degree."""
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    q = np.deg2rad([[float(row[f"q{j}_deg"]) for j in range(1, 7)] for row in rows])
    parts = [
        np.linspace(a, b, 1 + int(np.ceil(np.abs(b - a).max() / STEP)), endpoint=False)
        for a, b in pairwise(q) if (a != b).any()
    ]  # fmt: skip
    return np.vstack([*parts, q[-1:]])


def meetings(text: str, q: np.ndarray) -> dict[str, int]:
    """At how many states two links overlap that no joint joins."""
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    geometry.addAllCollisionPairs()
    arm = [model.joints[model.getJointId(f"j{k}")].idx_q for k in range(6)]
    full = np.tile(pin.neutral(model), (len(q), 1))
    full[:, arm] = q
    for name, value in STANDS.items():
        full[:, model.joints[model.getJointId(name)].idx_q] = value
    for k in reversed(range(len(geometry.collisionPairs))):
        pair = geometry.collisionPairs[k]
        names = {geometry.geometryObjects[i].name for i in (pair.first, pair.second)}
        if names in NEXT_TO_EACH_OTHER or names < HAND_LINKS:
            geometry.removeCollisionPair(pair)
    data, placed = model.createData(), geometry.createData()
    found: dict[str, int] = {}
    for state in full:
        pin.computeCollisions(model, data, geometry, placed, state, False)
        for k, result in enumerate(placed.collisionResults):
            if result.isCollision():
                pair = geometry.collisionPairs[k]
                name = " and ".join(geometry.geometryObjects[i].name for i in (pair.first, pair.second))
                found[name] = found.get(name, 0) + 1
    return found


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crowd")
    path = cell_of(folder, crowded_text())
    path.write_text(path.read_text() + PARKED)
    done = edbb("plan", path, "-o", folder / "out", "--poses", 25, "--dialect", "poses-csv")
    return folder, done


def test_no_link_meets_another_on_the_way(planned):
    folder, done = planned
    assert done.returncode == 0, done.stderr
    q = driven_states(folder / "out" / "trajectory.csv")
    assert len(q) > 5000
    assert meetings(crowded_text(), q) == {}


def test_plan_and_report_say_where_they_stand(planned):
    folder, done = planned
    plan = json.loads((folder / "out" / "plan.json").read_text())
    (note,) = [n for n in plan["notes"] if "stand still" in n]
    for said in ("shoulder2 at -90 deg", "grip at 50 mm", "grip2 at 50 mm (moved by grip)"):
        assert said in note
        assert said in done.screen
        assert said in (folder / "out" / "report.html").read_text()


def test_a_plan_of_another_place_is_not_the_same_plan(planned):
    folder, _ = planned
    cell = folder / "out" / "cell.toml"
    text = cell.read_text()
    assert "shoulder2_deg = -90" in text
    cell.write_text(text.replace("shoulder2_deg = -90", "shoulder2_deg = -130"))
    try:
        exported = edbb("export", folder / "out" / "plan.json", "--dialect", "poses-json", "-o", folder / "again.json")
    finally:
        cell.write_text(text)
    assert exported.returncode != 0
    assert "second_arm" in exported.screen or "cell.toml" in exported.screen
