"""The masses of links that were published in other frames stand where they were published."""

import numpy as np

from planner.kinematics.chain import Chain
from planner.kinematics.robot_reader import load_robot

# lbr_description of the LBR-Stack, iiwa14: masses [kg], and at q = 0 where the centres of mass are in the base [mm];
# sums of the joints' origins and the links' own ones, both along the axes of the base
IIWA14 = (
    (5.289529, (0.0, -33.795, 279.904)),
    (5.688888, (0.136, 37.548, 436.322)),
    (3.461245, (0.0, 34.913, 711.108)),
    (4.122995, (0.0, -29.293, 866.944)),
    (1.563756, (0.0, -29.824, 1063.767)),
    (2.457878, (0.0, 0.32, 1184.95)),
    (0.265331, (0.003, -0.002, 1284.782)),
)


def centres(robot, q):
    """Centres of mass of the links in the base frame, (N, 3) [m]."""
    theta = robot.theta(q[None])
    ends = robot.link_end[1:]
    return np.array(
        [Chain(robot.transforms[:end]).carry(theta, m.com)[0] for end, m in zip(ends, robot.masses, strict=True)]
    )


def test_the_iiwa_weighs_what_was_published_where_it_was_published():
    robot = load_robot("iiwa14")
    np.testing.assert_allclose([m.mass for m in robot.masses], [m for m, _ in IIWA14])
    np.testing.assert_allclose(centres(robot, np.zeros(7)) * 1e3, [c for _, c in IIWA14], atol=0.01)


def test_the_panda_holds_itself_within_what_its_motors_can():
    """A bound on the masses, no proof of them: axis 1 is vertical and carries nothing."""
    robot = load_robot("panda")
    assert np.isclose(sum(m.mass for m in robot.masses), 16.062132)
    q, step = np.deg2rad([0.0, -45.0, 0.0, -135.0, 0.0, 90.0, 45.0]), 1e-6

    def energy(v):
        return 9.81 * sum(m.mass * c[2] for m, c in zip(robot.masses, centres(robot, v), strict=True))

    torque = np.array([(energy(q + step * e) - energy(q - step * e)) / (2 * step) for e in np.eye(7)])
    assert abs(torque[0]) < 1e-6
    assert 5.0 < abs(torque[3]) < 30.0
    assert (np.abs(torque) < [1e-6, 87, 87, 87, 12, 12, 12]).all()  # Nm, what the motors can hold by the data sheet
