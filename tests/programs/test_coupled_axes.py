"""The rule for coupled axes, by other kinematics: which factor keeps the forearm's direction, and what is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.kinematics.robot_reader import load_robot
from planner.programs.coupled_axes import coupling_checks
from tests.compensation.foreign_kinematics import angle_deg, arm_of

FANUC = (Path(__file__).parents[1] / "compensation" / "programs" / "fanuc" / "robot.toml").read_text()
NAMES = tuple(f"J{k}" for k in range(1, 7))
SENSE, COUPLING = "sense = [1, 1, 1, 1, 1, 1]", "coupling = [[3, 2, -1]]"
HOME = np.array([10.0, 20.0, -15.0, 30.0, 40.0, 50.0])


def written(folder, s2, s3, factor):
    path = folder / "robot.toml"
    coupling = "" if factor is None else f"coupling = [[3, 2, {factor}]]"
    text = FANUC.replace(SENSE, f"sense = [1, {s2}, {s3}, 1, 1, 1]", 1).replace(COUPLING, coupling)
    path.write_text(text)
    return path


def controlled_arm(path, s2, s3, factor):
    """The arm at its controller's angles, by the sentence of the documentation alone: c3 = s3 q3 + factor c2."""
    shown = np.diag([1.0, s2, s3, 1.0, 1.0, 1.0])
    shown[2, 1] = (factor or 0) * s2
    return replace(arm_of(path, nominal=False), axes_of_joints=shown)


def turns(path, s2, s3):
    """The flange's rotation vector as J2 and as J3 is jogged by +10 deg alone [deg], by other kinematics."""
    arm, rest, out = controlled_arm(path, s2, s3, None), HOME, []
    for axis in (1, 2):
        R = arm.stand(rest + 10.0 * np.eye(6)[axis])[:3, :3] @ arm.stand(rest)[:3, :3].T
        out.append(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]))
    return out


def said(path):
    robot = load_robot(str(path))
    axes = robot.axes_of("fanuc-tp")
    return list(coupling_checks(robot, axes, NAMES, axes.to_model(np.deg2rad(HOME))))


@pytest.mark.parametrize(("s2", "s3"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_the_forearm_keeps_its_direction_by_the_documented_rule(tmp_path, s2, s3):
    two, three = turns(written(tmp_path, s2, s3, None), s2, s3)
    factor = 1 if two @ three > 0.0 else -1  # the same way or opposite ways, seen at an arm whose axes do not count so
    for sign, turned in ((1, 0.0), (-1, 20.0)):
        path = written(tmp_path, s2, s3, sign * factor)
        arm = controlled_arm(path, s2, s3, sign * factor)
        seen = angle_deg(arm.stand(HOME + 10.0 * np.eye(6)[1]), arm.stand(HOME))
        assert seen == pytest.approx(turned, abs=1e-6)
        (sentence,) = said(path)
        assert "J2 jogged by +10 deg alone" in sentence
        assert ("keeps its direction in the room" in sentence) == (turned == 0.0)
        assert ("turns by 20 deg in the room" in sentence) == ("sign is likely wrong" in sentence) == (turned == 20.0)


def test_axes_that_count_with_no_other_need_no_look(tmp_path):
    assert said(written(tmp_path, 1, 1, None)) == []


def test_the_lines_of_a_refusal_offer_the_coupling_of_fanuc(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(FANUC.replace("[controllers.fanuc-tp]", "[controllers.krl]", 1))
    with pytest.raises(InputError) as err:
        load_robot(str(path)).axes_of("fanuc-tp")
    offered = str(err.value).partition("or, where every axis")[0].replace("<date>", "2026-03-02")
    lines = offered[offered.index("[controllers.fanuc-tp]") :].replace("# coupling = [[3, 2, 1]]", COUPLING)
    path.write_text(path.read_text().replace("[controllers.krl]", f"{lines}\n[controllers.krl]", 1))
    assert load_robot(str(path)).axes_of("fanuc-tp").is_coupled
