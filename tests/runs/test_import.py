"""Traces through column maps: each dialect's own log, and the ways in which laboratories write numbers."""

import re

import numpy as np
import pytest

from planner.common.errors import InputError
from planner.programs.dialect import dialects
from planner.programs.verification import import_map, write_program
from planner.runs.loader import load_runs
from planner.runs.traces import import_run
from tests.programs.sessions import PLAN_ID, static
from tests.runs.made import rows, sine_path, write
from tests.speaking import let_speak_all

ANGLES = np.round(np.random.default_rng(4).uniform(-120, 120, (6, 6)), 5)
LENGTHS = "pose,length_mm\n" + "".join(f"{i},{400 + i}\n" for i in (1, 2, 3, 4, 5, 6))
LOGGING = [d.name for d in dialects() if d.logs_axes]


def krl_rows():
    """Return the .dat that goes with a program of six poses, as the controller has filled it by the fourth."""
    program = write_program(static(n_poses=6), "krl", "tour")
    (text,) = (f.text for f in program if f.name.endswith(".dat"))
    for i, q in enumerate(ANGLES[:4], start=1):
        measured = ",".join(f"A{j} {a}" for j, a in enumerate(q, start=1))
        text, n = re.subn(
            rf"(LOG_\w+\[{i}\]=.*AX {{)A1 0.0,A2 0.0,A3 0.0,A4 0.0,A5 0.0,A6 0.0", rf"\g<1>{measured}", text
        )
        assert n == 1
    return text


def linuxcnc_rows():
    return "".join(f"{i};" + ";".join(f"{a:.6f}" for a in q) + "\n" for i, q in enumerate(ANGLES, start=1))


def pdl2_rows():
    return "".join(f"{i:>6};" + ";".join(f"{a:12.5f}" for a in q) + "\r\n" for i, q in enumerate(ANGLES, start=1))


def rapid_rows():
    return "".join(
        f"{i};" + ";".join(f"{a:.5f}".rstrip("0").rstrip(".") for a in q) + "\n" for i, q in enumerate(ANGLES, 1)
    )


def sinumerik_rows():
    return "".join(
        f"{i};" + ";".join(f"{a:.6g}" if abs(a) < 10 else f"{a}" for a in q) + "\n" for i, q in enumerate(ANGLES, 1)
    )


WRITTEN = {
    "krl": krl_rows,
    "linuxcnc": linuxcnc_rows,
    "pdl2": pdl2_rows,
    "rapid": rapid_rows,
    "sinumerik": sinumerik_rows,
}


def own_map(name):
    """The map of a dialect's log, of a robot."""
    return import_map(name, 6).replace("axes_of", 'robot = "kuka-kr6-r700"\naxes_of', 1)


@pytest.fixture
def every_language(monkeypatch):
    let_speak_all(monkeypatch)


@pytest.mark.parametrize("name", LOGGING)
def test_each_dialects_own_log(every_language, tmp_path, name):
    path = write(tmp_path / "map.toml", own_map(name))
    log, gauge = write(tmp_path / "log.txt", WRITTEN[name]()), write(tmp_path / "gauge.csv", LENGTHS)
    run = import_run([log, gauge], path)
    n = 4 if name == "krl" else 6
    assert run.samples.pose.tolist() == list(range(1, n + 1))
    np.testing.assert_allclose(np.rad2deg(run.samples.q), ANGLES[:n], atol=1e-9)
    np.testing.assert_allclose(run.readings.length, 0.4 + 0.001 * np.arange(1, n + 1))
    assert (run.samples.q_read is None) == (name == "linuxcnc")
    if name == "krl":
        assert run.plan_id == PLAN_ID
        assert "2 rows hold 0 for every axis" in run.warnings[0]


