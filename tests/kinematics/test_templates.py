"""Templates of URDFs: the same URDF as the package ``xacro`` makes, from files in named folders alone."""

import sys
import types
import xml.etree.ElementTree as ET

import pytest
import xacro

from planner.common.errors import InputError
from planner.kinematics.packages import Packages
from planner.kinematics.xacro.expander import expand_template

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
def packages(tmp_path, monkeypatch):
    """A package in a folder of another name, known to the package ``xacro`` as ROS would tell it."""
    folder = tmp_path / "checkout-main"
    (folder / "config").mkdir(parents=True)
    (folder / "urdf").mkdir()
    found = types.ModuleType("ament_index_python.packages")
    vars(found)["get_package_share_directory"] = {"arm_description": str(folder)}.__getitem__
    monkeypatch.setitem(sys.modules, "ament_index_python", types.ModuleType("ament_index_python"))
    monkeypatch.setitem(sys.modules, "ament_index_python.packages", found)
    return Packages({"arm_description": folder})


def both(path, packages):
    own = ET.fromstring(expand_template(path, packages))
    return tree(own), tree(ET.fromstring(xacro.process_file(str(path)).toxml()))


SNIPPETS = dict(
    snippet.split("\n", 1)
    for snippet in r"""# arithmetic
<a v="${1 + 2 * 3 - 4 / 8} ${7 // 2} ${7 % 3} ${2**10} ${-3} ${+3} ${not 1}"/>
# functions
<a v="${sin(pi / 6)} ${radians(90)} ${math.degrees(pi)} ${sqrt(2)} ${atan2(1, 2)} ${round(2.567, 1)}"/>
# more functions
<a v="${max(1, 2.5)} ${min([3, 1])} ${python.abs(-2)} ${int(3.9)} ${float('2')} ${len('four')}"/>
# texts
<a v="${'a' + '_' + str(3)} ${'ab' * 2} ${'x y'.split(' ')[1]} ${'A'.lower()} ${'abc'[1:]}"/>
# comparisons
<a v="${1 &lt; 2} ${1 == 1.0} ${'a' != 'b'} ${'x' in 'xyz'} ${3 in [1, 2]} ${1 &lt; 2 &lt;= 2}"/>
# conditions
<a v="${'yes' if 1 &gt; 0 else 'no'} ${1 and 0} ${0 or 5} ${True} ${None}"/>
# a whole value
<xacro:property name="k" value="3"/><a v="${k}" w="k${k}${k}" x="$${k} $$(k) $k $"/>
# lazy
<xacro:property name="b" value="${c + 1}"/><xacro:property name="c" value="2"/><a v="${b}"/>
# literals
<xacro:property name="k" value="1_0"/><xacro:property name="s" value="'12'"/><a v="${k} ${s + 1}"/>
# defaults
<xacro:property name="k" value="1"/><xacro:property name="k" default="2"/><a v="${k}"/>
# if
<xacro:if value="${1 == 2}"><a/></xacro:if><xacro:unless value="false"><b/></xacro:unless>
# arguments
<xacro:arg name="n" default="0.5"/><xacro:arg name="n" default="9"/><a v="$(arg n)" w="${$(arg n) * 2}"/>
# eval
<xacro:arg name="n" default="2"/><a v="$(eval n * 3)" w="$(eval 1 if n == 2 else 0)"/>
# macro
<xacro:macro name="m" params="p q:=2 r:='a b'"><a v="${p} ${q} ${r}"/></xacro:macro><xacro:m p="1"/>
# forwarded
<xacro:macro name="m" params="p:=^ q:=^|7"><a v="${p} ${q}"/></xacro:macro><xacro:property name="p" value="4"/>
<xacro:m/>
# blocks
<xacro:macro name="m" params="*o **c"><a><xacro:insert_block name="o"/></a><b><xacro:insert_block name="c"/></b>
</xacro:macro><xacro:m><origin xyz="${1 + 1}"/><x><y/><z/></x></xacro:m>
# block property
<xacro:property name="o"><origin v="${2 * 2}"/><n/></xacro:property><a><xacro:insert_block name="o"/></a>
# scopes
<xacro:macro name="m" params=""><xacro:property name="k" value="5" scope="parent"/><xacro:property name="g"
value="6" scope="global"/><xacro:property name="l" value="7"/></xacro:macro><xacro:property name="l" value="0"/>
<xacro:m/><a v="${k} ${g} ${l}"/>
# nested macros
<xacro:macro name="i" params="n"><l n="${n}"/></xacro:macro><xacro:macro name="o" params="n">
<xacro:i n="${n + 1}"/><xacro:if value="${n &lt; 3}"><xacro:o n="${n + 1}"/></xacro:if></xacro:macro>
<xacro:o n="0"/>
# call
<xacro:macro name="m" params="p"><a v="${p}"/></xacro:macro><xacro:call macro="${'m'}" p="3"/>
# made
<xacro:element xacro:name="${'li' + 'nk'}" name="x"/><a><xacro:attribute name="b" value="x${1}"/></a>
# tables
<xacro:property name="t" value="${xacro.load_yaml('t.yaml')}"/>
<a v="${t['a']['b']} ${t.a.b} ${t['list'][1]} ${t['turn']} ${t['again']['b']} ${len(t['list'])}"/>
# table of arguments
<xacro:property name="t" value="${dict(a=1, b=-2.5)}"/><a v="${t['b']}"/>
# included
<xacro:include filename="parts.xacro"/><xacro:part k="2"/><a v="${size}"/>
# namespace
<xacro:include filename="parts.xacro" ns="p"/><xacro:p.part k="2"/><a v="${p.size}"/>
# optional
<xacro:include filename="gone.xacro" optional="true"/><a/>
# removed
<xacro:property name="k" value="1"/><xacro:property name="k" remove="true"/><xacro:property name="k" default="8"/>
<a v="${k}"/>
# text
<plugin>${1 + 1} <xacro:if value="1">more</xacro:if> end</plugin>
"""[2:].split("\n# ")
)


@pytest.mark.parametrize("snippet", SNIPPETS.values(), ids=SNIPPETS.keys())
def test_what_the_package_xacro_makes_is_made(tmp_path, packages, snippet):
    (tmp_path / "t.yaml").write_text("a: &x {b: 2.5}\nagain: *x\nlist: [1, two]\nturn: !degrees 180\n")
    (tmp_path / "parts.xacro").write_text(
        f'{HEAD}<xacro:property name="size" value="0.4"/><xacro:macro name="part" params="k"><l n="${{k}}"/>'
        "</xacro:macro></robot>"
    )
    (tmp_path / "arm.xacro").write_text(f"{HEAD}{snippet}</robot>")
    own, expected = both(tmp_path / "arm.xacro", packages)
    assert own == expected
    assert own[3]  # something came out


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
    path.write_text(ARM.replace("$(arg name)", "arm", 1))
    own, expected = both(path, packages)
    assert own == expected
    path.write_text(ARM)  # the robot's own name may be an argument
    assert tree(ET.fromstring(expand_template(path, packages)))[1] == [("name", "arm")]
    with pytest.raises(InputError, match=r"'arm_description' is asked for.*--package arm_description=DIR"):
        expand_template(path, Packages())


def test_attributes_have_the_order_and_bytes_of_every_run(tmp_path, packages):
    (tmp_path / "arm.xacro").write_text(f"{HEAD}{SNIPPETS['blocks']}</robot>")
    assert len({expand_template(tmp_path / "arm.xacro", packages) for _ in range(3)}) == 1
