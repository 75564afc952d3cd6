"""Readers of every language are tried with every arm, as if its file said how each controller counts."""

import pytest

from tests.speaking import let_speak_all


@pytest.fixture(scope="package", autouse=True)
def every_language():
    with pytest.MonkeyPatch.context() as patch:
        let_speak_all(patch)
        yield
