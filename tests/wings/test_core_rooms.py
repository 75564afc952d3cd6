"""The core's tests pass in an installation without an extension: none of its rooms needs one."""

import os
import re

import pytest

from tests.wings.core_rooms import ROOMS, WINGS, core_tests, install_with_tests, run_tests
from tests.wings.installation import needed_by

QUICK = ("tests/cell/test_model.py", "tests/common/", "tests/kinematics/test_axes.py", "tests/runs/")
TAKES_LONG = pytest.mark.skipif(
    not os.environ.get("EDBB_ALL_TRIALS"), reason="takes as long as all other tests: only with EDBB_ALL_TRIALS=1"
)
SPREAD = 8  # every so many of the core's tests are run of each extension that is left out, another part of each


@pytest.fixture(scope="module")
def without_any(tmp_path_factory):
    folder = tmp_path_factory.mktemp("core")
    return folder, install_with_tests(folder, *WINGS)


@pytest.mark.slow
def test_hardly_any_test_of_the_cores_rooms_needs_an_extension():
    every, left = core_tests(), core_tests(*WINGS)
    assert {t.split("/")[1] for t in left} == set(ROOMS)
    assert len(left) > 0.95 * len(every)


@pytest.mark.long
def test_the_cores_tests_are_collected_and_the_quick_ones_pass_without_any_extension(without_any):
    tests = core_tests(*WINGS)
    done = run_tests(*without_any, tests, "--collect-only")
    assert done.returncode == 0, done.stdout[-2000:]
    quick = [t for t in tests if t.startswith(QUICK)]
    done = run_tests(*without_any, quick)
    assert done.returncode == 0, done.stdout[-3000:]
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) > 100


@pytest.mark.long
@pytest.mark.parametrize("wing", sorted(set().union(*map(needed_by, WINGS))))
def test_the_command_line_passes_its_tests_without_an_extension_that_others_need(tmp_path, wing):
    """Here alone does more than one extension count: commands of others are listed, and say what they lack."""
    environment = install_with_tests(tmp_path, wing)
    done = run_tests(tmp_path, environment, [t for t in core_tests(wing) if t.startswith("tests/cli/")])
    assert done.returncode == 0, done.stdout[-3000:]
    assert int(re.search(r"(\d+) passed", done.stdout)[1]) > 60, "most of about 90 tests of the command line"


@TAKES_LONG
@pytest.mark.long
@pytest.mark.parametrize("wing", WINGS)
def test_the_cores_rooms_pass_without_one_extension(tmp_path, wing):
    """Each extension is left out for a part of the tests of every room, all together for all of them."""
    environment = install_with_tests(tmp_path, wing)
    tests = core_tests(wing)
    assert run_tests(tmp_path, environment, tests, "--collect-only").returncode == 0
    done = run_tests(tmp_path, environment, tests[sorted(WINGS).index(wing) :: SPREAD])
    assert done.returncode == 0, done.stdout[-3000:]


@TAKES_LONG
@pytest.mark.long
@pytest.mark.parametrize("room", ROOMS)
def test_every_room_of_the_core_passes_without_any_extension(without_any, room):
    done = run_tests(*without_any, [t for t in core_tests(*WINGS) if t.split("/")[1] == room])
    assert done.returncode == 0, done.stdout[-3000:]
