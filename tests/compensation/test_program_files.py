"""Files of one program are corrected together, whichever is named: all of them are written, or none is."""

import re

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.common.files import data_folder
from planner.compensation.compensated_program import compensate_program
from planner.compensation.languages import output_paths
from tests.command import edbb
from tests.compensation.test_formats import krl
from tests.compensation.test_partial import GOOD, GOOD_RAPID, NULL, pose, target

POINTS = {"XP1": (10, -80, 100, 20, 40, 30), "XP2": (5, -75, 95, 15, 45, 20), "XP3": (-20, -85, 90, -10, 35, 15)}
MOVES = [*NULL, GOOD, *(f"LIN {name}" for name in POINTS)]


@pytest.fixture
def model(tmp_path_factory):
    """The folder of a calibrated robot of KUKA."""
    folder = tmp_path_factory.mktemp("calibrated")
    text = (data_folder("robots") / "kuka-kr6-r700" / "robot.toml").read_text()
    (folder / "robot.toml").write_text(text.replace("a_mm = 315.0", "a_mm = 315.4") + "[nominal]\na2_mm = 315.0\n")
    return folder


def lay(folder, robot, source="pick.src", data="pick.dat", moves=MOVES):
    """Write both halves of a module; ``None`` leaves one out."""
    rows = [f"DECL E6POS {name}={pose(robot, np.array(q))}" for name, q in POINTS.items()]
    if source:
        (folder / source).write_text(krl(*moves))
    if data:
        (folder / data).write_text("\n".join(["DEFDAT PICK", *rows, "ENDDAT", ""]))


def run(model, folder, named, output):
    return edbb("compensate", folder / named, "--model", model, "-o", output)


