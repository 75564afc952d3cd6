"""Packages that bring effects and gauges: their modules are imported before a file is read."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import edbb

ROOT = Path(__file__).resolve().parents[2]
READ = """
from planner.cell.gauge_registry import gauge_kinds
from planner.effects.catalogue import effect_kinds
from planner.effects.phi_keys import functions_in
print(gauge_kinds()["plane-dial"].__module__, functions_in("hose:4")[0].__module__, "hose pull" in effect_kinds())
"""


def _install(folder, **modules):
    """A package as pip leaves it: its entry points are all that counts."""
    facts = folder / "cables-1.0.dist-info"
    facts.mkdir(parents=True)
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: cables\nVersion: 1.0\n")
    lines = (f"{name} = {module}\n" for name, module in modules.items())
    (facts / "entry_points.txt").write_text("[edbb.extensions]\n" + "".join(lines))
    return os.pathsep.join((str(folder), str(ROOT)))


needs_path = pytest.mark.skipif(sys.flags.ignore_environment, reason="this Python asks for no PYTHONPATH")


@pytest.mark.slow
@needs_path
def test_modules_of_an_installed_package_are_known(tmp_path):
    path = _install(tmp_path, dial="tests.gauges.plane_dial", hose="tests.effects.hose_pull")
    done = subprocess.run(
        [sys.executable, "-c", READ],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert done.stdout == "tests.gauges.plane_dial tests.effects.hose_pull True\n", done.stderr


@pytest.mark.slow
@needs_path
def test_a_module_that_cannot_be_used_is_named(tmp_path):
    path = _install(tmp_path / "site", cables="cables_of_mine")
    text = "from planner.effects.catalogue import register\nregister('backlash')(lambda run: ())"
    said = "ValueError: effect 'backlash': planner.effects.backlash has registered it already"
    (tmp_path / "site" / "cables_of_mine.py").write_text(text)
    done = edbb("plan", "ur10/edbb", "-o", tmp_path / "out", PYTHONPATH=path)
    assert done.returncode == 2
    assert done.stderr == f"edbb: extension 'cables' (cables_of_mine): {said}\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "from planner.effects.catalogue import register\nregister('backlash')(lambda run: ())",
            "ValueError: effect 'backlash': planner.effects.backlash has registered it already",
        ),
        (
            "from planner.cell.gauge import Gauge\nfrom planner.cell.gauge_registry import register_gauge\n"
            "register_gauge(type('Mine', (Gauge,), {'kind': 'tracker'}))",
            "ValueError: gauge kind 'tracker': planner.gauges.tracker has registered it already",
        ),
    ],
)
def test_who_takes_a_shipped_name_is_told_at_once(text, said):
    done = subprocess.run(
        [sys.executable, "-c", text],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == said