def test_a_log_of_axes_alone_is_no_run(every_language, tmp_path):
    path = write(tmp_path / "map.toml", own_map("rapid"))
    with pytest.raises(InputError, match="there is no reading"):
        import_run([write(tmp_path / "log.csv", rapid_rows())], path)
    empty = write(tmp_path / "log.dat", re.sub(r"(A\d) [-\d.]+", r"\1 0.0", krl_rows()))
    path = write(tmp_path / "krl.toml", own_map("krl"))
    with pytest.raises(InputError, match="all 6 rows hold 0 for every axis"):
        import_run([empty], path)


LAB = """schema = "edbb-map/1"
encoding = "latin-1"
decimal = ","
separator = ";"
skip_rows = 2
comment = "%"
measure = "static"
robot = "any-arm"
[columns]
t = "Zeit/ms"
q1 = "Achse 1 (°)"
q2 = 3
x_mm = {column = "X", factor = 25.4, offset = 1.0}
y_m = "Y"
z_um = "Z"
temperature_degC = "Temp. Küche"
[units]
t = "ms"
q1 = "deg"
q2 = "rad"
[constants]
fixture = "Süd"
payload_kg = 2.5
"""
TRACE = """Prüfstand 7;;;;
Bediener: x;y
Zeit/ms;"Achse 1 (°)";Achse 2;X;Y;Z;Temp. Küche;Bemerkung
% Anfang
0;12,5;0,25;1,0;0,1;-2000,5;21,5;gut
 1500 ; -1,25e1 ;-1,5;-2,0;0,2;3,5;22;

3000;90;1;0,5;0,3;0;22,5;"a;b"
"""


def test_decimal_commas_semicolons_latin_and_units(tmp_path):
    path = write(tmp_path / "map.toml", LAB)
    (tmp_path / "t.txt").write_bytes(TRACE.replace("\n", "\r\n").encode("latin-1"))
    run = import_run([tmp_path / "t.txt"], path)
    np.testing.assert_allclose(run.samples.t, [0, 1.5, 3])
    np.testing.assert_allclose(run.samples.q, np.column_stack([np.deg2rad([12.5, -12.5, 90]), [0.25, -1.5, 1]]))
    expected = np.column_stack([np.array([26.4, -49.8, 13.7]) * 1e-3, [0.1, 0.2, 0.3], [-2.0005e-3, 3.5e-6, 0]])
    np.testing.assert_allclose(run.readings.position, expected, atol=1e-15)
    np.testing.assert_allclose(run.samples.temperature, [21.5, 22, 22.5])
    np.testing.assert_allclose(run.samples.payload, 2.5)
    assert (run.places, run.robot, run.continuous) == (("Süd",), "any-arm", False)


def test_columns_set_apart_by_blanks(tmp_path):
    text = 'schema = "edbb-map/1"\nseparator = " "\nheader = false\n[columns]\nq1_deg = 2\nlength_mm = 1\n'
    path = write(tmp_path / "map.toml", text)
    run = import_run([write(tmp_path / "t.txt", "  400.5   10\n  401      90\n")], path)
    np.testing.assert_allclose(run.readings.length, [0.4005, 0.401])


TWO = """schema = "edbb-map/1"
[columns]
t_s = "time"
length_um = "probe"
sync = "trigger"
[[traces]]
separator = ";"
decimal = ","
columns = {t = "tick", q1 = "J1", q2 = "J2", q3 = "J3", sync = "DI"}
units = {t = "ms", q1 = "rad", q2 = "rad", q3 = "rad"}
"""


