"""Every request that the OpenAPI document allows, and many that it does not: none is answered by a server error."""

import hypothesis
import pytest
import schemathesis

from planner.service.serving import build_app, build_context
from tests.service.conftest import settings

OPERATIONS = 27  # of the document; a new one is counted here, so that none slips by


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """The document of a service that takes jobs and runs none."""
    app = build_app(build_context(settings(tmp_path_factory.mktemp("openapi"))))
    return schemathesis.openapi.from_asgi("/api/openapi.json", app)


def check(document, examples):
    tried = 0
    for found in document.get_all_operations():
        operation = found.ok()
        tried += 1

        @hypothesis.settings(
            max_examples=examples, deadline=None, database=None, suppress_health_check=list(hypothesis.HealthCheck)
        )
        @hypothesis.seed(1)
        @hypothesis.given(case=operation.as_strategy())
        def answer_is_no_server_error(case):
            if case.path == "/api/events":  # else it would go on for ever
                case.query = {**(case.query or {}), "wait": "false"}
            case.call_and_validate(checks=[schemathesis.checks.not_a_server_error])

        answer_is_no_server_error()
    assert tried == OPERATIONS


@pytest.mark.long
def test_no_request_is_answered_by_a_server_error(document):
    check(document, 15)
