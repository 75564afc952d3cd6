"""Every request that the OpenAPI document allows, and many that it does not: answered as the document says."""

import hypothesis
import pytest
import schemathesis
from schemathesis import GenerationMode

from planner.service.command_words import hide_folders
from planner.service.context import Supervisor
from planner.service.serving import build_app, build_context
from tests.service.conftest import settings

OPERATIONS = 55  # of the document; a new one is counted here, so that none slips by


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """The document of a service that takes jobs and runs none."""
    app = build_app(build_context(settings(tmp_path_factory.mktemp("openapi"))))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("start", "stop"):
            patch.setattr(Supervisor, name, lambda _: None)
        yield schemathesis.openapi.from_asgi("/api/openapi.json", app)


def ask(operation, mode, examples):
    codes = set()

    @hypothesis.settings(
        max_examples=examples, deadline=None, database=None, suppress_health_check=list(hypothesis.HealthCheck)
    )
    @hypothesis.seed(1)
    @hypothesis.given(case=operation.as_strategy(generation_mode=mode))
    def ask_once(case):
        if case.path == "/api/events":  # else it would go on for ever
            case.query = {**(case.query or {}), "wait": "false"}
        answer = case.call()
        case.validate_response(answer)
        codes.add(answer.status_code)

    try:
        ask_once()
    except hypothesis.errors.Unsatisfiable:  # an operation without input has no wrong one
        assert mode == GenerationMode.NEGATIVE
    return codes


def check(document, examples):
    operations, refused = [found.ok() for found in document.get_all_operations()], set()
    assert len(operations) == OPERATIONS
    for operation in operations:
        ask(operation, GenerationMode.POSITIVE, examples)
        refused |= ask(operation, GenerationMode.NEGATIVE, examples)
    assert 422 in refused


@pytest.mark.slow
def test_the_document_says_how_one_logs_in_and_what_errors_look_like(document):
    said = document.raw_schema
    assert said["components"]["securitySchemes"]["token"] == {
        "type": "http", "scheme": "bearer", "description": "of a person, or of the service",
    }  # fmt: skip
    assert {"token": []} in said["security"]
    for path, operations in said["paths"].items():
        for operation in operations.values():
            for code, answer in operation["responses"].items():
                if code >= "400":
                    (media,) = answer["content"].items()
                    assert (media[0], media[1]["example"]["status"]) == ("application/problem+json", int(code)), path


def test_a_message_names_no_folder_of_the_server():
    said = "record.toml is damaged; see (DELETE /api/jobs/ID) and https://doi.org/10.1/x/y, ur10/edbb"
    assert hide_folders(f"/var/lib/edbb/records/S1/{said}") == said


@pytest.mark.long
def test_every_answer_is_as_the_document_says(document):
    check(document, 5)
