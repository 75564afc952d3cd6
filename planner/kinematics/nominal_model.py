"""The nominal model in a robot's file, for telling whether two files are of one model: numbers alone, no meshes."""

from pathlib import Path

from planner.kinematics.chain import is_of_link_before
from planner.kinematics.robot_reader import describe_robot


def nominal_numbers(path: Path) -> dict[str, float | str]:
    """Return the numbers of the controller's own model in ``robot.toml``, rows and flange, by their keys [mm, deg].

    The file of a robot from a URDF holds only the nominal values of those numbers that a calibration changed.

    Raises:
        InputError: the file is wrong.
    """
    file = describe_robot(path)
    found: dict[str, float | str] = {"convention": file.convention, "joints": float(len(file.joints))}
    for i, joint in enumerate(file.joints, 1):
        rows = {"alpha_deg": joint.alpha_deg, "a_mm": joint.a_mm, "d_mm": joint.d_mm, "theta_deg": joint.theta_deg}
        for key, value in rows.items():
            name, _, unit = key.partition("_")
            if value is not None:
                found[f"{name}{i - is_of_link_before(file.convention, name)}_{unit}"] = value
    return found | file.nominal


def describe_difference(first: dict[str, float | str], second: dict[str, float | str]) -> str:
    """Return the first number that differs between two models, in words; empty where none does.

    Numbers that only one of them has do not count: a file keeps the old value of a row where it was corrected.
    """
    for key in (k for k in first if k in second):
        a, b = first[key], second[key]
        # 1e-6: mm or degrees: a number may have been written with fewer digits
        if a != b and (isinstance(a, str) or isinstance(b, str) or abs(a - b) > 1e-6):
            return f"{key} is {b} instead of {a}"
    return ""
