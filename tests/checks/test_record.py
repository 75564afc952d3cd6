"""A robot's record: what is added stays as it was, belongs to one robot, and shows what changed."""

import json
import shlex
from datetime import UTC, date, datetime

import pytest

from planner.checks.record import Circumstances, RobotRecord, map_to_opcua
from planner.checks.record_changes import add_entry
from planner.checks.results import verdict_content
from planner.checks.words import FORECAST
from planner.common.errors import InputError
from planner.common.files import document_text
from planner.common.units import DEG
from planner.kinematics.robot_reader import load_robot
from planner.report.check_report import drift_chart, record_rows, report_check, report_record
from planner.session.evaluations import evaluation_of
from planner.workflow.fleet import read_robot
from tests.checks.fleet import NAME
from tests.checks.test_evaluation import judged
from tests.command import edbb
from tests.common.test_exchange import tree, windows

FIXTURES = (windows,)


def calibration(theta3, robot=NAME):
    errors = {"rms_mm": 0.1, "mean_mm": 0.1, "max_mm": 0.2}
    parameters = [{"name": "theta3", "value": theta3, "std": 0.002, "unit": "deg", "group": "geometry"}]
    parameters += [{"name": "a2", "value": 400.01 + theta3 / 10, "std": 0.05, "unit": "mm", "group": "geometry"}]
    return {
        "schema": "edbb-identification/1", "robot": robot, "n_samples": 40, "degrees_of_freedom": 20, "findings": [],
        "stages": [{"name": "geometry", "train": errors, "held_out": errors}], "parameters": parameters,
        "known_anywhere_mm": 0.08,
    }  # fmt: skip


def results(folder, name, content):
    folder.mkdir()
    (folder / name).write_text(document_text(content))
    return folder


@pytest.fixture
def record(tmp_path):
    """Calibrated, checked twice (an axis lost its zero), calibrated again."""
    documents = [
        ("identification.json", calibration(0.01)),
        ("check.json", verdict_content(judged(), NAME)),
        ("check.json", verdict_content(judged(theta3=0.03 * DEG), NAME)),
        ("identification.json", calibration(0.04)),
    ]
    for month, (name, content) in enumerate(documents, 1):
        folder = results(tmp_path / str(month), name, content)
        add_entry(tmp_path / "record", folder, Circumstances(date=date(2024, month, 1), operator="W"), "S1")
    return tmp_path / "record"


def test_the_history_says_what_changed_and_when_the_next_check_is_due(record):
    known = RobotRecord.read(record)
    assert [e.file.kind for e in known.entries] == ["calibration", "check", "check", "calibration"]
    assert "master axis 3" in known.entries[2].sentence
    (moved,) = known.differences()  # a2 moved by less than chance
    assert moved[0] == 4
    assert moved[1].startswith("theta3 +5.24e-04 ± 4.9e-05 rad")
    assert known.next_check == date(2024, 5, 1)
    assert "theta3" in record_rows(known)[3][3]
    zeros, evidence = drift_chart(known).panels
    joint3 = next(s for s in zeros.series if s.name == "joint 3")
    assert abs(joint3.y[1]) > 0.1 > abs(joint3.y[0])
    assert evidence.series[0].y[0] < 0 < evidence.series[0].y[1]


def test_after_a_failed_check_the_next_is_due_at_once_and_days_are_in_order(tmp_path):
    days = (5, 3, 4)  # as they are added: a calibration, a check that fails, one before it that passed
    for k, (day, name, content) in enumerate(
        zip(
            days,
            ("identification.json", "check.json", "check.json"),
            (calibration(0.01), verdict_content(judged(theta3=0.03 * DEG), NAME), verdict_content(judged(), NAME)),
            strict=True,
        )
    ):
        when = Circumstances(date=date(2024, 1, 28 - day))
        known = add_entry(tmp_path / "record", results(tmp_path / str(k), name, content), when, "S1")
    assert [e.number for e in known.entries] == [1, 3, 2]
    assert (known.next_check, known.calibration_date) == (date(2024, 1, 25), None)
    assert known.due_text == "now: master axis 3 and check again"
    assert map_to_opcua(known).prognosis.predicted_time == datetime(2024, 1, 25, tzinfo=UTC)
    late = results(tmp_path / "late", "identification.json", calibration(0.05))
    with pytest.raises(InputError, match="dated 2200-01-01; allowed are 2000-01-01 to "):
        add_entry(tmp_path / "record", late, Circumstances(date=date(2200, 1, 1)), None)
    known = add_entry(tmp_path / "record", late, Circumstances(date=date(2024, 2, 1)), None)
    assert known.next_check == date(2024, 3, 2)


