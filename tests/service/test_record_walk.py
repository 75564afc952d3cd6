"""The record of a robot from its serial number to a withdrawn certificate, as two people walk it in browsers."""

import io
import re
import shutil
from datetime import date, timedelta

import pytest
from playwright.sync_api import expect
from pypdf import PdfReader

from planner.service.database import Database
from planner.service.file_store import FileStore
from planner.service.job_store import JobStore
from planner.service.people import PeopleStore
from planner.service.settings import Role
from tests.command import edbb
from tests.service.test_cell_side import (
    JOB,
    PASSWORD,
    add_plan,
    browser,
    check_page,
    needs_browser,
    open_checklist,
    open_page,
    service,
)

MONTH_AGO, TODAY = (date.today() - timedelta(days=d) for d in (30, 0))
SERIAL, MISTYPED, SECOND = "KR6-0815", "KR6-O815", "KR6-0816"
CHANGE = "theta3_deg=0.2"
PATIENCE_MS = 10 * 60_000
PROGRAM = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n10,-60,70,10,40,20\n-20,-70,80,5,50,0\n"
FIXTURES = (browser, service)
pytestmark = [needs_browser, pytest.mark.long]


def ended_page(page, selector):
    """Wait for the result of the job whose page is shown; return the job."""
    page.wait_for_selector(selector, timeout=PATIENCE_MS)
    return page.url.rpartition("/")[2].partition("?")[0]


def measured_log(store, plan, folder, *words):
    """The log of a robot that the service knows nothing of but its readings: a run without the lines of its truth."""
    folder.mkdir()
    for output in JobStore(Database(store / "jobs.sqlite3")).outputs(plan):
        if "/" not in output.name:
            shutil.copyfile(FileStore(store).path(output.sha256), folder / output.name)
    simulated = folder / "simulated.csv"
    done = edbb("simulate", folder / "plan.json", "-o", simulated, *words)
    assert done.returncode == 0, done.stderr
    lines = simulated.read_text().splitlines(keepends=True)
    (folder / "run.csv").write_text("".join(line for line in lines if not line.startswith("# truth:")))
    return folder / "run.csv"


def record(page, serial, day, is_new, **fields):
    page.fill("#serial", serial)
    page.fill("#date", day.isoformat())
    for name, value in fields.items():
        page.fill(f"#{name}", value)
    page.get_by_role("button", name="Add", exact=True).click()
    if is_new:
        page.get_by_role("button", name=f"{serial} is a new robot: add it").click()
    page.wait_for_url(f"**/robots/{serial}")


def measure(phone, desk, service):
    """Two tick in one checklist, one without a network; a second robot of the kind has its own."""
    checklist = open_checklist(phone, JOB, SERIAL)
    expect(phone.locator("#offline")).to_contain_text("without a network")
    service.cut()
    phone.check("#step-1")
    expect(phone.locator("#sent")).to_contain_text("kept on this device")
    service.begin()
    expect(phone.locator("#sent")).to_contain_text("All that is ticked is sent")
    desk.goto(checklist)
    expect(desk.locator("#step-1")).to_be_checked()
    expect(desk.locator("li:has(#step-1) .ticked")).to_contain_text("wanda")
    desk.check("#step-2")
    expect(phone.locator("#step-2")).to_be_checked()
    desk.click("#again")
    expect(desk.locator("#again-message")).to_contain_text("Press again")
    check_page(desk, "walk-session")
    check_page(phone, "walk-session-phone")
    open_checklist(desk, JOB, SECOND)
    expect(desk.locator("#done")).to_contain_text("0 of")


def calibrate(phone, folder):
    """The log is sent, the page loaded again, and the robot identified from what was sent."""
    phone.click("text=The run is measured")
    phone.set_input_files("#run", measured_log(folder, JOB, folder.parent / "run"))
    phone.wait_for_selector("#run-chart svg", timeout=PATIENCE_MS)
    phone.reload()
    phone.wait_for_selector("#run-chart svg", timeout=PATIENCE_MS)
    check_page(phone, "walk-log-phone")
    phone.fill("#tolerance", "0.5")
    phone.uncheck("#trace")
    phone.click("#identify")
    calibration = ended_page(phone, "#report h1")
    expect(phone.locator("#report h1")).to_contain_text("0.5 mm")
    assert phone.input_value("#serial") in ("", SERIAL)
    record(phone, MISTYPED, MONTH_AGO, True, operator="Wanda", gauge="bar 4711")
    phone.click("summary:has-text('Withdraw')")
    phone.fill("input[id^=reason-]", "serial number mistyped")
    phone.click("button:has-text('Withdraw entry 1')")
    expect(phone.locator(".verdict .word")).to_contain_text("Withdrawn")
    check_page(phone, "walk-mistyped-phone")
    phone.goto(f"/jobs/{calibration}")
    record(phone, SERIAL, MONTH_AGO, False, operator="Wanda", gauge="bar 4711")
    expect(phone.locator(".verdict .word")).to_contain_text(f"Good until {TODAY.isoformat()}")
    check_page(phone, "walk-robot-phone")
    return calibration


