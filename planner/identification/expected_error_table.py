"""``expected_error.csv``: the tool's expected error at states all over the workspace, before and after."""

import numpy as np

from planner.common.units import to_deg, to_mm
from planner.identification.released_robot import ReleasedRobot


def expected_error_csv(released: ReleasedRobot) -> str:
    """Return the table: joint angles, where the measured tool point is, and its expected error of three robots."""
    tool = released.tool
    head = [f"q{j + 1}_deg" for j in range(tool.q.shape[1])]
    head += ["x_mm", "y_mm", "z_mm", "nominal_mm", "geometry_mm", "released_mm"]
    errors = [released.expected_errors(fit) for fit in (None, released.geometry, released.fit)]
    rows = np.column_stack([to_deg(tool.q), to_mm(tool.position), to_mm(np.stack(errors, axis=1))])
    text = "\n".join(",".join(f"{v + 0.0:.4f}" for v in row) for row in rows.round(4))
    return ",".join(head) + "\n" + text + "\n"
