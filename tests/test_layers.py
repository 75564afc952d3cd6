"""Imports point down, rooms of one layer do not tangle, and what the libraries must not do is not asked of them."""

import ast
import re
from functools import cache
from inspect import get_annotations, isfunction
from pathlib import Path
from typing import Any

import pytest

import planner
from docs.plain_words import nodes_of
from docs.rooms_table import PAGE, rooms_table, with_table
from planner.cell.gauge import Gauge, GaugeFrames, GaugeNumbers, GaugeReach
from planner.cell.gauge_session import GaugeReading, GaugeSession, GaugeWay
from planner.effects.gauge_unknowns import GaugeUnknowns

ROOT = Path(planner.__file__).parent
# from the ground up; a room may import only what stands before it
ORDER = [
    "common", "kinematics", "runs", "cell", "effects", "gauges", "model", "motion", "design", "programs", "session",
    "fit", "inference", "tracing", "release", "documents", "identification", "compensation",
    "simulation", "centring", "next_session", "accuracy", "circular", "loaded", "checks", "report", "studies",
    "workflow", "reproduction", "cli", "service", "wings",
]  # fmt: skip


def room_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_modules(path):
    """The modules of the package that a file imports, each as its path's parts without ``planner``."""
    for node in nodes_of(path):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            longer = [f"{node.module}.{a.name}" for a in node.names]
            names = [name if is_module(name) else node.module for name in longer]
        elif isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "planner" and len(parts) > 1:
                yield tuple(parts[1:])


@cache
def is_module(name):
    path = ROOT.parent.joinpath(*name.split("."))
    return path.is_dir() or path.with_suffix(".py").exists()


def imported_rooms(path):
    return {parts[0] for parts in imported_modules(path)}


