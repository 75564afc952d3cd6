"""What strangers send has a bound that is known before it is read, and takes time and memory by its size."""

import os
import stat
import struct
import tracemalloc
from types import SimpleNamespace

import pytest

from planner.common.errors import InputError
from planner.common.schema import read_toml_content
from planner.compensation.compensated_file import NO_FRAMES
from planner.compensation.formats.rapid_frames import Names
from planner.compensation.languages import read_targets
from planner.compensation.targets import TargetReading
from planner.kinematics.robot_reader import load_robot
from planner.motion.collision.scene import count_triangles, mesh_faces
from planner.service.job_folder import JobFolder
from planner.service.private_store import keep_private

MB = 1_000_000
PARTS = 60_000
LONG_KEYS = [
    ".".join("a" * PARTS) + " = 1",
    "[" + ".".join("a" * PARTS) + "]\n",
    "[[" + " . ".join('"a"' for _ in range(PARTS)) + "]]\n",
    "b = {" + ".".join("'a'" for _ in range(PARTS)) + " = 1}",
    "x = 1\n" + "\t.\t".join("k-1" for _ in range(PARTS)) + " = 2",
]
GOOD = ['a.b."c d".e.f = 1', 'x = "' + "1." * 10 + '"', "x = [" + "1.5, " * 5000 + "2]", "[a.b.c]\nd = 1979-05-27"]


@pytest.mark.parametrize("text", LONG_KEYS, ids=range(len(LONG_KEYS)))
def test_a_key_of_many_parts_is_refused_before_it_is_read(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match="a key has more than 16 parts"):
            read_toml_content(tmp_path / "a.toml")
        assert tracemalloc.get_traced_memory()[1] < 20 * MB
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("text", GOOD, ids=range(len(GOOD)))
def test_other_keys_and_numbers_are_read(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    assert read_toml_content(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("text", "robot"),
    [
        ('schema = "edbb-cell/1"\nrobot = "ur10"\n[gauge]\n', "ur10"),
        ("robot = 'my arm.toml' # mine\n", "my arm.toml"),
        ('[gauge]\nrobot = "ur10"\n', ""),
        ("robot = 3\n", ""),
        (".".join("a" * 500_000) + ' = 1\nrobot = "ur10"', ""),
        ("\0\xff", ""),
    ],
)
def test_the_service_looks_for_a_robot_and_parses_nothing(tmp_path, text, robot, monkeypatch):
    (tmp_path / "cell").write_text(text, encoding="latin-1")
    files = SimpleNamespace(path=lambda _: tmp_path / "cell", holds=lambda _: True)
    monkeypatch.setattr("tomllib.loads", lambda _: pytest.fail("parsed"))
    folder = JobFolder(None, files, None)  # type: ignore[arg-type]
    assert folder.robot("0" * 64) == robot


def stl(count):
    return bytes(80) + struct.pack("<I", count) + bytes(50) * count


MESHES = {
    "a.stl": stl(300_000),
    "b.stl": b"solid x\n" + b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nendloop\nendfacet\n" * 300_000,
    "c.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n" + b"f 1 2 3\n" * 300_000,
    "d.dae": b'<COLLADA><triangles material="m" count="300000"><p>0</p></triangles></COLLADA>',
    "e.obj": b"v 0 0 0\n" + b"f" + b" 1" * 300_002 + b"\n",
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("hull", [False, True])
def test_triangles_are_counted_before_a_mesh_is_read(tmp_path, name, hull, monkeypatch):
    path = tmp_path / name
    path.write_bytes(MESHES[name])
    assert count_triangles(path) == 300_000
    monkeypatch.setattr("planner.motion.collision.scene._read", lambda *_: pytest.fail("read"))
    body = SimpleNamespace(mesh=path, scale=(1.0, 1.0, 1.0), hull=hull)
    with pytest.raises(InputError, match="the mesh has 300000 triangles"):
        mesh_faces(body)  # type: ignore[arg-type]


def rapid(n):
    """A module with a LOCAL name, and n routines each of which calls another and names what the file has not."""
    pose = "[[500,0,600],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    each = "".join(
        f"CONST robtarget p{k}:={pose};\nPROC r{k}()\nMoveL p{k},v100,fine,tool0;\nr{(k + 1) % n} x{k};\nENDPROC\n"
        for k in range(n)
    )
    return f"MODULE M\nLOCAL VAR num q;\n{each}ENDMODULE\n"


class Counted(set):
    """A set that counts what is copied of it."""

    copied = 0

    def __sub__(self, other):
        Counted.copied += len(self)
        return super().__sub__(other)


def test_names_of_a_rapid_file_are_resolved_without_copies_of_all(monkeypatch):
    robot, found = load_robot("kuka-kr6-r700"), []
    before = Names.__init__

    def watched(self, placed):
        before(self, placed)
        self._keys = Counted(self._keys)
        found.append(self)

    monkeypatch.setattr(Names, "__init__", watched)
    read_targets("rapid", rapid(60), TargetReading("a.mod", robot, NO_FRAMES, None))
    assert len(found[0]._keys) > 60
    assert Counted.copied == 0


@pytest.mark.skipif(os.name != "posix", reason="this system has no permissions of that kind")
def test_the_store_is_for_its_user_alone_and_what_was_open_is_said(tmp_path):
    store = tmp_path / "store"
    assert keep_private(store) == ()
    assert [stat.S_IMODE(p.stat().st_mode) for p in (store, store / "jobs.sqlite3")] == [0o700, 0o600]
    (store / "files").mkdir()
    for path, mode in ((store, 0o755), (store / "jobs.sqlite3", 0o644), (store / "files", 0o775)):
        path.chmod(mode)
    said = keep_private(store)
    assert len(said) == 1
    assert "could open 3 of its files and folders; now none" in said[0]
    assert {stat.S_IMODE(p.stat().st_mode) & 0o077 for p in (store, *store.iterdir())} == {0}
    assert keep_private(store) == ()