def test_two_traces_with_clocks_of_their_own(tmp_path):
    t = np.arange(0, 10, 0.004)
    on = lambda s: ((s % 3.3) > 3.2).astype(int)  # noqa: E731
    lines = (
        ";".join(f"{v:.9f}".replace(".", ",") for v in (1e3 * a, *q, m))
        for a, q, m in zip(t, sine_path(t)[0], on(t), strict=True)
    )
    controller = write(tmp_path / "c.txt", "tick;J1;J2;J3;DI\n" + "\n".join(lines) + "\n")
    true = np.arange(0.01, 9.9, 0.003)
    body = "".join(f"{s + 55.5:.6f},{1e6 * (0.4 + 0.01 * s):.4f},{m}\n" for s, m in zip(true, on(true), strict=True))
    gauge = write(tmp_path / "g.txt", "time,probe,trigger\n" + body)
    run = import_run([gauge, controller], write(tmp_path / "map.toml", TWO))
    assert len(run) == len(true)
    np.testing.assert_allclose(run.samples.t, true, atol=3.6e-3)
    np.testing.assert_allclose(run.samples.q, sine_path(run.samples.t)[0], atol=1e-8)
    np.testing.assert_allclose(run.readings.length, 0.4 + 0.01 * true, atol=1e-9)


TAIL = '\n[columns]\nq1_deg = "A"\nlength_mm = "L"\n'
MAPS = {
    "no schema": ("[columns]\nq1_deg = 1\n", "the key 'schema' is missing"),
    "unknown key": (
        'schema = "edbb-map/1"\nseperator = ";"' + TAIL,
        "unknown key 'seperator'; did you mean \"separator\"",
    ),
    "encoding": ('schema = "edbb-map/1"\nencoding = "latin-99"' + TAIL, "is no encoding of text; utf-8, latin-1"),
    "neither": ('schema = "edbb-map/1"\n', r"either \[columns\] or a pattern is needed"),
    "same signs": ('schema = "edbb-map/1"\ndecimal = ","' + TAIL, "separator and decimal are both ','"),
    "unit missing": (
        'schema = "edbb-map/1"\n[columns]\nq1 = 1\n',
        "'q1' does not say its unit: call it q1_deg or q1_rad, or",
    ),
    "quantity": ('schema = "edbb-map/1"\n[columns]\nspeed = 1\n', "'speed' is no quantity of a run"),
    "unit wrong": (
        'schema = "edbb-map/1"\n[columns]\nq1 = 1\n[units]\nq1 = "um"\n',
        "'um' is no unit of it .allowed: deg, rad, mm, m",
    ),
    "unit of nothing": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = 1\n[units]\nq2 = "deg"\n',
        "names 'q2', which is no column",
    ),
    "twice": ('schema = "edbb-map/1"\n[columns]\nq1_deg = 1\nq1_rad = 2\n', "'q1' is mapped twice"),
    "pattern": ("schema = \"edbb-map/1\"\npattern = '(?P<q1_deg>'\n", "is no regular expression"),
    "no groups": ("schema = \"edbb-map/1\"\npattern = 'q1'\n", "has no named group"),
    "factor": ('schema = "edbb-map/1"\n[columns]\nq1_deg = {column = 1, factor = 0}\n', "factor of 0 leaves nothing"),
    "column missing": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = "Q"\nlength_mm = "Lenght"\n',
        "no column 'Q' for q1_deg.*found: 'A', 'Length'",
    ),
    "near column": ('schema = "edbb-map/1"\n[columns]\nq1_deg = "A"\nlength_mm = "Lenght"\n', 'did you mean "Length"'),
    "position": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = 1\nlength_mm = 3\n',
        "length_mm from column 3, but there are columns 1 to 2",
    ),
    "text without header": (
        'schema = "edbb-map/1"\nheader = false\n[columns]\nq1_deg = "A"\n',
        "header = false; give a position",
    ),
    "column twice": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = 1\nlength_mm = 1\n',
        "column 1 for more than one quantity",
    ),
    "no match": (
        "schema = \"edbb-map/1\"\npattern = 'LOG (?P<q1_deg>[0-9]+)'\n",
        "no line of 4 matches the map's pattern",
    ),
    "a pattern too deep": (
        f'schema = "edbb-map/1"\npattern = "{"(" * 5000}{")" * 5000}"\n',
        "is no regular expression",
    ),
    **{
        f"{codec}, no text": (
            f'schema = "edbb-map/1"\nencoding = "{codec}"\n[columns]\nq1_deg = 1\nlength_mm = 2\n',
            "is no encoding of text; utf-8, latin-1",
        )
        for codec in ("punycode", "idna", "unicode_escape", "zlib", "rot13", "utf-7")
    },
    "a factor of 1e308": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = {column = 1, factor = 1e308}\n',
        r"map.toml: 'columns.q1_deg.factor' = 1e\+308: must be less",
    ),
    "skipped": ('schema = "edbb-map/1"\nskip_rows = 9\n[columns]\nq1_deg = 1\n', "nothing below the 9 lines"),
    "too few traces": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = 1\n[[traces]]\ncolumns = {length_mm = 1}\n',
        "reads 2 traces, but 1 were",
    ),
    "field": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = "A"\nlength_mm = "Length"\n',
        r"line 3, column 'Length': 'bad' is no number",
    ),
    "constant": (
        'schema = "edbb-map/1"\n[columns]\nq1_deg = "A"\n[constants]\nlength_mm = "x"\n',
        r"length_mm = 'x' is no number",
    ),
}


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "gauge.csv: is empty"), (" \n\n", "is empty"), ("# a\n\n# b\n", "there is nothing but blanks and comments")],
)
def test_a_trace_without_rows_is_told_as_it_is(tmp_path, text, words):
    (tmp_path / "gauge.csv").write_text(text)
    (tmp_path / "map.toml").write_text('schema = "edbb-map/1"\n[columns]\nq1_deg = 1\nlength_mm = 2\n')
    with pytest.raises(InputError, match=words):
        import_run([tmp_path / "gauge.csv"], tmp_path / "map.toml")


