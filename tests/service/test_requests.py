"""What requests become: the words of the command line, and the files that they name."""

import pytest

from planner.common.errors import InputError
from planner.service.job_folder import JobFolder
from planner.service.job_record import JobCommand, JobInput, JobOutput
from planner.service.job_requests import REQUESTS
from planner.service.serving import build_context
from tests.service.conftest import settings

PLAN, KNOWN, CHECK, OTHER_PLAN = "1" * 24, "2" * 24, "3" * 24, "4" * 24
FOUND = {"identification.json": b"{}", "robot.toml": b"r", "expected_error.csv": b"e", "report.html": b"x"}
NEEDED = sorted(FOUND.keys() - {"report.html"})
CALIBRATED = [f"calibrated/{name}" for name in NEEDED]


@pytest.fixture(scope="module")
def context(tmp_path_factory):
    """Jobs that are done: two plans, an identification by a log of the first, and the plan of a check."""
    made = build_context(settings(tmp_path_factory.mktemp("requests")))
    run = JobInput("run.csv", made.files.add(b"q1_deg"))
    identify = JobCommand(("identify", "run.csv", "--cell", "ur10/edbb"), (run,))
    held = (JobInput("calibrated/robot.toml", made.files.add(b"r")),)
    for id, kind, command, outputs in (
        (PLAN, "plan", JobCommand(("plan",)), {"plan.json": b"{}", "cell.toml": b""}),
        (KNOWN, "identification", identify, FOUND),
        (OTHER_PLAN, "plan", JobCommand(("plan",)), {"plan.json": b"{}", "cell.toml": b""}),
        (CHECK, "check-plan", JobCommand(("plan-check", "--model", "calibrated"), held), {"plan.json": b"{1}"}),
    ):
        made.jobs.submit(id, kind, "run.csv of ur10/edbb", "{}", command)
        written = [JobOutput(name, made.files.add(data), len(data)) for name, data in outputs.items()]
        assert made.jobs.finish(made.jobs.take(9), "done", written, 0, None)
    return made


