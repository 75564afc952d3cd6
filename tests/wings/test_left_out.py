"""The planner is whole without any of its extensions: the chain runs, and no command of theirs is there."""

import ast
import json
import os
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from docs.plain_words import nodes_of
from planner.cell.section_registry import section_readers
from planner.common.commands import extension_commands
from planner.common.extensions import GROUP
from planner.wings import SECTIONS
from planner.workflow.verbs import CORE, declared_calls
from tests.golden.cases import shipped
from tests.wings import registered
from tests.wings.installation import ROOT, WINGS, edbb_in, files_of, install_without, parts_of, run_in

TABLES, REGISTERED = registered.TABLES, registered.__file__
READ = "from planner.cell.reading import load_cell, shipped_cells; print(shipped_cells()); load_cell('mine.toml')"
QUICK = ("checks", "serving")  # of a room and of the service; the release is tried without each
LISTED = re.compile(r"^│ ([\w-]+) {2,}\w", re.MULTILINE)
HOME = ROOT / "planner"
EVERY_MODULE = """
import planner, sys
from importlib import import_module
from pathlib import Path
assert Path(planner.__file__).parents[1] == Path({home!r}), planner.__file__
for path in sorted(Path(planner.__file__).parent.rglob("*.py")):
    name = ".".join(path.relative_to(Path({home!r})).with_suffix("").parts).removesuffix(".__init__")
    if not name.startswith({without!r}) and not name.endswith("__main__"):
        import_module(name)
"""


def imported_files(path):
    """The files that may be meant by what a file imports from the planner."""
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("planner."):
            base = ROOT.joinpath(*node.module.split("."))
            yield from (base.with_suffix(".py"), base / "__init__.py")
            for name in (a.name for a in node.names):
                yield from ((base / name).with_suffix(".py"), base / name / "__init__.py")


def own_commands(wing):
    """The commands of an extension alone."""
    declared_calls()
    text = (HOME / "wings" / f"{wing}.py").read_text()
    tree = ast.parse(text)
    words = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    names = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}
    return {c.name for c in extension_commands().values() if c.name in words or (c.call and c.call.__name__ in names)}


@pytest.mark.parametrize("wing", WINGS)
def test_an_extension_says_which_files_are_its_own(wing):
    assert all((HOME / part).exists() for part in parts_of(wing))
    others = {f for other in WINGS if other != wing for f in files_of(other)}
    assert not others & set(files_of(wing))
    assert own_commands(wing)


def test_the_metadata_of_the_package_names_every_extension():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["entry-points"][GROUP] == WINGS


@pytest.mark.slow
def test_no_file_of_the_core_imports_one_of_an_extension():
    """Nor do its types; what shipped extensions give to editors stands in ``planner/wings/names.pyi``."""
    owner = {f: wing for wing in WINGS for f in files_of(wing)}
    for path in HOME.rglob("*.py"):
        if path in owner:
            continue
        taken = [f for f in imported_files(path) if f in owner]
        assert not taken, (
            f"{path.relative_to(HOME)}: {taken[0].relative_to(HOME)} is of the extension {owner[taken[0]]}"
        )


def test_no_text_of_the_core_names_a_command_of_an_extension():
    """What a message says of one, its extension tells (``common/advice.py``)."""
    theirs = {path for wing in WINGS for path in files_of(wing)}
    commands = sorted({name for wing in WINGS for name in own_commands(wing)})
    named = re.compile(rf"edbb ({'|'.join(commands)})\b")
    core = [p for kind in ("*.py", "*.j2") for p in HOME.rglob(kind) if p not in theirs and "service" not in p.parts]
    found = {str(p.relative_to(HOME)): named.findall(p.read_text()) for p in core}
    assert not {path: names for path, names in found.items() if names}
    assert named.search("edbb centre")


@pytest.mark.parametrize("wing", WINGS)
def test_an_extension_names_the_others_that_it_imports(wing):
    """Its command names them where they are left out, and ends with the code of what is not installed."""
    declared_calls()
    owner = {f: other for other in WINGS for f in files_of(other)}
    named = {f for path in files_of(wing) if path.suffix == ".py" for f in imported_files(path)}
    needed = {owner[f] for f in named if f in owner} - {wing}
    commands = [extension_commands()[name] for name in own_commands(wing)]
    assert set().union(*(c.needs for c in commands)) == needed


@pytest.mark.slow
def test_a_command_that_needs_an_extension_that_is_left_out_says_so(tmp_path):
    environment = install_without(tmp_path, "circles", "checks")
    for words, absent in (
        (["serve"], "extensions checks, circles, which are"),
        (["fleet"], "extension checks, which is"),
    ):
        done = edbb_in(tmp_path, environment, *words)
        assert done.returncode == 4
        assert done.stderr.strip().endswith(f"edbb {words[0]} needs the {absent} not installed here"), done.stderr


def test_no_verb_of_an_extension_is_one_of_the_core():
    core = {call.verb for call in CORE}
    assert core == {"plan", "export", "simulate", "identify", "import", "compensate"}
    assert set(declared_calls()) > core
    assert not core & set(extension_commands())


@pytest.fixture(scope="module")
def each():
    """What each extension registers where all are installed."""
    return json.loads(run_in(ROOT, {**os.environ, "PYTHONPATH": str(ROOT)}, REGISTERED).stdout)


