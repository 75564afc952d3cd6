"""Readers of every language are tried with every arm, as if its file said how each controller counts; two arms."""

import pickle

import pytest

import planner.compensation.compensated_file as compensated_file
from planner.compensation.nominal_angles import SearchSeeds
from tests.compensation.robots import bent
from tests.speaking import let_speak_all


@pytest.fixture(scope="package", autouse=True)
def every_language():
    with pytest.MonkeyPatch.context() as patch:
        let_speak_all(patch)
        yield


@pytest.fixture(scope="package", autouse=True)
def seeds_of_each_arm():
    """Arm positions that searches start from are computed once for arms that are the same in all."""
    kept = {}

    def seeds(robot):
        return kept.setdefault(pickle.dumps(robot), SearchSeeds(robot))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compensated_file, "SearchSeeds", seeds)
        yield


@pytest.fixture(scope="module")
def kuka():
    return bent("kuka-kr6-r700", seed=4)


@pytest.fixture(scope="module")
def abb():
    return bent("abb-irb120", seed=4)
