"""The folder of a plan that was made elsewhere, chosen on the page in a browser."""

import json
import shutil

import pytest
from playwright.sync_api import expect

from tests.service.test_cell_side import PLAN, browser, needs_browser, open_page, service

FIXTURES = (browser, service)


@pytest.mark.long  # by HTTP: test_interface; that the page is silent: test_pages_in_browser
@needs_browser
def test_the_folder_of_a_plan_is_sent_and_is_one_of_the_plans_from_then_on(service, browser, tmp_path):
    folder, other, faults = tmp_path / "Köln mine", tmp_path / "other", []
    shutil.copytree(PLAN, folder)
    shutil.copytree(PLAN, folder / "older")  # a plan in a folder below is not the one that was chosen
    (folder / "trajectory.csv").write_text("not needed")
    other.mkdir()
    (other / "notes.toml").write_text("")
    service.begin()
    page = open_page(browser, service, None, phone=False)
    page.on("pageerror", lambda fault: faults.append(fault))
    page.goto("/calibrate")
    page.set_input_files("#made-elsewhere", other)
    expect(page.locator("#plan-message")).to_have_text("this folder has no plan.json")
    page.set_input_files("#made-elsewhere", folder)
    expect(page.locator("#plan-message")).to_contain_text("It is taken")
    job = page.locator("#plan").input_value()
    plan_id = json.loads((PLAN / "plan.json").read_text())["plan_id"]
    assert page.locator("#plan option:checked").get_attribute("data-plan") == plan_id
    expect(page.locator("#simulate")).to_be_enabled()
    page.get_by_role("link", name="its page").click()
    expect(page.locator(f'a[href="/jobs/{job}/session"]').first).to_be_visible()
    sent = {f["name"] for f in page.request.get(f"{service.address}/api/jobs/{job}").json()["files"]}
    assert sent == {"plan.json", "cell.toml"}
    page.goto("/calibrate")
    assert plan_id in [o.get_attribute("data-plan") for o in page.locator("#plan option").all()]
    assert not faults
