"""``python -m planner.cli`` is the command ``edbb``."""

from planner.cli.app import main

main()
