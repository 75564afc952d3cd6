"""Readers of every language are tried with every arm, as if its file said how each controller counts; two arms."""

import pytest

from tests.compensation.robots import bent
from tests.speaking import let_speak_all


@pytest.fixture(scope="package", autouse=True)
def every_language():
    with pytest.MonkeyPatch.context() as patch:
        let_speak_all(patch)
        yield


@pytest.fixture(scope="module")
def kuka():
    return bent("kuka-kr6-r700", seed=4)


@pytest.fixture(scope="module")
def abb():
    return bent("abb-irb120", seed=4)
