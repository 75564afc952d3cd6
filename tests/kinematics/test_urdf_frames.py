"""The same arm with its URDF frames drawn another way has the same errors: none is lost where a pitch is ±90°."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planner.design.free_parameters import preference_order
from planner.design.observability.identifiability import find_identifiable
from planner.kinematics.robot_reader import load_robot
from planner.model.model import Model
from planner.runs.run import Samples
from tests.identification.calibrated.made import setup_at_flange
from tests.not_everywhere import pin

CUBE = Rotation.create_group("O")  # the 24 ways to put axes onto axes
UR10 = [  # alpha [rad], a [m], d [m]
    (np.pi / 2, 0, 0.1273), (0, -0.612, 0), (0, -0.5723, 0), (np.pi / 2, 0, 0.163941), (-np.pi / 2, 0, 0.1157),
    (0, 0, 0.0922),
]  # fmt: skip
TOOL = np.array([0.05, -0.03, 0.12])


def urdf(drawn):
    """The arm as URDF; ``drawn`` (6,) rotations by which each joint's frame is turned, its axis along with it."""
    links = "".join(f'<link name="l{i}"/>' for i in range(7)) + '<link name="tip"/>'
    joints, before = "", pin.SE3.Identity()
    for i, (alpha, a, d) in enumerate(UR10):
        turn = pin.SE3(drawn[i].as_matrix(), np.zeros(3))
        joints += joint(f"j{i}", "revolute", f"l{i}", f"l{i + 1}", before * turn, turn.rotation.T @ [0, 0, 1])
        before = turn.inverse() * pin.SE3(pin.exp3(np.array([alpha, 0, 0])), np.array([a, 0, d]))
    joints += joint("end", "fixed", "l6", "tip", before, None)
    return f'<robot name="six">{links}{joints}</robot>'


def joint(name, kind, parent, child, T, axis):
    numbers = lambda v: " ".join(f"{x:.15g}" for x in v)  # noqa: E731
    origin = f'<origin xyz="{numbers(T.translation)}" rpy="{numbers(pin.rpy.matrixToRpy(T.rotation))}"/>'
    moves = "" if axis is None else f'<axis xyz="{numbers(np.round(axis, 12))}"/>'
    limit = "" if axis is None else '<limit lower="-3" upper="3" velocity="2" effort="1"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{origin}{moves}{limit}</joint>'


def identified(folder, drawn, y, q, fresh):
    """Fit tool positions ``y``: names kept, residual (n, 3) and predicted change at ``fresh`` (m, 3)."""
    (folder / "six.urdf").write_text(urdf(drawn))
    setup = setup_at_flange(load_robot("six.urdf", folder, tip="tip"))
    object.__setattr__(setup, "p_FM", TOOL[None])
    object.__setattr__(setup.gauge, "noise_angle", None)
    model = Model.of(setup, frozenset({"base", "tool"}))
    rows, later = (model.rows(Samples(p, np.zeros(len(p), dtype=int))) for p in (q, fresh))
    seen = find_identifiable(rows, model.names, model.prior, preference_order(model))
    kept = list(seen.kept)
    A = rows[:, :, kept].reshape(-1, len(kept)) * model.prior[kept]
    x = np.linalg.lstsq(A, y.ravel(), rcond=None)[0] * model.prior[kept]
    return seen.names, y - rows[:, :, kept] @ x, later[:, :, kept] @ x


@pytest.fixture(scope="module")
def states():
    rng = np.random.default_rng(1)
    return rng.uniform(-2.5, 2.5, (60, 6)), rng.uniform(-2.5, 2.5, (20, 6))


@pytest.fixture(scope="module")
def plain(tmp_path_factory, states):
    y = np.random.default_rng(2).normal(size=(60, 3)) * 1e-3
    return y, identified(tmp_path_factory.mktemp("plain"), [CUBE[0]] * 6, y, *states)


@pytest.mark.parametrize("k", range(24))
def test_a_frame_drawn_another_way_shows_the_same_errors(tmp_path, states, plain, k):
    """Every frame goes through all 24 ways, in another order each."""
    y, (names, left, change) = plain
    drawn = [CUBE[int((k + 5 * i) % 24)] for i in range(6)]
    own_names, own_left, own_change = identified(tmp_path, drawn, y, *states)
    assert len(own_names) == len(names)
    np.testing.assert_allclose(own_left, left, atol=1e-11)
    np.testing.assert_allclose(own_change, change, atol=1e-9)


def test_zeros_of_joints_are_kept_before_turns_of_frames(plain):
    names = plain[1][0]
    assert {"theta2", "theta3", "theta4", "theta5"} <= set(names)
    assert not {"rz2", "rz3", "rz4"} & set(names)