def certify(desk, phone, calibration):
    """What one device issues another shows, and the sheet holds it all."""
    desk.goto(f"/jobs/{calibration}/certificate")
    desk.fill("#place", "Hall 7")
    desk.fill("#u_gauge_mm", "0.02")
    check_page(desk, "walk-issue")
    desk.get_by_role("button", name="Issue").click()
    desk.wait_for_url(f"**/certificates/{SERIAL}-C01")
    expect(desk.locator(".verdict .word")).to_have_text("It holds")
    check_page(desk, "walk-certificate")
    phone.goto(f"/certificates/{SERIAL}-C01")
    assert phone.inner_text(".sheet") == desk.inner_text(".sheet")
    check_page(phone, "walk-certificate-phone")
    sheet = desk.request.get(f"/api/certificates/{SERIAL}-C01/pdf")
    (page,) = PdfReader(io.BytesIO(sheet.body())).pages
    words = page.extract_text()
    for said in (SERIAL, "Hall 7", "bar 4711", MONTH_AGO.isoformat(), "ada", desk.inner_text("#hash")):
        assert said in words, said
    return f"/certificates/{SERIAL}-C01"


def correct(page, calibration, folder, despite=False):
    page.goto(f"/jobs/{calibration}/correct")
    (folder / "targets.csv").write_text(PROGRAM)
    page.set_input_files("#program", folder / "targets.csv")
    if despite:
        page.click("#correct-form button:has-text('Correct')")
        assert "/correct" in page.url, "asked first"
        page.check("[data-option=despite_change]")
    page.click("#correct-form button:has-text('Correct')")
    ended_page(page, ".result")
    expect(page.locator(".verdict")).to_contain_text("mm  rms at the 2 targets")
    expect(page.locator(".verdict a")).to_have_count(1)
    assert re.search("tool error|moved", page.inner_text("pre"))


def check_after_a_month(desk, service, calibration, folder):
    desk.goto(f"/jobs/{calibration}")
    desk.fill("#check-poses", "8")
    desk.click("#check-plan-form button")
    check_plan = ended_page(desk, "text=What it shows, and from where on")
    desk.goto(f"/calibrate?plan={check_plan}")
    truth = ("--truth", folder.parent / "run" / "simulated.csv", "--change", CHANGE)
    desk.set_input_files("#run", measured_log(service.folder, check_plan, folder / "check", *truth))
    desk.wait_for_selector("#run-chart svg", timeout=PATIENCE_MS)
    desk.click("#identify")
    ended_page(desk, ".verdict")
    expect(desk.locator(".verdict .word")).to_contain_text("Failed: changed")
    check_page(desk, "walk-check")


def test_two_people_walk_from_a_serial_number_to_a_withdrawn_certificate(service, browser, tmp_path):
    people = PeopleStore(Database(service.folder / "jobs.sqlite3"))
    people.add("ada", Role.ADMINISTER, PASSWORD)
    people.add("wanda", Role.WORK, PASSWORD)
    add_plan(service.folder, "ada")
    service.begin()
    desk, phone = (open_page(browser, service, name, name == "wanda") for name in ("ada", "wanda"))
    measure(phone, desk, service)
    calibration = calibrate(phone, service.folder)
    address = certify(desk, phone, calibration)
    correct(desk, calibration, tmp_path)
    check_page(desk, "walk-correction")
    check_after_a_month(desk, service, calibration, tmp_path)
    phone.goto(address)
    expect(phone.locator(".verdict .word")).to_have_text("Withdrawn")
    check_page(phone, "walk-withdrawn-phone")
    correct(desk, calibration, tmp_path, despite=True)
    check_page(desk, "walk-correction-despite")
    desk.goto(f"/robots/{SERIAL}")
    for said in ("session", "corrected program", "although the robot had changed", f"{SERIAL}-C01", "has changed"):
        expect(desk.locator("main")).to_contain_text(said)
    check_page(desk, "walk-robot")
    desk.goto("/jobs?q=kr6-0815")
    expect(desk.locator("#jobs tbody")).to_contain_text("changed")
    check_page(desk, "walk-jobs")
