"""Tables of somebody else, written by a German spreadsheet, with titles of its own: nothing is guessed silently."""

import csv
from pathlib import Path

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.runs.loader import load_run
from planner.runs.proposed_map import proposed_map
from planner.runs.traces import import_run
from tests.command import edbb

UR5 = Path("tests/data/ur5-tracker/run.csv")
AXES = [f"cmd{i}_deg" for i in range(1, 7)]
PLACE = ["x_mm", "y_mm", "z_mm"]


@pytest.fixture(scope="module")
def rows():
    """The first 40 rows of the UR5's run."""
    lines = [line for line in UR5.read_text().splitlines() if not line.startswith("#")]
    return [[float(row[k]) for k in AXES + PLACE] for row in csv.DictReader(lines[:41])]


def write(path, titles, rows, scale=1.0, encoding="utf-8"):
    """Write rows as a German spreadsheet does."""
    lines = [";".join(titles)]
    for k, row in enumerate(rows, 1):
        fields = [f"{v * scale:.5f}".replace(".", ",") for v in row[:6]] + [
            f"{v:.3f}".replace(".", ",") for v in row[6:]
        ]
        lines.append(";".join([str(k), *fields, "Wärme, Halle 3"]))
    path.write_text("\n".join(lines), encoding=encoding)
    return path


