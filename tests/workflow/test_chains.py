"""The whole chain of every shipped cell without a bar, and of all cells as they are shipped.

Each cell runs with two seeds of the robot in a smaller session; those with a bar do in a file of their own, so that
two processes share the work. Three more seeds, and the cells as they are shipped, take half an hour on two cores and
are run on demand (``EDBB_ALL_TRIALS=1``).
"""

import pytest

from tests.shipped import cells_that
from tests.workflow.chains import CELLS, ON_DEMAND, SEEDS, run_chain

QUICK = ("so101/sockets",)  # whose small session is part of the tests that always run
WITHOUT_BAR = cells_that(lambda cell: not cell.has_bar())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder in which every cell's plan is made once."""
    return tmp_path_factory.mktemp("chains")


@pytest.mark.long
@pytest.mark.parametrize("name", QUICK)
def test_a_small_session_of_a_quick_cell(folder, name):
    run_chain(folder, name, 1, small=True)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", WITHOUT_BAR)
def test_the_chain_of_a_smaller_session_ends_well(folder, name, seed):
    run_chain(folder, name, seed, small=True)


@pytest.mark.long
@ON_DEMAND
@pytest.mark.parametrize("name", CELLS)
def test_the_chain_ends_well_as_shipped(folder, name):
    run_chain(folder, name, 0, small=False)
