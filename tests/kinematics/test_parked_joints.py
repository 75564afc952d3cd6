"""Links beside the chain stand where their joints do: against pinocchio, which reads the same URDF by itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.robot import Robot
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.urdf_writer import write_urdf
from planner.motion.collision.scene import build_scene
from tests.not_everywhere import pin

SHAPE = '<collision><origin xyz="0.01 0.02 0.03" rpy="0.1 0.2 0.3"/><geometry><box size="0.02 0.03 0.04"/></geometry>'
LINK = '<link name="{}">' + SHAPE + "</collision></link>"
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="0.02 -0.1 0.2" '
    'rpy="0.3 -0.2 {turn}"/><axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="1" effort="1"/>'
    "{more}</joint>"
)
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
BESIDE = (  # name, kind, parent, child, axis, limits, mimic
    ("head_pan", "revolute", "l0", "head", "0 0.6 0.8", -1, 1, ""),
    ("head_tilt", "continuous", "head", "face", "1 0 0", 0, 0, ""),
    ("arm2", "revolute", "l0", "upper2", "0 1 0", 0.5, 1.5, ""),  # 0 is outside: it stands at 1
    ("jaw", "prismatic", "l6", "left", "0 1 0", 0, 0.04, ""),
    ("jaw2", "prismatic", "l6", "right", "0 -1 0", 0, 0.04, '<mimic joint="jaw" multiplier="-0.5" offset="0.01"/>'),
    ("elbow_motor", "revolute", "l2", "motor", "1 1 0", -1, 1, ""),
)
PARKED = {"head_pan_deg": 20.0, "head_tilt_deg": -30.0, "jaw_mm": 25.0, "elbow_motor_deg": -10.0}
STANDS = {"head_pan": np.deg2rad(20), "head_tilt": np.deg2rad(-30), "arm2": 1.0, "jaw": 0.025, "jaw2": -0.0025}
STANDS |= {"elbow_motor": np.deg2rad(-10)}
CARRIED = {"head": 0, "face": 0, "upper2": 0, "left": 6, "right": 6, "motor": 2}


def joint(name: str, kind: str, parent: str, child: str, axis: str, low: float, high: float, more: str = "") -> str:
    return JOINT.format(
        name=name, kind=kind, parent=parent, child=child, axis=axis, low=low, high=high, more=more, turn=len(name) / 10
    )


def tree() -> str:
    joints = [joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", axis, -2, 2) for k, axis in enumerate(AXES)]
    joints += [joint(*row) for row in BESIDE]
    names = [*(f"l{k}" for k in range(7)), *CARRIED]
    return f'<robot name="tree">{"".join(map(LINK.format, names))}{"".join(joints)}</robot>'


def write_robot(folder: Path, *lines: str) -> Path:
    (folder / "tree.urdf").write_text(tree())
    head = 'schema = "edbb-robot/1"\nname = "tree"\nconvention = "urdf"\nurdf = "tree.urdf"\ntip = "l6"\n'
    (folder / "robot.toml").write_text(head + "\n".join(lines))
    return folder / "robot.toml"


def parked_lines() -> list[str]:
    return ["[parked]", *(f"{key} = {value}" for key, value in PARKED.items())]


def poses_of_bodies(robot: Robot, q: np.ndarray) -> dict[str, np.ndarray]:
    frames = robot.chain.frames(robot.theta(q[None]), robot.link_end)
    out = {}
    for link, body in robot.bodies:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = frames[link][0][:, :, -1], frames[link][1][:, -1]
        out[body.part] = T @ body.T
    return out


def poses_by_pinocchio(xml: str, values: dict[str, float]) -> dict[str, np.ndarray]:
    model = pin.buildModelFromXML(xml)
    geometry = pin.buildGeomFromUrdfString(model, xml, pin.GeometryType.COLLISION)
    q = pin.neutral(model)
    for name, value in values.items():
        j = model.joints[model.getJointId(name)]
        q[j.idx_q : j.idx_q + j.nq] = [np.cos(value), np.sin(value)] if j.nq == 2 else [value]
    data, placed = model.createData(), geometry.createData()
    pin.updateGeometryPlacements(model, data, geometry, placed, q)
    names = [g.name.rpartition("_")[0] for g in geometry.geometryObjects]
    return {name: T.homogeneous for name, T in zip(names, placed.oMg, strict=True)}


def driven(q: np.ndarray) -> dict[str, float]:
    return {f"j{k}": float(v) for k, v in enumerate(q)}


def test_every_link_stands_where_pinocchio_has_it(tmp_path: Path) -> None:
    robot = load_robot(write_robot(tmp_path, *parked_lines()))
    assert robot.n_joints == 6
    assert robot.unchecked_links == ()
    for q in np.random.default_rng(0).uniform(-2, 2, (20, 6)):
        own, other = poses_of_bodies(robot, q), poses_by_pinocchio(tree(), driven(q) | STANDS)
        assert own.keys() == other.keys()
        for name in own:
            np.testing.assert_allclose(own[name], other[name], atol=1e-12, err_msg=name)
    assert {b.part: link for link, b in robot.bodies if b.branch} == CARRIED


def test_what_stands_where_is_stated(tmp_path: Path) -> None:
    robot = load_robot(write_robot(tmp_path, *parked_lines()))
    told = {j.name: (round(j.value, 9), j.unit, j.why) for j in robot.parked}
    assert told["jaw"] == (0.025, "mm", "")
    assert told["jaw2"] == (-0.0025, "mm", "moved by jaw")
    assert told["arm2"] == (1.0, "deg", "the middle of its stroke")
    assert told["head_pan"] == (round(np.deg2rad(20), 9), "deg", "")
    cell_first = load_robot(tmp_path / "robot.toml", parked={"jaw_mm": 5.0})
    assert {j.name: j.value for j in cell_first.parked}["jaw"] == pytest.approx(0.005)


def test_a_joint_of_the_chain_that_is_parked_is_no_axis(tmp_path: Path) -> None:
    robot = load_robot(write_robot(tmp_path, "[parked]", "j1_deg = 40"))
    assert robot.joint_names == ("j0", "j2", "j3", "j4", "j5")
    q = np.array([0.3, -0.4, 0.5, 0.6, -0.7])
    other = poses_by_pinocchio(
        tree(), {"arm2": 1.0, "jaw2": 0.01, **{k: float(v) for k, v in zip(robot.joint_names, q, strict=True)}}
        | {"j1": np.deg2rad(40)},
    )  # fmt: skip
    for name, T in poses_of_bodies(robot, q).items():
        np.testing.assert_allclose(T, other[name], atol=1e-12, err_msg=name)


def test_a_corrected_urdf_moves_as_the_corrected_chain_does(tmp_path: Path) -> None:
    """Also where the corrected joint is one that stands still."""
    path = write_robot(tmp_path, "[parked]", "j1_deg = 40")
    robot = load_robot(path)
    rng, values = np.random.default_rng(1), {}
    for t in robot.transforms:
        if not t.fixed and t.joint is None:
            values[t.name] = t.nominal + float(rng.normal(scale=1e-3))
    text, _ = write_urdf(tmp_path / "tree.urdf", "l6", values, {}, "corrected", robot.packages, {"j1_deg": 40.0})
    moved = replace(
        robot, transforms=tuple(replace(t, nominal=values.get(t.name, t.nominal)) for t in robot.transforms)
    )
    q = np.array([0.3, -0.4, 0.5, 0.6, -0.7])
    said = {k: float(v) for k, v in zip(robot.joint_names, q, strict=True)} | {"j1": np.deg2rad(40)}
    other = poses_by_pinocchio(text.partition("-->")[2].strip(), said)
    np.testing.assert_allclose(poses_of_bodies(moved, q)["l6"], other["l6"], atol=1e-11)


def test_fingers_are_checked_against_the_link_before_theirs(tmp_path: Path) -> None:
    robot = load_robot(write_robot(tmp_path))
    scene = build_scene(replace(load_cell("ur10/edbb"), robot=robot))
    found = [{scene.pieces[k].body.part for k in pair} for pair in scene.pairs]
    assert {"left", "l5"} in found
    assert {"head", "l1"} in found
    assert {"l6", "l5"} not in found  # neighbours of the chain
    assert {"left", "right"} not in found  # which do not move against each other
    named = load_robot(write_robot(tmp_path, 'never_meet = [["l5", "left"], [2, 4]]', 'never_meet_reason = "crude"'))
    scene = build_scene(replace(load_cell("ur10/edbb"), robot=named))
    left = [p for p in found if p not in [{scene.pieces[k].body.part for k in pair} for pair in scene.pairs]]
    assert sorted(map(sorted, left)) == [["l2", "l4"], ["l5", "left"]]


def checked_parts(robot: Robot) -> list[set[str]]:
    scene = build_scene(replace(load_cell("ur10/edbb"), robot=robot))
    return [{scene.pieces[k].body.part for k in pair} for pair in scene.pairs]


def test_what_a_fixed_joint_holds_is_one_with_its_link(tmp_path: Path) -> None:
    plate = LINK.format("plate") + joint("bolts", "fixed", "l6", "plate", "0 0 1", 0, 0)
    (tmp_path / "tree.urdf").write_text(tree().replace("</robot>", plate + "</robot>"))
    found = checked_parts(load_robot(tmp_path / "tree.urdf", tip="l6"))
    assert {"plate", "l5"} not in found
    assert {"plate", "l4"} in found


def test_a_joint_that_stands_still_makes_two_links_no_neighbours_of_one(tmp_path: Path) -> None:
    found = checked_parts(load_robot(write_robot(tmp_path, "[parked]", "j1_deg = 40")))
    assert {"l0", "l1"} not in found  # j0 is driven
    assert {"l0", "l2"} in found  # l2 moves with l1
    assert {"l2", "l3"} not in found
    assert {"l1", "l3"} in found


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("jaw_deg = 3", r"parked\.jaw_deg names no joint .*did you mean \"jaw_mm\""),
        ("jaw = 3", r"parked\.jaw names no joint .*did you mean \"jaw_mm\""),
        ("jaw_mm = 41", r"parked\.jaw_mm: 41 mm lies beyond its limits, 0 mm to 40 mm"),
        ("jaw2_mm = 1", r"moved by 'jaw'"),
        ("head_pan_deg = 60", r"60 deg lies beyond"),
    ],
)
def test_a_place_that_cannot_be_is_refused(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_robot(write_robot(tmp_path, "[parked]", line))


def test_a_link_that_a_driven_joint_moves_is_listed(tmp_path: Path) -> None:
    text = tree().replace('<mimic joint="jaw"', '<mimic joint="j3"')
    (tmp_path / "tree.urdf").write_text(text)
    robot = load_robot(tmp_path / "tree.urdf", tip="l6")
    assert robot.unchecked_links == (("right", "moved by joint 'j3'"),)


@pytest.mark.parametrize(("other", "said"), [("jaw2", "move each other"), ("nobody", "no joint that moves")])
def test_joints_that_follow_nobody_are_refused(tmp_path: Path, other: str, said: str) -> None:
    (tmp_path / "tree.urdf").write_text(tree().replace('<mimic joint="jaw"', f'<mimic joint="{other}"'))
    with pytest.raises(InputError, match=said):
        load_robot(tmp_path / "tree.urdf", tip="l6")


def test_rows_have_no_joints_to_park() -> None:
    with pytest.raises(InputError, match="of a URDF only"):
        load_robot("ur10", parked={"jaw_mm": 3.0})
