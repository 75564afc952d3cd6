"""An arm that is a part of a tree: ``base`` and ``tip`` choose it, ``[parked]`` holds the rest; against pinocchio."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.urdf_writer import write_urdf
from tests.not_everywhere import pin
from tests.workflow.conftest import small_cell

LINKS = ("world", "platform", "column", "carriage", "head", *(f"l{k}" for k in range(1, 7)), "tool")
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="{4}" rpy="{5}"/>'
    '<axis xyz="{6}"/><limit lower="{7}" upper="{8}" velocity="1" effort="1"/></joint>'
)
LIFT = 0.2  # [m] where the lift stands
TOML = 'schema = "edbb-robot/1"\nname = "lifted"\nconvention = "urdf"\nurdf = "lifted.urdf"\ntip = "tool"\n'


def lifted() -> str:
    """A platform that turns, a column on it with a lift, a head and an arm of six joints on the carriage."""
    names = ["carriage", *LINKS[5:11]]
    arm = zip(range(1, 7), pairwise(names), AXES, strict=True)
    joints = [
        ("turn", "revolute", "world", "platform", "0.1 0.2 0.3", "0.1 0 0.3", "0 0 1", -1, 1),
        ("foot", "fixed", "platform", "column", "0.3 -0.1 0.2", "0.2 0.1 -0.4", "0 0 1", 0, 0),
        ("lift", "prismatic", "column", "carriage", "0.05 0.02 0.5", "0.1 -0.2 0.3", "0 0 1", 0.0, 0.35),
        ("pan", "revolute", "carriage", "head", "0 0 0.4", "0 0 0", "0 0 1", -1, 1),
        *((f"j{k}", "revolute", *ends, "0.02 -0.1 0.25", f"0.3 -0.2 {k / 10}", a, -2, 2) for k, ends, a in arm),
        ("plate", "fixed", "l6", "tool", "0 0.01 0.1", "0.1 0.2 0.3", "0 0 1", 0, 0),
    ]  # fmt: skip
    shape = '<collision><geometry><box size="0.02 0.03 0.04"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{shape}</link>' for name in LINKS)
    return f'<robot name="lifted">{links}{"".join(JOINT.format(*row) for row in joints)}</robot>'


def write(folder: Path, *lines: str) -> Path:
    (folder / "lifted.urdf").write_text(lifted())
    (folder / "robot.toml").write_text(TOML + "\n".join(lines))
    return folder / "robot.toml"


def placed(xml: str, base: str, name: str, values: dict[str, float]) -> np.ndarray:
    """The pose of the link ``name`` in the link ``base``, (4, 4) [m], by pinocchio."""
    model = pin.buildModelFromXML(xml)
    data, q = model.createData(), pin.neutral(model)
    for joint, value in values.items():
        q[model.joints[model.getJointId(joint)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    at = [data.oMf[model.getFrameId(link)] for link in (base, name)]
    return np.asarray(at[0].actInv(at[1]).homogeneous)


@pytest.mark.parametrize("base", ["world", "platform", "column", "carriage"])
def test_the_arm_begins_at_its_base(tmp_path: Path, base: str) -> None:
    path = write(tmp_path, f'base = "{base}"', "[parked]", f"lift_mm = {1e3 * LIFT}", "turn_deg = 20")
    robot = load_robot(path)
    stands = {"lift": LIFT, "turn": np.deg2rad(20.0), "pan": 0.0}
    assert robot.joint_names == tuple(f"j{k}" for k in range(1, 7))
    assert {b.part for _, b in robot.bodies} == set(LINKS)
    for q in np.random.default_rng(0).uniform(-2, 2, (20, 6)):
        said = stands | {f"j{k + 1}": v for k, v in enumerate(q)}
        frames = robot.chain.frames(robot.theta(q[None]), [*robot.link_end, len(robot.chain)])
        np.testing.assert_allclose(frames[-1][1][:, 0], placed(lifted(), base, "tool", said)[:3, 3], atol=1e-12)
        for link, body in robot.bodies:
            R, x = (part[..., -1] for part in frames[link])
            other = placed(lifted(), base, body.part, said)
            np.testing.assert_allclose(x + R @ body.T[:3, 3], other[:3, 3], atol=1e-12, err_msg=body.part)
            np.testing.assert_allclose(R @ body.T[:3, :3], other[:3, :3], atol=1e-12, err_msg=body.part)


def test_a_corrected_urdf_has_the_same_base(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, 'base = "carriage"', "[parked]", "lift_mm = 200"))
    values = {"x3": 0.021, "y4": -0.105}
    text, changed = write_urdf(
        tmp_path / "lifted.urdf", "tool", values, {}, "corrected", parked=robot.parked_table, base="carriage"
    )
    assert {"x3", "y4"} <= changed
    q = np.array([0.3, -0.4, 0.5, 0.6, -0.7, 0.2])
    said = {"lift": LIFT} | {f"j{k + 1}": v for k, v in enumerate(q)}
    delta = [values.get(t.name, t.nominal) - t.nominal for t in robot.transforms]
    own = robot.chain.forward(robot.theta(q[None]), delta).x[:, 0]
    np.testing.assert_allclose(
        own, placed(text.partition("-->")[2].strip(), "carriage", "tool", said)[:3, 3], atol=1e-12
    )


def test_a_cell_chooses_the_part(tmp_path: Path) -> None:
    write(tmp_path)
    stated = 'robot = "lifted.urdf"\nbase = "column"\ntip = "l6"\nparked = {lift_mm = 100}'
    cell = load_cell(small_cell("ur10/edbb", tmp_path, ('robot = "ur10"', stated)), planning=False)
    assert (cell.robot.base, cell.robot.tip, cell.robot.n_joints) == ("column", "l6", 6)
    said = {"lift": 0.1} | {f"j{k + 1}": 0.0 for k in range(6)}
    own = cell.robot.chain.forward(np.zeros((1, 6))).x[:, 0]
    np.testing.assert_allclose(own, placed(lifted(), "column", "l6", said)[:3, 3], atol=1e-12)


def test_a_wrong_base_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no link is called 'carrige'.*did you mean .carriage"):
        load_robot(write(tmp_path, 'base = "carrige"'))
    with pytest.raises(InputError, match="the link 'tool' hangs on world > platform > column > carriage"):
        load_robot(write(tmp_path, 'base = "head"'))
    with pytest.raises(InputError, match="base names a link of a URDF; this robot is none"):
        load_robot("ur10", base="column")
