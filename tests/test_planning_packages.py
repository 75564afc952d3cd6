"""Planning alone needs compiled packages that not every system has; all else works where they are not installed."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement

import planner
from docs.plain_words import nodes_of
from planner.cell.reading import read_cell
from planner.common.errors import MissingProgramError
from planner.kinematics.chain import Transform
from planner.kinematics.geometry import rpy_of
from planner.kinematics.robot import elementary_placement
from planner.motion import planning_packages
from planner.motion.timing import phases
from planner.programs.dialect import dialect_names
from planner.session.neutral_program import driven_form
from planner.session.plan_record import part_hashes
from planner.session.planned_session import load_session
from planner.workflow.plan_use import export, simulate
from tests.not_everywhere import pin
from tests.workflow.small_plan import write_small_plan

ROOT = Path(planner.__file__).parent
PACKAGES = {"pinocchio", "coal", "ompl", "fcl", "ruckig"}
DOOR = "planning_packages.py"
EXAMPLES = ROOT.parent / "examples"
WITHOUT = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {packages}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from planner.cli.app import main
main()
"""


def edbb_without(*words, cwd=None, env=None, flags=(), text=True):
    """Run the command in a process of its own in which no package of planning can be imported."""
    code = WITHOUT.format(packages=PACKAGES)
    return subprocess.run(
        [sys.executable, *flags, "-c", code, *map(str, words)],
        capture_output=True,
        encoding="utf-8" if text else None,
        cwd=cwd,
        env=env,
        check=False,
    )


