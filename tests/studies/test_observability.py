"""What one's own poses show, against numpy's SVD, pinocchio's Jacobian and finite differences."""

import numpy as np
import polars as pl
import pytest

from planner import forward, load_cell, load_robot, observability, select
from planner.common.errors import InputError
from planner.common.units import to_deg
from planner.design.candidates.pool import draw_candidates
from planner.model.model import Model
from planner.runs.run import Samples


class Columns:
    """A data frame of another library: columns by name, and no Arrow."""

    def __init__(self, frame):
        self._frame, self.columns = frame, frame.columns

    def __getitem__(self, name):
        return self._frame[name].to_numpy()


class Arrow(Columns):
    """One that speaks Arrow."""

    def __arrow_c_stream__(self, requested_schema=None):
        return self._frame.__arrow_c_stream__(requested_schema)


class WithoutPyarrow(Columns):
    """As pandas does where pyarrow is not installed."""

    def __arrow_c_stream__(self, requested_schema=None):
        raise ImportError("pyarrow")


def near_home(cell, count=40, seed=0):
    return cell.home + np.random.default_rng(seed).uniform(-0.6, 0.6, (count, cell.robot.n_joints))


@pytest.mark.parametrize("name", ["ur10/edbb", "kuka-kr6-r700/tracker"])
def test_the_numbers_are_those_of_numpy(name):
    cell = load_cell(name)
    seen = observability(cell, near_home(cell))
    kept = [seen.names.index(p.name) for p in seen.seen_parameters]
    tall = seen.jacobian.reshape(-1, len(seen.names))
    prior = np.array([p.prior for p in seen.model.parameters])
    np.testing.assert_allclose(
        seen.singular_values("prior"), np.linalg.svd(tall * prior, compute_uv=False), rtol=1e-9, atol=1e-14
    )
    assert seen.numerical_rank == np.linalg.matrix_rank(tall * prior)
    mu = np.linalg.svd((tall * prior)[:, kept], compute_uv=False)
    found = seen.indices("prior")
    assert found["O1"] == pytest.approx(np.exp(np.log(mu).mean()) / np.sqrt(len(seen.samples)))
    assert found["O2"] == pytest.approx(mu[0] / mu[-1])
    assert found["O3"] == pytest.approx(mu[-1])
    assert found["O4"] == pytest.approx(mu[-1] ** 2 / mu[0])
    assert found["O5"] == pytest.approx(1 / (1 / mu).sum())
    white = seen.white_rows
    np.testing.assert_allclose(seen.covariance().matrix, np.linalg.inv(white.T @ white), rtol=1e-5)
    for direction in seen.null_vectors:
        vector = np.array([direction.get(n, 0.0) for n in seen.names])
        assert np.linalg.norm(tall @ vector) < 1e-3 * np.linalg.norm(tall, 2)


def test_scalings_are_those_of_the_columns():
    """Millimetres per degree: (mm / m) · (rad / °) of a column in metres per radian, 1 of one in metres per metre."""
    cell = load_cell("ur10/edbb")
    seen = observability(cell, near_home(cell))
    tall = seen.jacobian.reshape(-1, len(seen.names))
    by_hand = tall * [1e3 * np.pi / 180 if u == "rad" else 1.0 for u in seen.units]
    np.testing.assert_allclose(seen.singular_values("mm, deg"), np.linalg.svd(by_hand)[1], rtol=1e-9, atol=1e-9)
    assert len({round(seen.indices(s)["O2"], 3) for s in ("prior", "m, rad", "mm, deg", "columns")}) == 4
    with pytest.raises(InputError, match="'mm, deg'"):
        seen.indices("inch")


def pinocchio_of(robot):
    """A chain of pinocchio's own joints from the rows of the robot's table."""
    import pinocchio

    model, parent, placement = pinocchio.Model(), 0, pinocchio.SE3.Identity()
    kinds = [pinocchio.JointModelRX, pinocchio.JointModelRY, pinocchio.JointModelRZ]
    for t in robot.transforms:
        axis = np.eye(3)[t.axis]
        if t.joint is not None:
            parent = model.addJoint(parent, kinds[t.axis](), placement, t.name)
            placement = pinocchio.SE3.Identity()
        if t.kind == "translation":
            placement = placement * pinocchio.SE3(np.eye(3), t.nominal * axis)
        else:
            placement = placement * pinocchio.SE3(pinocchio.exp3(t.nominal * axis), np.zeros(3))
    return model, parent, placement


