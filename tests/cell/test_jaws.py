"""The jaws of the SO-101 are in the scene: points of the SO-ARM100 project's meshes lie in the robot's bodies."""

import numpy as np
import pytest

from planner.kinematics.robot_reader import load_robot

BEYOND = 1.0  # [mm] that the meshes may stand beyond the capsules
JAWS = {  # so101_new_calib.urdf, joint gripper at 0: outermost vertices below z = -60 in the last link's frame [mm]
    "fixed": [
        (-7.7, 5.1, -94.4), (-29.2, -4.9, -60.4), (-23.9, 9.6, -64.4), (-13.0, -8.2, -64.8), (-8.9, 0.2, -104.4),
        (-12.9, 0.4, -103.5), (-8.1, 3.8, -101.1), (-16.5, -4.9, -92.5),
    ],
    "moving": [
        (26.1, 4.3, -65.2), (7.6, -5.4, -95.4), (13.3, 8.1, -61.8), (21.0, -10.0, -61.5), (11.0, -0.6, -105.4),
        (13.2, -0.7, -104.5), (23.2, 5.2, -83.0), (8.1, -4.1, -102.1),
    ],
}  # fmt: skip


@pytest.mark.parametrize("jaw", JAWS)
def test_a_jaw_is_inside_the_bodies(jaw):
    points = np.array(JAWS[jaw])
    away = np.full(len(points), np.inf)
    for link, body in load_robot("so101").bodies:
        if link == 5:
            radius, length = body.size
            start, along = body.T[:3, 3] - body.T[:3, 2] * length / 2, body.T[:3, 2] * length
            share = np.clip((points * 1e-3 - start) @ along / (along @ along), 0, 1)
            away = np.minimum(away, np.linalg.norm(points * 1e-3 - start - share[:, None] * along, axis=1) - radius)
    assert 1e3 * away.max() < BEYOND
