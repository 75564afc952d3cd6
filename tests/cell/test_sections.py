"""A section of cell files that an extension declares is read, checked, kept and written like those of the core."""

import copy
import pickle
import tomllib
from dataclasses import dataclass

import numpy as np
import pytest

import planner.cell.section_registry as section_registry
from planner.cell.cell import setup_of
from planner.cell.reading import SectionReader, load_cell
from planner.cell.section_content import SectionContent
from planner.cell.section_registry import register_section
from planner.common.errors import InputError
from planner.common.schema import PositiveFloat, StrictModel
from planner.session.movable_cell import cell_files
from planner.workflow.plan_kinds import kind_of_cell


class SpringTable(StrictModel):
    """``[[springs]]``: a spring that pulls at the tool while the bar is at the first fixture."""

    name: str
    pull_N: PositiveFloat = 20.0


@dataclass(frozen=True)
class Springs(SectionContent):
    """The springs of a cell, [N]."""

    pull: tuple[float, ...]
    replaces_poses = True

    @property
    def pulls(self):
        return {0: "springs.pull_N"}


READER = SectionReader(SpringTable, lambda path, file, rows: Springs(tuple(r.pull_N for r in rows)))
SPRINGS = '\n[[springs]]\nname = "a"\n\n[[springs]]\nname = "b"\npull_N = 5\n'


@pytest.fixture(autouse=True)
def declared(monkeypatch):
    monkeypatch.setattr(section_registry, "_READERS", dict(section_registry.section_readers()))
    register_section("springs", f"{__name__}:READER")


def load(folder, more):
    (folder / "cell.toml").write_text(load_cell("comau-nj130/edbb").path.read_text() + more)
    return load_cell(str(folder / "cell.toml"))


def test_it_stands_in_the_cell(tmp_path):
    cell = load(tmp_path, SPRINGS)
    assert cell.sections == {"springs": Springs((20.0, 5.0))}
    assert cell.is_under_load
    assert setup_of(cell).loaded == {cell.fixtures[0].name: "springs.pull_N"}
    with pytest.raises(InputError, match=r"this needs a bar, and gauge.kind is 'edbb' with \[\[springs\]\]"):
        cell.require_bar("this needs a bar", free=True)
    with pytest.raises(InputError, match=r"no extension that is installed here plans \[\[springs\]\]"):
        kind_of_cell(cell)


def test_it_is_written_with_the_cell(tmp_path):
    written = tomllib.loads(cell_files(load(tmp_path, SPRINGS))["cell.toml"].decode())
    assert written["springs"] == [{"name": "a", "pull_N": 20.0}, {"name": "b", "pull_N": 5.0}]
    assert list(written).index("springs") < list(written).index("motion")


def test_it_goes_to_another_process_with_the_cell(tmp_path):
    for cell in (load(tmp_path, SPRINGS), load_cell("comau-nj130/edbb")):
        again = pickle.loads(pickle.dumps(cell))
        assert again.sections == cell.sections
        assert type(again.file) is type(cell.file)
        assert again.file == cell.file == copy.deepcopy(cell.file)


def test_a_cell_without_it_is_as_before(tmp_path):
    bare = load_cell("comau-nj130/edbb")
    assert not bare.sections
    assert cell_files(load(tmp_path, ""))["cell.toml"] == cell_files(bare)["cell.toml"]
    np.testing.assert_array_equal(load(tmp_path, SPRINGS).home, bare.home)


def test_a_wrong_key_is_told_as_everywhere(tmp_path):
    with pytest.raises(InputError, match=r"\[\[springs\]\] number 1: unknown key 'pull'.*allowed here: name, pull_N"):
        load(tmp_path, '\n[[springs]]\nname = "a"\npull = 3\n')
    with pytest.raises(InputError, match="unknown key 'spring'; did you mean \"springs\""):
        load(tmp_path, '\n[[spring]]\nname = "a"\n')


def test_a_section_that_is_taken_is_told(tmp_path):
    with pytest.raises(ValueError, match="section 'springs' of cell files: another extension"):
        register_section("springs", f"{__name__}:READER")
    register_section("motion", f"{__name__}:READER")
    with pytest.raises(InputError, match="declares the section 'motion' of cell files, which the core has already"):
        load(tmp_path, "")