def test_the_pages_of_record_and_check_in_a_browser(browser, record, tmp_path):
    page = tmp_path / "report.html"
    page.write_text(report_record(RobotRecord.read(record)).html(), encoding="utf-8")
    assert browser.check_report(page) == ["drift"]  # record.html.j2
    page.write_text(report_check(NAME, judged(theta3=0.03 * DEG)).html(), encoding="utf-8")
    assert browser.check_report(page) == ["check"]


def test_a_simulated_robot_has_a_record_of_its_own_that_says_so(record, tmp_path):
    day = Circumstances(date=date(2024, 6, 1))
    drawn = results(tmp_path / "drawn", "identification.json", calibration(0.02) | {"simulated": True})
    with pytest.raises(InputError, match="record of a robot that is real"):
        add_entry(record, drawn, day, None)
    known = add_entry(tmp_path / "other", drawn, day, "SIM-1")
    assert known.simulated
    assert record_rows(known)[0][3].startswith("SIMULATED: ")
    assert "nobody has measured this robot" in report_record(known).html()
    shown = edbb("record", tmp_path / "other")
    assert "SIMULATED" in (shown.stdout + shown.screen).splitlines()[0]


def test_the_run_of_a_checks_plan_is_judged_not_identified(tmp_path):
    plan = tmp_path / "plan.json"
    assert evaluation_of("run.csv", plan, None, True).startswith("edbb identify run.csv")
    (tmp_path / FORECAST).touch()
    assert evaluation_of("run.csv", plan, None, True).startswith("edbb check run.csv --plan")


def test_the_calibration_that_a_check_was_planned_for_is_named_where_it_is_found(tmp_path):
    """From wherever the run is simulated or imported; else a word stands in its place."""
    plan, model = tmp_path / "check" / "plan.json", tmp_path / "the robot"
    plan.parent.mkdir()
    (plan.parent / FORECAST).write_text(json.dumps({"model": str(model)}))
    assert "--model CALIBRATED " in evaluation_of("run.csv", plan, None, False)
    model.mkdir()
    assert shlex.split(evaluation_of("run.csv", plan, None, False))[5:7] == ["--model", str(model)]
    assert "--model other " in evaluation_of("run.csv", plan, None, False, "other")


def test_a_record_refuses_what_is_not_its_own(record, tmp_path):
    day = Circumstances(date=date(2024, 6, 1))
    with pytest.raises(InputError, match="already"):
        add_entry(record, tmp_path / "2", day, None)
    with pytest.raises(InputError, match="serial number S1"):
        add_entry(record, results(tmp_path / "a", "identification.json", calibration(0.02)), day, "S2")
    other = results(tmp_path / "b", "identification.json", calibration(0.02, "ur10"))
    with pytest.raises(InputError, match="ur10"):
        add_entry(record, other, day, None)
    with pytest.raises(InputError, match="no record yet"):
        add_entry(tmp_path / "none", other, day, None)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        add_entry(tmp_path / "file", other, day, "S9")
    assert (tmp_path / "file").read_text() == "mine"
    path = record / "entries" / "0002-check" / "check.json"
    path.write_text(path.read_text().replace("unchanged", "changed"))
    with pytest.raises(InputError, match="not what was added"):
        RobotRecord.read(record)


