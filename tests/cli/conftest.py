"""A small plan, the input of the commands that are killed."""

import pytest

from tests.workflow.conftest import FEWER, POSES, planned


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    return planned("kuka-kr6-r700/edbb", tmp_path_factory.mktemp("kr6"), POSES, "krl", changes=FEWER)
