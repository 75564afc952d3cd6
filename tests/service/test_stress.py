"""Thirty clients at once: no answer of theirs is a mistake of the service."""

import os

import pytest

from tests.service.stress import stress

SECONDS, CLIENTS = (60.0, 30) if os.environ.get("EDBB_ALL_TRIALS") else (2.0, 10)


@pytest.mark.slow
def test_many_at_once_break_nothing(tmp_path):
    answers, faults = stress(tmp_path, SECONDS, CLIENTS)
    assert not faults
    assert answers["POST 202"], answers