@pytest.mark.parametrize(("sign", "shown"), [(";", ";"), ("\t", r"\t"), (" ", " ")])
def test_another_separator_is_named_as_the_map_would_say_it(tmp_path, sign, shown):
    """What the sentence names is then written into the map, and the trace is read."""
    trace = write(tmp_path / "t.csv", "A,Length\n10,400\n90,401\n".replace(",", sign))
    text = 'schema = "edbb-map/1"\n{}[columns]\nq1_deg = "A"\nlength_mm = "Length"\n'
    with pytest.raises(InputError, match=r'; separator = "(.*)" for this trace in the map parts the line') as caught:
        import_run([trace], write(tmp_path / "map.toml", text.format("")))
    (line,) = re.findall(r'separator = ".*?"', str(caught.value))
    assert line == f'separator = "{shown}"'
    assert len(import_run([trace], write(tmp_path / "map.toml", text.format(line + "\n")))) == 2


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_another_encoding_is_named_as_the_map_would_say_it(tmp_path, encoding):
    trace = tmp_path / "t.csv"
    trace.write_bytes("A,Length\r\n10,400\r\n90,401\r\n".encode(encoding))
    text = 'schema = "edbb-map/1"\n{}[columns]\nq1_deg = "A"\nlength_mm = "Length"\n'
    with pytest.raises(InputError, match="the text is not utf-8, as the map says") as caught:
        import_run([trace], write(tmp_path / "map.toml", text.format("")))
    (line,) = re.findall(r'encoding = ".*?"', str(caught.value))
    assert line == f'encoding = "{encoding}"'
    assert len(import_run([trace], write(tmp_path / "map.toml", text.format(line + "\n")))) == 2


SMALL = {"krl": (0.0, 1.0), "pdl2": (-90.0, -1.0)}  # zero [deg] and sense of axis 3 on the controller


