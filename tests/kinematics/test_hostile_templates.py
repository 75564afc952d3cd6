"""Templates of strangers: nothing in them is run, no file outside the named folders is read, and all of them end."""

import time

import pytest

from planner.common.errors import InputError
from planner.kinematics.packages import Packages, named_packages
from planner.kinematics.robot_reader import load_robot
from planner.kinematics.xacro.expander import expand_template

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
SECRET = "the-secret-of-another-folder"
MOST_SECONDS = 20.0  # of the processor, however busy the machine is; most take milliseconds
X = "xacro:"

EXPRESSIONS = {
    "lambda": "(lambda: 1)()",
    "subclasses": "(lambda: [].__class__.__base__.__subclasses__())()",
    "class of a text": "''.__class__",
    "class through a call": "str.__class__",
    "mro": "().__class__.__mro__[1]",
    "globals of a function": "sin.__globals__",
    "globals of load_yaml": "xacro.load_yaml.__globals__",
    "getattr": "getattr('', 'upper')",
    "import": "__import__('os').system('touch /tmp/owned')",
    "eval": "eval('1 + 1')",
    "open": "open('/etc/passwd').read()",
    "comprehension": "[c for c in range(10)]",
    "generator": "sum(x for x in [1])",
    "walrus": "(a := 5)",
    "f string": "f'{1:>1000000000}'",
    "format": "'{:>1000000000}'.format(1)",
    "format of attributes": "'{0.__class__}'.format(1)",
    "per cent": "'%1000000000d' % 1",
    "format_map": "'{a}'.format_map(dict(a=1))",
    "power": "9**9**9",
    "power of powers": "2**64**64",
    "negative power of nothing": "0**-1",
    "shift": "1 << 1000000000",
    "long text": "'a' * 10**9",
    "longer text": "'aaaaaaaaaa' * 2000 + 'b' * 20000",
    "long list": "[0] * 10**9",
    "long range": "range(10**9)",
    "doubled list": "list(range(999)) + list(range(999))",
    "rounding": "round(5, -10**9)",
    "rounding far": "round(10**15, -(10**6))",
    "digits": "int('9' * 10000)",
    "infinite": "1e400",
    "not a number": "float('nan')",
    "factorial": "math.factorial(10**7)",
    "complex": "(-8)**0.5",
    "bytes": "b'a'",
    "ellipsis": "...",
    "star": "max(*[1, 2])",
    "replace": "('a' * 20000).replace('a', 'b' * 20000)",
    "join": "('a' * 20000).join(list('b' * 900))",
    "isinstance": "python.type(1)",
    "nested brackets": "(" * 500 + "1" + ")" * 500,
    "nested signs": "-" * 1500 + "1",
    "null": "1\0",
    "long expression": "1+" * 5000 + "1",
    "dictionary of a namespace": "math.__dict__",
    "vars": "python.vars()",
    "division": "1 / 0",
    "text of a table": "dict(a=1)",
    "yaml outside": "xacro.load_yaml('/etc/passwd')",
    "yaml above": "xacro.load_yaml('../secret.yaml')",
    "yaml by a link": "xacro.load_yaml('link.yaml')",
    "yaml of a device": "xacro.load_yaml('/dev/zero')",
    "yaml object": "xacro.load_yaml('object.yaml')",
    "yaml bomb": "len(xacro.load_yaml('bomb.yaml')['d'])",
    "yaml ring": "len(xacro.load_yaml('ring.yaml'))",
    "yaml depth": "len(xacro.load_yaml('deep.yaml'))",
    "yaml unit": "xacro.load_yaml('unit.yaml')",
    "aliases compared": "xacro.load_yaml('alias.yaml')['z'] == xacro.load_yaml('alias.yaml')['z']",
    "aliases written": "str(xacro.load_yaml('alias.yaml')['z'])",
}
GROWING = (
    "".join(f'<xacro:macro name="m{k}" params="">{f"<xacro:m{k + 1}/>" * 10}</xacro:macro>' for k in range(9))
    + '<xacro:macro name="m9" params=""><link name="a"/></xacro:macro><xacro:m0/>'
)
FILES = {
    "environment": "<a v='$(env HOME)'/>",
    "environment or else": "<a v='$(optenv HOME x)'/>",
    "unknown word": "<a v='$(command ls)'/>",
    "eval of a call": "<a v='$(eval __import__(&quot;os&quot;).getcwd())'/>",
    "eval power": "<a v='$(eval 9**9**9)'/>",
    "unknown package": "<a v='$(find nowhere)'/>",
    "package above": f"<{X}include filename='package://arm/../../secret.xacro'/>",
    "find above": f"<{X}include filename='$(find arm)/../secret.xacro'/>",
    "absolute include": f"<{X}include filename='/etc/passwd'/>",
    "relative include": f"<{X}include filename='../secret.xacro'/>",
    "include by a link": f"<{X}include filename='link.xacro'/>",
    "include by a linked folder": f"<{X}include filename='folder/secret.xacro'/>",
    "include of a file url": f"<{X}include filename='file:///etc/passwd'/>",
    "include of everything": f"<{X}include filename='*.xacro'/>",
    "include of a folder": f"<{X}include filename='.'/>",
    "include of itself": f"<{X}include filename='arm.xacro'/>",
    "name of no file": f"<{X}include filename='{'a' * 5000}'/>",
    "macro of itself": f"<{X}macro name='m' params=''><{X}m/></{X}macro><{X}m/>",
    "macros of macros": GROWING,
    "two macros": f"<{X}macro name='a' params=''><{X}b/></{X}macro>"
    f"<{X}macro name='b' params=''><{X}a/></{X}macro><{X}a/>",
    "macro in a macro": f"<{X}macro name='m' params='k'><{X}m k='${{k}}${{k}}'/></{X}macro><{X}m k='aaaaaaaaaa'/>",
    "property of itself": f"<{X}property name='p' value='${{p}}'/><a v='${{p}}'/>",
    "ring of properties": f"<{X}property name='p' value='${{q}}'/><{X}property name='q' value='${{p}}'/>"
    "<a v='${p}'/>",
    "doubling properties": "".join(
        f"<{X}property name='p{k + 1}' value='${{p{k}}}${{p{k}}}'/>" for k in range(40)
    ) + f"<{X}property name='p0' value='aaaaaaaaaa'/><a v='${{p40}}'/>",
    "hidden name": f"<{X}property name='__builtins__' value='1'/>",
    "element of no name": f"<{X}element {X}name='a b&lt;c'/>",
    "attribute of no name": f"<{X}attribute name='a b' value='1'/>",
    "open expression": "<a v='${1 + 1'/>",
    "many open expressions": f"<a v='{'${' * 100000}'/>",
    "open parameters": f"<{X}macro name='m' params=\"a:='\"/>",
    "block of itself": f"<{X}property name='b'><{X}insert_block name='b'/></{X}property><{X}insert_block name='b'/>",
    "no macro": f"<{X}nothing/>",
    "deep elements": "<a>" * 5000 + "</a>" * 5000,
    "call of a class": f"<{X}call macro='__class__'/>",
    "namespace of a scope": f"<{X}include filename='part.xacro' ns='n'/><a v='${{n.evaluate}}'/>",
    "method of a scope": f"<{X}include filename='part.xacro' ns='n'/><a v='${{n.find(1)}}'/>",
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
    merges = "\n".join(f"{b}: {{<<: [{', '.join([f'*{a}'] * 10)}]}}" for a, b in ("ab", "bc", "cd"))
    (folder / "bomb.yaml").write_text("a: &a {k: 1}\n" + merges.replace("b: {", "b: &b {").replace("c: {", "c: &c {"))
    aliases = "\n".join(f"{b}: &{b} [{', '.join([f'*{a}'] * 10)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True))
    (folder / "alias.yaml").write_text(f"a: &a [x]\n{aliases}\nz: *i")
    (folder / "ring.yaml").write_text("&a [*a]")
    (folder / "deep.yaml").write_text("[" * 50_000)
    (folder / "unit.yaml").write_text("a: !degrees __import__('os').getcwd()")
    return folder / "arm.xacro"


def refused(path):
    began = time.process_time()
    with pytest.raises(InputError) as refusal:
        expand_template(path, Packages({"arm": path.parent}))
    assert time.process_time() - began < MOST_SECONDS
    assert SECRET not in str(refusal.value)
    assert "root:" not in str(refusal.value)
    assert str(refusal.value).startswith(str(path))


@pytest.mark.parametrize("expression", EXPRESSIONS.values(), ids=EXPRESSIONS.keys())
def test_an_expression_is_arithmetic_and_names_alone(arm, expression):
    text = expression.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    arm.write_text(f'{HEAD}<link name="${{{text}}}"/></robot>')
    refused(arm)
    assert sorted(p.name for p in arm.parent.iterdir() if "owned" in p.name) == []


@pytest.mark.parametrize("content", FILES.values(), ids=FILES.keys())
def test_nothing_outside_is_read_and_nothing_grows_without_end(arm, content):
    arm.write_text(f"{HEAD}{content}</robot>")
    refused(arm)


@pytest.mark.parametrize("document", ENTITIES.values(), ids=ENTITIES.keys())
@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf"])
def test_documents_declare_no_entities(arm, document, name):
    path = arm.with_name(name)
    path.write_text(document)
    began = time.process_time()
    with pytest.raises(InputError, match=r"arm\.(xacro|urdf): "):
        load_robot(path)
    assert time.process_time() - began < MOST_SECONDS


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
