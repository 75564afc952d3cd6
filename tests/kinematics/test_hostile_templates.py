"""Templates of strangers: nothing in them is run, no file outside the named folders is read, and all of them end."""

import pytest

from planner.common.errors import InputError
from planner.kinematics.packages import Packages, named_packages
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.xacro_templates import MOST_SECONDS, check_expression, expand_template

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
SECRET = "the-secret-of-another-folder"
X = "xacro:"

EXPRESSIONS = {
    "lambda": "(lambda: 1)()",
    "subclasses": "(lambda: [].__class__.__base__.__subclasses__())()",
    "class of a text": "''.__class__",
    "class through a call": "str.__class__",
    "mro": "().__class__.__mro__[1]",
    "globals of a function": "sin.__globals__",
    "import": "__import__('os').system('touch /tmp/owned')",
    "comprehension": "[c for c in range(10)]",
    "generator": "sum(x for x in [1])",
    "walrus": "(a := 5)",
    "f string": "f'{1:>1000000000}'",
    "format": "'{:>1000000000}'.format(1)",
    "format of attributes": "'{0.__class__}'.format(1)",
    "format_map": "'{a}'.format_map(dict(a=1))",
    "star": "max(*[1, 2])",
    "dictionary of a namespace": "math.__dict__",
}
REFUSED_BY_NAME = {
    "open": "open('/etc/passwd').read()",
    "eval": "eval('1 + 1')",
    "getattr": "getattr('', 'upper')",
    "yaml outside": "xacro.load_yaml('/etc/passwd')",
    "yaml above": "xacro.load_yaml('../secret.yaml')",
    "yaml by a link": "xacro.load_yaml('link.yaml')",
    "yaml of a device": "xacro.load_yaml('/dev/zero')",
    "yaml object": "xacro.load_yaml('object.yaml')",
    "yaml depth": "len(xacro.load_yaml('deep.yaml'))",
    "yaml unit": "xacro.load_yaml('unit.yaml')",
    "type": "python.type(1)",
    "variables": "python.vars()",
}
EXPRESSIONS_WITHOUT_END = {
    "power": "9**9**9",
    "long text": "'a' * 10**9",
    "aliases written": "str(xacro.load_yaml('alias.yaml')['z'])",
}
FILES = {
    "environment": "<a v='$(env HOME)'/>",
    "unknown word": "<a v='$(command ls)'/>",
    "eval of a call": "<a v='$(eval __import__(&quot;os&quot;).getcwd())'/>",
    "unknown package": "<a v='$(find nowhere)'/>",
    "find above": f"<{X}include filename='$(find arm)/../secret.xacro'/>",
    "absolute include": f"<{X}include filename='/etc/passwd'/>",
    "relative include": f"<{X}include filename='../secret.xacro'/>",
    "include by a link": f"<{X}include filename='link.xacro'/>",
    "include by a linked folder": f"<{X}include filename='folder/secret.xacro'/>",
    "include of everything": f"<{X}include filename='../*.xacro'/>",
    "include of a folder": f"<{X}include filename='.'/>",
    "include of itself": f"<{X}include filename='arm.xacro'/>",
    "macro of itself": f"<{X}macro name='m' params=''><{X}m/></{X}macro><{X}m/>",
    "ring of properties": f"<{X}property name='p' value='${{q}}'/><{X}property name='q' value='${{p}}'/>"
    "<a v='${p}'/>",
    "hidden name": f"<{X}property name='__builtins__' value='1'/>",
    "open expression": "<a v='${1 + 1'/>",
    "no macro": f"<{X}nothing/>",
    "deep elements": "<a>" * 5000 + "</a>" * 5000,
    "method of a scope": f"<{X}include filename='part.xacro' ns='n'/><a v='${{n.__class__}}'/>",
    **{name: f'<a v="${{{text}}}"/>' for name, text in REFUSED_BY_NAME.items()},
}
ENDLESS = {
    **{name: f"<a v=\"${{{text}}}\"/>" for name, text in EXPRESSIONS_WITHOUT_END.items()},
    "macros of macros": "".join(
        f'<xacro:macro name="m{k}" params="">{f"<xacro:m{k + 1}/>" * 10}</xacro:macro>' for k in range(9)
    )
    + '<xacro:macro name="m9" params=""><link name="a"/></xacro:macro><xacro:m0/>',
    "doubling properties": "".join(
        f"<{X}property name='p{k + 1}' value='${{p{k}}}${{p{k}}}'/>" for k in range(40)
    ) + f"<{X}property name='p0' value='aaaaaaaaaa'/><a v='${{p40}}'/>",
}  # fmt: skip
ENTITIES = {
    "billion laughs": '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
    + "]><robot>&j;</robot>",
    "file entity": '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot>&a;</robot>',
    "parameter entity": '<!DOCTYPE r [<!ENTITY % a SYSTEM "file:///etc/passwd">%a;]><robot/>',
    "no XML": "GIF89a",
    "empty": "",
}


