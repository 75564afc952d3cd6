"""The masses of links that were published in other frames stand where they were published."""

import numpy as np
from scipy.spatial.transform import Rotation

from planner.kinematics.chain import Chain
from planner.kinematics.robot_reader import load_robot

# Stürz, Affolter and Smith 2017: masses [kg] and centres of mass [mm] in modified DH frames, whose first is at the
# shoulder and whose x looks back; angles alpha [deg] and lengths d [mm] of the rows
IIWA14 = (
    (3.94781, (-3.51, 1.60, -31.39), 0, 360),
    (4.50275, (-7.67, 166.69, -3.55), 90, 0),
    (2.45520, (-2.25, -34.92, -26.52), -90, 420),
    (2.61155, (0.20, -52.68, 38.18), -90, 0),
    (3.41000, (0.05, -2.37, -211.34), 90, 400),
    (3.38795, (0.49, 20.19, -27.50), 90, 0),
    (0.35432, (-34.66, -23.24, 71.38), -90, 0),
)
# the same of bodies of KUKA's CAD in lbr_description of the LBR-Stack: where they are at q = 0 in the base [mm]
CAD = (
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


def published_centres(q):
    """Centres of mass of the iiwa's links by the frames in which they were published, (7, 3) [mm]."""
    T, out = Rotation.from_euler("z", 180, degrees=True), []
    p = np.zeros(3)
    for angle, (_, com, alpha, d) in zip(q, IIWA14, strict=True):
        T = T * Rotation.from_euler("x", alpha, degrees=True)
        p = p + T.apply([0, 0, d])
        T = T * Rotation.from_rotvec([0, 0, angle])
        out.append(p + T.apply(com))
    return np.array(out)


def test_the_iiwa_weighs_what_was_published_where_it_was_published():
    robot = load_robot("iiwa14")
    np.testing.assert_allclose([m.mass for m in robot.masses], [m for m, *_ in IIWA14])
    for q in np.random.default_rng(0).uniform(robot.q_lower, robot.q_upper, (5, 7)):
        np.testing.assert_allclose(centres(robot, q) * 1e3, published_centres(q), atol=0.01)


def test_what_the_iiwas_links_weigh_on_its_shoulder_is_near_what_its_drawings_say():
    """The two sets are of different origin: a sign of a frame that is wrong would set them apart."""
    identified = np.array([(m, *c) for (m, *_), c in zip(IIWA14, published_centres(np.zeros(7)), strict=True)])
    drawn = np.array([(m, *c) for m, c in CAD])
    for link, height in ((1, 360.0), (3, 780.0)):  # the second axis carries links 2 to 7, the fourth 4 to 7
        moment = [(s[link:, 0] * (s[link:, 3] - height)).sum() for s in (identified, drawn)]
        assert abs(moment[0] / moment[1] - 1) < 0.3
    np.testing.assert_allclose(identified[2:4, 2], drawn[2:4, 2], atol=10)  # elbow and forearm lie beside the plane


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