def test_the_jacobian_is_that_of_pinocchio():
    """Joint zeros seen by a tracker: the linear velocity of the tool point in a chain of pinocchio's joints."""
    pinocchio = pytest.importorskip("pinocchio")
    cell = load_cell("kuka-kr6-r700/tracker")
    robot, q = cell.robot, near_home(cell, 5)
    model, last, flange = pinocchio_of(robot)
    data, point = model.createData(), flange.act(np.array(cell.tool.points[0].p_FM))
    seen = observability(cell, q, free=list(robot.zero_names))
    order = [seen.names.index(name) for name in robot.zero_names]
    for k, theta in enumerate(robot.theta(q)):
        twist = pinocchio.computeJointJacobians(model, data, theta)
        twist = pinocchio.getJointJacobian(model, data, last, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        lever = data.oMi[last].rotation @ point
        linear = twist[:3] + np.cross(twist[3:], lever, axisa=0, axisc=0)
        np.testing.assert_allclose(seen.jacobian[k][:, order], linear, atol=1e-9)
    moved = np.array([data.oMi[last].act(point)])
    np.testing.assert_allclose(forward(robot, q[-1:], cell.tool.points[0].p_FM)[:, :3, 3], moved, atol=1e-9)


def test_any_list_of_parameters_and_own_priors():
    cell = load_cell("ur10/edbb")
    q = near_home(cell)
    some = observability(cell, q, free=["theta2", "a2", "fixture", "joint compliance"], priors={"theta2_deg": 0.01})
    assert {"theta2", "a2", "compliance2"} <= set(some.names)
    assert [n for n in some.names if n.startswith(("fixture", "theta"))] == [
        "fixture_A_x", "fixture_A_y", "fixture_A_z", "theta2",
    ]  # fmt: skip
    assert some.model.prior[some.names.index("theta2")] == pytest.approx(np.deg2rad(0.01))
    assert some.to_frame()["parameter"].to_list() == list(some.names)
    with pytest.raises(InputError, match="'theta9'"):
        observability(cell, q, free=["theta9"])
    with pytest.raises(InputError, match="'theta2'"):
        observability(cell, q, priors={"theta2": 0.01})
    with pytest.raises(InputError, match="above zero"):
        observability(cell, q, priors={"theta2_deg": 0.0})


def test_poses_come_as_arrays_frames_of_any_library_and_samples():
    cell = load_cell("ur10/edbb")
    q = near_home(cell, 12)
    whole = observability(cell, q)
    frame = pl.DataFrame({f"q{j + 1}_deg": to_deg(q[:, j]) for j in range(6)})
    for poses in (q.tolist(), frame, Columns(frame), Arrow(frame), WithoutPyarrow(frame), Samples.at(q)):
        np.testing.assert_allclose(observability(cell, poses).jacobian, whole.jacobian, atol=1e-9)
    for wrong, says in ((q[:, :5], "6"), (frame.drop("q3_deg"), "q3_deg"), (np.full((2, 6), np.nan), "finite")):
        with pytest.raises(InputError, match=says):
            observability(cell, wrong)
    with pytest.raises(InputError, match="counted from 0"):
        observability(cell, q, fixture=1)


@pytest.mark.slow
def test_chosen_poses_beat_chance_and_keep_below_their_bound():
    cell = load_cell("ur10/edbb")
    count = 30
    chosen = select(cell, count, "O1", candidates=200)
    assert chosen.q.shape == (count, 6)
    assert 0 <= chosen.gap < 0.2
    pool = draw_candidates(cell, 200, 0).samples
    by_chance = observability(cell, pool.take(np.arange(count)))
    own = chosen.observability()
    assert own.d_efficiency(200)[0] > by_chance.d_efficiency(200)[0]
    assert 0.5 < own.d_efficiency(200)[0] <= 1.0
    rows = Model.from_cell(cell).rows(chosen.samples)
    assert rows.shape[0] == count


def test_forward_has_the_effects_of_the_robot(tmp_path):
    """An encoder error of 0.9 mrad at joint 2 turns the arm as the joint itself does."""
    nominal = load_robot("kuka-kr6-r700")
    said = nominal.path.read_text()
    effect = '\n[[effects]]\nname = "e"\non = "theta2"\nphi = "1"\nvalue = 0.9e-3\nunit = "rad"\n'
    q = np.random.default_rng(1).uniform(-1, 1, (5, 6))
    off = q.copy()
    off[:, 1] += 0.9e-3 * np.sign(nominal.coupling_matrix[1, 1])
    assert forward(nominal, q[0]).shape == (1, 4, 4)
    expected = forward(nominal, off, [0.1, 0.0, 0.2])
    path = tmp_path / "robot.toml"
    path.write_text(said + effect)
    try:
        moved = load_robot(str(path))
    except InputError as err:
        pytest.fail(str(err))
    np.testing.assert_allclose(forward(moved, q, [0.1, 0.0, 0.2]), expected, atol=1e-9)
    assert np.abs(forward(moved, q) - forward(nominal, q)).max() > 1e-4
    for wrong in (np.zeros(5), np.zeros((2, 3, 6))):
        with pytest.raises(InputError, match="6 joints"):
            forward(nominal, wrong)
    with pytest.raises(InputError, match="tool has the shape"):
        forward(nominal, q, np.zeros(4))
