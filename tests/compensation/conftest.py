"""Readers of every language are tried with every arm, as if its file said how each controller counts; two arms."""

import pickle

import pytest

import planner.compensation.compensated_file as compensated_file
import planner.compensation.nominal_angles as nominal_angles
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


@pytest.fixture(scope="package", autouse=True)
def searches_of_each_pose():
    """Angles of the same poses of the same arm are searched for once: hundreds of programs hold the same few."""
    kept, search = {}, nominal_angles._search

    def search_once(T, shapes, seeds):
        key = (pickle.dumps(seeds.robot), T.tobytes(), tuple(shapes))
        if key not in kept:
            kept[key] = search(T, shapes, seeds)
        return tuple(array.copy() for array in kept[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(nominal_angles, "_search", search_once)
        yield


@pytest.fixture(scope="module")
def kuka():
    return bent("kuka-kr6-r700", seed=4)


@pytest.fixture(scope="module")
def abb():
    return bent("abb-irb120", seed=4)
