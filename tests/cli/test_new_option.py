"""A new option of ``plan`` is the one field that docs/extend/option.md shows, and is there wherever options are."""

import json
import re

import pytest

from tests.wings.installation import ROOT, edbb_in, install_without, run_in

PAGE = (ROOT / "docs" / "extend" / "option.md").read_text()
WHERE_IT_IS = """
import inspect, json, planner
from planner.cell.reading import load_cell
from planner.common.calls import options_table
from planner.service.job_requests import PlanRequest
from planner.service.pages import ENVIRONMENT
from planner.session.options import PlanOptions
from planner.workflow.verbs import declared_calls

page = '{% from "options.html.j2" import option_inputs %}{{ option_inputs(typed_options("plan")) }}'
cell = PlanOptions(clearance_mm=25.0).in_motion(load_cell("ur10/edbb"))
try:
    planner.plan("ur10/edbb", clearance_mm=0.5)
except Exception as error:
    refused = str(error)
print(json.dumps({
    "python": str(inspect.signature(planner.plan).parameters["clearance_mm"]),
    "docstring": "clearance_mm: clearance to keep along the path" in planner.plan.__doc__,
    "form": ENVIRONMENT.from_string(page).render(),
    "request": PlanRequest.model_json_schema()["properties"]["clearance_mm"],
    "documentation": options_table(declared_calls()["plan"]),
    "used": [cell.motion.clearance, cell.file.motion.clearance_mm],
    "refused": refused,
}))
"""


@pytest.fixture(scope="module")
def changed(tmp_path_factory):
    """A copy of the planner with the lines of the page below the field that it names."""
    folder = tmp_path_factory.mktemp("option")
    environment = install_without(folder)
    (lines,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    below = re.search(r"In `PlanOptions`, below `(\w+)`:", PAGE)[1]
    file = folder / "planner" / "session" / "options.py"
    text = file.read_text()
    field = re.search(rf"^    {below}: Annotated\[\n.*?^    \] = None\n", text, re.MULTILINE | re.DOTALL)
    file.write_text(text[: field.end()] + lines + text[field.end() :])
    return folder, environment


@pytest.mark.slow
def test_one_field_is_an_option_everywhere(changed):
    done = run_in(*changed, "-c", WHERE_IT_IS)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["python"] == "clearance_mm: float | None = None"
    assert found["docstring"]
    assert 'data-option="clearance_mm"' in found["form"]
    assert "clearance to keep along the path" in str(found["request"])
    assert "500" in str(found["request"])
    row = "| `--clearance-mm` | 1 to 500 | clearance to keep along the path |"
    assert row in found["documentation"].splitlines()
    assert found["used"] == [0.025, 25.0]
    assert found["refused"] == "plan(): clearance_mm = 0.5, but the least is 1"


@pytest.mark.slow
def test_it_is_on_the_command_line(changed):
    shown = re.sub(r"\s+", " ", edbb_in(*changed, "plan", "--help").stdout)
    assert "--clearance-mm MM" in shown
    assert edbb_in(*changed, "plan", "ur10/edbb", "-o", "out", "--clearance-mm", 501).returncode == 2