@pytest.mark.parametrize("named", ["pick.src", "pick.dat"])
def test_both_halves_of_a_module_are_corrected_whichever_is_named(named, kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    done = run(model, tmp_path, named, f"{tmp_path}/out/")
    assert done.returncode == 0, done.stderr
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["pick.dat", "pick.src"]
    for name, lines in (("pick.src", 1), ("pick.dat", 3)):
        before, after = ((folder / name).read_text().splitlines() for folder in (tmp_path, tmp_path / "out"))
        assert sum(row not in after for row in before) == lines
        assert any("edbb-compensated" in row for row in after)
    assert re.search(r"next +load .*pick\.", done.screen)


@pytest.mark.parametrize(
    ("source", "data"), [("PICK.SRC", "PICK.DAT"), ("Pick.src", "pick.DAT"), ("pick.SRC", "pick.dat")]
)
def test_halves_belong_together_in_letters_of_any_size(source, data, kuka, tmp_path):
    lay(tmp_path, kuka[0], source, data)
    files = compensate_program(tmp_path / source, *kuka)
    assert [(f.name, len(f.report.corrected)) for f in files] == [(source, 1), (data, 3)]
    assert not any(f.partly for f in files)


def test_two_programs_of_one_folder_are_two(kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    lay(tmp_path, kuka[0], "place.src", "place.dat")
    (tmp_path / "$config.dat").write_text("DEFDAT $CONFIG PUBLIC\nENDDAT\n")
    assert run(model, tmp_path, "place.dat", f"{tmp_path}/out/").returncode == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["place.dat", "place.src"]


@pytest.mark.parametrize(
    ("left_out", "named", "why"),
    [
        ("pick.dat", "pick.src", "XP1 is not declared here, and no data of the module"),
        ("pick.src", "pick.dat", "whose program (.src) does not lie beside it"),
    ],
)
def test_one_half_alone_is_refused_and_nothing_is_written(left_out, named, why, kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    (tmp_path / left_out).unlink()
    done = run(model, tmp_path, named, tmp_path / f"out{named[-4:]}")
    assert done.returncode == 2
    assert why in done.screen
    assert [p.name for p in tmp_path.iterdir()] == [named]


@pytest.mark.posix  # PICK.DAT and pick.dat are one file on Windows
def test_a_half_that_cannot_be_told_is_refused(kuka, tmp_path):
    lay(tmp_path, kuka[0], "Pick.src", "pick.dat")
    (tmp_path / "PICK.DAT").write_text((tmp_path / "pick.dat").read_text())
    with pytest.raises(InputError, match=r"may be PICK\.DAT and pick\.dat"):
        compensate_program(tmp_path / "Pick.src", *kuka)


def test_a_half_that_was_corrected_before_leaves_both(kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    assert run(model, tmp_path, "pick.src", f"{tmp_path}/out/").returncode == 0
    (tmp_path / "pick.dat").write_text((tmp_path / "out" / "pick.dat").read_text())
    done = run(model, tmp_path, "pick.src", f"{tmp_path}/again/")
    assert done.returncode == 2
    assert "corrected before, by this same model" in done.screen
    assert not (tmp_path / "again").exists()


def test_a_file_of_others_in_the_place_of_one_half_leaves_both(kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    (tmp_path / "out.dat").write_text("somebody else's\n")
    done = run(model, tmp_path, "pick.src", tmp_path / "out.src")
    assert done.returncode == 2
    assert "was not written by edbb" in done.screen
    assert not (tmp_path / "out.src").exists()
    assert (tmp_path / "out.dat").read_text() == "somebody else's\n"


def test_the_other_half_takes_the_name_of_the_output(kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    done = run(model, tmp_path, "pick.src", tmp_path / "better.src")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "better.dat").is_file()
    assert "under the name of the module, pick" in done.screen


@pytest.mark.parametrize("output", ["-", "out.dat", "out.txt"])
def test_an_output_that_holds_one_file_alone_is_refused(output, kuka, model, tmp_path):
    lay(tmp_path, kuka[0])
    done = run(model, tmp_path, "pick.src", output if output == "-" else tmp_path / output)
    assert done.returncode == 2
    assert "are written together; name a" in done.screen
    assert len(list(tmp_path.iterdir())) == 2


def test_a_program_that_is_corrected_in_part_is_not_recommended(kuka, model, tmp_path):
    lay(tmp_path, kuka[0], moves=[*MOVES, "LIN_REL {Z 5}"])
    done = run(model, tmp_path, "pick.src", f"{tmp_path}/out/")
    assert done.returncode == 5
    assert "load" not in done.screen
    assert "see to the lines that were left as they were" in done.screen


@pytest.mark.slow
def test_data_of_a_rapid_program_are_corrected_with_the_module_that_uses_them(abb, tmp_path):
    """Points without a move in their own module get the tool and the work object of the moves in the other one."""
    points = [
        f"CONST robtarget pA:={target(abb[0])};",
        f"CONST robtarget pB:={target(abb[0], (5, 10, 20, 30, 40, 50))};",
    ]
    main = ["PROC main()", GOOD_RAPID, "MoveL pA,v9,fine,tool0;", "MoveL pB,v9,fine,tool0;", "ENDPROC"]
    (tmp_path / "main.mod").write_text("\n".join(["MODULE A", *main, "ENDMODULE", ""]))
    (tmp_path / "data.sys").write_text("\n".join(["MODULE B", *points, "ENDMODULE", ""]))
    (tmp_path / "other.mod").write_text(f"MODULE C\n{points[0].replace('pA', 'pC')}\nENDMODULE\n")
    for named in ("main.mod", "data.sys"):
        files = {f.name: f for f in compensate_program(tmp_path / named, *abb)}
        assert {name: f.report.corrected for name, f in files.items()} == {"main.mod": (3,), "data.sys": (2, 3)}
        assert not any(f.partly for f in files.values())


def test_a_point_that_two_modules_declare_is_refused(abb, tmp_path):
    point = f"CONST robtarget pA:={target(abb[0])};"
    (tmp_path / "main.mod").write_text(
        f"MODULE A\nPROC main()\n{GOOD_RAPID}\nMoveL pA,v9,fine,tool0;\nENDPROC\nENDMODULE\n"
    )
    for name in ("new.mod", "old.mod"):
        (tmp_path / name).write_text(f"MODULE B\n{point}\nENDMODULE\n")
    with pytest.raises(InputError, match=r"pa is declared in new\.mod and old\.mod"):
        compensate_program(tmp_path / "main.mod", *abb)


@pytest.mark.parametrize("data", [[], ["DECL FDAT FP1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}"], ["DECL E6POS XP1"]])
def test_a_half_without_targets_goes_along(data, kuka, model, tmp_path):
    (tmp_path / "pick.src").write_text(krl(*NULL, GOOD))
    text = "\n".join(["DEFDAT PICK", *data, "ENDDAT", ""])
    (tmp_path / "pick.dat").write_text(text)
    for named in ("pick.src", "pick.dat"):
        done = run(model, tmp_path, named, f"{tmp_path}/{named}-out/")
        assert done.returncode == 0, done.stderr
        rows = (tmp_path / f"{named}-out" / "pick.dat").read_text().splitlines()
        assert [row for row in rows if not row.startswith("; ")] == text.splitlines()


def test_halves_of_which_nothing_is_certain_are_refused(kuka, model, tmp_path):
    lay(tmp_path, kuka[0], moves=["BAS(#TOOL,3)", "BAS(#BASE,3)", *(f"LIN {name}" for name in POINTS)])
    done = run(model, tmp_path, "pick.dat", f"{tmp_path}/out/")
    assert done.returncode == 2
    assert "pick.dat and pick.src hold no target that could be compensated" in done.screen
    assert not (tmp_path / "out").exists()


def test_names_of_outputs(tmp_path):
    names = ["main.mod", "data.sys"]
    assert [p.name for p in output_paths(tmp_path, True, names)] == names
    assert [p.name for p in output_paths(tmp_path / "x.mod", False, names)] == ["x.mod", "data.sys"]
    with pytest.raises(InputError, match="name a folder"):
        output_paths(tmp_path / "data.sys", False, names)
