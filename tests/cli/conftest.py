"""A small plan, the input of the commands that are killed."""

import pytest

from tests.workflow.conftest import planned


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    few = ("candidates = 3000", "candidates = 600")
    return planned("kuka-kr6-r700/edbb", tmp_path_factory.mktemp("kr6"), 30, "krl", changes=(few,))