def _imported(path):
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from (a.name.partition(".")[0] for a in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield str(node.module).partition(".")[0]


@pytest.mark.slow
def test_one_file_names_the_packages_of_planning():
    naming = {p.name for p in ROOT.rglob("*.py") if PACKAGES & set(_imported(p))}
    assert naming == {DOOR}


@pytest.mark.slow
def test_no_module_loads_a_package_of_planning():
    code = (
        "import sys, pkgutil, planner; from importlib import import_module\n"
        "for m in pkgutil.walk_packages(planner.__path__, 'planner.'):\n"
        "    if not m.name.endswith('__main__'): import_module(m.name)\n"
        f"print('loaded:', *sorted({PACKAGES} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["loaded:"]


@pytest.mark.slow
def test_planning_without_its_packages_says_in_one_sentence_where_it_can_be_done(tmp_path):
    commands = (
        ["plan", "ur10/edbb"], ["study", "ur10/edbb"], ["plan-check", "ur10/edbb", "--model", "b"],
        ["demo", "ur10/edbb"], ["demo", "--poses", "30"],
    )  # fmt: skip
    one_by_one = "for sys.argv[1:] in {}:\n    try: main()\n    except SystemExit as done: print(done.code)\n"
    code = WITHOUT.format(packages=PACKAGES).replace(
        "\nmain()\n", "\n" + one_by_one.format([[*c, "-o", "out"] for c in commands])
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout.split() == ["4"] * len(commands), done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == len(commands)
    for line in lines:
        assert line.startswith("edbb: planning needs")
        for word in ("pin", "--server URL", "Linux, macOS, WSL", "container"):
            assert word in line
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_a_run_is_identified_without_packages_of_planning(tmp_path):
    words = ("identify", EXAMPLES / "measured_run.csv", "--cell", EXAMPLES / "measured_run.toml", "-o", "out")
    done = edbb_without(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {"report.html", "robot.toml", "identification.json"} <= {p.name for p in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize("kind", ["translation", "rotation"])
def test_elementary_transforms_are_those_of_pinocchio(kind):
    rng = np.random.default_rng(1)
    for axis in range(3):
        for value in rng.uniform(-7.0, 7.0, 20):
            v = np.eye(3)[axis] * value
            T = pin.SE3(np.eye(3), v) if kind == "translation" else pin.SE3(pin.exp3(v), np.zeros(3))
            ours = elementary_placement(Transform("x", kind, axis, 0.0), value)
            np.testing.assert_allclose(ours, T.homogeneous, atol=1e-15)


def test_roll_pitch_and_yaw_are_those_of_pinocchio_and_at_a_right_angle_give_the_rotation_back():
    for R in (pin.exp3(v) for v in np.random.default_rng(2).uniform(-3.0, 3.0, (50, 3))):
        np.testing.assert_allclose(rpy_of(R), pin.rpy.matrixToRpy(R), atol=1e-12)
    for pitch in (np.pi / 2, -np.pi / 2):
        R = pin.rpy.rpyToMatrix(0.3, pitch, -0.8)
        np.testing.assert_allclose(pin.rpy.rpyToMatrix(rpy_of(R)), R, atol=1e-9)


def _mac(kernel, machine):
    version = f"Darwin Kernel Version {kernel}.1.0: Mon Sep 16 2024; root:xnu-1/RELEASE_ARM64_T8103"
    return {"sys_platform": "darwin", "platform_machine": machine, "platform_version": version}


LINUX = {"sys_platform": "linux", "platform_machine": "x86_64", "platform_version": "#1 SMP Debian 6.1.0-18"}
WINDOWS = {"sys_platform": "win32", "platform_machine": "AMD64", "platform_version": "10.0.22631"}


@pytest.mark.parametrize(
    ("system", "found"),
    [
        (LINUX, {"pin", "python-fcl", "ruckig", "ompl"}),
        (WINDOWS, set()),
        (_mac(23, "arm64"), {"pin", "python-fcl", "ruckig"}),  # macOS 14
        (_mac(24, "arm64"), {"pin", "python-fcl", "ruckig", "ompl"}),
        (_mac(24, "x86_64"), {"pin", "python-fcl", "ompl"}),
    ],
    ids=["linux", "windows", "macos-14", "macos-15", "macos-15-intel"],
)
def test_pip_is_asked_for_what_has_wheels(system, found):
    """As looked up on the registry with ``pip download --platform … --only-binary=:all:``; docs/install.md."""
    project = tomllib.loads((ROOT.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {r.name for r in map(Requirement, project["dependencies"]) if not r.marker or r.marker.evaluate(system)}
    assert asked & {"pin", "python-fcl", "ruckig", "ompl"} == found
    assert {"numpy", "scipy", "highspy", "polars", "pyserial"} <= asked


@pytest.fixture
def without_packages(monkeypatch):
    """Let this process believe that no package of planning is installed."""
    monkeypatch.setattr(planning_packages, "is_installed", lambda name: name not in PACKAGES)
    monkeypatch.setattr(phases, "is_installed", lambda name: name not in PACKAGES)
    monkeypatch.setattr("planner.session.judgement.judge_program", _not_called)


def _not_called(*_):
    raise AssertionError("there is no engine to judge with")


@pytest.fixture
def planned(tmp_path):
    """A small plan as ``edbb plan`` writes it, with a program in KRL."""
    plan = write_small_plan(tmp_path, "kuka-kr6-r700/edbb", 2)
    plan["programs"] = [{"dialect": "krl", "file": "A.src"}, {"dialect": "krl", "file": "A.dat"}]
    plan["hashes"] = part_hashes(
        {k: v for k, v in plan.items() if k != "hashes"}, read_cell(tmp_path / "cell.toml", "cell")
    )
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan), encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_plan_as_it_was_proven_is_exported_without_engines_and_its_program_says_so(planned, without_packages):
    made = export(planned, dialect="krl", name="a")
    (note,) = made.notes
    assert "was not judged anew" in note
    assert "proven anew" not in note
    head = re.sub(r"\W+", " ", made.programs[0].text[:3000])
    assert "was not judged anew where it was written" in head


def test_the_program_without_engines_drives_what_the_one_with_them_drives(planned, monkeypatch, request):
    judged = export(planned, dialect="krl", name="a").programs
    request.getfixturevalue("without_packages")
    trusted = export(planned, dialect="krl", name="a").programs
    for a, b in zip(judged, trusted, strict=True):
        mine, theirs = ([x for x in f.text.splitlines() if not x.lstrip().startswith(";")] for f in (a, b))
        assert mine == theirs


def test_what_differs_from_what_was_proven_is_refused_without_engines(planned, without_packages):
    cell = planned.parent / "cell.toml"
    text = cell.read_text(encoding="utf-8")
    assert "[controller]\n" in text
    cell.write_text(text.replace("[controller]\n", "[controller]\nsync_output = 33\n"), encoding="utf-8")
    with pytest.raises(MissingProgramError, match=r"not as it was planned.*proven anew by both.*not installed here"):
        export(planned, dialect="krl", name="a")
    cell.write_text(text, encoding="utf-8")
    dense = next(n for n in dialect_names() if driven_form(n) != driven_form("krl") and n in ("bnr", "din66025"))
    with pytest.raises(MissingProgramError, match="no program was proven with it that drives as this dialect does"):
        export(planned, dialect=dense, name="a")


def test_a_run_of_a_changed_plan_is_simulated_without_engines_and_that_is_said(planned, without_packages):
    plan = json.loads(planned.read_text(encoding="utf-8"))
    planned.write_text(json.dumps(plan | {"seed": 12}), encoding="utf-8")
    said = simulate(planned, seed=1).run.warnings
    assert any("not proven anew" in w for w in said)


def test_ruckigs_profile_is_written_down_in_closed_form_where_ruckig_is_not_installed(planned, request):
    with_ruckig = load_session(planned, "exported", check=True).courses[0].trajectory
    request.getfixturevalue("without_packages")
    closed = load_session(planned, "exported", check=True).courses[0].trajectory
    assert closed.duration_s == pytest.approx(with_ruckig.duration_s, rel=1e-6)
    t = np.linspace(0.0, closed.duration_s, 500)
    np.testing.assert_allclose(closed.at(t).q, with_ruckig.at(t).q, atol=1e-6)
