"""Arms on a lift and on a rail: a URDF with a slanted slide, and DH rows whose first joint moves d."""

from pathlib import Path

from tests.kinematics.test_parked_joints import tree

LIFT = (
    '<link name="floor"/><joint name="lift" type="prismatic"><parent link="floor"/><child link="l0"/>'
    '<origin xyz="0.1 -0.2 -0.1" rpy="0.1 0.2 -0.3"/><axis xyz="{axis}"/>'
    '<limit lower="-0.1" upper="0.4" velocity="0.2" effort="1"/></joint></robot>'
)
AXES = {"along z": "0 0 1", "against x": "-1 0 0", "slanted": "0.2 -0.3 0.9"}
RAIL = """schema = "edbb-robot/1"
name = "rail"
convention = "{convention}"
[[joints]]
variable = "d"
alpha_deg = -90
a_mm = 20
d_mm = 300
theta_deg = 10
limit_mm = [-1000, 3000]
speed_mm_s = 1500
mass_kg = 50
com_mm = [10, -20, 30]
"""
ROW = """[[joints]]
alpha_deg = {alpha}
a_mm = {a}
d_mm = {d}
theta_deg = 0
limit_deg = [-170, 170]
speed_deg_s = 120
mass_kg = 5
com_mm = [5, 6, -7]
"""
ROWS = ((-90, 100, 400), (0, 500, 0), (-90, 50, 0), (90, 0, 450), (-90, 0, 0), (0, 0, 90))


def lift_text(axis: str = AXES["along z"]) -> str:
    """Return the URDF of the tree on a lift."""
    return tree().replace("</robot>", LIFT.format(axis=axis))


def write_rail(folder: Path, convention: str) -> Path:
    """Write an arm of six rows on a rail."""
    rows = "".join(ROW.format(alpha=alpha, a=a, d=d) for alpha, a, d in ROWS)
    (folder / "robot.toml").write_text(RAIL.format(convention=convention) + rows)
    return folder / "robot.toml"