def test_extensions_register_in_the_tables_that_are_compared_and_nowhere_else(each):
    called = set()
    for path in HOME.glob("wings/*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        of = {a.name: n.module for n in nodes if isinstance(n, ast.ImportFrom) for a in n.names}
        calls = {ast.unparse(n.func) for n in nodes if isinstance(n, ast.Call)}
        called |= {of[name] for name in calls if name.startswith("register_")}
        assert all(name.startswith("register_") or of[name] in TABLES or name[0].isupper() for name in calls & set(of))
    assert called == set(TABLES)
    for module, tables in TABLES.items():
        tree = ast.parse(Path(import_module(module).__file__).read_text())
        empty = [n for n in tree.body if isinstance(n, ast.AnnAssign) and ast.unparse(n.value) in ("{}", "[]")]
        filled = {ast.unparse(n.target) for n in empty}
        assert filled == set(tables)
    assert not each[""]
    assert all(len(each[wing]) == len(set(each[wing])) > 0 for wing in WINGS)


@pytest.mark.slow
@pytest.mark.parametrize("wing", [w if w in QUICK else pytest.param(w, marks=pytest.mark.long) for w in WINGS])
def test_without_an_extension_all_but_its_own_is_registered_and_listed(tmp_path, wing, each):
    """Registration adds up: so a test of the core that passes with all extensions and with none passes with some.

    No module of the core imports one of theirs; all that it meets of them are the entries of these tables.
    """
    environment = install_without(tmp_path, wing)
    found = run_in(tmp_path, environment, REGISTERED)
    assert found.returncode == 0, found.stderr
    assert json.loads(found.stdout) == {name: entries for name, entries in each.items() if name != wing}
    done = edbb_in(tmp_path, environment, "--help")
    assert done.returncode == 0, done.stderr
    left = set(LISTED.findall(done.stdout))
    assert {"plan", "simulate", "identify", "compensate", "robots"} <= left
    assert left.isdisjoint(own_commands(wing))
    gone = edbb_in(tmp_path, environment, sorted(own_commands(wing))[0], "--help")
    assert gone.returncode == 2
    assert "No such command" in gone.stderr


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    folder = tmp_path_factory.mktemp("core")
    return folder, install_without(folder, *WINGS)


@pytest.mark.slow
def test_every_module_of_the_core_is_imported_without_extensions(core):
    folder, environment = core
    code = EVERY_MODULE.format(home=str(folder), without="planner.wings.")
    done = run_in(folder, environment, "-c", code)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.long
def test_the_chain_runs_without_extensions(core):
    """From a cell to a corrected program, with nothing installed but the core."""
    folder, environment = core
    (folder / "cell.toml").write_text(shipped("kuka-kr6-r700/edbb"))

    def run(*words):
        done = edbb_in(folder, environment, *words)
        assert done.returncode == 0, (words, done.stderr[-2000:])
        return done

    said = run("plan", "cell.toml", "-o", "out", "--poses", 30, "--index", "O1", "--dialect", "krl").stderr
    assert "edbb identify" in said
    run("simulate", "out/plan.json", "-o", "run.csv", "--seed", 3)
    run("identify", "run.csv", "--cell", "out/cell.toml", "--plan", "out/plan.json", "-o", "calibrated")
    assert json.loads((folder / "calibrated" / "identification.json").read_text())["robot"] == "kuka-kr6-r700"
    (source,) = (folder / "out").glob("*.src")
    words = ("compensate", source, "--measuring", "--model", "calibrated/robot.toml", "-o", "corrected.src")
    done = edbb_in(folder, environment, *words)
    assert done.returncode in (0, 5), done.stderr
    assert (folder / "corrected.src").read_text() != source.read_text()


@pytest.mark.slow
def test_a_section_that_only_an_extension_reads_is_refused_by_the_name_of_it(core):
    folder, environment = core
    (folder / "mine.toml").write_text(shipped("comau-nj130/circular"))
    done = run_in(folder, environment, "-c", READ)
    said = done.stderr.strip().splitlines()[-1]
    assert said.endswith("mine.toml: [[circles]] is read by the extension 'circles', which is not installed here"), said
    assert "comau-nj130/edbb" in done.stdout
    assert "comau-nj130/circular" not in done.stdout


@pytest.mark.parametrize("wing", WINGS)
def test_the_sections_that_are_told_of_are_those_that_an_extension_declares(wing):
    """What names them where they are left out says the same as what declares them."""
    calls = [n for n in ast.walk(ast.parse((HOME / "wings" / f"{wing}.py").read_text())) if isinstance(n, ast.Call)]
    named = [c.args[0] for c in calls if getattr(c.func, "id", "") == "register_section"]
    declared = {ast.literal_eval(name) for name in named}
    assert declared == {key for key, owner in SECTIONS.items() if owner == wing}
    assert declared <= set(section_readers())


@pytest.mark.slow
def test_what_only_an_extension_plans_is_told(core):
    folder, environment = core
    (folder / "plan.json").write_text(json.dumps({"schema": "edbb-plan/1", "kind": "circular", "plan_id": "0" * 12}))
    done = edbb_in(folder, environment, "simulate", "plan.json", "-o", "run.csv")
    assert done.returncode == 2
    assert "is a plan of the kind 'circular', and no extension that is installed here reads it" in done.stderr
    done = edbb_in(folder, environment, "--server", "http://127.0.0.1:1", "robots")
    assert done.returncode == 4
    assert "no extension that is installed here runs commands on a server" in done.stderr


@pytest.mark.slow
def test_a_name_of_an_extension_that_is_left_out_is_told(core):
    folder, environment = core
    done = run_in(folder, environment, "-c", "from planner import plan, study")
    assert "cannot import name 'study' from 'planner'" in done.stderr
    assert import_module("planner").study
