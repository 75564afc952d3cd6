"""The chain of every shipped cell with a bar in a smaller session, five seeds of the robot, three of them on demand.

Then a calibrated robot is checked.
"""

import pytest

from tests.shipped import cells_that
from tests.workflow.chains import SEEDS, run_chain, succeed

BARS = cells_that(lambda cell: cell.has_bar())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which every cell's plan is made once."""
    return tmp_path_factory.mktemp("chains")


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", BARS)
def test_the_chain_of_a_smaller_session_ends_well(folder, name, seed):
    run_chain(folder, name, seed, small=True)


@pytest.mark.long
def test_a_calibrated_robot_is_checked(folder):
    """Ten poses of the robot that was calibrated: nothing has changed."""
    name, seed = "kuka-kr6-r700/edbb", 5
    plan = run_chain(folder, name, seed, small=True)
    check, out = folder / "check-plan", folder / f"{plan.name}-{seed}-out"
    succeed("plan-check", plan / "cell.toml", "--model", out, "-o", check)
    run = folder / "check.csv"
    succeed("simulate", check / "plan.json", "-o", run, "--truth", folder / f"{plan.name}-{seed}.csv", "--seed", 9)
    succeed("check", run, "--model", out, "--plan", check / "plan.json", "-o", folder / "check-out")
