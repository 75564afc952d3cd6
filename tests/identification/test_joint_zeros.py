"""Joint zeros as the screen states them, against an arm whose zeros alone are off."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.documents.calibration import find_joint_zeros, find_other_zeros, joint_zeros_text
from planner.identification.pipeline import FitSettings, identify
from planner.kinematics.robot_reader import load_robot
from planner.model.identification_document import Estimate
from planner.runs.loader import load_runs
from tests.identification.worlds import arm_of
from tests.simulation.generator import runs
from tests.simulation.generator.truth import Noise, Truth

NAME, TURNED = "kuka-kr6-r700", 3  # the joint whose controller counts the other way
STATED = re.compile(r"joint (\d) ([+-][\d.]+) ± ([\d.]+)°(\*?)")


@pytest.mark.long
def test_zeros_are_what_the_controller_shows_too_little(tmp_path) -> None:
    """A tracker's run of an arm that stands 0.2° and more elsewhere than its controller shows."""
    off = np.deg2rad([0.0, 0.3, -0.25, 0.2, -0.4, 0.0])
    truth = Truth(0, {}, (), Noise(5e-6, 1e-5), (1.0,) * 6)
    run, cell = runs.tracker(arm_of(NAME), n_poses=40, seed=0, truth=truth, logs=()).write(tmp_path)
    moved = _with_other_angles(run, off)
    text = re.sub(r"^robot = .*$", 'robot = "robot.toml"', cell.read_text(), count=1, flags=re.MULTILINE)
    cell.write_text(text)
    (tmp_path / "robot.toml").write_text(_turned_robot())
    found = identify(load_runs([moved], 6), load_cell(str(cell), planning=False), settings=FitSettings())
    stated = {int(k): (float(v), float(s)) for k, v, s, _ in STATED.findall(joint_zeros_text(found))}
    assert set(stated) >= {2, 3, 4, 5}
    for joint, (value, std) in stated.items():
        assert abs(value - np.rad2deg(off[joint - 1])) < 4 * std + 1e-3
        assert std < 0.05


def test_zeros_are_those_of_the_controllers_axes() -> None:
    """Comau counts five axes of the NJ-130 the other way round; where the file states no convention, that is said."""
    robot = load_robot("comau-nj130")
    off = np.deg2rad([0.1, 0.2, -0.3, 0.4, -0.5, 0.6])  # of the joints
    shift = robot.coupling_matrix @ off
    rows = [
        Estimate(name=f"theta{k + 1}", value=float(v), std=1e-5, unit="rad", group="geometry")
        for k, v in enumerate(shift)
    ]
    found = find_joint_zeros(robot, rows)
    assert [z.axes_of for z in found] == ["pdl2"] * 6
    assert np.allclose([z.offset for z in found], off * [-1, 1, -1, -1, -1, -1])
    plain = find_joint_zeros(replace(robot, conventions=()), rows)
    assert [z.axes_of for z in plain] == [None] * 6
    assert np.allclose([z.offset for z in plain], off)
    unseen = [rows[0], rows[1].model_copy(update={"identifiable": False}), *rows[2:]]
    assert [z.joint for z in find_joint_zeros(robot, unseen)] == [1, 3, 4, 5, 6]
    coupled = np.eye(6)
    coupled[2, 1] = 1.0  # as FANUC's axis 3 counts with axis 2
    axes = replace(robot.conventions[0], controller="pdl2", matrix=coupled)
    both = {z.joint: z.offset for z in find_joint_zeros(replace(robot, conventions=(axes,)), rows)}
    assert np.isclose(both[3], off[2] + off[1])
    assert 3 not in {z.joint for z in find_joint_zeros(replace(robot, conventions=(axes,)), unseen)}


def test_a_cell_of_another_controller_sees_the_zeros_in_its_axes() -> None:
    """Comau counts five axes of the NJ-130 the other way round, B&R counts as the model does: the signs differ."""
    robot = load_robot("comau-nj130")
    off = np.deg2rad([0.1, 0.2, -0.3, 0.4, -0.5, 0.6])  # of the joints
    rows = [
        Estimate(name=f"theta{k + 1}", value=float(v), std=1e-5, unit="rad", group="geometry")
        for k, v in enumerate(robot.coupling_matrix @ off)
    ]
    others = find_other_zeros(robot, rows, ("bnr+g126", "pdl2", "poses-csv"))
    assert {z.axes_of for z in others} == {"bnr"}  # the maker's stand before it, lists hold the model's own angles
    assert np.allclose([z.offset for z in others], off)
    setup = SimpleNamespace(robot=robot)
    found = SimpleNamespace(joint_zeros=find_joint_zeros(robot, rows), other_zeros=others, setup=setup)
    maker, bnr = joint_zeros_text(found).split("; in the axes of B&R instead: ")
    assert "(in the axes of Comau PDL2: add it to the angle that this controller shows; " in maker
    for text, sense in ((maker, [-1, 1, -1, -1, -1, -1]), (bnr, [1] * 6)):
        stated = [float(v) for _, v, *_ in STATED.findall(text)]
        np.testing.assert_allclose(stated, np.rad2deg(off) * sense, atol=1e-4)


def _turned_robot():
    head, *joints = (Path(__file__).parents[2] / "robots" / NAME / "robot.toml").read_text().split("[[joints]]")
    own = joints[TURNED - 1].replace("sense = 1", "sense = -1")
    lower, upper = (float(v) for v in re.search(r"limit_deg = \[(.*), (.*)\]", own).groups())
    joints[TURNED - 1] = re.sub(r"limit_deg = .*", f"limit_deg = [{-upper}, {-lower}]", own)
    return "[[joints]]".join([head, *joints])


def _with_other_angles(run, off):
    """Return a copy of the run whose controller shows ``off`` [rad] less than where the joints stand."""
    lines = run.read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    at = [lines[first].split(",").index(f"q{j + 1}_deg") for j in range(6)]
    for k in range(first + 1, len(lines)):
        fields = lines[k].split(",")
        for j, column in enumerate(at):
            sense = -1 if j + 1 == TURNED else 1
            fields[column] = f"{sense * float(fields[column]) - np.rad2deg(off[j]):.6f}"
        lines[k] = ",".join(fields)
    out = run.with_name("moved.csv")
    out.write_text("\n".join(lines) + "\n")
    return out
