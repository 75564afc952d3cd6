"""Small files that grow without end when they are read, or name what is not theirs: refused in a sentence, at once."""

import struct
import zlib

import polars as pl
import pytest

from planner.cell.reading import load_cell
from planner.common.errors import InputError
from planner.motion.collision.surroundings import check_surroundings
from planner.runs.loader import load_run
from tests.service.test_interface import CELL

LAUGHS = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(9))
LEAK = '<!ENTITY l9 SYSTEM "file:///etc/passwd">'
ROBOT = '<?xml version="1.0"?><!DOCTYPE r [<!ENTITY l0 "lol">{}]><robot name="&l9;"><link name="a"/></robot>'
MESH = '[[obstacles]]\nkind = "mesh"\nfile = "huge.stl"\n'
FILES = {
    "laughs.urdf": ROBOT.format(LAUGHS).encode(),
    "leak.urdf": ROBOT.format(LEAK).encode(),
    "huge.stl": bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(500),  # says four thousand million triangles
    "zipped.parquet": zlib.compress(bytes(10_000_000), 9),
}


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        (CELL.replace('"ur10"', '"laughs.urdf"\ntip = "a"'), "declares the entity 'l0'"),
        (CELL.replace('"ur10"', '"leak.urdf"\ntip = "a"'), "declares the entity 'l0'"),
        (CELL + MESH, "cannot be read as a mesh"),
        (f'schema = "edbb-cell/1"\nrobot = {"[" * 100_000}', "nested too deeply"),
    ],
)
def test_cells_that_explode_are_refused(tmp_path, cell, words):
    for name, data in FILES.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "cell.toml").write_text(cell)
    with pytest.raises(InputError, match=words):
        check_surroundings(load_cell(str(tmp_path / "cell.toml")))


@pytest.mark.slow
def test_runs_that_explode_are_refused(tmp_path):
    (tmp_path / "zipped.parquet").write_bytes(FILES["zipped.parquet"])
    with pytest.raises(InputError, match="cannot be read as Parquet"):
        load_run(tmp_path / "zipped.parquet", 6)
    pl.select(t_s=pl.repeat(None, 200_000_000, dtype=pl.Boolean)).write_parquet(tmp_path / "bomb.parquet")
    assert (tmp_path / "bomb.parquet").stat().st_size < 2_000_000
    with pytest.raises(InputError, match="more than any run has"):
        load_run(tmp_path / "bomb.parquet", 6)