CASES = [
    ("plan", {"cell": "ur10/edbb", "poses": 9, "dialect": ["krl", "rapid"], "separate": KNOWN},
     "plan ur10/edbb -o out --json --poses 9 --seed 0 --dialect krl --dialect rapid --tsp auto"
     " --separate before/identification.json", [f"before/{n}" for n in NEEDED]),
    ("plan", {"cell": "ur10/edbb", "method": "pruning", "order": "slowest-axis"},
     "plan ur10/edbb -o out --json --seed 0 --tsp auto --method pruning --order slowest-axis", []),
    ("plan", {"after": KNOWN, "same_mounting": True, "until_mm": 0.2},
     "plan ur10/edbb --after calibrated -o out --json --seed 0 --tsp auto --same-mounting --until-mm 0.2",
     ["run.csv", *CALIBRATED]),
    ("plan", {"cell": "so101/wire", "after": KNOWN},
     "plan so101/wire --after calibrated -o out --json --seed 0 --tsp auto", CALIBRATED),
    ("identification", {"plan": PLAN, "runs": ["a.csv", "b.csv"], "plans": [OTHER_PLAN], "no_trace": True},
     "identify a.csv b.csv --plan plan/plan.json --plan plan-2/plan.json --cell plan/cell.toml --cell plan-2/cell.toml"
     " -o out --json --no-trace --hold-out 0.2 --seed 0",
     ["a.csv", "b.csv", "plan/cell.toml", "plan/plan.json", "plan-2/cell.toml", "plan-2/plan.json"]),
    ("fixture-view", {"cell": "ur10/edbb", "position_mm": [1, 2, 3]}, "fixture-view ur10/edbb 0 1.0 2.0 3.0", []),
    ("export", {"plan": CHECK, "dialect": "krl"}, "export plan/plan.json -o out/program.src --dialect krl",
     ["plan/plan.json"]),
    ("identification", {"plan": PLAN, "runs": ["run.csv"], "no_trace": True, "validate_with": "v.csv"},
     "identify run.csv --plan plan/plan.json --cell plan/cell.toml -o out --json --validate v.csv --no-trace"
     " --hold-out 0.2 --seed 0", ["run.csv", "plan/cell.toml", "plan/plan.json", "v.csv"]),
    ("run-check", {"cell": "ur10/edbb", "runs": ["a.csv", "b.csv"]}, "run-check ur10/edbb a.csv b.csv",
     ["a.csv", "b.csv"]),
    ("plan-upload", {"files": ["plan.csv", "cell.csv"]}, "plan-upload plan/plan.json",
     ["plan/plan.csv", "plan/cell.csv"]),
    ("check-plan", {"model": KNOWN},
     "plan-check ur10/edbb --model calibrated -o out --json --poses 10 --seed 0", ["run.csv", *CALIBRATED]),
    ("check", {"plan": CHECK, "run": "c.csv", "limit_mm": 0.2},
     "check c.csv --plan check/plan.json --model calibrated -o out --json --limit-mm 0.2",
     ["check/plan.json", "c.csv", "calibrated/robot.toml"]),
    ("validation", {"cell": "ur10/edbb", "runs": ["v.csv"], "model": KNOWN},
     "accuracy v.csv --cell ur10/edbb -o out --json --model calibrated/robot.toml", ["v.csv", *CALIBRATED]),
    ("compensation", {"program": "p.src", "model": KNOWN, "strict": True},
     "compensate p.src -o out/ --model calibrated/robot.toml --strict", ["p.src", *CALIBRATED]),
    ("compensation", {"program": "p.src", "files": ["p.dat"], "model": KNOWN},
     "compensate p.src -o out/ --model calibrated/robot.toml", ["p.dat", "p.src", *CALIBRATED]),
    ("compensation", {"program": "p.src", "model": KNOWN, "cell": "ur10/edbb", "zeros_set": "2, 3"},
     "compensate p.src --cell ur10/edbb -o out/ --model calibrated/robot.toml --zeros-set 2, 3",
     ["p.src", *CALIBRATED]),
]  # fmt: skip


def uploaded(context, value):
    """The value of a field, with references to files where it names some."""
    if isinstance(value, list) and str(value[0]).endswith((".csv", ".dat")):
        return [uploaded(context, v) for v in value]
    if str(value).endswith((".csv", ".src", ".dat")):
        return {"id": context.files.add(b"q1_deg"), "name": value}
    return value


def test_what_is_not_given_may_be_null():
    request = REQUESTS["simulation"].model_validate({"plan": PLAN, "change": None, "truth": None})
    assert request == REQUESTS["simulation"].model_validate({"plan": PLAN})
    plan = {"cell": "ur10/edbb"}
    assert REQUESTS["plan"].model_validate({**plan, "poses": None}) == REQUESTS["plan"].model_validate(plan)


@pytest.mark.parametrize(("kind", "fields", "words", "names"), CASES)
def test_a_request_becomes_a_command(context, kind, fields, words, names):
    request = REQUESTS[kind].model_validate({k: uploaded(context, v) for k, v in fields.items()})
    command = request.command(JobFolder(context.jobs, context.files, context.uploads))
    assert " ".join(command.words) == words
    assert [i.name for i in command.inputs] == names


def test_that_a_robot_has_changed_is_a_matter_of_the_service_alone(context):
    fields = {"program": uploaded(context, "p.src"), "model": KNOWN, "despite_change": True}
    command = context.submit(REQUESTS["compensation"].model_validate(fields)).command
    assert " ".join(command.words) == "compensate p.src -o out/ --model calibrated/robot.toml"


def test_two_files_of_one_name_are_refused(context):
    twice = {"cell": "ur10/edbb", "runs": uploaded(context, ["a.csv", "a.csv"])}
    with pytest.raises(InputError, match=r"two files of the request are called 'a\.csv'"):
        context.submit(REQUESTS["run-check"].model_validate(twice))