@pytest.mark.parametrize("axes_of", SMALL)
def test_radians_under_degrees_are_told_by_their_own_file_in_the_controllers_axes(tmp_path, axes_of):
    """A zero of 90° on the controller must not hide them; in the file they stay within a turn."""
    robot = {"krl": "kuka-kr6-r700", "pdl2": "comau-nj130"}[axes_of]
    columns = "".join(f'q{j}_deg = "A{j}"\n' for j in range(1, 7))
    text = f'schema = "edbb-map/1"\nrobot = "{robot}"\naxes_of = "{axes_of}"\n{{}}[columns]\npose = "pose"\n{columns}'
    text += '[[traces]]\n[traces.columns]\npose = "pose"\nlength_mm = "length_mm"\n'
    c = np.round(np.random.default_rng(1).uniform(-1.5, 1.5, (6, 6)), 4)
    head = "pose," + ",".join(f"A{j}" for j in range(1, 7)) + "\n"
    lines = head + "".join(f"{i},{','.join(map(str, row))}\n" for i, row in enumerate(c, start=1))
    traces = [write(tmp_path / "axes.log", lines), write(tmp_path / "gauge.csv", LENGTHS)]
    message = (
        r"axes\.log: the columns A1 … are called degrees, but .*radians look like that; call them q1_rad …, or write"
    )
    with pytest.raises(InputError, match=message):
        import_run(traces, write(tmp_path / "map.toml", text.format("")))
    zero, sense = SMALL[axes_of]
    for said, log in (('angles = "degrees"\n', lines), ("", "# angles: degrees\n" + lines)):
        traces[0].write_text(log)
        q = import_run(traces, write(tmp_path / "map.toml", text.format(said))).samples.q
        np.testing.assert_allclose(np.rad2deg(q[:, 2]), sense * (c[:, 2] - zero), atol=1e-9)
    as_radians = write(tmp_path / "map.toml", text.format("").replace("_deg =", "_rad ="))
    traces[0].write_text(lines)
    q = import_run(traces, as_radians).samples.q
    np.testing.assert_allclose(np.rad2deg(q[:, 2]), sense * (np.rad2deg(c[:, 2]) - zero), atol=1e-9)


@pytest.mark.parametrize("case", MAPS)
def test_one_sentence(tmp_path, case):
    text, message = MAPS[case]
    with pytest.raises(InputError, match=message) as caught:
        import_run([write(tmp_path / "t.csv", "A,Length\n10,400\n90,bad\n")], write(tmp_path / "map.toml", text))
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


def test_points_in_numbers_with_decimal_commas_are_refused(tmp_path):
    (tmp_path / "t.txt").write_bytes(TRACE.replace("-2000,5", "-2.000").encode("latin-1"))
    with pytest.raises(InputError, match=r"line 5, column 'Z': '-2\.000' is no number \(the decimal sign is ','\)"):
        import_run([tmp_path / "t.txt"], write(tmp_path / "map.toml", LAB))


def test_no_trace_and_several_whole_runs(tmp_path):
    path = write(
        tmp_path / "map.toml",
        'schema = "edbb-map/1"\n[columns]\nq1_deg = "q1_deg"\nq2_deg = "q2_deg"\nlength_mm = "length_mm"\n',
    )
    with pytest.raises(InputError, match="no trace was given"):
        import_run([], path)
    with pytest.raises(InputError, match="are several runs, each whole; import them one by one"):
        import_run([write(tmp_path / f"{i}.csv", rows()) for i in range(2)], path)


@pytest.mark.parametrize(
    ("labels", "numbers"),
    [
        (["P1", "P12", "P3"], [1, 12, 3]),
        (["pose 7", "pose 8", ""], [7, 8, -1]),
        (["A1", "B1", "AB2"], [10001, 20001, 290002]),
    ],
)
def test_labels_of_poses_become_numbers(tmp_path, labels, numbers):
    rows = "".join(f"{k},{10 * k},{400 + k},{label}\n" for k, label in enumerate(labels))
    path = write(tmp_path / "run.csv", "t_s,q1_deg,length_mm,pose\n" + rows)
    assert load_runs([path], 1).samples.pose.tolist() == numbers


def test_a_pose_without_a_number_is_told(tmp_path):
    path = write(tmp_path / "run.csv", "t_s,q1_deg,length_mm,pose\n0,10,400,left\n1,20,401,P1\n")
    with pytest.raises(InputError, match=r"line 2, column 'pose': 'left' is no number \(poses are numbered, or called"):
        load_runs([path], 1)