def public_modules():
    """What each room, and each public folder of it, lists in ``__all__``: {folder's parts: names}."""
    out = {}
    for path in ROOT.rglob("*/__init__.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                continue
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if getattr(target, "id", "") == "__all__":
                out[path.parent.relative_to(ROOT).parts] = set(ast.literal_eval(node.value))
    return out


def test_every_room_has_its_place():
    rooms = {room_of(p) for p in ROOT.rglob("*.py")} - {"__init__", "_data"}
    assert rooms <= set(ORDER), f"rooms without a layer: {rooms - set(ORDER)}"


def test_the_table_of_rooms_is_as_it_is_generated():
    page = PAGE.read_text(encoding="utf-8")
    assert with_table(page, ORDER) == page, "python -m docs.rooms_table writes it"
    assert rooms_table(ORDER) in page
    assert page.count("\n") <= 120, "a page of architecture that is read in ten minutes"


@pytest.mark.slow
def test_imports_point_down():
    wrong = []
    for path in ROOT.rglob("*.py"):
        room = room_of(path)
        if room == "__init__":
            continue
        wrong += [
            f"{path.name}: {room} imports {other}"
            for other in imported_rooms(path)
            if other != room and ORDER.index(other) > ORDER.index(room)
        ]
    assert not wrong, wrong


def imports_of(path):
    """The files of the package that a file imports, those that only its types need (``TYPE_CHECKING``) included."""
    for parts in imported_modules(path):
        target = ROOT.joinpath(*parts)
        file = target / "__init__.py" if target.is_dir() else target.with_suffix(".py")
        if file.exists() and file != path:
            yield file


@pytest.mark.slow
def test_no_files_import_each_other():
    """Kahn's order: what is left, once files that import none of the rest are taken away, goes round in a circle."""
    left = {path: set(imports_of(path)) for path in ROOT.rglob("*.py") if path.name != "__init__.py"}
    left = {path: {file for file in files if file in left} for path, files in left.items()}
    while free := {path for path, files in left.items() if not files & left.keys()}:
        left = {path: files for path, files in left.items() if path not in free}
    assert not left, sorted(str(path.relative_to(ROOT)) for path in left)


MOST_MEMBERS = 25
GAUGE_PROTOCOLS = (GaugeReading, GaugeNumbers, GaugeFrames, GaugeReach, GaugeSession, GaugeWay, Gauge, GaugeUnknowns)


@pytest.mark.parametrize("protocol", GAUGE_PROTOCOLS)
def test_each_protocol_of_a_gauge_is_small(protocol):
    made = {"_abc_impl"}  # by Python
    members = {n for n in {*vars(protocol), *get_annotations(protocol)} - made if not n.startswith("__")}
    assert 0 < len(members) <= MOST_MEMBERS, sorted(members)
    methods = [getattr(m, "__func__", getattr(m, "fget", m)) for m in vars(protocol).values()]
    typed = [(f.__name__, *item) for f in methods if isfunction(f) for item in get_annotations(f).items()]
    vague = [(function, name) for function, name, kind in typed if kind is Any and name != "return"]
    assert not vague


@pytest.mark.slow
def test_no_import_goes_past_the_public_modules_of_a_room():
    public, used, wrong = public_modules(), set(), []
    assert {folder[0] for folder in public} == set(ORDER), "every room lists its public modules"
    for path in (*ROOT.rglob("*.py"), *ROOT.rglob("*.pyi")):
        for parts in imported_modules(path):
            if room_of(path) == parts[0]:
                continue
            steps = [(parts[:k], parts[k]) for k in range(1, len(parts))]
            used.update(steps)
            if not steps or any(name not in public.get(folder, ()) for folder, name in steps):
                wrong.append(f"{path.relative_to(ROOT)}: {'.'.join(parts)}")
    assert not wrong, f"internal modules imported from another room: {wrong}"
    listed = {(folder, name) for folder, names in public.items() for name in names}
    assert listed <= used, f"listed, but no other room imports it: {sorted(listed - used)}"


def test_files_and_functions_stay_small():
    for path in ROOT.rglob("*.py"):
        text = path.read_text()
        assert text.count("\n") <= 400, path
        for node in nodes_of(path):
            if isinstance(node, ast.FunctionDef):
                doc = ast.get_docstring(node) or ""
                assert node.end_lineno - node.lineno - doc.count("\n") <= 60, f"{path}: {node.name}"


IRREGULAR = re.compile(
    "beaten|become|begun|bent|bought|broken|brought|caught|chosen|dealt|done|drawn|driven|felt|forgotten|found|given|gone|"
    "grown|heard|held|hidden|hung|kept|known|laid|led|left|lent|lost|made|meant|met|paid|risen|said|seen|sent|shown|"
    "sought|spent|spoken|spun|stolen|stood|struck|stuck|swept|swung|taken|thought|thrown|told|torn|understood|won|"
    "worn|wound|written"
)
NO_PARTICIPLES = {"seed", "need", "feed", "speed", "deed"}
PARTICLES = {
    "again", "apart", "aside", "away", "down", "from", "in", "into", "of", "off", "on", "out", "over", "to", "together",
    "up", "with", "after", "along", "before", "by", "there",
}  # fmt: skip
NAMED_BY_OTHERS = {
    "connection_made", "connection_lost", "data_received",  # methods of asyncio.Protocol
    "evaluate_loaded",  # the command evaluate-loaded
}  # fmt: skip


def _is_participle(word):
    return word not in NO_PARTICIPLES and bool(word.endswith("ed") or IRREGULAR.fullmatch(word))


def _is_named_by_a_participle(function):
    """A participle alone, or with a particle; or one at the end, where the noun that it is of is missing.

    A property that is true or false may be one (``file.closed``), and so may a name that asks (``is_known``).
    """
    first, *others = words = function.name.strip("_").split("_")
    if function.name in NAMED_BY_OTHERS or (getattr(function.returns, "id", "") == "bool" and _is_property(function)):
        return False
    alone = PARTICLES.issuperset(others) and _is_participle(first)
    return alone or (first not in ("is", "are", "has", "was") and _is_participle(words[-1]))


def _is_property(function):
    return any("property" in ast.unparse(d) for d in function.decorator_list)


def test_no_function_is_named_by_a_participle():
    """A verb does (``solve_ik``), a noun is (``measured_circles``); properties, validators and wrappers as well.

    A decorator may be called by one with ``with``: it stands above what is so.
    """
    decorators = {"called_with"}
    wrong = []
    for path in ROOT.rglob("*.py"):
        functions = (n for n in nodes_of(path) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
        wrong += [f"{path}: {f.name}" for f in functions if f.name not in decorators and _is_named_by_a_participle(f)]
    assert not wrong, f"name what they do, or what they return: {wrong}"


@pytest.mark.parametrize(
    ("source", "wrong"),
    [
        ("def held(): ...", True), ("def _told(x): ...", True), ("def left_out(): ...", True),
        ("def as_driven(): ...", True),
        ("def delete_sent(): ...", True), ("def measured_circles(): ...", False), ("def is_known(): ...", False),
        ("@property\ndef passed(self) -> bool: ...", False), ("@property\ndef tried(self) -> int: ...", True),
        ("def feed(): ...", False), ("async def done(): ...", True),
    ],
)  # fmt: skip
def test_a_participle_is_known(source, wrong):
    assert _is_named_by_a_participle(ast.parse(source).body[0]) is wrong


def test_no_room_prints_or_exits():
    for path in ROOT.rglob("*.py"):
        if room_of(path) == "cli":
            continue
        for node in nodes_of(path):
            called = isinstance(node, ast.Call) and ast.unparse(node.func)
            assert called not in ("print", "sys.exit", "exit"), path


OF_THE_PROCESS = {  # what a process keeps beside its results; ARCHITECTURE.md says why it is not handed down
    "common/files.py: INPUTS", "kinematics/packages.py: COMMAND_PACKAGES",  # files that it may read, packages of ROS
    "common/second_process.py: _inside",  # that it is a second process
    "service/callers.py: CALLER", "service/rendering.py: ROOT", "service/job_api.py: STREAMS",  # requests under way
}  # fmt: skip
REGISTERED = {  # what modules register when they are imported
    "effects/basis.py: FUNCTIONS", "effects/catalogue.py: _REGISTRY", "cell/gauge_registry.py: _KINDS",
    "cell/section_registry.py: _READERS", "runs/run.py: _SCALARS", "session/evaluations.py: _EVALUATIONS",
    "session/evaluations.py: _DRAWN", "workflow/plan_kinds.py: _KINDS", "common/advice.py: _ADVICE",
    "common/commands.py: _COMMANDS", "common/commands.py: _NAMES", "common/commands.py: _REMOTE",
}  # fmt: skip
KEEPS = re.compile(r"\{\}|\[\]|(set|dict|list|Counter|local|Inputs|CommandPackages)(\[.*\])?\(\)|ContextVar\(.*\)")


def kept_by(nodes):
    """Yield the names that functions bind anew, variables of a context, and what is empty until it is filled."""
    for node in nodes:
        if isinstance(node, ast.Global):
            yield from node.names
    for node in nodes[0].body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value and KEEPS.fullmatch(ast.unparse(node.value)):
            name = ast.unparse(node.targets[0] if isinstance(node, ast.Assign) else node.target)
            kind = ast.unparse(node.annotation) if isinstance(node, ast.AnnAssign) else ""
            if name != "__all__" and "Mapping[" not in kind:
                yield name


def test_nothing_is_kept_by_a_process_but_what_is_named_here():
    files = {path.relative_to(ROOT): nodes_of(path) for path in ROOT.rglob("*.py")}
    found = {f"{path}: {name}" for path, nodes in files.items() for name in kept_by(nodes)}
    assert found == OF_THE_PROCESS | REGISTERED
    assert list(kept_by(tuple(ast.walk(ast.parse("A = {}\nB: Mapping[str, int] = {}\nC = [1]"))))) == ["A"]
