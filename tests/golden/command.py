"""The command of a case: ``edbb`` with a quarter of the posterior's draws."""

from planner.cli.app import main
from tests.identification.few_draws import few_draws

if __name__ == "__main__":
    with few_draws():
        main()
