"""Bodies that another arm's rows tear apart: refused where somebody wrote them, said of a URDF, silent on real arms."""

import re
from dataclasses import replace

import numpy as np
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.kinematics.angle_units import radians_text
from planner.kinematics.robot_reader import list_robots, load_robot
from planner.motion.collision.body_gaps import clearance_text, describe_body_gaps, find_body_gaps
from planner.motion.collision.surroundings import check_surroundings

BODIES = "[[bodies]]"
KR6 = data_folder("robots") / "kuka-kr6-r700"


def rewritten(tmp_path, change, bodies=True):
    """Return the path of a cell of the shipped KR 6 with its file changed, and the bodies taken out where asked."""
    text = (KR6 / "robot.toml").read_text()
    if not bodies:
        text = re.sub(r"^never_meet.*\n", "", text[: text.index(BODIES)], flags=re.MULTILINE)
    (tmp_path / "robot.toml").write_text(change(text))
    cell = (KR6 / "cells/edbb.toml").read_text().replace('robot = "kuka-kr6-r700"', 'robot = "robot.toml"')
    (tmp_path / "cell.toml").write_text(cell)
    return str(tmp_path / "cell.toml")


def lengthened(tmp_path, **lengths):
    """Return a cell of the shipped KR 6 with other lengths in its rows, and its bodies as they were."""

    def change(text):
        for key, (old, new) in lengths.items():
            text, n = re.subn(rf"^{key} = {old}$", f"{key} = {new}", text, flags=re.MULTILINE)
            assert n == 1
        return text

    return load_cell(rewritten(tmp_path, change))


@pytest.mark.parametrize("name", list_robots())
def test_no_shipped_arm_has_a_gap(name):
    assert find_body_gaps(load_robot(name)) == ()


def test_an_upper_arm_that_ends_before_the_elbow_is_refused(tmp_path):
    """The axis of joint 3 is parallel to z of frame 2, 680 mm along x; the old elbow ends at 315 + 82."""
    cell = lengthened(tmp_path, a_mm=("315.0", "680.0"))
    with pytest.raises(InputError, match=r"robot\.toml: the bodies of link 2 end 283 mm before the axis of joint 3"):
        check_surroundings(cell)


def test_a_forearm_that_hangs_at_the_wrist_alone_is_refused(tmp_path):
    """The axis of joint 4 runs through the old forearm wherever it ends: the bodies of links 3 and 4 tell it."""
    cell = lengthened(tmp_path, d_mm=("-365.0", "-670.0"))
    with pytest.raises(InputError, match=r"links 3 and 4 are up to \d\d\d mm apart at joint 4.*another arm's"):
        check_surroundings(cell)


def test_a_small_gap_is_said_and_not_refused(tmp_path):
    """The elbow's own capsule of 97 mm begins 5 mm off the axis: of 525 mm, 397 and at the worst 92 are covered."""
    cell = lengthened(tmp_path, a_mm=("315.0", "525.0"))
    check_surroundings(cell)
    (said,) = describe_body_gaps(cell)
    assert re.search(r"link 2 end 128 mm before the axis of joint 3, up to 3[56] mm before those of link 3", said)


def test_a_joint_whose_housing_is_the_next_link_s_is_no_gap(tmp_path):
    cell = lengthened(tmp_path, a_mm=("315.0", "475.0"))  # 78 mm before the axis, which the elbow's capsule fills
    assert describe_body_gaps(cell) == ()


def test_bodies_of_a_urdf_are_spoken_of_and_not_refused(tmp_path):
    cell = lengthened(tmp_path, a_mm=("315.0", "680.0"))
    own = tuple((link, replace(body, part=f"link_{link}")) for link, body in cell.robot.bodies)
    cell = replace(cell, robot=replace(cell.robot, bodies=own))
    check_surroundings(cell)
    assert "283 mm before the axis of joint 3" in describe_body_gaps(cell)[0]


def test_a_link_without_bodies_is_passed_over():
    robot = load_robot("kuka-kr6-r700")
    some = tuple((link, body) for link, body in robot.bodies if link != 5)
    assert find_body_gaps(replace(robot, bodies=some)) == ()
    assert find_body_gaps(replace(robot, bodies=())) == ()
    assert len(some) < len(robot.bodies)