@pytest.fixture
def arm(tmp_path):
    """A folder with links out of it and tables that try something; the file ``arm.xacro`` is still to be written."""
    folder = tmp_path / "arm"
    folder.mkdir()
    for name in ("secret.xacro", "secret.yaml"):
        (tmp_path / name).write_text(f"<robot><link name='{SECRET}'/></robot>" if "xacro" in name else f"k: {SECRET}")
    (folder / "link.xacro").symlink_to(tmp_path / "secret.xacro")
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    (folder / "folder").symlink_to(tmp_path)
    (folder / "part.xacro").write_text(f"{HEAD}<link name='p'/></robot>")
    (folder / "object.yaml").write_text("!!python/object/apply:os.system ['touch owned']")
    aliases = "\n".join(f"{b}: &{b} [{', '.join([f'*{a}'] * 10)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    (folder / "alias.yaml").write_text(f"a: &a [x]\n{aliases}\nz: *i")
    (folder / "deep.yaml").write_text("[" * 50_000)
    (folder / "unit.yaml").write_text("a: !degrees __import__('os').getcwd()")
    return folder / "arm.xacro"


def refused(path, most_seconds=MOST_SECONDS):
    with pytest.raises(InputError) as refusal:
        expand_template(path, Packages({"arm": path.parent}), most_seconds)
    assert SECRET not in str(refusal.value)
    assert "root:" not in str(refusal.value)
    assert str(refusal.value).startswith(str(path))


@pytest.mark.parametrize("expression", EXPRESSIONS.values(), ids=EXPRESSIONS.keys())
def test_an_expression_is_arithmetic_and_names_alone(expression):
    with pytest.raises(ValueError, match="is not read in an expression"):
        check_expression(expression)


def test_nothing_of_an_expression_is_run_before_it_is_checked(arm):
    arm.write_text(f"{HEAD}<link name=\"${{__import__('os').system('touch owned')}}\"/></robot>")
    refused(arm)
    assert not [p.name for p in arm.parent.iterdir() if "owned" in p.name]


@pytest.mark.slow
@pytest.mark.parametrize("content", FILES.values(), ids=FILES.keys())
def test_nothing_outside_is_read(arm, content):
    arm.write_text(f"{HEAD}{content}</robot>")
    refused(arm)
    assert not [p.name for p in arm.parent.iterdir() if "owned" in p.name]


@pytest.mark.slow
@pytest.mark.parametrize("content", ENDLESS.values(), ids=ENDLESS.keys())
def test_nothing_grows_without_end(arm, content):
    arm.write_text(f"{HEAD}{content}</robot>")
    refused(arm, most_seconds=3)


@pytest.mark.parametrize("document", ENTITIES.values(), ids=ENTITIES.keys())
@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf"])
def test_documents_declare_no_entities(arm, document, name):
    path = arm.with_name(name)
    path.write_text(document)
    with pytest.raises(InputError, match=r"arm\.(xacro|urdf): "):
        load_robot(path)


def test_a_package_is_a_folder_with_a_plain_name(tmp_path):
    for table in ({"../x": "."}, {"a": "gone"}, {"a b": "."}, {"a": "\0"}):
        with pytest.raises(InputError, match="packages: "):
            named_packages("cell.toml", table, tmp_path)
    assert named_packages("cell.toml", {"arm-1_x": "."}, tmp_path).folders == {"arm-1_x": tmp_path.resolve()}


def test_mesh_paths_do_not_climb_out_of_a_package(tmp_path):
    (tmp_path / "pkg" / "meshes").mkdir(parents=True)
    (tmp_path / "out.stl").write_bytes(b"solid")
    (tmp_path / "pkg" / "meshes" / "link.stl").symlink_to(tmp_path / "out.stl")
    joints = "".join(
        f"<link name='l{k}'/><joint name='j{k}' type='revolute'><parent link='l{k - 1}'/><child link='l{k}'/>"
        "<origin xyz='0 0 0.2'/><axis xyz='0 1 0'/><limit lower='-1' upper='1' velocity='1'/></joint>"
        for k in range(1, 6)
    )
    (tmp_path / "cell").mkdir()
    path = tmp_path / "cell" / "arm.urdf"
    for mesh in ("package://pkg/../out.stl", "package://pkg/meshes/link.stl", "package://../../etc/hosts"):
        shape = f"<collision><geometry><mesh filename='{mesh}'/></geometry></collision>"
        path.write_text(f"<robot name='r'><link name='l0'>{shape}</link>{joints}</robot>")
        with pytest.raises(InputError, match="does not exist in"):
            load_robot(path, packages=named_packages("cell", {"pkg": "../pkg"}, path.parent)).check_meshes()
    path.write_text(path.read_text().replace("package://../../etc/hosts", "package://other/a.stl"))
    with pytest.raises(InputError, match="add --package other=DIR"):
        load_robot(path).check_meshes()
