"""Templates of URDFs are expanded without ROS, from files in named folders alone."""

import math
import xml.etree.ElementTree as ET

import pytest

from planner.common.errors import InputError
from planner.kinematics.packages import Packages
from planner.kinematics.xacro_templates import expand_template

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'


def tree(element):
    """Tags, attributes, texts and children, without white space and comments."""
    return (
        element.tag,
        sorted(element.attrib.items()),
        (element.text or "").strip(),
        [tree(child) for child in element if isinstance(child.tag, str)],
    )


@pytest.fixture
def packages(tmp_path):
    """A package in a folder of another name."""
    folder = tmp_path / "checkout-main"
    (folder / "config").mkdir(parents=True)
    (folder / "urdf").mkdir()
    return Packages({"arm_description": folder})


ARM = """<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="name" default="arm"/>
<xacro:arg name="limits" default="$(find arm_description)/config/limits.yaml"/>
<xacro:include filename="$(find arm_description)/urdf/link.xacro"/>
<xacro:property name="limits" value="${xacro.load_yaml('$(arg limits)')}"/><link name="l0"/>
<xacro:link k="1" axis="0 0 1" limit="${limits['joints']['j1']}"><origin xyz="0 0 ${0.3 / 2}"/></xacro:link></robot>"""
LINK = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="link" params="k axis limit *origin">
<link name="l${k}"/><joint name="j${k}" type="revolute"><xacro:insert_block name="origin"/><parent link="l${k - 1}"/>
<child link="l${k}"/><axis xyz="${axis}"/><limit lower="${limit['min']}" upper="${limit.max}" velocity="2"/></joint>
</xacro:macro></robot>"""


def test_a_description_in_the_manner_of_ros_2_needs_no_ros(tmp_path, packages):
    folder = packages.folders["arm_description"]
    (folder / "config" / "limits.yaml").write_text("joints:\n  j1: {min: !degrees -170, max: !radians 2.5}\n")
    (folder / "urdf" / "link.xacro").write_text(LINK)
    (tmp_path / "cell").mkdir()
    path = tmp_path / "cell" / "arm.urdf.xacro"
    path.write_text(ARM)
    found = tree(ET.fromstring(expand_template(path, packages)))
    assert found[1] == [("name", "arm")]  # by the argument's default
    joint = [("origin", [("xyz", "0 0 0.15")]), ("parent", [("link", "l0")]), ("child", [("link", "l1")])]
    limit = [("lower", repr(-170 * math.pi / 180)), ("upper", "2.5"), ("velocity", "2")]
    assert [(tag, attributes) for tag, attributes, *_ in found[3]] == [
        ("link", [("name", "l0")]), ("link", [("name", "l1")]), ("joint", [("name", "j1"), ("type", "revolute")])
    ]  # fmt: skip
    assert [(tag, a) for tag, a, *_ in found[3][2][3]] == [*joint, ("axis", [("xyz", "0 0 1")]), ("limit", limit)]
    with pytest.raises(InputError, match=r"'arm_description' is asked for.*--package arm_description=DIR"):
        expand_template(path, Packages())


BLOCKS = """<xacro:macro name="m" params="*o **c"><a><xacro:insert_block name="o"/></a><b>
<xacro:insert_block name="c"/></b></xacro:macro><xacro:m><origin xyz="${1 + 1}"/><x><y/><z/></x></xacro:m>"""


def test_attributes_have_the_order_and_bytes_of_every_run(tmp_path, packages):
    (tmp_path / "arm.xacro").write_text(f"{HEAD}{BLOCKS}</robot>")
    assert len({expand_template(tmp_path / "arm.xacro", packages) for _ in range(3)}) == 1