def test_where_the_arm_stands_says_nothing():
    """A gap is one of the arm, not of a state: the turned base and other limits leave it as it is."""
    robot = load_robot("kuka-kr6-r700")
    moved = replace(robot, q_lower=robot.q_lower + 0.3, q_upper=np.minimum(robot.q_upper, 2.0))
    assert find_body_gaps(moved) == ()


def test_the_clearance_of_an_arm_without_bodies_claims_nothing_of_the_arm(tmp_path):
    cell = lengthened(tmp_path)
    assert clearance_text(cell, 0.0101) == "nearest bodies 10.1 mm apart, proven by two engines"
    bare = replace(cell, robot=replace(cell.robot, bodies=()))
    said = clearance_text(bare, 0.3038)
    assert said == ("only the bar and the tool were checked, 303.8 mm from the rest: kuka-kr6-r700 has no bodies")
    assert "[[bodies]] of robot.toml add them" in describe_body_gaps(bare)[0]
    torn = lengthened(tmp_path, a_mm=("315.0", "525.0"))
    assert clearance_text(torn, 0.01).endswith("proven by two engines, of an arm with gaps (see the note)")


def test_rows_of_the_other_convention_are_named_where_its_bodies_meet(tmp_path):
    cell = load_cell(rewritten(tmp_path, lambda text: text.replace('convention = "mdh"', 'convention = "dh"')))
    with pytest.raises(InputError, match='with convention = "mdh" all bodies meet at their joints'):
        check_surroundings(cell)


def test_a_home_below_the_floor_asks_for_rows_and_names_the_convention_that_would_stand(tmp_path):
    cell = load_cell(rewritten(tmp_path, lambda text: text.replace('convention = "mdh"', 'convention = "dh"'), False))
    with pytest.raises(InputError, match=r"rows in degrees.*With convention = \"mdh\" all of it would stand"):
        check_surroundings(cell)


@pytest.mark.parametrize("key", ["alpha_deg", "theta_deg"])
def test_rows_in_radians_are_named(tmp_path, key):
    def in_radians(text):
        return re.sub(rf"^{key} = (\S+)", lambda m: f"{key} = {np.deg2rad(float(m[1])):.4f}", text, flags=re.MULTILINE)

    with pytest.raises(InputError, match=rf"{key} of the rows looks like radians.*if radians are meant, \["):
        load_cell(rewritten(tmp_path, in_radians))


@pytest.mark.parametrize("angles", [[0, 0, 0], [0.03, -0.02, 90.01], [1.2, -0.5], [None, 180, 1.5708]])
def test_angles_of_real_rows_are_no_radians(angles):
    assert radians_text("alpha_deg", angles) == ""


def test_the_recipes_of_the_tutorial_leave_no_gap(tmp_path):
    """The KR 10 of docs/tutorials/kuka-bar.md: the bodies that its table changes, and those that its list guesses."""

    def lengths(text):
        return text.replace("a_mm = 315.0", "a_mm = 560.0").replace("d_mm = -365.0", "d_mm = -515.0")

    def of_the_table(text):
        text = lengths(text).replace("to_mm = [265,", "to_mm = [510,").replace("_mm = [315,", "_mm = [560,")
        return text.replace("from_mm = [3, 0, 198]", "from_mm = [3, 0, 348]")

    def guessed(text):
        head, *bodies = lengths(text).split(BODIES)
        kept = [b for b in bodies if "link = 2" not in b and "link = 4" not in b]
        ends = {2: "[560, 0, 0]", 4: "[0, 0, 515]"}
        kept += [
            f'\nlink = {k}\nkind = "capsule"\nfrom_mm = [0, 0, 0]\nto_mm = {end}\nradius_mm = 90\n'
            for k, end in ends.items()
        ]
        return BODIES.join([head, *kept])

    assert find_body_gaps(load_cell(rewritten(tmp_path, of_the_table)).robot) == ()
    assert find_body_gaps(load_cell(rewritten(tmp_path, guessed)).robot) == ()
    with pytest.raises(InputError, match="another arm's"):
        check_surroundings(load_cell(rewritten(tmp_path, lengths)))
