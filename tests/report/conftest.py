from pathlib import Path

import pytest

from planner.report.plan_report import report_plan
from planner.session.plan_types import Plan
from tests.report.made import made_plan
from tests.report.reading import ReadPage


@pytest.fixture(scope="package")
def plan() -> Plan:
    return made_plan()


@pytest.fixture(scope="package")
def folder(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("report")
    report_plan(plan).write(place)
    return place


@pytest.fixture(scope="package")
def page(folder: Path) -> ReadPage:
    read = ReadPage()
    read.feed((folder / "report.html").read_text(encoding="utf-8"))
    read.close()
    return read