GERMAN = ["Nr.", *(f"Achse {i}" for i in range(1, 7)), *(f"Tracker {a} [mm]" for a in "XYZ"), "Größe"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16", "utf-16-le"])
def test_the_proposed_map_reads_the_table(tmp_path, rows, encoding):
    table = write(tmp_path / "Messung Halle 3.csv", GERMAN, rows, encoding=encoding)
    (tmp_path / "map.toml").write_text(proposed_map([table]), encoding="utf-8")
    run = import_run([table], tmp_path / "map.toml")
    assert np.allclose(np.rad2deg(run.samples.q), np.array(rows)[:, :6], atol=1e-5)
    assert np.allclose(run.readings.position * 1e3, np.array(rows)[:, 6:], atol=1e-3)


def test_angles_without_a_unit_that_are_radians_are_proposed_so(tmp_path, rows):
    table = write(
        tmp_path / "log.csv", ["Nr.", *(f"J{i}" for i in range(1, 7)), "x", "y", "z", "note"], rows, np.pi / 180
    )
    text = proposed_map([table])
    assert 'q1_rad = "J1"  # the title says no unit' in text
    assert 'x_mm = "x"' in text
    assert '# not understood: "note"' in text


def test_a_map_that_is_not_there_is_proposed_and_nothing_is_read_yet(tmp_path, rows):
    table, target = write(tmp_path / "log.csv", GERMAN, rows), tmp_path / "map.toml"
    words = ("import", str(table), "--map", str(target), "-o", str(tmp_path / "run.csv"))
    first = edbb(*words)
    assert first.returncode == 2
    assert first.screen.startswith("log.csv: 10 columns understood, 6 without a unit, 1 left out\n  written to")
    assert "look at its lines, then give the same command again" in first.screen
    assert not (tmp_path / "run.csv").exists()
    assert edbb(*words).returncode == 0
    assert len(load_run(tmp_path / "run.csv", 6)) == len(rows)


def test_a_runs_own_names_are_read_with_semicolons_and_said(tmp_path, rows):
    named = ["pose", *AXES, *PLACE, "note"]
    run = load_run(write(tmp_path / "run.csv", named, rows), 6)
    assert np.allclose(run.readings.position * 1e3, np.array(rows)[:, 6:], atol=1e-3)
    assert any("was read with ';' between columns and ',' as the decimal sign" in w for w in run.warnings)


def test_other_titles_are_refused_with_the_command_that_reads_them(tmp_path, rows):
    with pytest.raises(InputError, match=r"edbb import .* --map map.toml -o run.csv reads other names"):
        load_run(write(tmp_path / "log.csv", GERMAN, rows), 6)


def test_joints_that_are_counted_from_0_become_all_joints_of_the_arm(tmp_path, rows):
    table = write(tmp_path / "log.csv", ["Nr.", *(f"joint_{i}" for i in range(6)), "x", "y", "z", "note"], rows)
    text = proposed_map([table])
    assert 'q1_deg = "joint_0"  # the title says no unit: is this one true?  # counted from 0 there' in text
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    run = import_run([table], tmp_path / "map.toml")
    assert np.allclose(np.rad2deg(run.samples.q), np.array(rows)[:, :6], atol=1e-5)


def with_rows(table, above=(), below=()):
    """Write lines above the titles of a table, and below them."""
    first, *others = table.read_text().splitlines()
    table.write_text("\n".join([*above, first, *below, *others]))
    return table


@pytest.mark.parametrize("fill", ["", ";" * 10])
@pytest.mark.parametrize("lines", [1, 2])
def test_what_a_spreadsheet_has_above_the_titles_is_passed_over_and_said(tmp_path, rows, lines, fill):
    above = [f"Messprotokoll Halle 3{fill}", f"Datum;12.03.2026{fill[1:]}" if fill else "12.03.2026"][:lines]
    table = with_rows(write(tmp_path / "log.csv", GERMAN, rows), above)
    text = proposed_map([table])
    assert f"skip_rows = {lines}  # {('line 1 stands', 'lines 1 to 2 stand')[lines - 1]} above the titles" in text
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    run = import_run([table], tmp_path / "map.toml")
    assert np.allclose(np.rad2deg(run.samples.q), np.array(rows)[:, :6], atol=1e-5)


@pytest.mark.parametrize("above", [(), ("Messprotokoll Halle 3;;;;;;;;;;", ";;;;;;;;;;")])
@pytest.mark.parametrize(("angle", "length", "to_deg", "to_mm"), [("gon", "cm", 0.9, 10.0), ("[deg]", "m", 1.0, 1e3)])
def test_a_row_of_units_below_the_titles_gives_the_columns_their_units(
    tmp_path, rows, above, angle, length, to_deg, to_mm
):
    titles = [title.removesuffix(" [mm]") for title in GERMAN]
    units = ";".join(["-", *[angle] * 6, *[length] * 3, ""])
    table = with_rows(write(tmp_path / "log.csv", titles, rows), above, [units])
    text = proposed_map([table])
    assert "unit_rows = 1" in text
    assert "no unit" not in text
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    run = import_run([table], tmp_path / "map.toml")
    assert np.allclose(np.rad2deg(run.samples.q), to_deg * np.array(rows)[:, :6], atol=1e-5)
    assert np.allclose(run.readings.position * 1e3, to_mm * np.array(rows)[:, 6:], atol=1e-3 * to_mm)


def test_a_second_row_of_titles_is_told(tmp_path, rows):
    table = with_rows(write(tmp_path / "log.csv", GERMAN, rows), (), [";".join(["Punkt", *["Soll"] * 9, "in Halle"])])
    with pytest.raises(InputError, match=r"log.csv: no title is understood .*line 1: .*'Achse 1'.*row of titles out"):
        proposed_map([table])


@pytest.mark.parametrize(("titles", "unit"), [(("x", "y", "z"), "mm"), (("x", "y [m]", "z"), "m")])
def test_coordinates_of_one_place_have_one_unit(tmp_path, titles, unit):
    """One of them is small by chance, or alone says its unit."""
    table = tmp_path / "log.csv"
    lines = [",".join([*(f"J{k} [deg]" for k in range(1, 7)), *titles]), *["10,20,30,40,50,60,812.1,3.2,4.1"] * 3]
    table.write_text("\n".join(lines))
    text = proposed_map([table])
    assert [f'{axis}_{unit} = "{title}"' in text for axis, title in zip("xyz", titles, strict=True)] == [True] * 3


def test_two_logs_of_their_own_clocks_become_one_run(tmp_path):
    """The controller's in milliseconds between tabs, the gauge's in seconds with decimal commas, both under a head."""
    t = np.arange(100)
    angles = [[10 * np.sin(k / 9 + i) for i in range(6)] for k in t]
    log = ["Logger v3", "exported 2026", "\t".join(["Time [ms]", *(f"Axis{i}" for i in range(1, 7))])]
    log += ["\t".join([str(100 * k), *(f"{v:.4f}" for v in row)]) for k, row in zip(t, angles, strict=True)]
    gauge = [
        "Zeit (s);Länge (mm)",
        *(f"{0.05 * k:.2f};{400 + np.sin(k / 20):.4f}".replace(".", ",") for k in range(200)),
    ]
    (tmp_path / "axes.log").write_text("\n".join(log))
    (tmp_path / "gauge.csv").write_text("\n".join(gauge), encoding="utf-8")
    traces = [tmp_path / "axes.log", tmp_path / "gauge.csv"]
    (tmp_path / "map.toml").write_text(proposed_map(traces), encoding="utf-8")
    run = import_run(traces, tmp_path / "map.toml")
    assert run.samples.t[-1] - run.samples.t[0] > 9
    assert np.abs(np.rad2deg(run.samples.q)).max() == pytest.approx(10, abs=0.1)
    assert run.readings.length.min() * 1e3 > 398.9


OTHER_UNITS = [  # a title, the numbers below it, the quantity and its value in SI
    ("t [ms]", "2500", lambda run: run.samples.t, 2.5),
    ("t [min]", "0.5", lambda run: run.samples.t, 30.0),
    ("t_us", "2500000", lambda run: run.samples.t, 2.5),
    ("L [cm]", "41.25", lambda run: run.readings.length, 0.4125),
    ("L (in)", "16.25", lambda run: run.readings.length, 0.41275),
    ("L [inch]", "16.25", lambda run: run.readings.length, 0.41275),
    ("J2 [gon]", "100", lambda run: run.samples.q[:, 1], np.pi / 2),
    ("J2 [mrad]", "1500", lambda run: run.samples.q[:, 1], 1.5),
    ("Temp [°F]", "68", lambda run: run.samples.temperature, 20.0),
    ("Temp [K]", "293.15", lambda run: run.samples.temperature, 20.0),
    ("Temp [°C]", "20", lambda run: run.samples.temperature, 20.0),
]


@pytest.mark.parametrize(("title", "number", "value", "true"), OTHER_UNITS, ids=[u[0] for u in OTHER_UNITS])
def test_a_unit_that_no_run_has_is_brought_to_one_that_it_has(tmp_path, title, number, value, true):
    columns = {f"J{k} [deg]": "10" for k in range(1, 7)} | {"L [mm]": "400", "t [s]": "1"}
    mine = title[0]
    columns = {name: n for name, n in columns.items() if name[:2] not in (title[:2], f"{mine} ", f"{mine}_")}
    columns[title] = number
    table = tmp_path / "log.csv"
    table.write_text("\n".join([",".join(columns), *[",".join(columns.values())] * 3]) + "\n", encoding="utf-8")
    (tmp_path / "map.toml").write_text(proposed_map([table]), encoding="utf-8")
    run = import_run([table], tmp_path / "map.toml")
    np.testing.assert_allclose(value(run), true, rtol=1e-9)


@pytest.mark.parametrize("title", ["L [ft]", "X [furlong]", "J1 [turns/8]"])
def test_a_unit_that_nobody_knows_is_never_taken_for_another_one(tmp_path, title):
    table = tmp_path / "log.csv"
    table.write_text(f"J2 [deg],J3 [deg],{title}\n1,2,3\n1,2,3\n")
    text = proposed_map([table])
    (line,) = (row for row in text.splitlines() if title in row)
    assert line.startswith("# not understood")
    assert "is not known: write for instance" in line
    assert "factor = F" in line