def test_a_calibration_that_failed_is_no_entry(record, tmp_path):
    day = Circumstances(date=date(2024, 6, 1))
    for key, said in (("problems", ["readings of other poses"]), ("worse_than_nominal", "WORSE THAN THE NOMINAL")):
        folder = results(tmp_path / key, "identification.json", calibration(0.05) | {key: said})
        with pytest.raises(InputError, match=f"is no calibration, it says: .*{said if key[0] == 'w' else said[0]}"):
            add_entry(record, folder, day, None)
        with pytest.raises(InputError, match="is not to be used"):
            read_robot(folder)
    assert len(RobotRecord.read(record).entries) == 4


def test_a_record_does_not_change_its_robot(tmp_path):
    shipped = load_robot("ur10").path.read_text()
    day = Circumstances(date=date(2024, 6, 1))

    def add(name, text):
        folder = results(tmp_path / name, "identification.json", calibration(len(name) / 1e3, "ur10"))
        (folder / "robot.toml").write_text(text)
        return add_entry(tmp_path / "record", folder, day, "S1")

    corrected = shipped.replace("a_mm = -612.0", "a_mm = -612.4") + "\n[nominal]\na2_mm = -612\n"
    assert corrected.count("-612.4") == 1
    add("first", corrected)
    assert len(add("second", shipped).entries) == 2  # the same model, of which nothing was corrected
    with pytest.raises(InputError, match=r"another nominal model than .*: a2_mm is -613.0 instead of -612.0"):
        add("another", shipped.replace("a_mm = -612.0", "a_mm = -613.0"))
    with pytest.raises(InputError, match="convention is mdh instead of dh"):
        add("convention", shipped.replace('convention = "dh"', 'convention = "mdh"'))
    assert len(RobotRecord.read(tmp_path / "record").entries) == 2
    path = tmp_path / "record" / "record.toml"
    path.write_text(path.read_text().replace('robot = "ur10"', 'robot = "ur5e"'))
    with pytest.raises(InputError, match="is the record of ur5e, but entry 1 is of ur10"):
        RobotRecord.read(tmp_path / "record")


def test_the_command_shows_it(record):
    done = edbb("record", record, "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said["serial"], said["next_check"], len(said["entries"])) == ("S1", "2024-05-01", 4)
    assert edbb("record", record, "--add", record, "--date", "tomorrow").returncode == 2


def test_an_entry_whose_page_is_open_elsewhere_is_added_and_the_command_that_shows_it_is_named(
    record, tmp_path, windows
):
    out, another = tmp_path / "his tory", results(tmp_path / "5", "identification.json", calibration(0.05))
    assert edbb("record", record, "-o", out).returncode == 0
    windows.open_file = out / "report.html"
    before = tree(out)
    done = edbb("record", record, "--add", another, "--date", "2024-06-01", "-o", out)
    assert done.returncode == 2
    assert "report.html: another program has it open" in done.screen.replace("\n", " ")
    assert tree(out) == before
    windows.open_file = None
    words = shlex.split(done.screen.replace("\n", " ").partition("show it with edbb ")[2])
    assert edbb(*words).returncode == 0
    assert len(json.loads((out / "history.json").read_text())["entries"]) == 5


def with_windows_line_ends(folder):
    for path in (p for p in folder.rglob("*") if p.suffix in (".json", ".toml", ".csv", ".src")):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))


def test_a_record_whose_line_ends_were_changed_by_git_is_the_same_record(record, tmp_path):
    before = list(record_rows(RobotRecord.read(record)))
    with_windows_line_ends(record)
    assert list(record_rows(RobotRecord.read(record))) == before
    with_windows_line_ends(tmp_path / "4")
    with pytest.raises(InputError, match="is in the record already"):
        add_entry(record, tmp_path / "4", Circumstances(date=date(2024, 5, 1)), "S1")
    last = results(tmp_path / "5", "identification.json", calibration(0.05))
    with_windows_line_ends(last)
    add_entry(record, last, Circumstances(date=date(2024, 5, 1)), "S1")
    (kept,) = record.glob("entries/0005-*/identification.json")
    kept.write_bytes(kept.read_bytes().replace(b"\r\n", b"\n"))
    assert len(RobotRecord.read(record).entries) == 5
    kept.write_bytes(kept.read_bytes().replace(b"0.05", b"0.06"))
    with pytest.raises(InputError, match="its hash differs"):
        RobotRecord.read(record)
