"""Imports point down, rooms of one layer do not tangle, and what the libraries must not do is not asked of them."""

import ast
from pathlib import Path

import planner

ROOT = Path(planner.__file__).parent
# from the ground up; a room may import only what stands before it
ORDER = [
    "common", "kinematics", "runs", "cell", "effects", "gauges", "model", "motion", "design", "programs", "session",
    "identification", "tracing", "compensation", "instruments", "simulation", "report", "studies", "workflow", "cli",
]  # fmt: skip


def room_of(path):
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imported_rooms(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = [node.module]
        elif isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "planner" and len(parts) > 1:
                yield parts[1]


def test_every_room_has_its_place():
    rooms = {room_of(p) for p in ROOT.rglob("*.py")} - {"__init__", "_data"}
    assert rooms <= set(ORDER), f"rooms without a layer: {rooms - set(ORDER)}"


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


def test_files_and_functions_stay_small():
    for path in ROOT.rglob("*.py"):
        text = path.read_text()
        assert text.count("\n") <= 400, path
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                doc = ast.get_docstring(node) or ""
                assert node.end_lineno - node.lineno - doc.count("\n") <= 60, f"{path}: {node.name}"


def test_no_room_prints_or_exits():
    for path in ROOT.rglob("*.py"):
        if room_of(path) == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            called = isinstance(node, ast.Call) and ast.unparse(node.func)
            assert called not in ("print", "sys.exit", "exit"), path
