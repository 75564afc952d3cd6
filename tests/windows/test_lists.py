"""What is carried to a computer without internet is what the project asks for, each file with its hash."""

import re
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SYSTEMS = {
    "windows": {"sys_platform": "win32", "platform_system": "Windows", "platform_machine": "AMD64"},
    "linux": {"sys_platform": "linux", "platform_system": "Linux", "platform_machine": "x86_64"},
}


def listed(system):
    """Versions of the distributions in a list, by name; every line names a hash."""
    lines = (ROOT / ".ci" / f"{system}.txt").read_text().splitlines()
    found = [re.fullmatch(r"(\S+)==(\S+)((?: --hash=sha256:[0-9a-f]{64})+)", line) for line in lines]
    assert all(found), "a line without a hash"
    return {canonicalize_name(m[1]): m[2] for m in found}


@pytest.mark.parametrize("system", SYSTEMS)
def test_what_the_project_asks_for_is_in_the_list(system):
    versions = listed(system)
    extras = PROJECT["optional-dependencies"]
    asked = [
        Requirement(r) for r in [*PROJECT["dependencies"], *extras["service"], *extras["camera"], *extras["xacro"]]
    ]
    asked = [r for r in asked if r.marker is None or r.marker.evaluate(SYSTEMS[system])]
    assert len(asked) > 18
    for requirement in asked:
        assert versions[canonicalize_name(requirement.name)] in requirement.specifier, requirement


def test_planning_is_carried_to_linux_alone():
    packages = {"pin", "coal", "ompl", "python-fcl", "ruckig"}
    assert packages <= set(listed("linux"))
    assert not packages & set(listed("windows"))


@pytest.fixture
def offline(monkeypatch):
    """The module that packs the folders."""
    monkeypatch.syspath_prepend(ROOT / ".ci")
    import offline

    return offline


def test_a_distribution_without_the_text_of_its_licence_is_refused(offline, tmp_path):
    """A note that names the licence is no text; some texts are kept here, where the distribution ships none."""
    text = b"Permission is hereby granted to everybody. " * 20
    offline.write_licences("some_tool-1.0", {"METADATA": b"License: MIT", "licenses/LICENSE": text}, tmp_path)
    assert (tmp_path / "some_tool-1.0" / "LICENSE").read_bytes() == text
    for texts in ({"METADATA": b"License: MIT"}, {"licenses/LICENSE": b"MIT"}):
        with pytest.raises(SystemExit, match=r"no_text-1\.0: has no text of its licence"):
            offline.write_licences("no_text-1.0", texts, tmp_path)
    kept = {p.stem: p.read_text(encoding="utf-8") for p in (ROOT / ".ci" / "licences").glob("*.txt")}
    assert set(kept) <= set(listed("linux")) | set(listed("windows"))
    for name, said in kept.items():
        offline.write_licences(f"{name.replace('-', '_')}-1.0", {"METADATA": b""}, tmp_path)
        assert (tmp_path / f"{name.replace('-', '_')}-1.0" / "LICENSE.txt").read_text(encoding="utf-8") == said


def test_the_folder_is_refused_by_another_python(offline, monkeypatch, tmp_path):
    """Its modules are compiled by the Python that builds it."""
    monkeypatch.setattr(sys, "version_info", (3, 12, 1))
    with pytest.raises(SystemExit, match=r"Python 3\.11"):
        offline.make_windows(Path("edbb_planner-1.0.0-py3-none-any.whl"), tmp_path)
