"""The command of a case: ``edbb`` with a quarter of the posterior's draws and without pictures, which tests check."""

from planner.cli.app import main
from tests.identification.few_draws import few_draws
from tests.unprinted import leave_out_pictures

if __name__ == "__main__":
    leave_out_pictures()
    with few_draws():
        main()
